"""With which power laws hang on a parameter, so that it is known how far it may go where all is linear.

A conductance may fall to nothing and a resistance may not; where laws hang on the reciprocal of a parameter it is that
which keeps its sign.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fmus.kit.symbolic.perturbed import PerturbedLaws
from orchestration.discrepancy.laws.linear.response import Course
from orchestration.records.joined import base_name

Array = NDArray[np.float64]
LEAST, MOST = -0.9, 20.0  # change of the power of a parameter beside a correction, relative to it
_CHANGE = 0.1  # of the logarithm of a parameter, by which its power is told
_POINTS = 200  # of a course at which laws are asked
_NONE = 1e-3  # power, below which a law hangs on the logarithm


def powers(
    laws: PerturbedLaws, course: Course, values: Mapping[str, float], names: Sequence[str]
) -> Array:
    """Tell powers n where laws are a + b p^n along a course.

    Parameters
    ----------
    laws : PerturbedLaws
    course : Course
        Where a model ran.
    values : Mapping of str to float
        Of its parameters, SI.
    names : sequence of str
        Of p coordinates, which may be parameters in one of several runs.

    Returns
    -------
    ndarray, shape (p,)
        1 where no law hangs on a parameter, as none does on where a state starts.
    """
    at = np.unique(np.linspace(0, len(course.time) - 1, _POINTS).astype(int))
    inputs, states = (
        {n: s.begin[at] for n, s in group.items()} for group in (course.inputs, course.states)
    )

    def changed(name: str, change: float) -> Array:
        changed = dict(values) | {name: values[name] * float(np.exp(change))}
        return laws.along(course.time[at], changed, inputs, states).values

    known = {p.name for p in laws.graph.layout.parameters}
    found = np.ones(len(names))
    for k, name in enumerate(map(base_name, names)):
        if name not in known or not values.get(name):
            continue
        less, same, more = (changed(name, change) for change in (-_CHANGE, 0.0, _CHANGE))
        size = np.maximum(np.abs(same).max(axis=0), 1e-300)
        rise, fall = (float(np.linalg.norm(part / size)) for part in (more - same, same - less))
        if rise > 0.0 and fall > 0.0:
            found[k] = np.log(rise / fall) / _CHANGE
    return found


def moved(step: Array, power: Array, logarithmic: NDArray[np.bool_]) -> Array:
    """Searched coordinates (p,) after a step to first order: those of a logarithm as far as its power goes."""
    relative = np.clip(power * step, LEAST, MOST)
    straight = np.abs(power) < _NONE
    by_power = np.log1p(relative) / np.where(straight, 1.0, power)
    return np.where(logarithmic & ~straight, by_power, np.clip(step, -1.0, 1.0))


def reach(power: Array) -> tuple[Array, Array]:
    """Least and most (p,) that steps may be."""
    ends = np.array([LEAST, MOST])[:, None] / np.where(np.abs(power) < _NONE, _NONE, power)
    return ends.min(axis=0), ends.max(axis=0)
