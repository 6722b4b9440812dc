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
from orchestration.sweeps.pareto.point_journal import PointJournal, point_journal

_STARTS = 4  # of the local method for a point, in addition to neighbours
_GENERATIONS = 60
_LEAST_POPULATION = 5  # of differential evolution: SciPy refuses fewer points
_FAILED = 1e6  # loss of a point that cannot be simulated; others are about -1 to 0
_TOLERANCE = 1e-10  # of the local method, for objectives scaled to 0 to 1
_FEASIBLE = (
    1e-7  # largest shortfall of the second objective below its level, as a share of its range
)

Find = Callable[
    [int, Callable[[], Array]], Array
]  # of a row, and a function that searches its point


@dataclass
class _Scales:
    """Lower limits (m,) and widths (m,) of objectives in the sample, which scale them to 0..1."""

    low: Array
    width: Array

    def __call__(self, k: int, values: Array) -> Array:
        """Return values of objective k, scaled."""
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
        worst = _evaluate_sample(journal, sample)
        finite = np.isfinite(worst).all(axis=1)
        if not finite.any():
            objectives.evaluate(sample[0])  # raises the error of that run
            raise UserError("no run of the sample gives numbers: set other ranges")
        search = _ParetoSearch(objectives, sample[finite], worst[finite], seed)

        def find(row: int, work: Callable[[], Array]) -> Array:
            return journal.find(samples + row, work)

        if is_single:
            points = [find(0, partial(search.best, 0))]
            progress(1, 1)
        else:
            points = search.front(count, progress, find)
    return Front.of(objectives, np.array(points))


def _evaluate_sample(journal: PointJournal, sample: Array) -> Array:
    """Return the worst outputs (k, m) at points (k, p), from the journal as far as it has them."""
    for row, shares in enumerate(sample):
        journal.find(row, partial(np.copy, shares))  # the point itself: there is nothing to search
    return np.array([journal.worst(row) for row in range(len(sample))])


