"""Smoothing: the likeliest random walk, added to a law, with which a model follows a record.

States are bound to the course exactly, and what is measured scatters about them; the normal
equations with the multipliers of the bonds are a band, so that a long record costs in proportion to
its length (Rauch, Tung, Striebel, AIAA Journal 3, 1965, solve the same by recursion; Bell, SIAM J.
Optimization 4, 1994, as least squares).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_banded

from fmus.kit.arrays import Array
from orchestration.discrepancy.laws.linear.response import LinearResponse

# reach of a course over a record, in sizes that explain what is wrong
_REACHES = np.geomspace(1e-3, 1e3, 7)
_FARTHEST = 1.0  # that the model's own coordinates may move at once
_ENOUGH = 1.1  # times the least residual of any course, which the smoothest one may leave
# Precision of the level that a course begins at, in precisions of a step: next to none, and still
# more than round-off (Durbin and Koopman: Time Series Analysis by State Space Methods, chapter 5).
# A law that no output shows would have a course of any level.
_DIFFUSE = 1e-10


@dataclass(frozen=True)
class TrackingTarget:
    """The residual of a run that an addition to a law is to explain.

    Attributes
    ----------
    response : LinearResponse
        Of the model to what is added to a law.
    outputs : dict of str to ndarray, shape (n,)
        The residual; NaN where nothing is known.
    slopes : dict of str to ndarray, shape (n, p)
        Derivatives of that by the model's own coordinates, of all runs.
    """

    response: LinearResponse
    outputs: dict[str, Array]
    slopes: dict[str, Array]


class Smoother:
    """Random walks of every run that are added to a law, with a step of the own coordinates.

    Parameters
    ----------
    runs : sequence of TrackingTarget
    law : str
    noise : Mapping of str to float
        Its standard deviation by output.
    precision : ndarray, shape (p,)
        Of the model's own coordinates.
    """

    def __init__(
        self,
        runs: Sequence[TrackingTarget],
        law: str,
        noise: Mapping[str, float],
        precision: Array,
    ):
        self._runs = runs
        self._law = law
        self._noise = noise
        self._precision = precision
        self._equations = [_BandedEquations(run, law, noise) for run in runs]
        strength = sum(
            float(np.nansum((y / noise[o]) ** 2)) for run in runs for o, y in run.outputs.items()
        )
        unit = sum(run.response.size(law, noise) ** 2 for run in runs)
        self._size = (strength / unit) ** 0.5 if unit and strength else 1.0
        self._duration = sum(float(np.sum(run.response.steps)) for run in runs)

    def smoothest(self) -> float:
        """Return the reach of the smoothest course that explains what any course can.

        Returns
        -------
        float
            In sizes that explain what is wrong.
        """
        left = np.array([self(reach)[2] for reach in _REACHES])
        return float(_REACHES[int(np.argmax(left <= _ENOUGH**2 * left.min()))])

    def __call__(self, reach: float) -> tuple[list[Array], Array, float]:
        """Estimate the likeliest random walk of every run, and a step of the own coordinates.

        Parameters
        ----------
        reach : float
            Of a course over all runs, in sizes that explain what is wrong.

        Returns
        -------
        courses : list of ndarray, shape (n,)
            In the unit of the law.
        step : ndarray, shape (p,)
            None of them more than one.
        left : float
            Squares of what they do not explain, in units of the noise; no less than noise leaves in
            any output.
        """
        precision_of_walk = self._duration / (reach * self._size) ** 2
        solved = [equations.solved(precision_of_walk) for equations in self._equations]
        # the coordinates are the border of the band, which is eliminated last (Schur)
        matrix = np.diag(self._precision) + sum(one.matrix for one in solved)
        # the course makes up for what a coordinate may not do
        unbounded, *_ = np.linalg.lstsq(matrix, sum(one.score for one in solved), rcond=None)
        step = np.clip(unbounded, -_FARTHEST, _FARTHEST)
        moved = [one.alone - one.beside @ step for one in solved]
        left = 0.0
        for o, deviation in self._noise.items():
            errors = [
                run.outputs[o]
                + run.slopes[o] @ step
                - np.sum(run.response.row(self._law, o) * z, axis=1)
                for run, z in zip(self._runs, moved, strict=True)
            ]
            e = np.concatenate(errors) / deviation
            # noise leaves that much, and a course that leaves less follows it
            left += max(float(np.nansum(e**2)), float(np.isfinite(e).sum()))
        return [z[:, -1] for z in moved], step, left


@dataclass(frozen=True)
class _Solved:
    """Solution of a run, as far as it does not depend on the step of the own coordinates.

    Attributes
    ----------
    alone : ndarray, shape (n, k)
        States and course without a step.
    beside : ndarray, shape (n, k, p)
        Their change per unit of the step.
    matrix : ndarray, shape (p, p)
    score : ndarray, shape (p,)
        Equations of the step, states and course eliminated.
    """

    alone: Array
    beside: Array
    matrix: Array
    score: Array


class _BandedEquations:
    """Equations of a run for the bonds' multipliers, the states and the course of every sample.

    In this order the matrix is a band, in LAPACK's storage.

    Parameters
    ----------
    run : TrackingTarget
    law : str
    noise : Mapping of str to float
        Its standard deviation by output.
    """

    def __init__(self, run: TrackingTarget, law: str, noise: Mapping[str, float]):
        transition, before, after = run.response.step(law)
        n = len(transition) + 1
        self._states = transition.shape[1]
        self._steps = run.response.steps
        self._equations = _normal_equations(run, law, noise, (n, self._states + 1))
        self._band = _band(self._equations.information, transition, before, after)

    def solved(self, precision_of_walk: float) -> _Solved:
        """Eliminate multipliers, states and course.

        Parameters
        ----------
        precision_of_walk : float
            Over a second.
        """
        equations = self._equations
        n, size = equations.score.shape
        block = size + self._states
        walk = precision_of_walk / self._steps
        band = self._band.copy()
        course = band[:, block - 1 :: block]
        course[block, :-1] += walk
        course[block, 1:] += walk
        course[block, :1] += _DIFFUSE * walk[:1]
        course[0, 1:] -= walk
        course[2 * block, :-1] -= walk
        right = np.zeros((n, block, 1 + equations.border.shape[2]))
        right[:, self._states :, 0] = equations.score
        right[:, self._states :, 1:] = equations.border
        flat = right.reshape(n * block, -1)
        solution = solve_banded((block, block), band, flat, overwrite_ab=True, check_finite=False)
        shaped = solution.reshape(n, block, -1)[:, self._states :]
        return _Solved(
            shaped[:, :, 0],
            shaped[:, :, 1:],
            equations.matrix - flat[:, 1:].T @ solution[:, 1:],
            equations.own - flat[:, 1:].T @ solution[:, 0],
        )


@dataclass(frozen=True)
class _NormalEquations:
    """Normal equations of a run for states and course, k together, and p own coordinates.

    Attributes
    ----------
    information : ndarray, shape (n, k, k)
    score : ndarray, shape (n, k)
        Of states and course.
    border : ndarray, shape (n, k, p)
        Between these and the own coordinates.
    matrix : ndarray, shape (p, p)
    own : ndarray, shape (p,)
        Of the own coordinates.
    """

    information: Array
    score: Array
    border: Array
    matrix: Array
    own: Array


def _normal_equations(
    run: TrackingTarget, law: str, noise: Mapping[str, float], shape: tuple[int, int]
) -> _NormalEquations:
    """Return the normal equations of what was measured, for (n, k) states and course."""
    n, size = shape
    count = next(iter(run.slopes.values())).shape[1]
    information = np.zeros((n, size, size))
    score = np.zeros((n, size))
    border = np.zeros((n, size, count))
    matrix = np.zeros((count, count))
    own = np.zeros(count)
    for o, y in run.outputs.items():
        known = np.isfinite(y)
        row = np.where(known[:, None], run.response.row(law, o), 0.0) / noise[o]
        slope = np.where(known[:, None], run.slopes[o], 0.0) / noise[o]
        wanted = np.where(known, y, 0.0) / noise[o]
        information += row[:, :, None] * row[:, None, :]
        score += row * wanted[:, None]
        border -= row[:, :, None] * slope[:, None, :]
        matrix += slope.T @ slope
        own -= slope.T @ wanted
    return _NormalEquations(information, score, border, matrix, own)


def _band(information: Array, transition: Array, before: Array, after: Array) -> Array:
    """Return the band of a run without the precision of its walk.

    The states of every sample are bound to those before, and to the course; at first nothing has
    moved.

    Parameters
    ----------
    information : ndarray, shape (n, states + 1, states + 1)
    transition : ndarray, shape (n - 1, states, states)
    before, after : ndarray, shape (n - 1, states)

    Returns
    -------
    ndarray, shape (2 b + 1, n b)
        Of blocks of b = 2 states + 1.
    """
    n = len(information)
    states = transition.shape[1]
    block = 2 * states + 1
    here = np.zeros((n, block, block))
    here[:, states:, states:] = information
    here[:, :states, states:-1] = np.eye(states)
    here[1:, :states, -1] = -after
    here[:, states:, :states] = here[:, :states, states:].swapaxes(1, 2)
    behind = np.concatenate([-transition, -before[:, :, np.newaxis]], axis=2)
    band = np.zeros((2 * block + 1, n * block))
    for column in range(block):
        band[block - column : 2 * block - column, column::block] = here[:, :, column].T
    for row in range(states):
        for k in range(states + 1):
            column = states + k
            apart = block + row - column
            band[block + apart, column : (n - 1) * block : block] = behind[:, row, k]
            band[block - apart, block + row :: block] = behind[:, row, k]
    return band
