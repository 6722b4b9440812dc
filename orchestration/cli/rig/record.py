"""``ppy rig record``: a rig driven with an experiment, without any model, and what it did."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from fmus.kit.errors import UserError
from fmus.rig_proxy.protocol import ENDPOINT
from orchestration.cli.options import (
    Credentials,
    RigEndpoint,
    complete_experiments,
    option,
    seconds,
)
from orchestration.cli.outputs import SIGNALS, Outputs
from orchestration.cli.real_time import JOURNAL, keep, status_line

if TYPE_CHECKING:
    import xarray

    from orchestration.experiment.live import Live
    from orchestration.records.journal import Journal
    from orchestration.rig.endpoint import Endpoint
    from orchestration.rig.record.plan import Plan


def record(
    stimulus: Annotated[
        str,
        option(
            "--stimulus",
            metavar="FILE.toml|NAME",
            help="Experiment whose inputs drive the rig, as for ppy run.",
            autocompletion=complete_experiments,
        ),
    ],
    out: Annotated[Path, option("--out", metavar="FILE", help="Record: .nc, .parquet or .csv.")],
    endpoint: RigEndpoint = ENDPOINT,
    credentials: Credentials = None,
    rate: Annotated[
        float | None,
        option("--rate", metavar="HZ", help="Rows a second; default those of the experiment."),
    ] = None,
    max_age: Annotated[
        float | None,
        option(
            "--max-age",
            metavar="TIME",
            help="Older values become gaps; default two steps.",
            parser=seconds,
        ),
    ] = None,
    settings: Annotated[
        list[str] | None,
        option("--set", metavar="KEY=VALUE", help="Over the file: duration=20s, inputs.force=0."),
    ] = None,
) -> None:
    """Drive the rig with an experiment, without any model, and record what it does."""
    import numpy as np

    from orchestration.experiment import results
    from orchestration.experiment.live import Live
    from orchestration.experiment.reading import files, read
    from orchestration.reporting.console import note, warn, wrote
    from orchestration.reporting.console import out as terminal
    from orchestration.rig.endpoint import read_endpoint
    from orchestration.rig.operator import ask
    from orchestration.rig.record.data import sketch
    from orchestration.rig.record.plan import plan

    for name, value in (("--rate", rate), ("--max-age", max_age)):
        if value is not None and not 0.0 < value < float("inf"):
            raise UserError(f"{name} {value:g}: must be above 0")
    wanted = read(stimulus, settings or [])
    reads = {"the experiment": Path(stimulus), "the key file": credentials} | files(wanted)
    live = Live(journal=out.with_name(out.name + JOURNAL))
    Outputs(dict(reads), {"--out": out}, {"--out": SIGNALS}).check()
    remote = read_endpoint(endpoint, credentials, warn)
    planned = plan(wanted, ask(remote, "status"), stimulus, rate, max_age, note)
    results.check(sketch(planned), out)
    data = _drive(planned, remote, credentials, stimulus, live)
    keep(data, out, live)
    held = f"{data.time.size} rows, {float(data.time[-1]):g} s of {planned.time[-1]:g} s"
    terminal.print(f"{data.attrs['subject']}: {held}")
    wrote(out, "" if data.attrs["complete"] else "incomplete")
    if not any(np.isfinite(data[name]).any() for name in planned.outputs):
        raise UserError(
            f"{out} holds no measured value: none was younger than {planned.max_age:g} s (--max-age)"
        )
    if "failure" in data.attrs:
        raise UserError(f"{data.attrs['failure']}; {out} holds {held}")
    if not data.attrs["complete"]:
        raise KeyboardInterrupt


def _drive(
    planned: Plan, remote: Endpoint, credentials: Path | None, where: str, live: Live
) -> xarray.Dataset:
    """Drive the rig, with a journal on the disk and a status line."""
    from contextlib import ExitStack

    from fmus.rig_proxy.link import Link
    from orchestration.master.interrupt import deferred
    from orchestration.master.undisturbed import undisturbed
    from orchestration.reporting.console import err, note
    from orchestration.rig.ending import on_termination
    from orchestration.rig.record.data import dataset
    from orchestration.rig.record.drive import drive

    with ExitStack() as opened:
        link = Link(remote.requests, planned.inputs, planned.outputs, credentials, "ppy rig record")
        opened.callback(link.close)
        journal = _journal(live, planned)
        opened.callback(journal.close)
        err.print(
            f"driving the rig at {remote.requests} for {planned.time[-1]:g} s", soft_wrap=True
        )
        note(f"until the record is written, it goes to {live.journal}")
        telling, interrupt = (
            opened.enter_context(status_line(live)),
            opened.enter_context(deferred()),
        )
        opened.enter_context(on_termination(lambda: setattr(interrupt, "pressed", True)))
        opened.enter_context(undisturbed())
        recorded = drive(link, planned, interrupt, journal.add, telling.look, lambda: journal.error)
    if not len(recorded.inputs):
        if recorded.failure:
            raise UserError(f"{recorded.failure}; nothing was recorded")
        raise KeyboardInterrupt
    return dataset(planned, recorded, where, remote.requests)


def _journal(live: Live, planned: Plan) -> Journal:
    from orchestration.records.journal import Journal
    from orchestration.rig.record.data import units

    assert live.journal is not None
    try:
        return Journal(live.journal, units(planned))
    except UserError:
        raise
    except ValueError as error:
        raise UserError(f"the rig has a name that cannot be recorded: {error}") from error
