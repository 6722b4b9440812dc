"""``ppy black-box``: discrete-time models of one column of a record."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fmus.kit.errors import UserError
from orchestration.cli.options import Json, Record, comma_list, option, seconds
from orchestration.cli.outputs import JSON, PAGE, Outputs, standard_output_for, write_json


def black_box(
    record: Record,
    output: Annotated[str, option("--output", metavar="COLUMN", help="What is foretold.")],
    inputs: Annotated[
        str | None,
        option(
            "--inputs", metavar="COLUMNS", help="What drives it; all but the first unless named."
        ),
    ] = None,
    step: Annotated[
        float | None,
        option(
            "--step",
            metavar="TIME",
            help="Sample period of a file without time, such as 1s.",
            parser=seconds,
        ),
    ] = None,
    share: Annotated[
        float, typer.Option("--share", help="Of the record that models are identified from.")
    ] = 0.5,
    structures: Annotated[
        str,
        typer.Option("--structures", help="Of ARX, ARMAX, OE, SS (subspace), BJ (Box-Jenkins)."),
    ] = "ARX,ARMAX,OE,SS,BJ",
    orders: Annotated[
        str, typer.Option("--orders", help="Of the path from every input, all combinations.")
    ] = "1,2,3",
    noise_orders: Annotated[
        str, typer.Option("--noise-orders", help="Of the noise model.")
    ] = "1,2,3",
    delays: Annotated[
        str, typer.Option("--delays", help="In samples: one number, or one for every input.")
    ] = "1",
    criterion: Annotated[
        str, typer.Option("--criterion", help="What chooses: BIC or AIC.")
    ] = "BIC",
    report: Annotated[
        Path | None, option("--report", metavar="FILE", help="The page (.html).")
    ] = None,
    result: Json = None,
    out: Annotated[
        Path | None,
        option(
            "--out",
            metavar="FILE",
            help="The model as a class (.py), for ppy build, simulate and diagnose.",
        ),
    ] = None,
) -> None:
    """Identify ARX, ARMAX, OE, state-space and Box-Jenkins models of one column of a record, and choose one."""
    from orchestration.api.black_box import black_box as work
    from orchestration.identify.black_box.study.component import class_name
    from orchestration.reporting.console import note, progress, wrote
    from orchestration.reporting.console import out as console

    Outputs(
        {"the record": record},
        {"--report": report, "--json": result, "--out": out},
        {"--report": PAGE, "--json": JSON, "--out": (".py",)},
    ).check()
    paths, noises = _numbers("--orders", orders, 1), _numbers("--noise-orders", noise_orders, 1)
    late = _numbers("--delays", delays, 0)
    for name, text in (("--inputs", inputs), ("--structures", structures)):
        if text is not None and not comma_list(text, name):
            raise UserError(f"{name} {text!r}: name at least one, or leave the option out")
    with progress() as tell:
        tell(f"identifying models of {output}")
        found = work(
            record,
            output,
            comma_list(inputs, "--inputs"),
            step=step,
            share=share,
            structures=comma_list(structures, "--structures"),
            path_orders=paths,
            noise_orders=noises,
            delays=late[0] if len(late) == 1 else late,
            criterion=criterion,
            progress=tell.done,
        )
    with standard_output_for(result):
        console.print(str(found), highlight=False, markup=False)
        for line in (*found.columns.notes, *found.search.left_out):
            note(line)
        write_json(result, found.to_dict())
        if report is not None:
            wrote(found.report(report))
        if out is not None:
            wrote(found.export(out))
            note(f"next: ppy build {out}:{class_name(out.stem)}")


def _numbers(name: str, text: str, least: int) -> list[int]:
    """Read whole numbers, none of them left out or below the least."""
    try:
        numbers = [int(one) for one in text.split(",")]
    except ValueError:
        numbers = [least - 1]
    if min(numbers) < least:
        raise UserError(f"{name} {text!r}: write whole numbers from {least} on, such as 1,2,3")
    return numbers
