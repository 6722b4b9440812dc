"""Smoothing: the likeliest random walk, added to a law, with which a model follows a record.

States are bound to the course exactly, and what is measured scatters about them; the normal
equations with the multipliers of the bonds are sparse, so that a long record costs in proportion to
its length (Rauch, Tung, Striebel, AIAA Journal 3, 1965, solve the same by recursion; Bell, SIAM J.
Optimization 4, 1994, as least squares).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from fmus.kit.arrays import Array
from orchestration.discrepancy.laws.linear.response import LinearResponse

# reach of a course over a record, in sizes that explain what is wrong
_REACHES = np.geomspace(1e-3, 1e3, 7)
_FARTHEST = 1.0  # that the model's own coordinates may move at once
_ENOUGH = 1.1  # times the least residual of any course, which the smoothest one may leave


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


def smoothest(
    runs: Sequence[TrackingTarget], law: str, noise: Mapping[str, float], precision: Array
) -> float:
    """Return the reach of the smoothest course that explains what any course can.

    Parameters
    ----------
    runs : sequence of TrackingTarget
    law : str
    noise : Mapping of str to float
        Its standard deviation by output.
    precision : ndarray, shape (p,)
        Of the model's own coordinates.

    Returns
    -------
    float
        In sizes that explain what is wrong.
    """
    left = np.array([smoothed(runs, law, noise, precision, reach)[2] for reach in _REACHES])
    return float(_REACHES[int(np.argmax(left <= _ENOUGH**2 * left.min()))])


def smoothed(
    runs: Sequence[TrackingTarget],
    law: str,
    noise: Mapping[str, float],
    precision: Array,
    reach: float,
) -> tuple[list[Array], Array, float]:
    """Estimate the likeliest random walk of every run, and a step of the own coordinates.

    Parameters
    ----------
    runs, law, noise, precision
        See `smoothest`.
    reach : float
        Of a course over all runs, in sizes that explain what is wrong.

    Returns
    -------
    courses : list of ndarray, shape (n,)
        In the unit of the law.
    step : ndarray, shape (p,)
        None of them more than one.
    left : float
        Squares of what they do not explain, in units of the noise; no less than noise leaves in any
        output.
    """
    precision_of_walk = _precision_of_walk(runs, law, noise, reach)
    solved = [_solved(run, law, noise, precision_of_walk) for run in runs]
    # the coordinates are the border of a sparse matrix, which is eliminated last (Schur)
    matrix = np.diag(precision) + sum(one.matrix for one in solved)
    # the course makes up for what a coordinate may not do
    unbounded, *_ = np.linalg.lstsq(matrix, sum(one.score for one in solved), rcond=None)
    step = np.clip(unbounded, -_FARTHEST, _FARTHEST)
    moved = [one.alone - one.beside @ step for one in solved]
    left = 0.0
    for o, deviation in noise.items():
        errors = [
            run.outputs[o] + run.slopes[o] @ step - np.sum(run.response.row(law, o) * z, axis=1)
            for run, z in zip(runs, moved, strict=True)
        ]
        e = np.concatenate(errors) / deviation
        # noise leaves that much, and a course that leaves less follows it
        left += max(float(np.nansum(e**2)), float(np.isfinite(e).sum()))
    return [z[:, -1] for z in moved], step, left


def _precision_of_walk(
    runs: Sequence[TrackingTarget], law: str, noise: Mapping[str, float], reach: float
) -> float:
    """Return the precision of a random walk over a second, by its reach over all runs."""
    strength = (
        sum(float(np.nansum((y / noise[o]) ** 2)) for run in runs for o, y in run.outputs.items())
        ** 0.5
    )
    unit = sum(run.response.size(law, noise) ** 2 for run in runs) ** 0.5
    size = reach * (strength / unit if unit and strength else 1.0)
    duration = sum(float(np.sum(run.response.steps)) for run in runs)
    return duration / size**2


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


def _solved(
    run: TrackingTarget, law: str, noise: Mapping[str, float], precision_of_walk: float
) -> _Solved:
    """Eliminate states and course of a run.

    Parameters
    ----------
    run : TrackingTarget
    law : str
    noise : Mapping of str to float
        Its standard deviation by output.
    precision_of_walk : float
        Over a second.
    """
    transition, before, after = run.response.step(law)
    n = len(transition) + 1
    size = transition.shape[1] + 1
    equations = _normal_equations(run, law, noise, (n, size))
    information = equations.information
    walk = precision_of_walk / run.response.steps
    information[:-1, -1, -1] += walk
    information[1:, -1, -1] += walk
    bonds = _bonds(transition, before, after)
    normal = sparse.bmat([[_quadratic(information, walk), bonds.T], [bonds, None]], format="csc")
    flat = equations.border.reshape(n * size, -1)
    right = np.column_stack([equations.score.ravel(), flat])
    no_bonds = np.zeros((bonds.shape[0], right.shape[1]))
    solution = splu(normal).solve(np.vstack([right, no_bonds]))[: n * size]
    return _Solved(
        solution[:, 0].reshape(n, size),
        solution[:, 1:].reshape(n, size, -1),
        equations.matrix - flat.T @ solution[:, 1:],
        equations.own - flat.T @ solution[:, 0],
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


def _quadratic(information: Array, walk: Array) -> Any:
    """Return the matrix of the cost: blocks (n, k, k), and steps of a walk between their last."""
    n, size = information.shape[:2]
    k = np.arange(n)[:, None, None] * size
    i, j = np.meshgrid(np.arange(size), np.arange(size), indexing="ij")
    last = np.arange(n) * size + size - 1
    return _sparse(
        [(k + i, k + j, information), (last[:-1], last[1:], -walk), (last[1:], last[:-1], -walk)],
        (n * size, n * size),
    )


def _bonds(transition: Array, before: Array, after: Array) -> Any:
    """Return the bonds of the states of every sample to those before, and to the course.

    At first nothing has moved.
    """
    n = len(transition) + 1
    states = transition.shape[1]
    size = states + 1
    row = np.arange(n)[:, None] * states + np.arange(states)
    column = np.arange(n)[:, None] * size
    own = column + np.arange(states)
    course = np.broadcast_to(column + states, (n, states))
    return _sparse(
        [
            (row, own, np.ones((n, states))),
            (row[1:, :, None], own[:-1, None, :], -transition),
            (row[1:], course[:-1], -before),
            (row[1:], course[1:], -after),
        ],
        (n * states, n * size),
    )


def _sparse(blocks: Sequence[tuple[Any, Any, Array]], shape: tuple[int, int]) -> Any:
    parts = [np.broadcast_arrays(*block) for block in blocks]
    row, column, value = (np.concatenate([part[i].ravel() for part in parts]) for i in range(3))
    return sparse.coo_matrix((value, (row, column)), shape=shape).tocsc()
