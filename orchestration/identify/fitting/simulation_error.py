"""The simulation-error fit: least squares of the free run's errors (output-error method).

Nothing is assumed of the noise but its size, so that no noise model can explain a part that the
simulation should explain (Ljung: System Identification, section 7.2). The search begins at several
points, because the sum has several minima where time constants are far from the true ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.identify.fitting.least_squares import Minimum, minimise
from orchestration.identify.fitting.problem import Problem
from orchestration.identify.noise import noise_std
from orchestration.records.runs import base_name

# spread of starting points about nominal, in searched coordinates: a decade either way
_SPREAD = float(np.log(10.0))
_STARTS = 4  # in addition to the nominal one
_BRIEF = 12  # trial points after which only the best start goes on
# Root mean square error, in standard deviations of the noise, that leaves nothing to be gained
# elsewhere: that of the true parameters is 1.
_FLOOR = 1.1
# Fall of minus twice the log-likelihood for which another optimum than that of the nominal start is
# taken: very strong evidence (Kass and Raftery 1995). A parameter that does nothing where it is
# nominal may follow a little of the noise elsewhere, as a limit does that is just reached.
_CLEARLY = 10.0
# times the least sum of squares: a brief search that ended above it is not continued
_HOPELESS = 4.0
_FINE = 1e-4  # of the spread of an output: least noise that it is weighted by


def error_scales(problem: Problem) -> dict[str, float]:
    """Return the size of the noise of every output, robustly from its third differences."""
    for output, y in problem.measured.items():
        if output not in problem.error_scales:
            fine = _FINE * float(np.nanstd(y))
            problem.error_scales[output] = max(noise_std(y, 3), fine) or 1.0
    return problem.error_scales


def pooled_error(
    residual: Mapping[str, Array],
    scales: Mapping[str, float],
    weights: Mapping[str, Array] | None = None,
) -> float:
    """Return the root mean square error of all outputs, each over the size of its noise.

    Parameters
    ----------
    residual : Mapping of str to ndarray, shape (m,)
        By output.
    scales : Mapping of str to float
        See `error_scales`.
    weights : Mapping of str to ndarray, shape (m,), optional
        Weights of all samples; equal by default.
    """
    scaled = np.concatenate([error / scales[output] for output, error in residual.items()])
    counted = np.concatenate(
        [
            weights[output] if weights is not None else np.ones_like(error)
            for output, error in residual.items()
        ]
    )
    return float(np.sqrt((counted * scaled**2).sum() / counted.sum()))


def weighted_slopes(
    jacobian: Mapping[str, Array], scales: Mapping[str, float], below: Array
) -> Array:
    """Return the Jacobians of all outputs over their scales, and more rows below them.

    Quotients are written into the result directly, as a second copy takes much memory.

    Parameters
    ----------
    jacobian : Mapping of str to ndarray, shape (m, p)
        By output.
    scales : Mapping of str to float
        See `error_scales`.
    below : ndarray, shape (r, p)

    Returns
    -------
    ndarray, shape (m + r, p)
        With m rows of all outputs together.
    """
    rows = sum(map(len, jacobian.values()))
    stacked = np.empty((rows + len(below), below.shape[1]))
    first = 0
    for output, slopes in jacobian.items():
        last = first + len(slopes)
        np.divide(slopes, scales[output], out=stacked[first:last])
        first = last
    stacked[rows:] = below
    return stacked


def error_at(problem: Problem, q: Array) -> float:
    """Return the pooled error at a point; infinite where the model cannot be simulated.

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
    """Return the nominal point, and others spread evenly within a decade on either side.

    Parameters that are not searched in their logarithm are spread by as much in units of their
    size, log(10). Start values of states, and parameters of a single run, stay nominal.
    """
    nominal = problem.inside(problem.position(problem.start))
    is_spread = np.array(
        [not problem.declared[name].starts and base_name(name) == name for name in problem.names]
    )
    if not is_spread.any():
        return [nominal]
    points = 2.0 * halton_points(_STARTS, int(is_spread.sum())) - 1.0
    low, high = problem.bounds()
    others = []
    for point in points:
        q = nominal.copy()
        q[is_spread] += _SPREAD * point
        others.append(problem.inside(np.clip(q, low, high)))
    return [nominal, *others]


