"""Search for a Pareto front: a global method for its ends, and a local one along it.

The ends are found by differential evolution (Storn, Price), and the points between them by the
epsilon constraint (Haimes et al.): the first objective is maximised while the second is not below a
level. The worst of several outputs is replaced by a bound below all of them, so that the problem is
smooth for the local method, SciPy's SLSQP with exact derivatives. It starts from neighbours on the
front and from the best points of a Sobol sample.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.sweeps.pareto.front import Front
from orchestration.sweeps.pareto.objectives import Objectives
from orchestration.sweeps.pareto.point_journal import point_journal

_STARTS = 4  # of the local method for a point, in addition to neighbours
_GENERATIONS = 60
_TOLERANCE = 1e-10  # of the local method, for objectives scaled to 0 to 1
_FEASIBLE = (
    1e-7  # largest shortfall of the second objective below its level, as a share of its range
)

Find = Callable[
    [int, Callable[[], Array]], Array
]  # of a row, and a function that searches its point


@dataclass
class _Scales:
    """Lower limits and widths of objectives in the sample, which scale them from 0 to 1."""

    low: Array
    width: Array

    def __call__(self, k: int, values: Array) -> Array:
        return np.asarray((values - self.low[k]) / self.width[k])


def pareto_front(
    objectives: Objectives,
    count: int = 21,
    samples: int = 256,
    seed: int = 0,
    progress: Callable[[int, int], None] = lambda done, all_of: None,
    folder: Path | None = None,
) -> Front:
    """Return the optimum of one objective, or the Pareto front of two.

    Parameters
    ----------
    objectives : Objectives
        One or two.
    count : int
        Number of levels of the second objective at which the first is maximised, 2 or more.
    samples : int
        Size of the Sobol sample from which the search starts, preferably a power of 2.
    seed : int
        Seed of the sample and of the global method.
    progress : callable
        Called with the number of finished points and the number of all.
    folder : Path, optional
        Journal of the points, from which an interrupted search is continued; it is not removed.

    Returns
    -------
    Front
        Points of which none is dominated by another.

    Raises
    ------
    UserError
        If no run of the sample succeeds, or the folder belongs to another search.
    """
    from scipy.stats import qmc

    sample = qmc.Sobol(len(objectives.ranges), seed=seed).random(samples)
    is_single = len(objectives.objectives) == 1
    # a front has two rows for each end, and for each point between them one per direction
    rows = 1 if is_single else 2 * count
    with point_journal(objectives, samples + rows, (samples, count, seed), folder) as journal:
        for row, shares in enumerate(sample):
            journal.find(row, partial(np.copy, shares))
        values = np.array([journal.worst(row) for row in range(samples)])
        finite = np.isfinite(values).all(axis=1)
        if not finite.any():
            objectives.evaluate(sample[0])  # raises the error of that run
            raise UserError("no run of the sample gives numbers: set other ranges")
        sample = sample[finite]
        values = values[finite]
        low = values.min(axis=0)
        width = np.where(np.ptp(values, axis=0) > 0.0, np.ptp(values, axis=0), 1.0)
        search = _ParetoSearch(objectives, _Scales(low, width), sample, values, seed)

        def find(row: int, work: Callable[[], Array]) -> Array:
            return journal.find(samples + row, work)

        if is_single:
            points = [find(0, partial(search.best, 0))]
            progress(1, 1)
        else:
            points = search.front(count, progress, find)
    return Front.of(objectives, np.array(points))


class _ParetoSearch:
    """Search from a sample of points, with their objectives."""

    def __init__(
        self, objectives: Objectives, scales: _Scales, sample: Array, values: Array, seed: int
    ):
        self._objectives = objectives
        self._scales = scales
        self._sample = sample
        self._values = values
        self._seed = seed

    def best(self, k: int) -> Array:
        """Return the optimum of an objective, by the global and then the local method."""
        from scipy.optimize import differential_evolution

        size = len(self._objectives.ranges)
        order = np.argsort(-self._values[:, k])
        start = self._sample[order[: max(10 * size, 5)]]

        def loss(shares: Array) -> float:
            worst = self._objectives.worst(np.clip(shares, 0.0, 1.0))[k]
            return -float(self._scales(k, worst)) if np.isfinite(worst) else 1e6

        box: Any = [(0.0, 1.0)] * size
        result = differential_evolution(
            loss,
            box,
            init=start if len(start) >= 5 else "latinhypercube",
            maxiter=_GENERATIONS,
            polish=False,
            rng=np.random.default_rng(self._seed),
        )
        starts = [np.asarray(result.x), *self._sample[order[:_STARTS]]]
        return self._refine(k, starts, {})

    def front(self, count: int, progress: Callable[[int, int], None], find: Find) -> list[Array]:
        """Return points from the optimum of the first objective to that of the second.

        `find` returns the point of a row, by a function that searches it.
        """
        tops = [find(k, partial(self.best, k)) for k in (0, 1)]
        ends = [find(2 + k, partial(self._end, k, tops)) for k in (0, 1)]
        levels = np.linspace(
            self._objectives.worst(ends[0])[1], self._objectives.worst(ends[1])[1], count
        )
        points = [ends[0]]
        for place in range(1, count - 1):
            near = [points[-1], ends[1]]
            points.append(find(3 + place, partial(self._between, levels[place], near)))
            progress(place, count)
        # a second time in reverse order, as a point may improve its predecessor
        points.append(ends[1])
        for place in reversed(range(1, count - 1)):
            search = partial(self._improve_point, levels[place], points[place], points[place + 1])
            points[place] = find(1 + count + place, search)
        progress(count, count)
        return points

    def _end(self, k: int, tops: list[Array]) -> Array:
        """Return the point of the best other objective among the optima of an objective."""
        level = {k: float(self._objectives.worst(tops[k])[k])}
        starts = self._starts(1 - k, level, tops)
        optima = [self._local(1 - k, start, level) for start in starts]
        return self._best_feasible([*optima, tops[k]], 1 - k, level)

    def _between(self, least: float, near: list[Array]) -> Array:
        """Return the optimum of the first objective while the second is not below a level."""
        level = {1: float(least)}
        return self._refine(0, self._starts(0, level, near), level)

    def _improve_point(self, least: float, point: Array, neighbour: Array) -> Array:
        """Return the better of a point and the local optimum from its neighbour."""
        level = {1: float(least)}
        return self._best_feasible([self._local(0, neighbour, level), point], 0, level)

    def _refine(self, k: int, starts: list[Array], level: dict[int, float]) -> Array:
        """Return the best of some starts and of the local optima from them."""
        return self._best_feasible([self._local(k, s, level) for s in starts] + starts, k, level)

    def _starts(self, k: int, level: dict[int, float], near: list[Array]) -> list[Array]:
        """Return starts of the local method: neighbours, and the best of the sample."""
        feasible = np.ones(len(self._values), dtype=bool)
        for other, least in level.items():
            feasible &= self._values[:, other] >= least
        order = np.argsort(-np.where(feasible, self._values[:, k], -np.inf))
        return [*near, *self._sample[order[:_STARTS]]]

    def _best_feasible(self, candidates: list[Array], k: int, level: dict[int, float]) -> Array:
        """Return the best candidate that is not below the level, or else the nearest to it."""

        def merit(shares: Array) -> tuple[float, float]:
            """Return the negative shortfall, then the objective."""
            worst = self._objectives.worst(shares)
            shortfall = sum(
                max((least - worst[other]) / self._scales.width[other], 0.0)
                for other, least in level.items()
            )
            return (0.0 if shortfall <= _FEASIBLE else -shortfall, float(worst[k]))

        return max(candidates, key=merit)

    def _local(self, k: int, start: Array, level: dict[int, float]) -> Array:
        """Return the local optimum of an objective from a start, with others not below a level.

        The variables are the shares and a bound below all outputs of the objective.
        """
        from scipy import optimize

        minimize: Any = optimize.minimize  # its stubs do not know mixed bounds
        size = start.size
        first = np.clip(start, 0.0, 1.0)
        bound = float(self._scales(k, self._objectives.worst(first)[k]))
        if not np.isfinite(bound):
            return first

        def margins(x: Array) -> Array:
            """Return the constraints, which are met where they are not negative."""
            values, _ = self._objectives.evaluate(np.clip(x[:size], 0.0, 1.0))
            own = self._scales(k, values[k]) - x[size]
            others = [
                self._scales(o, values[o]) - self._scales(o, np.array(least))
                for o, least in level.items()
            ]
            return np.concatenate([own, *others])

        def slopes(x: Array) -> Array:
            """Return the derivatives of the constraints."""
            _, derivatives = self._objectives.evaluate(np.clip(x[:size], 0.0, 1.0))
            scale = self._scales.width
            own = np.column_stack([derivatives[k] / scale[k], -np.ones(len(derivatives[k]))])
            others = [
                np.column_stack([derivatives[o] / scale[o], np.zeros(len(derivatives[o]))])
                for o in level
            ]
            return np.concatenate([own, *others])

        gradient = np.append(np.zeros(size), -1.0)
        box: Any = [(0.0, 1.0)] * size + [(None, None)]
        constraint: Any = {"type": "ineq", "fun": margins, "jac": slopes}
        try:
            result = minimize(
                lambda x: -x[size],
                np.append(first, bound),
                jac=lambda x: gradient,
                bounds=box,
                constraints=[constraint],
                method="SLSQP",
                options={"ftol": _TOLERANCE, "maxiter": 200},
            )
        except UserError:  # a run failed
            return first
        return np.clip(result.x[:size], 0.0, 1.0) if np.isfinite(result.x).all() else first
