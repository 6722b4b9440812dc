"""``ppy list`` and ``ppy check``: which components there are, and whether an FMU is sound."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from orchestration.cli.options import Json
from orchestration.cli.outputs import (
    JSON,
    STANDARD_OUTPUT,
    Outputs,
    standard_output_for,
    write_json,
)


def list_components(result: Json = None) -> None:
    """List the components."""
    from fmus import MODELS, component

    Outputs(writes={"--json": result}, endings={"--json": JSON}).check()
    summaries = {
        name: (component(name).__doc__ or "").strip().split("\n")[0].rstrip(".") for name in MODELS
    }
    width = max(map(len, MODELS))
    for name, summary in summaries.items():
        if result != STANDARD_OUTPUT:
            print(f"{name:{width}}  {summary}")
    write_json(result, [{"name": name, "summary": summary} for name, summary in summaries.items()])


def check(
    fmus: Annotated[
        list[Path], typer.Argument(metavar="FMU...", help="FMU files, ours or anybody's.")
    ],
    result: Json = None,
) -> None:
    """Check FMUs against the static part of the contract: structure, units, documentation, binaries."""
    from dataclasses import asdict

    from rich.text import Text

    from orchestration.fmu.check import check_fmu
    from orchestration.reporting.console import out

    Outputs(
        {f"the FMU {path}": path for path in fmus}, {"--json": result}, {"--json": JSON}
    ).check()
    findings = {path: check_fmu(path) for path in fmus}
    counted = {
        path: {kind: sum(f.severity == kind for f in among) for kind in ("error", "warning")}
        for path, among in findings.items()
    }
    with standard_output_for(result):
        for path, among in findings.items():
            for f in among:
                style = {"error": "red", "warning": "yellow"}.get(f.severity, "dim")
                out.print(
                    Text.assemble(
                        f"{path}: ", (f.severity, style), f" (contract line {f.line}) {f.message}"
                    )
                )
            errors, warnings = counted[path]["error"], counted[path]["warning"]
            out.print(
                f"{path}: {f'{errors} errors' if errors else 'no errors'}, {warnings} warnings"
            )
        write_json(
            result,
            [
                {
                    "file": str(path),
                    "errors": counted[path]["error"],
                    "warnings": counted[path]["warning"],
                    "findings": [asdict(f) for f in among],
                }
                for path, among in findings.items()
            ],
        )
    if any(count["error"] for count in counted.values()):
        raise typer.Exit(1)