def halton_points(count: int, dimensions: int) -> Array:
    """Return the first points (count, dimensions) of a Halton sequence, without the origin.

    Coordinate j of point k is k + 1 in base p_j, the j-th prime, with its digits mirrored at the
    decimal point.

    Parameters
    ----------
    count, dimensions : int
    """
    points = np.zeros((count, dimensions))
    for column, prime in enumerate(_primes(dimensions)):
        for row in range(count):
            rest = row + 1
            place_value = 1.0 / prime
            while rest:
                rest, digit = divmod(rest, prime)
                points[row, column] += digit * place_value
                place_value /= prime
    return points


def _primes(count: int) -> list[int]:
    """Return the first primes."""
    primes: list[int] = []
    number = 2
    while len(primes) < count:
        if all(number % prime for prime in primes):
            primes.append(number)
        number += 1
    return primes


def fit_simulation_error(
    problem: Problem,
    starts: Sequence[Array],
    scales: Mapping[str, float],
    tolerance: float,
    prior: tuple[Callable[[Array], Array], Array] | None = None,
) -> Minimum:
    """Fit by least squares, with the error of each output divided by the size of its noise.

    Parameters
    ----------
    problem : Problem
    starts : sequence of ndarray, shape (p,)
        The others are tried only if the search from the first ends above the noise.
    scales : Mapping of str to float
        See `error_scales`.
    tolerance : float
        Fall of the sum of squares, relative to it, that ends a search.
    prior : tuple of callable and ndarray, optional
        Rows of a prior, and their Jacobian.

    Returns
    -------
    Minimum
        The end of the search from the first start, or the best of the others if that is clearly
        better.

    Raises
    ------
    UserError
        If the simulation fails where the first search starts.
    """
    errors = _WeightedErrors(problem, scales, prior)
    first = errors.search(starts[0], tolerance)
    best = first
    if errors.cost(first.q) <= _FLOOR**2 * problem.samples:
        return first
    for start in starts[1:]:
        if problem.out_of_time():
            break
        best = errors.better_minimum(best, start, tolerance)
    # Minus twice the log-likelihood is N log(S) plus a constant, with the sum of squares S and the
    # size of the noise estimated. No logarithm is taken: S is zero where noise-free data is met.
    factor = np.exp(_CLEARLY / problem.samples)
    is_clearly_better = errors.cost(first.q) > factor * errors.cost(best.q)
    return best if is_clearly_better else first


class _WeightedErrors:
    """Errors of the free run as a least-squares problem, each over the size of its noise.

    Parameters
    ----------
    problem, scales, prior
        See `fit_simulation_error`.
    """

    def __init__(
        self,
        problem: Problem,
        scales: Mapping[str, float],
        prior: tuple[Callable[[Array], Array], Array] | None,
    ):
        self._problem = problem
        self._scales = scales
        self._prior = prior

    def rows(self, q: Array) -> Array:
        """Return the weighted errors (m,)."""
        parts = [
            error / self._scales[output] for output, error in self._problem.evaluate(q)[0].items()
        ]
        return np.concatenate([*parts, self._prior[0](q)] if self._prior else parts)

    def slopes(self, q: Array) -> Array:
        """Return their derivatives (m, p)."""
        below = self._prior[1] if self._prior else np.empty((0, len(q)))
        return weighted_slopes(self._problem.evaluate(q)[1], self._scales, below)

    def cost(self, q: Array) -> float:
        """Return their sum of squares."""
        with np.errstate(over="ignore"):  # a simulation that runs away is far off
            return float((self.rows(q) ** 2).sum())

    def search(self, begin: Array, tolerance: float, trials: int = 200) -> Minimum:
        """Search for the least sum of squares from a point."""
        low, high = self._problem.smooth_bounds(begin)
        residual = self._problem.time_limited(self.rows)
        return minimise(residual, self.slopes, begin, low, high, tolerance=tolerance, trials=trials)

    def better_minimum(self, best: Minimum, start: Array, tolerance: float) -> Minimum:
        """Return the better of a minimum and the end of a search from another start."""
        try:
            tried = self.search(start, tolerance, _BRIEF)
            cost = self.cost(tried.q)
            least = self.cost(best.q)
            # clearly below the best, if the next step falls as promised; else it is no other
            # optimum, or one that is not clearly better
            may_win = cost - tried.promised < least * np.exp(-_CLEARLY / self._problem.samples)
            if not tried.converged and may_win and cost < _HOPELESS * least:
                tried = self.search(tried.q, tolerance)
        except UserError:  # it cannot be simulated there
            return best
        return tried if self.cost(tried.q) < self.cost(best.q) else best
