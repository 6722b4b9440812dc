"""``ppy age``: the ageing of an actuator over its records."""

from __future__ import annotations

from orchestration.api.declaration import only
from orchestration.api.options import AgeKeywords
from orchestration.cli.command import command
from orchestration.cli.commands.options import AgeCommand
from orchestration.cli.outputs import check_outputs, typed_command, write_json


@command(AgeCommand)
def age(options: AgeCommand) -> None:
    """Fit a circuit window by window, forecast the life, and show how derating would have acted.

    The clock is the time of operation: records follow each other without the rests between them.
    """
    from rich.console import Group

    from orchestration.api import age as work
    from orchestration.reporting.console import out, progress, wrote

    records = {f"record {k}": path for k, path in enumerate(options["records"], 1)}
    check_outputs(options, records, out=(".csv",))
    with progress() as tell:
        keywords = only(AgeKeywords, {**options, "progress": tell})
        found = work(options["records"], options["model"], **keywords)
    out.print(Group(*found.overview()))
    write_json(options["json"], found.to_dict())
    if options["out"] is not None:
        found.to_frame().to_csv(options["out"])
        wrote(options["out"])
    if options["plot"] is not None:
        found.plot(options["plot"])
        wrote(options["plot"])
    if options["report"] is not None:
        wrote(found.report(options["report"], typed_command()))
