"""The course of an addition to a law with which a linear model follows a record: a random walk, as calm as will do.

States are bound to the course exactly, and what is measured scatters about them; the normal equations with the
multipliers of the bonds are sparse, so that a long record costs in proportion to its length (Rauch, Tung, Striebel,
AIAA Journal 3, 1965, solve the same by recursion; Bell, SIAM J. Optimization 4, 1994, as least squares).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from orchestration.discrepancy.laws.linear.response import LinearResponse

Array = NDArray[np.float64]
_STIRRED = np.geomspace(
    1e-3, 1e3, 7
)  # how far a course may go over a record, in sizes that explain what is wrong
_FARTHEST = 1.0  # that the model's own coordinates may move at once
_ENOUGH = 1.1  # times the least that any course leaves, which the calmest one may leave


@dataclass(frozen=True)
class Wanted:
    """What a run has more than a linear model.

    Attributes
    ----------
    response : LinearResponse
        Of the model to what is added to a law.
    outputs : dict of str to ndarray, shape (n,)
        What they have more; NaN where nothing is known.
    slopes : dict of str to ndarray, shape (n, p)
        Derivatives of that by the model's own coordinates, of all runs.
    """

    response: LinearResponse
    outputs: dict[str, Array]
    slopes: dict[str, Array]


def calmest(
    runs: Sequence[Wanted], law: str, noise: Mapping[str, float], precision: Array
) -> float:
    """How far a course has to be let go to explain what it can.

    Parameters
    ----------
    runs : sequence of Wanted
    law : str
    noise : Mapping of str to float
        Its standard deviation by output.
    precision : ndarray, shape (p,)
        With which the model's own coordinates are known.

    Returns
    -------
    float
        In sizes that explain what is wrong.
    """
    left = np.array([smoothed(runs, law, noise, precision, stirred)[2] for stirred in _STIRRED])
    return float(_STIRRED[int(np.argmax(left <= _ENOUGH**2 * left.min()))])


def smoothed(
    runs: Sequence[Wanted], law: str, noise: Mapping[str, float], precision: Array, stirred: float
) -> tuple[list[Array], Array, float]:
    """Find the likeliest random walk of every run, and with them a step of the model's own coordinates.

    Parameters
    ----------
    runs, law, noise, precision
        See `calmest`.
    stirred : float
        How far a course goes over all runs, in sizes that explain what is wrong.

    Returns
    -------
    courses : list of ndarray, shape (n,)
        In the unit of the law.
    step : ndarray, shape (p,)
        None of them more than one.
    left : float
        Squares of what they do not explain, in units of the noise; no less than noise leaves in any output.
    """
    strength = (
        sum(float(np.nansum((y / noise[o]) ** 2)) for run in runs for o, y in run.outputs.items())
        ** 0.5
    )
    unit = sum(run.response.size(law, noise) ** 2 for run in runs) ** 0.5
    reach = stirred * (strength / unit if unit and strength else 1.0)
    duration = sum(float(np.sum(run.response.steps)) for run in runs)
    solved = [_solved(run, law, noise, duration / reach**2) for run in runs]
    # the coordinates are the border of a sparse matrix, which is eliminated last (Schur)
    matrix = np.diag(precision) + sum(one.matrix for one in solved)
    # the course makes up for what a coordinate may not do
    step = np.clip(
        np.linalg.lstsq(matrix, sum(one.score for one in solved), rcond=None)[0],
        -_FARTHEST,
        _FARTHEST,
    )
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


@dataclass(frozen=True)
class _Solved:
    """States and course without a step (n, k) and per step (n, k, p), and what is left of the step's equations."""

    alone: Array
    beside: Array
    matrix: Array
    score: Array


def _solved(run: Wanted, law: str, noise: Mapping[str, float], calm: float) -> _Solved:
    """Eliminate states and course of a run; calm is the precision of a walk over a second."""
    transition, before, after = run.response.step(law)
    n, size = len(transition) + 1, transition.shape[1] + 1
    count = next(iter(run.slopes.values())).shape[1]
    information, score = np.zeros((n, size, size)), np.zeros((n, size))
    border, matrix, own = np.zeros((n, size, count)), np.zeros((count, count)), np.zeros(count)
    for o, y in run.outputs.items():
        known = np.isfinite(y)
        row = np.where(known[:, None], run.response.row(law, o), 0.0) / noise[o]
        slope, wanted = (
            np.where(known[:, None], run.slopes[o], 0.0) / noise[o],
            np.where(known, y, 0.0) / noise[o],
        )
        information += row[:, :, None] * row[:, None, :]
        score += row * wanted[:, None]
        border -= row[:, :, None] * slope[:, None, :]
        matrix += slope.T @ slope
        own -= slope.T @ wanted
    walk = calm / run.response.steps
    information[:-1, -1, -1] += walk
    information[1:, -1, -1] += walk
    bonds = _bonds(transition, before, after)
    normal = sparse.bmat([[_quadratic(information, walk), bonds.T], [bonds, None]], format="csc")
    right = np.column_stack([score.ravel(), border.reshape(n * size, count)])
    found = splu(normal).solve(np.vstack([right, np.zeros((bonds.shape[0], 1 + count))]))[
        : n * size
    ]
    flat = border.reshape(n * size, count)
    return _Solved(
        found[:, 0].reshape(n, size),
        found[:, 1:].reshape(n, size, count),
        matrix - flat.T @ found[:, 1:],
        own - flat.T @ found[:, 0],
    )


def _quadratic(information: Array, walk: Array) -> Any:
    """Matrix of what is minimised: blocks (n, k, k), and the steps of a walk between the last of each."""
    n, size = information.shape[:2]
    k = np.arange(n)[:, None, None] * size
    i, j = np.meshgrid(np.arange(size), np.arange(size), indexing="ij")
    last = np.arange(n) * size + size - 1
    return _sparse(
        [(k + i, k + j, information), (last[:-1], last[1:], -walk), (last[1:], last[:-1], -walk)],
        (n * size, n * size),
    )


def _bonds(transition: Array, before: Array, after: Array) -> Any:
    """What ties the states of every sample to those before, and to the course; at first nothing has moved."""
    n, states = len(transition) + 1, transition.shape[1]
    size = states + 1
    row, column = np.arange(n)[:, None] * states + np.arange(states), np.arange(n)[:, None] * size
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