class _ParetoSearch:
    """Search from a sample of points, with their objectives.

    A point is an array (p,) of shares of the ranges. In `floors` the methods have the least value
    of each constrained objective, by its index.
    """

    def __init__(self, objectives: Objectives, sample: Array, values: Array, seed: int):
        spread = np.ptp(values, axis=0)
        self._objectives = objectives
        self._scales = _Scales(values.min(axis=0), np.where(spread > 0.0, spread, 1.0))
        self._sample = sample
        self._values = values
        self._seed = seed

    def best(self, k: int) -> Array:
        """Return the optimum of an objective, by the global and then the local method."""
        from scipy.optimize import differential_evolution

        size = len(self._objectives.ranges)
        order = np.argsort(-self._values[:, k])
        population = self._sample[order[: max(10 * size, _LEAST_POPULATION)]]

        def loss(shares: Array) -> float:
            worst = self._objectives.worst(np.clip(shares, 0.0, 1.0))[k]
            return -float(self._scales(k, worst)) if np.isfinite(worst) else _FAILED

        box: Any = [(0.0, 1.0)] * size
        result = differential_evolution(
            loss,
            box,
            init=population if len(population) >= _LEAST_POPULATION else "latinhypercube",
            maxiter=_GENERATIONS,
            polish=False,
            rng=np.random.default_rng(self._seed),
        )
        starts = [np.asarray(result.x), *self._sample[order[:_STARTS]]]
        return self._refine(k, starts, {})

    def front(self, count: int, progress: Callable[[int, int], None], find: Find) -> list[Array]:
        """Return points from the optimum of the first objective to that of the second.

        `find` returns the point of a row, by a function that searches it. Rows are two optima, two
        ends, ``count - 2`` points between them, and these again in the reverse direction.
        """
        optima = [find(k, partial(self.best, k)) for k in (0, 1)]
        ends = [find(2 + k, partial(self._find_end, k, optima)) for k in (0, 1)]
        levels = np.linspace(
            self._objectives.worst(ends[0])[1], self._objectives.worst(ends[1])[1], count
        )
        points = [ends[0]]
        for i in range(1, count - 1):
            neighbours = [points[-1], ends[1]]
            points.append(find(3 + i, partial(self._find_between, levels[i], neighbours)))
            progress(i, count)
        # a second time in reverse order, as a point may improve its predecessor
        points.append(ends[1])
        for i in reversed(range(1, count - 1)):
            search = partial(self._improve_point, levels[i], points[i], points[i + 1])
            points[i] = find(1 + count + i, search)
        progress(count, count)
        return points

    def _find_end(self, k: int, optima: list[Array]) -> Array:
        """Return the end of the front at objective k: of all its optima the best in the other."""
        floors = {k: float(self._objectives.worst(optima[k])[k])}
        starts = self._starts(1 - k, floors, optima)
        ends = [self._optimise_locally(1 - k, start, floors) for start in starts]
        return self._best_feasible([*ends, optima[k]], 1 - k, floors)

    def _find_between(self, level: float, neighbours: list[Array]) -> Array:
        """Return the optimum of the first objective while the second is not below a level."""
        floors = {1: float(level)}
        return self._refine(0, self._starts(0, floors, neighbours), floors)

    def _improve_point(self, level: float, point: Array, neighbour: Array) -> Array:
        """Return the better of a point and the local optimum from its neighbour."""
        floors = {1: float(level)}
        return self._best_feasible([self._optimise_locally(0, neighbour, floors), point], 0, floors)

    def _refine(self, k: int, starts: list[Array], floors: dict[int, float]) -> Array:
        """Return the best of some starts and of the local optima from them."""
        ends = [self._optimise_locally(k, start, floors) for start in starts]
        return self._best_feasible(ends + starts, k, floors)

    def _starts(self, k: int, floors: dict[int, float], neighbours: list[Array]) -> list[Array]:
        """Return starts of the local method: neighbours, and the best feasible of the sample."""
        feasible = np.ones(len(self._values), dtype=bool)
        for other, floor in floors.items():
            feasible &= self._values[:, other] >= floor
        order = np.argsort(-np.where(feasible, self._values[:, k], -np.inf))
        return [*neighbours, *self._sample[order[:_STARTS]]]

    def _best_feasible(self, candidates: list[Array], k: int, floors: dict[int, float]) -> Array:
        """Return the best candidate that is not below the floors, or else the nearest to them."""

        def merit(shares: Array) -> tuple[float, float]:
            """Return the negative shortfall, then the objective."""
            worst = self._objectives.worst(shares)
            shortfall = sum(
                max((floor - worst[other]) / self._scales.width[other], 0.0)
                for other, floor in floors.items()
            )
            return (0.0 if shortfall <= _FEASIBLE else -shortfall, float(worst[k]))

        return max(candidates, key=merit)

    def _optimise_locally(self, k: int, start: Array, floors: dict[int, float]) -> Array:
        """Return the local optimum of objective k from a start, with others not below the floors.

        The variables are the shares s and a bound b, which is maximised while ``f(s) >= b`` for
        every output f of objective k, and ``g(s) >= floor`` for every output g of the others.
        """
        from scipy import optimize

        minimize: Any = optimize.minimize  # its stubs do not know mixed bounds
        first = np.clip(start, 0.0, 1.0)
        bound = float(self._scales(k, self._objectives.worst(first)[k]))
        if not np.isfinite(bound):
            return first
        gradient = np.append(np.zeros(start.size), -1.0)
        constraints = {
            "type": "ineq",
            "fun": partial(self._margins, k, floors),
            "jac": partial(self._slopes_of_margins, k, floors),
        }
        try:
            result = minimize(
                lambda x: -x[-1],
                np.append(first, bound),
                jac=lambda x: gradient,
                bounds=[(0.0, 1.0)] * start.size + [(None, None)],
                constraints=[constraints],
                method="SLSQP",
                options={"ftol": _TOLERANCE, "maxiter": 200},
            )
        except UserError:  # a run failed
            return first
        return np.clip(result.x[:-1], 0.0, 1.0) if np.isfinite(result.x).all() else first

    def _margins(self, k: int, floors: dict[int, float], x: Array) -> Array:
        """Return the constraints of `_optimise_locally`, which are met if not negative.

        The variables `x` are the shares, and the bound last.
        """
        values, _ = self._objectives.evaluate(np.clip(x[:-1], 0.0, 1.0))
        margins = [self._scales(k, values[k]) - x[-1]]
        for other, floor in floors.items():
            least = self._scales(other, np.array(floor))
            margins.append(self._scales(other, values[other]) - least)
        return np.concatenate(margins)

    def _slopes_of_margins(self, k: int, floors: dict[int, float], x: Array) -> Array:
        """Return the derivatives of `_margins` by the variables."""
        _, derivatives = self._objectives.evaluate(np.clip(x[:-1], 0.0, 1.0))
        rows = []
        for objective in (k, *floors):
            by_shares = derivatives[objective] / self._scales.width[objective]
            by_bound = np.full(len(by_shares), -1.0 if objective == k else 0.0)
            rows.append(np.column_stack([by_shares, by_bound]))
        return np.concatenate(rows)
