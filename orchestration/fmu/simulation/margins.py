"""Limits that an FMU reports by its outputs, and remarks on a run that exceeds them.

An output ``X_margin`` is a parameter ``X_limit`` minus the limited value, so that a negative margin
is beyond the limit. Any FMU may have them; those of the actuator are limits of its material. Nor
should an output leave the range that it declares, such as that in which a curve was identified. A
Boolean output ``limited`` or ``saturated`` is true while a command differs from that of its control
law.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import isfinite

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.units import format_value
from orchestration.fmu.signal import Signal, Value

_MARGIN, _LIMIT = "_margin", "_limit"
_LIMITERS = ("limited", "saturated")
_ROUNDING = 1e-9  # rounding error of a margin, relative to the largest one
_SLACK = 0.01  # of a range: noise of the record in which its ends were found


@dataclass(frozen=True)
class Margin:
    """An output that is the distance to a limit, and that limit.

    Attributes
    ----------
    output : Signal
        The output ``X_margin``.
    limit : Signal
        The parameter ``X_limit``.
    """

    output: Signal
    limit: Signal


@dataclass(frozen=True)
class LimitOutputs:
    """The outputs of a model or a system that report limits.

    Attributes
    ----------
    margins : dict of str to Margin
        By the name of the output.
    limiters : dict of str to Signal
        Outputs ``limited`` and ``saturated``, by name.
    ranges : dict of str to Signal
        Outputs that declare both ends of a range, by name.
    """

    margins: dict[str, Margin]
    limiters: dict[str, Signal]
    ranges: dict[str, Signal]

    @classmethod
    def among(cls, outputs: Mapping[str, Signal], parameters: Mapping[str, Signal]) -> LimitOutputs:
        """Find the limit outputs among the outputs of a model or a system."""
        margins = {}
        limiters = {}
        for name, signal in outputs.items():
            limit = parameters.get(_limit_name(name))
            if name.endswith(_MARGIN) and limit and signal.type == limit.type == "real":
                margins[name] = Margin(signal, limit)
            if name.rpartition(".")[2] in _LIMITERS and signal.type == "boolean":
                limiters[name] = signal
        ranges = {
            name: signal for name, signal in outputs.items() if isfinite(signal.max - signal.min)
        }
        return cls(margins, limiters, ranges)

    @property
    def watched(self) -> list[str]:
        """Outputs that a run watches whether they are recorded or not."""
        return [*self.margins, *self.limiters, *self.ranges]

    def remarks(
        self, time: Array, signals: Mapping[str, Array], settings: Mapping[str, Value]
    ) -> Iterator[str]:
        """Yield a line for every limit or range that a run leaves, and every limited command.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds.
        signals : Mapping of str to ndarray, shape (n,)
            Recorded outputs, and limits that were driven.
        settings : Mapping of str to float or str
            Parameters that differ from their defaults.

        Yields
        ------
        str
        """
        for name, margin in self.margins.items():
            if name in signals:
                stated = settings.get(_limit_name(name), margin.limit.start)
                limit = np.broadcast_to(signals.get(_limit_name(name), float(stated)), time.shape)
                yield from _exceeded_limit(name, margin, time, signals[name], limit)
        for name, limiter in self.limiters.items():
            if name in signals:
                yield from _limited_command(name, limiter, time, signals[name])
        for name, signal in self.ranges.items():
            if name in signals:
                yield from _left_range(name, signal, time, signals[name])


def _limit_name(margin: str) -> str:
    """Return the name of the limit of a margin."""
    return margin.removesuffix(_MARGIN) + _LIMIT


def _exceeded_limit(
    name: str, margin: Margin, time: Array, values: Array, limits: Array
) -> Iterator[str]:
    """Yield a line if a limit is exceeded: its signal, the largest excess, and the first time."""
    is_beyond = values < -_ROUNDING * float(np.abs(values).max(initial=0.0))
    if not is_beyond.any():
        return
    worst = int(np.argmin(values))
    limit = float(limits[worst])
    farthest = limit - float(values[worst])
    yield (
        f"{name.removesuffix(_MARGIN)} reaches {format_value(farthest, margin.output)}, beyond"
        f" {_limit_name(name)} = {format_value(limit, margin.output)}, first at"
        f" {float(time[np.argmax(is_beyond)]):g} s: {margin.limit.doc}"
    )


def _limited_command(name: str, limiter: Signal, time: Array, values: Array) -> Iterator[str]:
    """Yield a line if a command was limited: the share of the time, and the first time."""
    is_limited = np.asarray(values, dtype=bool)
    duration = float(np.diff(time)[is_limited[:-1]].sum())  # no time follows the last point
    if duration > 0.0:
        share = 100.0 * duration / float(time[-1] - time[0])
        first = float(time[np.argmax(is_limited)])
        yield f"{name} for {share:.3g} % of the time, first at {first:g} s: {limiter.doc}"


def _left_range(name: str, signal: Signal, time: Array, values: Array) -> Iterator[str]:
    """Yield a line if an output leaves its range: the farthest value, and the first time."""
    excess = np.maximum(values - signal.max, signal.min - values)
    is_outside = excess > _SLACK * (signal.max - signal.min)
    if is_outside.any():
        farthest = format_value(float(values[np.nanargmax(excess)]), signal)
        low, high = (format_value(end, signal, 5) for end in (signal.min, signal.max))
        yield (
            f"{name} reaches {farthest}, outside of its range, {low} to {high}, first at"
            f" {float(time[np.argmax(is_outside)]):g} s: {signal.doc}"
        )
