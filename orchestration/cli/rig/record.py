"""``ppy rig record``: a rig driven with an experiment, without any model, and what it did."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from fmus.kit import UserError
from orchestration.cli.command import command
from orchestration.cli.outputs import SIGNALS, Outputs
from orchestration.cli.real_time import JOURNAL, keep, status_line
from orchestration.cli.rig.options import RecordRigCommand

if TYPE_CHECKING:
    import xarray

    from orchestration.experiment import Live
    from orchestration.records import Journal
    from orchestration.rig import Endpoint
    from orchestration.rig.record import RecordingPlan


@command(RecordRigCommand)
def record(options: RecordRigCommand) -> None:
    """Drive the rig with an experiment, without any model, and record what it does."""
    from orchestration.experiment import Live, files, read, results
    from orchestration.reporting import note, warn, wrote
    from orchestration.reporting import out as terminal
    from orchestration.rig import ask, read_endpoint
    from orchestration.rig.record import empty_dataset, plan_recording

    rate = options["rate"]
    max_age = options["max_age"]
    for name, value in (("--rate", rate), ("--max-age", max_age)):
        if value is not None and not 0.0 < value < float("inf"):
            raise UserError(f"{name} {value:g}: must be above 0")
    stimulus = options["stimulus"]
    credentials = options["credentials"]
    out = options["out"]
    experiment = read(stimulus, options["settings"])
    reads = {"the experiment": Path(stimulus), "the key file": credentials, **files(experiment)}
    live = Live(journal=out.with_name(out.name + JOURNAL))
    Outputs(reads, {"--out": out}, {"--out": SIGNALS}).check()
    remote = read_endpoint(options["endpoint"], credentials, warn)
    planned = plan_recording(experiment, ask(remote, "status"), stimulus, rate, max_age, note)
    results.check(empty_dataset(planned), out)
    data = _drive(planned, remote, credentials, stimulus, live)
    keep(data, out, live)
    held = f"{data.time.size} rows, {float(data.time[-1]):g} s of {planned.time[-1]:g} s"
    terminal.print(f"{data.attrs['subject']}: {held}")
    wrote(out, "" if data.attrs["complete"] else "incomplete")
    _refuse_what_failed(data, planned, out, held)


def _refuse_what_failed(data: xarray.Dataset, planned: RecordingPlan, out: Path, held: str) -> None:
    """Fail where a record is not what was to be recorded.

    Raises
    ------
    UserError
        If it holds no measured value, or the run failed.
    KeyboardInterrupt
        If the run was interrupted.
    """
    import numpy as np

    if not any(np.isfinite(data[name]).any() for name in planned.outputs):
        raise UserError(
            f"{out} holds no measured value: none was younger than {planned.max_age:g} s"
            " (--max-age)"
        )
    if "failure" in data.attrs:
        raise UserError(f"{data.attrs['failure']}; {out} holds {held}")
    if not data.attrs["complete"]:
        raise KeyboardInterrupt


def _drive(
    planned: RecordingPlan, remote: Endpoint, credentials: Path | None, where: str, live: Live
) -> xarray.Dataset:
    """Drive the rig, with a journal on the disk and a status line."""
    from contextlib import ExitStack

    from fmus.rig_proxy import Link
    from orchestration.master import deferred, realtime_priority
    from orchestration.reporting import err, note
    from orchestration.rig import on_termination
    from orchestration.rig.record import dataset, drive

    with ExitStack() as opened:
        link = Link(remote.requests, planned.inputs, planned.outputs, credentials, "ppy rig record")
        opened.callback(link.close)
        journal = _journal(live, planned)
        opened.callback(journal.close)
        err.print(
            f"driving the rig at {remote.requests} for {planned.time[-1]:g} s", soft_wrap=True
        )
        note(f"until the record is written, it goes to {live.journal}")
        telling = opened.enter_context(status_line(live))
        interrupt = opened.enter_context(deferred())
        opened.enter_context(on_termination(lambda: setattr(interrupt, "pressed", True)))
        opened.enter_context(realtime_priority())
        recorded = drive(link, planned, interrupt, journal.add, telling.look, lambda: journal.error)
    if not len(recorded.inputs):
        if recorded.failure:
            raise UserError(f"{recorded.failure}; nothing was recorded")
        raise KeyboardInterrupt
    return dataset(planned, recorded, where, remote.requests)


def _journal(live: Live, planned: RecordingPlan) -> Journal:
    """Open the journal that keeps the record until it is written."""
    from orchestration.records import Journal
    from orchestration.rig.record import units

    assert live.journal is not None
    try:
        return Journal(live.journal, units(planned))
    except UserError:
        raise
    except ValueError as error:
        raise UserError(f"the rig has a name that cannot be recorded: {error}") from error
