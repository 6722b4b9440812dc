"""``ppy run --real-time``: its options, the line that says how the run is doing, and a record that nothing may cost."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, NamedTuple

from fmus.kit.errors import UserError
from fmus.rig_proxy.proxy import LINK_STATES

if TYPE_CHECKING:
    import xarray

    from orchestration.experiment.live import Live, Moment

JOURNAL = ".part.csv"  # behind the name of the result
_ON_TERMINAL, _ELSEWHERE = 0.2, 5.0  # s between two lines


class Options(NamedTuple):
    """What was asked for; None where nothing was.

    Attributes
    ----------
    real_time : bool
    missed : str or None
    lag : float or None
    processor : int or None
    priority : bool
    """

    real_time: bool
    missed: str | None
    lag: float | None
    processor: int | None
    priority: bool

    def live(self, out: Path | None) -> Live | None:
        """Return how to run, None for as fast as possible.

        Parameters
        ----------
        out : Path or None
            The result; beside it goes the journal.

        Raises
        ------
        UserError
            If an option makes no sense, or is about real time and that was not asked for.
        """
        from orchestration.experiment.live import Live
        from orchestration.master import RealTime

        if not self.real_time:
            given = {"--missed": self.missed, "--lag": self.lag, "--cpu": self.processor}
            for option in [name for name, value in given.items() if value is not None]:
                raise UserError(f"{option} is about real time; add --real-time")
            if self.priority:
                raise UserError("--priority is about real time; add --real-time")
            return None
        lag = RealTime.lag if self.lag is None else self.lag
        pace = RealTime(self.missed or RealTime.missed, lag, None, self.processor, self.priority)
        return Live(pace, None if out is None else out.with_name(out.name + JOURNAL))


def status(moment: Moment) -> str:
    """Say how a run is doing, in a line."""
    parts = [
        f"{moment.time:.1f} s of {moment.end:g} s",
        f"lag {1e3 * max(0.0, moment.lag):.1f} ms",
        f"missed {moment.missed}",
    ]
    if (state := _worst(moment, "link_state")) is not None:
        known = state in range(len(LINK_STATES))
        parts.append(f"link {LINK_STATES[int(state)] if known else f'{state:g}'}")
    if (age := _worst(moment, "_age")) is not None:
        parts.append(f"age {1e3 * age:.0f} ms")
    if (trip := _worst(moment, "round_trip_time")) is not None:
        parts.append(f"round trip {1e3 * trip:.1f} ms")
    return ", ".join(parts)


def _worst(moment: Moment, ending: str) -> float | None:
    """Greatest of the values about links whose names end so; None if there is none."""
    return max(
        (value for name, value in moment.link.items() if name.endswith(ending)), default=None
    )


@contextmanager
def status_line(live: Live) -> Iterator[Live]:
    """Have a run tell how it is doing while the context lasts: in place on a terminal, else a line now and then.

    Parameters
    ----------
    live : Live

    Yields
    ------
    Live
        The same, telling.
    """
    from dataclasses import replace

    from orchestration.reporting.background import BackgroundWriter
    from orchestration.reporting.console import err, warn

    if err.quiet:
        yield live
        return
    in_place, every = err.is_terminal, _ON_TERMINAL if err.is_terminal else _ELSEWHERE
    stream = sys.stderr

    def show(content: bytes) -> None:
        stream.write(content.decode())
        stream.flush()

    writer, told, troubles = BackgroundWriter(show), monotonic(), list[str]()

    def look(moment: Moment) -> None:
        nonlocal told
        if moment.trouble and not troubles:
            troubles.append(moment.trouble)
            told = 0.0
        now = monotonic()
        if now - told < every or writer.is_behind:
            return
        told, line = now, status(moment) + (f", {moment.trouble}" if moment.trouble else "")
        writer.put((f"\r{line}\x1b[K" if in_place else f"{line}\n").encode())

    try:
        yield replace(live, look=look)
    finally:
        if in_place:
            writer.put(b"\r\x1b[K")
        writer.close()
        for text in troubles:
            warn(f"{text}; from then on the record was in memory only")


def keep(data: xarray.Dataset, out: Path, live: Live) -> None:
    """Write the result of a run in real time; if that fails, write it elsewhere, for a rig cannot be asked again.

    Raises
    ------
    UserError
        If it is not where it was to be: why, and where it is.
    """
    from orchestration.experiment import results
    from orchestration.experiment.reading import movable

    try:
        results.write(movable(data, out.parent), out)
    except UserError as error:
        raise UserError(f"{error}; {_rescued(data, out, live)}") from error
    if live.journal is not None:
        live.journal.unlink(missing_ok=True)


def _rescued(data: xarray.Dataset, out: Path, live: Live) -> str:
    from orchestration.experiment import results

    try:
        elsewhere = (
            Path(tempfile.gettempdir()) / f"ppy-{data.attrs['created'].replace(':', '')}-{out.name}"
        )
        results.write(data, elsewhere)
    except (UserError, FileNotFoundError):
        return f"what went to the disk before is in {live.journal}"
    return f"the record is in {elsewhere}"
