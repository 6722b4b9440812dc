"""Comparison with a reference, as commands show, write and judge it."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orchestration.cli.outputs import typed_command, write_files
from orchestration.cli.verdicts import Case

if TYPE_CHECKING:
    from orchestration.experiment.regression import Regression


def show(regression: Regression) -> None:
    """Print the signals with their worst differences, and the places where they differ."""
    from orchestration.experiment.regression import page
    from orchestration.reporting import plain_table
    from orchestration.reporting.console import note, out

    rows = page.rows(regression)
    out.print(plain_table(None, *page.COLUMNS, right=page.COLUMNS[1:4], rows=rows))
    for one in regression.refused:
        out.print(f"not as in {regression.reference}: {one.signal} {one.message}")
    if regression.exact:
        note(f"without a tolerance, the same to the last bit: {', '.join(regression.exact)}")
    if regression.new:
        note(f"not in {regression.reference}, not compared: {', '.join(regression.new)}")
    out.print(page.verdict(regression))


def write(regression: Regression, report: Path | None, plot: Path | None = None) -> None:
    """Write the page and the picture that are asked for."""
    from orchestration.reporting import draw, pictures, write_page

    write_files(
        {"report": report, "plot": plot},
        report=partial(write_page, regression, command=typed_command()),
        plot=lambda path: pictures.save(draw(regression), path),
    )


def cases(regression: Regression) -> list[Case]:
    """Return a case for each signal of the reference."""
    return [Case(regression.result, one.signal, one.message) for one in regression.deviations]


def as_json(regression: Regression) -> dict[str, Any]:
    """Gather the verdict and the figures of every signal, in its unit."""
    return {
        "result": regression.result,
        "reference": regression.reference,
        "same": not regression.refused,
        "signals": {
            one.signal: {
                "unit": one.unit,
                "difference": one.difference,
                "at": None if one.fault else float(one.time[one.worst]),
                "outside": one.outside,
                "message": one.message or None,
            }
            for one in regression.deviations
        },
        "new": regression.new,
    }
