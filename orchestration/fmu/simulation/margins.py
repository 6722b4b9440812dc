"""Limits that an FMU tells of itself, and remarks on what of a run lies beyond them.

An output ``X_margin`` is what is left of a parameter ``X_limit``: the limit less the value that it
is about, so that a negative one is beyond. Any FMU may have them; those of the actuator are limits
of its material. A Boolean output ``limited`` or ``saturated`` says that a command is not what the
law asks for, so that what it is to bring about is beyond reach.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.units import format_value
from orchestration.fmu.signal import Signal, Value

_MARGIN, _LIMIT = "_margin", "_limit"
_LIMITERS = ("limited", "saturated")
# of the largest margin, that a value may lie beyond its limit by rounding
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Margin:
    """An output that tells what is left of a limit.

    Attributes
    ----------
    output, limit : Signal
        The margin and its parameter, by their names in the run.
    """

    output: Signal
    limit: Signal


@dataclass(frozen=True)
class LimitOutputs:
    """The outputs of a model or a system that tell of its limits.

    Attributes
    ----------
    margins : dict of str to Margin
        By name, what is left of a limit.
    limiters : dict of str to Signal
        By name, whether a command is not what the law asks for.
    """

    margins: dict[str, Margin]
    limiters: dict[str, Signal]

    @classmethod
    def among(cls, outputs: Mapping[str, Signal], parameters: Mapping[str, Signal]) -> LimitOutputs:
        """Return those among the outputs of a model or a system."""
        limits = {
            name: f"{name.removesuffix(_MARGIN)}{_LIMIT}"
            for name, signal in outputs.items()
            if name.endswith(_MARGIN) and signal.type == "real"
        }
        return cls(
            margins={
                name: Margin(outputs[name], parameters[limit])
                for name, limit in limits.items()
                if limit in parameters and parameters[limit].type == "real"
            },
            limiters={
                name: signal
                for name, signal in outputs.items()
                if name.rpartition(".")[2] in _LIMITERS and signal.type == "boolean"
            },
        )

    def remarks(
        self, time: Array, signals: Mapping[str, Array], settings: Mapping[str, Value]
    ) -> Iterator[str]:
        """Yield a line for every limit that a run went beyond, or at which it was held.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds.
        signals : Mapping of str to ndarray, shape (n,)
            Those outputs that were recorded.
        settings : Mapping of str to float or str
            Parameters that are not at their defaults.
        """
        for name, margin in self.margins.items():
            if name in signals:
                yield from _beyond(name, margin, time, signals[name], settings)
        for name, limiter in self.limiters.items():
            if name in signals:
                yield from _held(name, limiter, time, signals[name])


def _beyond(
    name: str, margin: Margin, time: Array, left: Array, settings: Mapping[str, Value]
) -> Iterator[str]:
    """Yield, if a limit was passed, the signal, its farthest value, the limit, and when first."""
    beyond = left < -_ROUNDING * float(np.abs(left).max(initial=0.0))
    if not beyond.any():
        return
    limit_name = f"{name.removesuffix(_MARGIN)}{_LIMIT}"
    limit = float(settings.get(limit_name, margin.limit.start))
    farthest = limit - float(left.min())
    yield (
        f"{name.removesuffix(_MARGIN)} reaches {format_value(farthest, margin.output)} and is"
        f" beyond {limit_name} = {format_value(limit, margin.output)} at"
        f" {float(time[np.argmax(beyond)]):g} s first: {margin.limit.doc}"
    )


def _held(name: str, limiter: Signal, time: Array, values: Array) -> Iterator[str]:
    """Yield, if a command was limited, for how much of the time, and when first."""
    limited = np.asarray(values, dtype=bool)
    spent = float(np.diff(time)[limited[:-1]].sum())  # the last point has no time after it
    if spent > 0.0:
        share = 100.0 * spent / float(time[-1] - time[0])
        first = float(time[np.argmax(limited)])
        yield f"{name} for {share:.3g} % of the time, at {first:g} s first: {limiter.doc}"
