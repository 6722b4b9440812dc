"""Limits that an FMU tells of itself, and remarks on what of a run lies beyond them.

An output ``X_margin`` is what is left of a parameter ``X_limit``: the limit less the value that it
is about, so that a negative one is beyond. Any FMU may have them; those of the actuator are limits
of its material.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.units import format_value
from orchestration.fmu.signal import Signal, Value

_MARGIN, _LIMIT = "_margin", "_limit"
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


def margins(outputs: Mapping[str, Signal], parameters: Mapping[str, Signal]) -> dict[str, Margin]:
    """Return the margins among the outputs of a model or a system, by name."""
    pairs = {
        name: f"{name.removesuffix(_MARGIN)}{_LIMIT}"
        for name, signal in outputs.items()
        if name.endswith(_MARGIN) and signal.type == "real"
    }
    return {
        name: Margin(outputs[name], parameters[limit])
        for name, limit in pairs.items()
        if limit in parameters and parameters[limit].type == "real"
    }


def remarks(
    known: Mapping[str, Margin],
    time: Array,
    signals: Mapping[str, Array],
    settings: Mapping[str, Value],
) -> Iterator[str]:
    """Yield a line for every limit that a run went beyond: signal, value, limit, and when first.

    Parameters
    ----------
    known : Mapping of str to Margin
        See `margins`.
    time : ndarray, shape (n,)
        Seconds.
    signals : Mapping of str to ndarray, shape (n,)
        Those margins that were recorded.
    settings : Mapping of str to float or str
        Parameters that are not at their defaults.
    """
    for name, margin in known.items():
        if name not in signals:
            continue
        left = signals[name]
        beyond = left < -_ROUNDING * float(np.abs(left).max(initial=0.0))
        if not beyond.any():
            continue
        limit_name = f"{name.removesuffix(_MARGIN)}{_LIMIT}"
        limit = float(settings.get(limit_name, margin.limit.start))
        farthest = limit - float(left.min())
        yield (
            f"{name.removesuffix(_MARGIN)} reaches {format_value(farthest, margin.output)} and is"
            f" beyond {limit_name} = {format_value(limit, margin.output)} at"
            f" {float(time[np.argmax(beyond)]):g} s first: {margin.limit.doc}"
        )
