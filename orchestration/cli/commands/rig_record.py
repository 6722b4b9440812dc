"""``ppy rig record`` and ``ppy rig archive``: what a rig did, driven, heard or kept by a server."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from datetime import datetime
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from fmus.kit import UserError
from fmus.kit.extras import require
from orchestration.cli.command import command
from orchestration.cli.commands.options import ArchiveCommand, RecordRigCommand
from orchestration.cli.outputs import SIGNALS, check_outputs, write_files, write_json
from orchestration.cli.real_time import JOURNAL, IncompleteRecord, keep, status_line
from orchestration.reporting.console import alarm, err, note, warn, wrote
from orchestration.reporting.console import out as terminal

if TYPE_CHECKING:
    import xarray

    from fmus.kit.interrupt import Interrupt
    from orchestration.experiment.live import Live
    from orchestration.records import Journal
    from orchestration.rig import Endpoint
    from orchestration.rig.record import RecordingObserver, RecordingPlan


@command(RecordRigCommand)
def record(options: RecordRigCommand) -> None:
    """Drive the rig with an experiment, without any model, and record what it does.

    Without --stimulus it only listens, at the rate of the telemetry, 30 rows a second at most.
    """
    for name, value in (("--rate", options["rate"]), ("--max-age", options["max_age"])):
        if value is not None and not 0.0 < value < inf:
            raise UserError(f"{name} {value:g}: must be above 0")
    if options["stimulus"] is None:
        _listen(options)
    elif options["duration"] is not None:
        raise UserError("--for: an experiment has its own duration (--set duration=20s)")
    else:
        _follow(options, options["stimulus"])


def _follow(options: RecordRigCommand, stimulus: str) -> None:
    """Record while an experiment drives the rig.

    Raises
    ------
    UserError
        If the rig cannot be driven, or nothing was measured.
    IncompleteRecord
        If the record is not complete.
    """
    from orchestration.experiment import read, results
    from orchestration.experiment.reading import files
    from orchestration.rig import ask
    from orchestration.rig.record import empty_dataset, plan_recording

    experiment = read(stimulus, options["settings"])
    reads = {"the experiment": Path(stimulus), **files(experiment)}
    live, remote = _prepared(options, reads)
    planned = plan_recording(
        experiment, ask(remote, "status"), stimulus, options["rate"], options["max_age"], note
    )
    out = options["out"]
    results.check(empty_dataset(planned), out)
    data = _drive(planned, remote, options, live)
    extent = f"{data.time.size} rows, {float(data.time[-1]):g} s of {planned.time[-1]:g} s"
    _write(data, out, live, extent)
    _raise_if_incomplete(data, planned, out, extent)


def _listen(options: RecordRigCommand) -> None:
    """Record what the rig's server publishes, for a time or until Ctrl-C."""
    from orchestration.rig import ask
    from orchestration.rig.record import heard_dataset, listen, units

    about = {
        "--rate": options["rate"],
        "--max-age": options["max_age"],
        "--set": options["settings"],
    }
    for flag, value in about.items():
        if value:
            raise UserError(f"{flag}: is about an experiment; give one with --stimulus")
    duration = inf if options["duration"] is None else options["duration"]
    if not duration > 0.0:
        raise UserError(f"--for {duration:g}: must be above 0 s")
    live, remote = _prepared(options, {})
    status = ask(remote, "status")
    names = units(status["inputs"], status["outputs"])
    with _recording(live, names, f"listening to the rig at {remote.requests}") as recording:
        rows, failure = listen(remote, status, duration, *recording)
    if not len(rows):
        raise UserError(f"{failure or f'nothing was heard of {remote.telemetry}'}; no record")
    if recording.interrupt.pressed and duration < inf:
        failure = "interrupted"
    data = heard_dataset(status, rows, failure, remote.requests)
    extent = f"{len(rows)} rows, {float(data.time[-1]):g} s, {data.attrs['rate']:.3g} rows a second"
    rate = f"the rig samples {1.0 / status['period']:.4g} times a second"
    _write(data, options["out"], live, f"{extent}; {rate}")
    if not data.attrs["complete"]:
        raise IncompleteRecord(failure or f"the rig was not heard {data.attrs['gaps']} times")


def _prepared(options: RecordRigCommand, reads: Mapping[str, Path | None]) -> tuple[Live, Endpoint]:
    """Return where the record goes until it is written, and the server, if it can be written."""
    from orchestration.experiment.live import Live
    from orchestration.rig import read_endpoint

    out = options["out"]
    credentials = options["credentials"]
    reads = {"the key file": credentials, **reads}
    check_outputs(options, reads, out=SIGNALS)
    live = Live(journal=out.with_name(out.name + JOURNAL))
    return live, read_endpoint(options["endpoint"], credentials, warn)


def _write(data: xarray.Dataset, out: Path, live: Live, extent: str) -> None:
    """Write a record, and print what it holds."""
    keep(data, out, live)
    terminal.print(f"{data.attrs['subject']}: {extent}")
    wrote(out, "" if data.attrs["complete"] else "incomplete")


