"""Backend that plays back a record and ignores all commands."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping

import numpy as np

from fmus.kit import UserError
from fmus.kit.units import parse
from orchestration.records import Record, parse_mapping, read_record
from orchestration.rig.backends.backend import Limit, Steppable
from orchestration.rig.signals import KNOWN_LIMITS, SIGNALS, UNITS, checked_step, commands, one_of

_LONGEST = 86400.0  # s, of one step
_ROUNDING = 1e-9  # s


class Replay(Steppable):
    """Playback of a record from its first row.

    Its time starts with the first :meth:`write`, and is real until :meth:`advance` is called for
    the first time; from then on it is the caller's. Commands are accepted and change nothing.

    Parameters
    ----------
    file : str
        Any file that is read as a record.
    signals : {"force-driven", "length-driven", "bench"}
        Names of inputs and outputs, unless these are given.
    inputs, outputs : str
        Names with commas between them; one that is not known by name has its SI unit behind it:
        ``temperature[K]``. Without them all of the signals are inputs, and those that the file has
        are outputs.
    at_end : {"hold", "loop", "fail"}
        Whether the last row is followed by itself, by the first one, or by an error.
    map : str
        ``column=signal`` with commas between them, for columns that have other names.

    Raises
    ------
    UserError
        If the file cannot be read or lacks an output, or an option has a value that is not allowed.
    """

    @classmethod
    def devices(cls, **options: str) -> list[str]:
        """Return an empty list: a record can be played back by any number of servers."""
        return []

    def __init__(
        self,
        file: str,
        signals: str = "force-driven",
        inputs: str = "",
        outputs: str = "",
        at_end: str = "hold",
        map: str = "",
    ) -> None:
        chosen = SIGNALS[one_of("signals", signals, SIGNALS)]
        self._at_end = one_of("at_end", at_end, ("hold", "loop", "fail"))
        self.inputs = _signal_units("inputs", inputs or ",".join(chosen.inputs))
        wanted = _signal_units("outputs", outputs or ",".join(chosen.outputs))
        columns = parse_mapping([part for part in map.split(",") if part.strip()])
        record = read_record(
            file, self.inputs | wanted, mapping=columns, required=list(wanted) if outputs else ()
        )
        self.outputs = {name: unit for name, unit in wanted.items() if name in record.signals}
        if not self.outputs:
            raise UserError(f"{file}: has none of the outputs {', '.join(wanted)}")
        self.limits: Mapping[str, Limit] = {
            n: KNOWN_LIMITS[n] for n in self.inputs if n in KNOWN_LIMITS
        }
        self._file = file
        self._times = record.time - record.time[0]
        self._values = {name: record.signals[name] for name in self.outputs}
        self._length = _length(record)
        self._time = 0.0
        self._since: float | None = None  # on the clock, where time is real
        self._stepped = False

    def read(self) -> Mapping[str, float]:
        """Return the row of the record that is valid at this time; NaN where the record has a gap.

        Returns
        -------
        Mapping of str to float

        Raises
        ------
        UserError
            If the record is at its end and that is to fail.
        """
        if self._since is not None:
            now = time.perf_counter()
            self._time = self._time + now - self._since
            self._since = now
        at = self._time
        if at >= self._length:
            if self._at_end == "fail":
                raise UserError(
                    f"{self._file}: the record is at its end after {self._length:.6g} s"
                )
            if self._at_end == "loop":
                at = math.fmod(at, self._length)
        # rounding of many steps must not show the row before
        row = max(int(np.searchsorted(self._times, at + _ROUNDING, side="right")) - 1, 0)
        return {name: float(values[row]) for name, values in self._values.items()}

    def write(self, values: Mapping[str, float]) -> None:
        """Accept commands, which change nothing.

        Raises
        ------
        UserError
            If one is missing, unknown or not finite.
        """
        commands(values, self.inputs)
        if self._since is None and not self._stepped:
            self._since = time.perf_counter()

    def advance(self, step: float) -> None:
        """Advance the time of the playback.

        Parameters
        ----------
        step : float
            s, at most a day.

        Raises
        ------
        UserError
            If it is out of range.
        """
        self._stepped = True
        self._since = None
        self._time += checked_step(step, _LONGEST)

    def safe(self) -> None:
        """Do nothing: a record harms nobody."""

    def close(self) -> None:
        """Do nothing: the file has been read."""


def _signal_units(option: str, text: str) -> dict[str, str]:
    """Return names and units of signals such as ``current,temperature[K]``."""
    signals: dict[str, str] = {}
    for part in text.split(","):
        if not part.strip():
            continue
        before, bracket, after = part.strip().partition("[")
        name = before.strip()
        if bracket:
            unit = after.removesuffix("]").strip()
        elif name in UNITS:
            unit = UNITS[name]
        else:
            raise UserError(
                f"option {option}: {name} is not known by name; write its SI unit: {name}[K]"
            )
        parse(unit)
        signals[name] = unit
    if not signals:
        raise UserError(f"option {option} = {text!r}: names no signal")
    return signals


def _length(record: Record) -> float:
    """Return the duration of a record, s; its last row lasts for the median step."""
    steps = np.diff(record.time)
    last = np.median(steps) if steps.size else 1.0
    return float(record.time[-1] - record.time[0] + last)
