"""The search for a front: a global method for its ends, a local one along it.

Ends by differential evolution (Storn, Price), points between them by the epsilon constraint (Haimes
et al.): the first objective as large as it can be while the second is not below a level. What is
the worst of several outputs is a bound under all of them, so that the local method, SciPy's SLSQP
on exact derivatives, sees no kink. It starts from neighbours on the front and from the best of a
Sobol sample.
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
from orchestration.sweeps.pareto.kept import kept_points
from orchestration.sweeps.pareto.objectives import Objectives

_STARTS = 4  # of the local method for a point, besides neighbours
_GENERATIONS = 60
_TOLERANCE = 1e-10  # of the local method, where objectives go from 0 to 1
_FEASIBLE = 1e-7  # of the range of the second objective: how far below its level a point may be

Find = Callable[[int, Callable[[], Array]], Array]  # of a row, and what searches its point


@dataclass
class _Scales:
    """What objectives are counted in, so that they go from 0 to 1 over the sample."""

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
    """Search for the best of one objective, or for the front of two.

    Parameters
    ----------
    objectives : Objectives
        One or two.
    count : int
        Levels of the second objective at which the first is maximised, 2 or more.
    samples : int
        Of the Sobol sample from which the search starts, a power of 2 at best.
    seed : int
        Of the sample and of the global method.
    progress : callable
        Called with the number of points that are done, and of all.
    folder : Path, optional
        Keeps every point, so that an interrupted search goes on; it stays.

    Returns
    -------
    Front
        Points none of which is better in both objectives than another.

    Raises
    ------
    UserError
        If no run of the sample succeeds, or the folder is not of this search.
    """
    from scipy.stats import qmc

    drawn = qmc.Sobol(len(objectives.ranges), seed=seed).random(samples)
    alone = len(objectives.objectives) == 1
    # each point of a front twice: ends for both objectives, those between there and back
    searched = 1 if alone else 2 * count
    with kept_points(objectives, samples + searched, (samples, count, seed), folder) as kept:
        for row, shares in enumerate(drawn):
            kept.find(row, partial(np.copy, shares))
        values = np.array([kept.worst(row) for row in range(samples)])
        finite = np.isfinite(values).all(axis=1)
        if not finite.any():
            objectives.evaluate(drawn[0])  # which says why
            raise UserError("no run of the sample gives numbers: set other ranges")
        drawn, values = drawn[finite], values[finite]
        low = values.min(axis=0)
        width = np.where(np.ptp(values, axis=0) > 0.0, np.ptp(values, axis=0), 1.0)
        search = _ParetoSearch(objectives, _Scales(low, width), drawn, values, seed)

        def find(row: int, work: Callable[[], Array]) -> Array:
            return kept.find(samples + row, work)

        if alone:
            points = [find(0, partial(search.best, 0))]
            progress(1, 1)
        else:
            points = search.front(count, progress, find)
    return Front.of(objectives, np.array(points))


class _ParetoSearch:
    """A search that starts from a sample."""

    def __init__(
        self, objectives: Objectives, scales: _Scales, drawn: Array, values: Array, seed: int
    ):
        self._of = objectives
        self._scales = scales
        self._drawn = drawn
        self._values = values
        self._seed = seed

    def best(self, k: int) -> Array:
        """Return where an objective is best, by the global method and then by the local one."""
        from scipy.optimize import differential_evolution

        size = len(self._of.ranges)
        order = np.argsort(-self._values[:, k])
        start = self._drawn[order[: max(10 * size, 5)]]

        def loss(shares: Array) -> float:
            worst = self._of.worst(np.clip(shares, 0.0, 1.0))[k]
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
        starts = [np.asarray(result.x), *self._drawn[order[:_STARTS]]]
        return self._improved(k, starts, {})

    def front(self, count: int, progress: Callable[[int, int], None], find: Find) -> list[Array]:
        """Return points from where the first objective is best to where the second is.

        Each is found by its row, with a function that searches it.
        """
        tops = [find(k, partial(self.best, k)) for k in (0, 1)]
        ends = [find(2 + k, partial(self._end, k, tops)) for k in (0, 1)]
        levels = np.linspace(self._of.worst(ends[0])[1], self._of.worst(ends[1])[1], count)
        points = [ends[0]]
        for place in range(1, count - 1):
            near = [points[-1], ends[1]]
            points.append(find(3 + place, partial(self._between, levels[place], near)))
            progress(place, count)
        # once more from the other side, for a later point may improve one before it
        points.append(ends[1])
        for place in reversed(range(1, count - 1)):
            again = partial(self._again, levels[place], points[place], points[place + 1])
            points[place] = find(1 + count + place, again)
        progress(count, count)
        return points

    def _end(self, k: int, tops: list[Array]) -> Array:
        """Return where an objective is best, and the other as good as it can be there."""
        level = {k: float(self._of.worst(tops[k])[k])}
        starts = self._starts(1 - k, level, tops)
        found = [self._local(1 - k, start, level) for start in starts]
        return self._chosen([*found, tops[k]], 1 - k, level)

    def _between(self, least: float, near: list[Array]) -> Array:
        """Return where the first objective is best while the second is not below a level."""
        level = {1: float(least)}
        return self._improved(0, self._starts(0, level, near), level)

    def _again(self, least: float, point: Array, neighbour: Array) -> Array:
        """Return the better of a point and of what is found from its neighbour."""
        level = {1: float(least)}
        return self._chosen([self._local(0, neighbour, level), point], 0, level)

    def _improved(self, k: int, starts: list[Array], level: dict[int, float]) -> Array:
        """Return the best point of some starts and of those that the local method makes of them."""
        return self._chosen([self._local(k, s, level) for s in starts] + starts, k, level)

    def _starts(self, k: int, level: dict[int, float], near: list[Array]) -> list[Array]:
        """Return where the local method starts: neighbours, and the best of the sample."""
        fits = np.ones(len(self._values), dtype=bool)
        for other, least in level.items():
            fits &= self._values[:, other] >= least
        order = np.argsort(-np.where(fits, self._values[:, k], -np.inf))
        return [*near, *self._drawn[order[:_STARTS]]]

    def _chosen(self, candidates: list[Array], k: int, level: dict[int, float]) -> Array:
        """Return the best candidate of those that reach the level, or else the nearest to it."""

        def merit(shares: Array) -> tuple[float, float]:
            worst = self._of.worst(shares)
            short = sum(
                max((least - worst[other]) / self._scales.width[other], 0.0)
                for other, least in level.items()
            )
            return (0.0 if short <= _FEASIBLE else -short, float(worst[k]))

        return max(candidates, key=merit)

    def _local(self, k: int, start: Array, level: dict[int, float]) -> Array:
        """Return where an objective is largest near a start, while others are not below a level.

        The variables are the shares and a bound under all outputs of the objective.
        """
        from scipy import optimize

        minimize: Any = optimize.minimize  # whose stubs know no mixed bounds
        size = start.size
        first = np.clip(start, 0.0, 1.0)
        bound = float(self._scales(k, self._of.worst(first)[k]))
        if not np.isfinite(bound):
            return first

        def margins(x: Array) -> Array:
            values, _ = self._of.evaluate(np.clip(x[:size], 0.0, 1.0))
            own = self._scales(k, values[k]) - x[size]
            others = [
                self._scales(o, values[o]) - self._scales(o, np.array(least))
                for o, least in level.items()
            ]
            return np.concatenate([own, *others])

        def slopes(x: Array) -> Array:
            _, derivatives = self._of.evaluate(np.clip(x[:size], 0.0, 1.0))
            scale = self._scales.width
            own = np.column_stack([derivatives[k] / scale[k], -np.ones(len(derivatives[k]))])
            others = [
                np.column_stack([derivatives[o] / scale[o], np.zeros(len(derivatives[o]))])
                for o in level
            ]
            return np.concatenate([own, *others])

        downhill = np.append(np.zeros(size), -1.0)
        box: Any = [(0.0, 1.0)] * size + [(None, None)]
        constraint: Any = {"type": "ineq", "fun": margins, "jac": slopes}
        try:
            result = minimize(
                lambda x: -x[size],
                np.append(first, bound),
                jac=lambda x: downhill,
                bounds=box,
                constraints=[constraint],
                method="SLSQP",
                options={"ftol": _TOLERANCE, "maxiter": 200},
            )
        except UserError:  # a run that fails on the way is no better than the start
            return first
        return np.clip(result.x[:size], 0.0, 1.0) if np.isfinite(result.x).all() else first