def _raise_if_incomplete(
    data: xarray.Dataset, planned: RecordingPlan, out: Path, extent: str
) -> None:
    """Raise the error of an incomplete record, which is already written.

    Raises
    ------
    UserError
        If it holds no measured value.
    IncompleteRecord
        If the run failed, or rows lack a value.
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
        raise IncompleteRecord(f"{data.attrs['failure']}; {out} holds {extent}")
    if data.time.size < planned.time.size:
        raise KeyboardInterrupt
    if gaps := data.attrs["gaps"]:
        raise IncompleteRecord(
            f"{gaps} of {data.time.size} rows lack a value; {out} holds {extent}"
        )


def _drive(
    planned: RecordingPlan, remote: Endpoint, options: RecordRigCommand, live: Live
) -> xarray.Dataset:
    """Drive the rig and return the record, with a journal on the disk and a status line."""
    from contextlib import closing

    from fmus.rig_proxy import Link
    from orchestration.master import realtime_priority
    from orchestration.rig.record import dataset, drive, units
    from orchestration.rig.server import CLIENT, preferred

    names = units(planned.inputs, planned.outputs)
    task = f"driving the rig at {remote.requests} for {planned.time[-1]:g} s"
    with preferred(CLIENT):
        link = Link(
            remote.requests,
            planned.inputs,
            planned.outputs,
            options["credentials"],
            "ppy rig record",
            take_over=options["take_over"],
        )
        with closing(link), _recording(live, names, task) as recording, realtime_priority():
            recorded = drive(link, planned, *recording)
    if not len(recorded.inputs):
        if recorded.failure:
            raise UserError(f"{recorded.failure}; nothing was recorded")
        raise KeyboardInterrupt
    return dataset(planned, recorded, str(options["stimulus"]), remote.requests)


class _Recording(NamedTuple):
    """The interrupt that ends a recording, and the observer of its rows."""

    interrupt: Interrupt
    observer: RecordingObserver


@contextmanager
def _recording(live: Live, names: Mapping[str, str], task: str) -> Iterator[_Recording]:
    """Keep a journal on the disk and a status line; Ctrl-C and SIGTERM end the recording."""
    from fmus.kit.interrupt import deferred
    from orchestration.rig import on_termination
    from orchestration.rig.record import RecordingObserver

    with ExitStack() as opened:
        journal = _journal(live, names)
        opened.callback(journal.close)
        err.print(task, soft_wrap=True)
        note(f"until the record is written, it goes to {live.journal}")
        telling = opened.enter_context(status_line(live))
        interrupt = opened.enter_context(deferred())
        opened.enter_context(on_termination(lambda: setattr(interrupt, "pressed", True)))
        yield _Recording(
            interrupt, RecordingObserver(journal.add, telling.look, lambda: journal.error, alarm)
        )


def _journal(live: Live, names: Mapping[str, str]) -> Journal:
    """Open the journal that keeps the record until it is written."""
    from orchestration.records import Journal

    assert live.journal is not None
    try:
        return Journal(live.journal, names)
    except UserError:
        raise
    except ValueError as error:
        raise UserError(f"the rig has a name that cannot be recorded: {error}") from error


@command(ArchiveCommand)
def archive(options: ArchiveCommand) -> None:
    """List what an archive of ppy rig serve holds: spans, gaps and events; or export a part."""
    from orchestration.experiment import results
    from orchestration.rig.archive import Archive, read_date
    from orchestration.rig.record import archived_dataset

    require("pyarrow")
    check_outputs(options, out=SIGNALS)
    begin = read_date(options["since"], "--from", -inf)
    end = read_date(options["until"], "--to", inf)
    kept = Archive(options["folder"])
    for path in kept.damaged:
        warn(f"{path} is damaged: what it held is not shown")
    contents = kept.contents(begin, end)
    for line in _lines(contents):
        terminal.print(line)
    write_json(options["json"], contents)
    write_files(options, out=lambda path: results.write(archived_dataset(kept, begin, end), path))


def _lines(contents: Mapping[str, Any]) -> Iterator[str]:
    """Yield what an archive holds for a reader, in local time."""
    rig = contents["rig"]
    signals = {**rig["inputs"], **rig["outputs"]}.items()
    names = ", ".join(f"{name} [{unit}]" for name, unit in signals)
    yield f"{rig['backend']} on {rig['host']}, {rig['rate']:g} samples a second: {names}"
    for span in contents["spans"]:
        yield f"{_local(span['begin'])} to {_local(span['end'])}  {span['samples']} samples"
    for gap in contents["gaps"]:
        lost = f"{gap['lost']} samples " * bool(gap["lost"])
        yield f"{_local(gap['begin'])} to {_local(gap['end'])}  gap: {lost}{gap['reason']}"
    for event in contents["events"]:
        yield f"{_local(event['time'])}  {event['what']}: {event['text']}"


def _local(wall: float) -> str:
    return datetime.fromtimestamp(wall).isoformat(" ", "milliseconds")
