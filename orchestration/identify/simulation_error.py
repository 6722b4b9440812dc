"""The simulation-error fit: the model runs free, and the sum of its squared errors is least (output-error method).

Nothing is assumed of the noise but its size, so that no noise model can take over what the simulation should explain
(Ljung: System Identification, section 7.2). The search begins at several points, because the sum has several minima
where time constants are far from what they are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from fmus.kit.errors import UserError
from orchestration.identify.least_squares import Minimum, minimise
from orchestration.identify.noise.model import noise_std
from orchestration.identify.problem import Problem
from orchestration.records.joined import base_name

Array = NDArray[np.float64]
_SPREAD = float(
    np.log(10.0)
)  # of starting points about nominal, in searched coordinates: a decade either way
_STARTS = 4  # beside the nominal one
_BRIEF = 12  # trial points after which only the best start goes on
_FLOOR = 1.1  # times the noise: closer to it nothing better is to be found elsewhere
# Fall of minus twice the log-likelihood for which another optimum than that of the nominal start is taken: very strong
# evidence (Kass and Raftery 1995). A parameter that does nothing where it is nominal may follow a little of the noise
# elsewhere, as a limit does that is just reached.
_CLEARLY = 10.0
_FINE = 1e-4  # of the spread of an output: noise below it does not make the output matter more


def error_scales(problem: Problem) -> dict[str, float]:
    """Size of the noise of every output, robustly from its third differences, in its unit."""
    spread = {o: float(np.nanstd(y)) for o, y in problem.measured.items()}
    return {o: max(noise_std(y, 3), _FINE * spread[o]) or 1.0 for o, y in problem.measured.items()}


def pooled_error(
    residual: Mapping[str, Array],
    scales: Mapping[str, float],
    weights: Mapping[str, Array] | None = None,
) -> float:
    """Root mean square of the errors of all outputs, each over the size of its noise.

    Parameters
    ----------
    residual : Mapping of str to ndarray, shape (m,)
        By output.
    scales : Mapping of str to float
        See `error_scales`.
    weights : Mapping of str to ndarray, shape (m,), optional
        How much every sample counts; all alike by default.
    """
    scaled = np.concatenate([e / scales[o] for o, e in residual.items()])
    counted = np.concatenate(
        [weights[o] if weights is not None else np.ones_like(e) for o, e in residual.items()]
    )
    return float(np.sqrt((counted * scaled**2).sum() / counted.sum()))


def error_at(problem: Problem, q: Array) -> float:
    """Pooled error at a point; infinite where the model cannot be simulated.

    Parameters
    ----------
    problem : Problem
    q : ndarray, shape (p,)
    """
    try:
        error = pooled_error(problem.evaluate(q)[0], error_scales(problem))
    except UserError:
        return np.inf
    return error if np.isfinite(error) else np.inf


def starting_points(problem: Problem) -> list[Array]:
    """Nominal parameters, and others within a decade, spread evenly; starts of states stay, and what is a run's own."""
    nominal = problem.inside(problem.position(problem.start))
    moved = np.array(
        [not problem.declared[name].starts and base_name(name) == name for name in problem.names]
    )
    if not moved.any():
        return [nominal]
    points = 2.0 * qmc.Halton(int(moved.sum()), scramble=False).random(_STARTS + 1)[1:] - 1.0
    low, high = problem.bounds()
    others = []
    for point in points:
        q = nominal.copy()
        q[moved] += _SPREAD * point
        others.append(problem.inside(np.clip(q, low, high)))
    return [nominal, *others]


def fit_simulation_error(
    problem: Problem,
    starts: Sequence[Array],
    scales: Mapping[str, float],
    tolerance: float,
    prior: tuple[Callable[[Array], Array], Array] | None = None,
) -> Minimum:
    """Fit by plain least squares, each output over the size of its noise.

    Parameters
    ----------
    problem : Problem
    starts : sequence of ndarray, shape (p,)
        The first is searched to the end; the others only if that does not come down to the noise.
    scales : Mapping of str to float
        See `error_scales`.
    tolerance : float
        Fall of the sum of squares, relative to it, that ends a search.
    prior : tuple of callable and ndarray, optional
        Rows of a prior, and their Jacobian.

    Returns
    -------
    Minimum
        Where the first search ended, or the best of the others if it is clearly better.

    Raises
    ------
    UserError
        If the simulation fails where the first search starts.
    """

    def rows(q: Array) -> Array:
        parts = [e / scales[o] for o, e in problem.evaluate(q)[0].items()]
        return np.concatenate([*parts, prior[0](q)] if prior else parts)

    def slopes(q: Array) -> Array:
        parts = [j / scales[o] for o, j in problem.evaluate(q)[1].items()]
        return np.vstack([*parts, prior[1]] if prior else parts)

    def cost(q: Array) -> float:
        return float((rows(q) ** 2).sum())

    def search(q: Array, trials: int = 200) -> Minimum:
        return minimise(
            problem.while_there_is_time(rows),
            slopes,
            q,
            *problem.neighbourhood(q),
            tolerance,
            trials,
        )

    first = best = search(starts[0])
    if cost(best.q) <= _FLOOR**2 * problem.samples:
        return best
    for start in starts[1:]:
        if problem.out_of_time():
            break
        try:
            tried = search(start, _BRIEF)
            if not tried.converged and cost(tried.q) < 4.0 * cost(best.q):
                tried = search(tried.q)
        except UserError:  # it cannot be simulated there
            continue
        if cost(tried.q) < cost(best.q):
            best = tried
    # not by a ratio, for a record without noise may be met exactly
    clearly = cost(first.q) > cost(best.q) * np.exp(_CLEARLY / problem.samples)
    return best if clearly else first
