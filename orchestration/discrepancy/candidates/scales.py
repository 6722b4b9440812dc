"""Typical magnitudes of the signals and laws of a model on a record, and of its times."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fmus.kit import Component, UserError
from fmus.kit.arrays import Array
from fmus.kit.record import CompiledModel
from fmus.kit.sampling import Sampling
from fmus.kit.symbolic import list_laws
from orchestration.identify.fitting import usual_effort

# no signal is larger, or as small and anything to go by, and their powers are still numbers
_LARGEST = 1e30
_SMALLEST = 1e-30
_QUANTILE = 0.95  # of the modulus: the largest value may be a glitch


def signal_scales(
    cls: type[Component], time: Array, fed: Mapping[str, Array], values: Mapping[str, float]
) -> dict[str, float]:
    """Return typical magnitudes of a model's inputs, states and laws over a record, SI.

    Parameters
    ----------
    cls : type[Component]
    time : ndarray, shape (n,)
    fed : Mapping of str to ndarray, shape (n,)
        Inputs.
    values : Mapping of str to float
        Of parameters, where they are not the default ones.

    Returns
    -------
    dict of str to float
        To one figure, 1, 2 or 5 with a power of ten, so that records alike have models alike;
        without what is zero or next to it, runs away, or cannot be simulated.
    """
    inputs = {name: np.nan_to_num(u) for name, u in fed.items()}
    sizes = dict(inputs)
    try:
        signals = (
            CompiledModel(cls).run(time, inputs, values, effort=usual_effort(len(time))).signals
        )
        sizes |= {state.name: signals[state.name] for state in cls.layout.states}
        sizes |= _law_values(cls, sizes, values)
    except UserError:  # at its nominal parameters it may not run; the declared values have to do
        pass
    magnitudes = {name: _rounded_magnitude(values) for name, values in sizes.items()}
    return {name: size for name, size in magnitudes.items() if _SMALLEST < size < _LARGEST}


def sampling_of(time: Array) -> Sampling:
    """Return sample time and length of a record, of time (n,) in seconds, to two figures."""
    step = float(np.median(np.diff(time)))
    return Sampling(float(f"{step:.2g}"), float(f"{time[-1] - time[0]:.2g}"))


def _law_values(
    cls: type[Component], signals: Mapping[str, Array], values: Mapping[str, float]
) -> dict[str, Array]:
    """Return every law, computed of arrays of the signals; each shape (n,) or (1,)."""
    component = cls()
    component.__dict__.update(values)
    for name, signal in signals.items():
        setattr(component, name, signal)
    laws = {}
    for law in list_laws(cls):
        try:
            laws[law.name] = np.atleast_1d(np.asarray(getattr(component, law.name)(), dtype=float))
        except (TypeError, ValueError):  # it returns several values at once
            continue
    return laws


def _rounded_magnitude(values: Array) -> float:
    """Return the magnitude, rounded down to 1, 2 or 5 with a power of ten; zero if none."""
    finite = np.isfinite(values)
    if not finite.any():
        return 0.0
    size = float(np.quantile(np.abs(values[finite]), _QUANTILE))
    if not size > 0.0:
        return 0.0
    power = 10.0 ** np.floor(np.log10(size))
    return float(max(f for f in (1.0, 2.0, 5.0) if f <= size / power * (1.0 + 1e-9)) * power)
