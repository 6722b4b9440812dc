"""Runs in real time: their options, their status line, and the rescue of their records."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from functools import partial
from math import inf, isfinite
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

from fmus.kit import UserError
from fmus.rig_proxy import LINK_STATES

if TYPE_CHECKING:
    import xarray

    from orchestration.cli.commands.options import RunCommand
    from orchestration.experiment.live import Live, Moment, RigEnd
    from orchestration.master import RealTime
    from orchestration.reporting import BackgroundWriter

JOURNAL = ".part.csv"  # behind the name of the result
TUNING_LOG = ".tuning.log"  # there, too
_ON_TERMINAL = 0.2  # s between two lines
_ELSEWHERE = 5.0
_SILENCE = 0.4  # s without an answer of a rig, after which somebody has to look


class IncompleteRecord(UserError):
    """A record was written, but is shorter than requested."""


def live_run(options: RunCommand, out: Path | None) -> Live | None:
    """Return the options of a run in real time; None for a run that is as fast as possible.

    Parameters
    ----------
    options : RunCommand
    out : Path or None
        File of the result; the journal is in its folder.

    Raises
    ------
    UserError
        If a value is not allowed, or an option of real time is given without ``--real-time``.
    """
    from orchestration.cli.command import refuse
    from orchestration.cli.commands.options import RunCommand
    from orchestration.experiment.live import Live, Tuner
    from orchestration.master import RealTime

    if not options["real_time"]:
        names = ("missed", "lag", "processor", "priority", "tunable")
        refuse(RunCommand, options, "is about real time; add --real-time", names)
        return None
    lag = RealTime.lag if options["lag"] is None else options["lag"]
    missed = options["missed"] or RealTime.missed
    pace = RealTime(missed, lag, processor=options["processor"], priority=options["priority"])
    journal = None if out is None else out.with_name(out.name + JOURNAL)
    tuner = Tuner(options["tunable"])
    return Live(pace, partial(_admit, lag=options["lag"]), journal, tuner=tuner)


@contextmanager
def tuned(live: Live | None, options: RunCommand) -> Iterator[None]:
    """Let operators move the parameters of a run that are named, while the context lasts."""
    if live is None or not live.tuner.names:
        yield
        return
    from orchestration.reporting.console import note
    from orchestration.rig import tuning_socket

    out = options["out"]
    log = None if out is None else out.with_name(f"{out.name}{TUNING_LOG}")
    with tuning_socket(live.tuner, options["tuning_port"], log) as address:
        note(f"ppy rig tune --run {address} and ppy rig watch move {', '.join(live.tuner.names)}")
        yield


def _admit(
    pace: RealTime, rigs: Sequence[RigEnd], step: float, lag: float | None = None
) -> RealTime:
    """Measure whether this machine keeps pace with rigs, and return the pace of a run with them.

    Parameters
    ----------
    pace : RealTime
        Pace that the options describe.
    rigs : sequence of RigEnd
    step : float
        Communication step in s.
    lag : float, optional
        Longest pause, s; default half the shortest watchdog, so that a run ends before its rig.

    Raises
    ------
    UserError
        If a rig does not answer, or the machine does not hold the rate.
    """
    from dataclasses import replace

    from fmus.rig_proxy import Link
    from orchestration.master import realtime_priority
    from orchestration.reporting.console import note
    from orchestration.rig import check_response_times, measure_response_times

    longest = pace.lag
    for rig in rigs:
        keys = Path(rig.credentials) if rig.credentials else None
        with (
            closing(Link(rig.endpoint, {}, {}, keys, "ppy run")) as link,
            realtime_priority(pace.processor, pace.priority),
        ):
            measured = measure_response_times(link, step)
        if measured is None:  # the rig waits for us
            continue
        check_response_times(measured, rig.endpoint)
        longest = min(longest, measured.longest_pause) if lag is None else lag
        note(
            f"this machine holds {1.0 / step:.4g} Hz with the rig at {rig.endpoint}: answers come"
            f" {measured} after they are due; a pause of more than {longest:.3g} s ends the run,"
            " and the rig goes to zero"
        )
    return replace(pace, makes_up=not rigs, lag=longest)


def status(moment: Moment) -> str:
    """Return the progress and the delays of a run in one line."""
    parts = [
        f"{moment.time:.1f} s" + f" of {moment.end:g} s" * isfinite(moment.end),
        f"lag {1e3 * max(0.0, moment.lag):.1f} ms",
        f"missed {moment.missed}",
    ]
    state = _worst(moment, "link_state")
    if state is not None:
        known = state in range(len(LINK_STATES))
        parts.append(f"link {LINK_STATES[int(state)] if known else f'{state:g}'}")
    age = _worst(moment, "_age")
    if age is not None:
        parts.append(f"age {1e3 * age:.0f} ms")
    trip = _worst(moment, "round_trip_time")
    if trip is not None:
        parts.append(f"round trip {1e3 * trip:.1f} ms")
    return ", ".join(parts)


def _worst(moment: Moment, ending: str) -> float | None:
    """Return the largest value of the signals of links with this ending; None if there is none."""
    values = [value for name, value in moment.link.items() if name.endswith(ending)]
    return max(values, default=None)


@contextmanager
def status_line(live: Live) -> Iterator[Live]:
    """Show the progress of a run while the context lasts.

    A terminal has one line that changes; other streams get a line every few seconds.

    Parameters
    ----------
    live : Live

    Yields
    ------
    Live
        The same options, with a `look` that shows the progress.
    """
    from dataclasses import replace

    from orchestration.reporting import BackgroundWriter
    from orchestration.reporting.console import err, warn

    stream = sys.stderr

    def show(content: bytes) -> None:
        stream.write(content.decode())
        stream.flush()

    in_place = err.is_terminal
    writer = BackgroundWriter(show)
    every = _ON_TERMINAL if in_place else _ELSEWHERE
    line = _StatusLine(writer, in_place, inf if err.quiet else every)
    try:
        yield replace(live, look=line.look)
    finally:
        if in_place:
            writer.put(b"\r\x1b[K")
        writer.close()
        if line.trouble:
            warn(f"{line.trouble}; from then on the record was in memory only")


class _StatusLine:
    """Status line of a run, rewritten at intervals; and alarms, at once.

    Attributes
    ----------
    trouble : str
        First reason for which the journal could not be written; empty without one.
    """

    def __init__(self, writer: BackgroundWriter, in_place: bool, every: float):
        self._writer = writer
        self._in_place = in_place
        self._every = every
        self._written = monotonic()
        self._is_silent = False
        self.trouble = ""

    def look(self, moment: Moment) -> None:
        """Write the line if the last one is old, and at once at the first trouble."""
        self._alarm(_worst(moment, "round_trip_time") or 0.0)
        if moment.trouble and not self.trouble:
            self.trouble = moment.trouble
            self._written = 0.0
        now = monotonic()
        if now - self._written < self._every or self._writer.is_behind:
            return
        self._written = now
        trouble = f", {moment.trouble}" if moment.trouble else ""
        self._show(status(moment) + trouble, stays=False)

    def _alarm(self, silence: float) -> None:
        """Alarm the operator once if a rig does not answer, even in quiet mode."""
        if silence > _SILENCE and not self._is_silent:
            self._show(
                f"ALARM: no answer from a rig for {silence:.1f} s: it goes to its safe state by"
                " itself; see that it does",
                stays=True,
            )
        self._is_silent = silence > _SILENCE

    def _show(self, line: str, stays: bool) -> None:
        """Show a line, in whose place the next one comes on a terminal, unless it stays."""
        start, rest = ("\r", "\x1b[K") if self._in_place else ("", "")
        end = "\n" if stays or not self._in_place else ""
        self._writer.put(f"{start}{line}{rest}{end}".encode())


def keep(data: xarray.Dataset, out: Path, live: Live) -> None:
    """Write the result of a run in real time, which cannot be repeated; elsewhere if that fails.

    Raises
    ------
    UserError
        If it was written elsewhere: the reason, and the path.
    """
    from orchestration.experiment import results
    from orchestration.experiment.reading import movable

    try:
        is_repeatable = "experiment" in data.attrs
        results.write(movable(data, out.parent) if is_repeatable else data, out)
    except UserError as error:
        raise UserError(f"{error}; {_write_elsewhere(data, out, live)}") from error
    if live.journal is not None:
        live.journal.unlink(missing_ok=True)


def _write_elsewhere(data: xarray.Dataset, out: Path, live: Live) -> str:
    """Write a result among the temporary files; return its path, or else why that failed."""
    from orchestration.experiment import results

    created = data.attrs["created"].replace(":", "")  # which a name on Windows cannot have
    try:
        elsewhere = Path(tempfile.gettempdir()) / f"ppy-{created}-{out.name}"
        results.write(data, elsewhere)
    except (UserError, FileNotFoundError):
        return f"what went to the disk before is in {live.journal}"
    return f"the record is in {elsewhere}"
