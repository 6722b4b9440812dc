"""How large the signals and laws of a model are on a record, which is where searches for what they lack begin."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fmus.kit import Component
from fmus.kit.errors import UserError
from fmus.kit.record.compiled import CompiledModel
from fmus.kit.symbolic.families import laws_of

Array = NDArray[np.float64]
_QUANTILE = 0.95  # of the modulus: the largest value may be a glitch


def typical(
    cls: type[Component], time: Array, fed: Mapping[str, Array], values: Mapping[str, float]
) -> dict[str, float]:
    """Typical magnitudes of a model's inputs, states and laws over a record, SI.

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
        To one figure, 1, 2 or 5 with a power of ten, so that records alike have models alike; without what is zero,
        or what cannot be simulated.
    """
    inputs = {name: np.nan_to_num(u) for name, u in fed.items()}
    sizes = dict(inputs)
    try:
        signals = CompiledModel(cls).run(time, inputs, values).signals
        sizes |= {state.name: signals[state.name] for state in cls.layout.states}
        sizes |= _laws(cls, sizes, values)
    except UserError:  # at its nominal parameters it may not run; the declared values have to do
        pass
    return {name: size for name, value in sizes.items() if (size := _rounded(value)) > 0.0}


def _laws(
    cls: type[Component], signals: Mapping[str, Array], values: Mapping[str, float]
) -> dict[str, Array]:
    """Every law, computed of arrays."""
    one = cls()
    one.__dict__.update(values)
    for name, value in signals.items():
        setattr(one, name, value)
    found = {}
    for law in laws_of(cls):
        try:
            found[law.name] = np.atleast_1d(np.asarray(getattr(one, law.name)(), dtype=float))
        except (TypeError, ValueError):  # it returns several values at once
            continue
    return found


def _rounded(values: Array) -> float:
    size = (
        float(np.quantile(np.abs(values[np.isfinite(values)]), _QUANTILE))
        if np.isfinite(values).any()
        else 0.0
    )
    if not size > 0.0:
        return 0.0
    power = 10.0 ** np.floor(np.log10(size))
    return float(max(f for f in (1.0, 2.0, 5.0) if f <= size / power * (1.0 + 1e-9)) * power)
