"""``ppy black-box``: discrete-time models of one column of a record."""

from __future__ import annotations

from typing import TYPE_CHECKING

from orchestration.api.declaration import only
from orchestration.api.options import BlackBoxKeywords
from orchestration.cli.command import command
from orchestration.cli.commands.options import BlackBoxCommand
from orchestration.cli.outputs import check_outputs, write_files, write_json
from orchestration.reporting.console import note, progress
from orchestration.reporting.console import out as console

if TYPE_CHECKING:
    from orchestration.identify.black_box.study import BlackBox


@command(BlackBoxCommand)
def black_box(options: BlackBoxCommand) -> None:
    """Identify discrete-time models of one column of a record, and choose one."""
    from orchestration.api import black_box as work

    check_outputs(options, {"the record": options["record"]}, out=(".py",))
    chosen = only(BlackBoxKeywords, options)
    with progress(f"identifying models of {options['output']}") as tell:
        chosen["progress"] = tell.done
        identified = work(options["record"], options["output"], options["inputs"], **chosen)
    _show(identified, options)


def _show(identified: BlackBox, options: BlackBoxCommand) -> None:
    """Print the result, and write the files of the options."""
    from orchestration.identify.black_box.study import class_name

    console.print(str(identified))
    for line in (*identified.columns.notes, *identified.remarks):
        note(line)
    write_json(options["json"], identified.to_dict())
    write_files(options, report=identified.report, out=identified.export)
    out = options["out"]
    if out is not None:
        note(f"next: ppy build {out}:{class_name(out.stem)}")
