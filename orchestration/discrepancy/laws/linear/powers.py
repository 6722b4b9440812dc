"""Powers with which laws depend on parameters, which bound steps to first order.

A conductance may fall to nothing and a resistance may not; where laws depend on the reciprocal of
a parameter it is that which keeps its sign.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fmus.kit.arrays import Array, Mask
from fmus.kit.symbolic import PerturbedLaws
from orchestration.discrepancy.laws.linear.response import SimulatedCourse
from orchestration.records.runs import base_name

# change of the power of a parameter beside a correction, relative to it
LEAST = -0.9
MOST = 20.0
_CHANGE = 0.1  # of the logarithm of a parameter, by which its power is estimated
_POINTS = 200  # of a course at which laws are evaluated
_NONE = 1e-3  # power, below which a law depends on the logarithm


def affine_powers(
    laws: PerturbedLaws, course: SimulatedCourse, values: Mapping[str, float], names: Sequence[str]
) -> Array:
    """Estimate powers n where laws are a + b p^n along a course.

    Parameters
    ----------
    laws : PerturbedLaws
    course : SimulatedCourse
        Of a simulation of the model.
    values : Mapping of str to float
        Of its parameters, SI.
    names : sequence of str
        Of p coordinates, which may be parameters in one of several runs.

    Returns
    -------
    ndarray, shape (p,)
        1 where no law depends on a parameter, as none does on a start value.
    """
    at = np.unique(np.linspace(0, len(course.time) - 1, _POINTS).astype(int))
    inputs = {name: sides.begin[at] for name, sides in course.inputs.items()}
    states = {name: sides.begin[at] for name, sides in course.states.items()}

    def changed(name: str, change: float) -> Array:
        changed_values = dict(values) | {name: values[name] * float(np.exp(change))}
        return laws.along(course.time[at], changed_values, inputs, states).values

    known = {p.name for p in laws.graph.layout.parameters}
    powers = np.ones(len(names))
    for k, name in enumerate(map(base_name, names)):
        if name not in known or not values.get(name):
            continue
        less, same, more = (changed(name, change) for change in (-_CHANGE, 0.0, _CHANGE))
        size = np.maximum(np.abs(same).max(axis=0), 1e-300)
        rise, fall = (float(np.linalg.norm(part / size)) for part in (more - same, same - less))
        if rise > 0.0 and fall > 0.0:
            powers[k] = np.log(rise / fall) / _CHANGE
    return powers


def moved(step: Array, power: Array, logarithmic: Mask) -> Array:
    """Return the change of searched coordinates (p,) by a step, bounded by the powers of laws."""
    relative = np.clip(power * step, LEAST, MOST)
    straight = np.abs(power) < _NONE
    by_power = np.log1p(relative) / np.where(straight, 1.0, power)
    return np.where(logarithmic & ~straight, by_power, np.clip(step, -1.0, 1.0))


def reach(power: Array) -> tuple[Array, Array]:
    """Return the least and the largest steps (p,) that are allowed."""
    ends = np.array([LEAST, MOST])[:, None] / np.where(np.abs(power) < _NONE, _NONE, power)
    return ends.min(axis=0), ends.max(axis=0)
