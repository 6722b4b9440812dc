"""Ageing of an actuator over records: its circuit window by window, its life and the derating."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.units import Described
from orchestration.identify.ageing.life import LifeForecast
from orchestration.identify.effect_sizes import interval_cells
from orchestration.identify.metrics import finite_or_none
from orchestration.identify.uncertainty import Estimate
from orchestration.reporting import Displayable, format_percent, one_line, plain_table

if TYPE_CHECKING:
    import pandas
    from rich.console import RenderableType

HOUR = 3600.0  # s


@dataclass(frozen=True)
class Course:
    """A quantity in each of n windows, SI.

    Attributes
    ----------
    value, low, high : ndarray, shape (n,)
        Estimates with the ends of their 95 % intervals.
    declared : Described
        Its unit.
    """

    value: Array
    low: Array
    high: Array
    declared: Described

    @classmethod
    def of(cls, estimates: Sequence[Estimate], declared: Described) -> Course:
        """Return the course of one estimate for each window."""
        value, low, high = np.transpose([(one.value, *one.interval) for one in estimates])
        return cls(value, low, high, declared)

    def change(self) -> str:
        """Return the change from the first window to the last as a text.

        It is empty for a quantity that may be zero at first.
        """
        if self.low[0] <= 0.0 <= self.high[0]:
            return ""
        return format_percent(float(self.value[-1] / self.value[0] - 1.0))

    def at(self, window: int) -> tuple[str, str]:
        """Return the value in a window and its interval as texts."""
        value, low, high = (float(x[window]) for x in (self.value, self.low, self.high))
        return interval_cells(value, (low, high), self.declared)


@dataclass(frozen=True)
class Derating:
    """Voltage limit as the degradation estimator would have lowered it.

    Attributes
    ----------
    time, limit, change : ndarray, shape (n,)
        Time of operation in s, voltage limit in V, and change of the impedance relative to the
        first valid estimate; NaN before it.
    """

    time: Array
    limit: Array
    change: Array

    def steps(self) -> list[tuple[float, float]]:
        """Return the time in s and the new limit in V of each step."""
        falls = 1 + np.flatnonzero(np.diff(self.limit) < 0.0)
        return [(float(self.time[k]), float(self.limit[k])) for k in falls]

    def summary(self) -> str:
        """Return the steps in a sentence."""
        if not np.isfinite(self.change).any():
            return "The estimator would never have been valid: see its README for what it needs."
        steps = ", ".join(f"{limit:.4g} V after {hours(at)}" for at, limit in self.steps())
        return f"Voltage limit {self.limit[0]:.4g} V; lowered to {steps or 'no other'}."


@dataclass(frozen=True)
class Ageing(Displayable):
    """The result of ``ppy.age``.

    Attributes
    ----------
    model : str
    sources : tuple of Path
    of : str
        The quantity whose rise ends the life.
    time : ndarray, shape (n,)
        Middle of each window, in s of operation: the records one after the other.
    labels : tuple of str, length n
        Record of each window.
    courses : dict of str to Course
        By parameter, and by `of`.
    forecast : LifeForecast or None
        None with fewer windows than it needs.
    derating : Derating or None
        None where the records have no current and voltage.
    notes : tuple of str
        What could not be done, and why.
    """

    model: str
    sources: tuple[Path, ...]
    of: str
    time: Array
    labels: tuple[str, ...]
    courses: Mapping[str, Course]
    forecast: LifeForecast | None
    derating: Derating | None
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return one_line(f"Ageing {self.model}: {self.headline()}")

    def headline(self) -> str:
        """Return the forecast in a sentence."""
        count = f"{len(self.labels)} windows over {hours(float(self.time[-1]))} of operation"
        if self.forecast is None:
            return f"{count}: too few for a forecast."
        one = self.forecast
        rise = f"{self.of} is {format_percent(one.rise)} above its first value"
        low, high = one.interval
        if not np.isfinite(low):
            return f"{count}: no sign that {rise} at any time."
        if not np.isfinite(one.life):
            return f"{rise} not before {hours(low)} of operation (97.5 %), perhaps never."
        return f"{rise} after {hours(one.life)} of operation (95 %: {hours(low)} to {hours(high)})."

    def overview(self) -> Iterator[RenderableType]:
        """Yield the first and the last window, the forecast, and the derating."""
        rows = [
            (name, *course.at(0), *course.at(-1), course.change())
            for name, course in self.courses.items()
        ]
        yield plain_table(None, "quantity", "first", "95 %", "last", "95 %", "change", rows=rows)
        yield self.headline()
        if self.derating is not None:
            yield self.derating.summary()
        yield from self.notes

    def to_frame(self) -> pandas.DataFrame:
        """Return a row for each window: record, and value and interval of every quantity, SI.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        import pandas

        columns: dict[str, Any] = {"record": self.labels}
        for name, course in self.courses.items():
            columns |= {name: course.value, f"{name}_low": course.low, f"{name}_high": course.high}
        return pandas.DataFrame(columns, index=pandas.Index(self.time, name="time"))

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON: None for an open end."""
        windows = {}
        for name, course in self.courses.items():
            ends = {"value": course.value, "low": course.low, "high": course.high}
            numbers = {key: [*map(finite_or_none, end)] for key, end in ends.items()}
            windows[name] = {"unit": course.declared.unit, **numbers}
        return {
            "model": self.model,
            "of": self.of,
            "time": self.time.tolist(),
            "records": [*self.labels],
            "windows": windows,
            "forecast": self.forecast and self.forecast.to_dict(),
            "derating": self.derating and self.derating.steps(),
            "notes": [*self.notes],
        }


def hours(seconds: float) -> str:
    """Return a time in hours as a text; "never" if it is infinite."""
    return f"{seconds / HOUR:.3g} h" if np.isfinite(seconds) else "never"
