"""``ppy age``: the ageing of an actuator over its records."""

from __future__ import annotations

from functools import partial

from orchestration.api.declaration import only
from orchestration.api.options import AgeKeywords
from orchestration.cli.command import command
from orchestration.cli.commands.options import AgeCommand
from orchestration.cli.outputs import check_outputs, show_and_write, typed_command


@command(AgeCommand)
def age(options: AgeCommand) -> None:
    """Fit a circuit window by window, forecast the life, and show how derating would have acted.

    The clock is the time of operation: records follow each other without the rests between them.
    """
    from orchestration.api import age as work
    from orchestration.reporting.console import progress

    records = {f"record {k}": path for k, path in enumerate(options["records"], 1)}
    check_outputs(options, records, out=(".csv",))
    with progress() as tell:
        keywords = only(AgeKeywords, {**options, "progress": tell})
        found = work(options["records"], options["model"], **keywords)
    show_and_write(
        found,
        options,
        out=lambda path: found.to_frame().to_csv(path),
        plot=found.plot,
        report=partial(found.report, command=typed_command()),
    )
