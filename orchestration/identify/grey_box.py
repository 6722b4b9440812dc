"""Grey-box identification: a component's parameters from a record, on the simulation error.

Output-error estimation (Ljung: System Identification, section 7.4): the model runs free over the record and the sum of
squared differences is minimised, each output weighted by its own residual. Positive parameters are searched in their
logarithm. The Jacobian is exact (forward sensitivities). Intervals allow for coloured residuals.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import norm

from fmus.kit import Component
from fmus.kit.errors import UserError
from fmus.kit.units import allowed, shown
from orchestration.identify.covariance import covariance, sandwich
from orchestration.identify.estimate import Estimate
from orchestration.identify.noise import Noise, autoregression
from orchestration.identify.problem import Problem

Array = NDArray[np.float64]
_PASSES = 5  # at most, of weighting every output by the residual it leaves
_SETTLED = 0.01  # relative change of the weights that ends it
_VAGUE = float(np.log(10.0))  # half width of a logarithm's interval that makes its parameter hardly determined
_FEW = 50  # independent values below which the colour of a residual is not known well enough


@dataclass(frozen=True)
class Fit:
    """The result of :func:`fit`.

    Attributes
    ----------
    estimates : dict of str to Estimate
    evaluations : int
        Simulations made.
    warnings : list of str
        What cannot be told from this record, parameters at the end of their range.
    """

    estimates: dict[str, Estimate]
    evaluations: int
    warnings: list[str]

    @property
    def values(self) -> dict[str, float]:
        """Fitted values by name."""
        return {name: e.value for name, e in self.estimates.items()}


class _Weighted(Problem):
    """Residuals weighted by output."""

    def __init__(self, *given: Any):
        super().__init__(*given)
        self.weight = {o: 1.0 / (float(np.nanstd(y)) or 1.0) for o, y in self.measured.items()}

    def error(self, q: Array) -> Array:
        try:
            self.evaluate(q)
        except UserError:
            if not self.ran:
                raise  # already where the search starts
            return np.full(self.samples, np.inf)  # a point to step back from
        return np.concatenate([self.weight[o] * e for o, e in self.evaluate(q)[0].items()])

    def jacobian(self, q: Array) -> Array:
        return np.vstack([self.weight[o] * j for o, j in self.evaluate(q)[1].items()])

    def reweight(self, q: Array) -> bool:
        """Weight every output by the residual it leaves, as maximum likelihood would; true if that changed little."""
        before = self.weight
        self.weight = {o: 1.0 / (float(np.sqrt(np.mean(e**2))) or 1.0) for o, e in self.evaluate(q)[0].items()}
        change = np.array([self.weight[o] / before[o] for o in before])
        return bool(change.max() < (1.0 + _SETTLED) * change.min())  # a common factor moves no optimum

    def misses(self, output: str, residual: Array) -> bool:
        """Whether there is a residual at all, beyond rounding."""
        return bool(np.std(residual) > 1e-6 * np.std(self.measured[output][self.present[output]]))


def fit(
    cls: type[Component],
    time: Array,
    inputs: Mapping[str, Array],
    measured: Mapping[str, Array],
    names: Sequence[str],
    fixed: Mapping[str, float] | None = None,
    progress: Callable[[int, float], None] = lambda evaluations, cost: None,
) -> Fit:
    """Fit parameters so that the free-running simulation follows the record.

    Parameters
    ----------
    cls : type[Component]
    time : ndarray, shape (n,)
        Seconds.
    inputs, measured : Mapping[str, ndarray]
        Inputs and measured outputs of shape (n,), SI; NaN in an output is a gap.
    names : sequence of str
        Parameters to fit, start values of states included.
    fixed : Mapping[str, float], optional
        Values of others, and starting points of those to fit.
    progress : callable
        Told the number of simulations made and the present cost.

    Returns
    -------
    Fit

    Raises
    ------
    UserError
        If a name is unknown or given twice, a starting point is out of range, or there is nothing to fit to.
    """
    if len(set(names)) < len(names):
        raise UserError(f"a parameter to fit is named twice in {', '.join(names)}")
    problem = _Weighted(cls, time, inputs, measured, names, fixed or {})
    if len(names) >= problem.samples:
        raise UserError(f"{len(names)} parameters cannot be fitted to {problem.samples} measured values")
    low, high = problem.bounds()
    q = problem.position(problem.start)
    for name in names:
        declared = problem.declared[name]
        if not declared.min <= problem.start[name] <= declared.max:
            start = shown(problem.start[name], declared)
            raise UserError(f"the fit of {name} cannot start at {start}; allowed is {allowed(declared)}")
    q = problem.inside(q)
    for _ in range(_PASSES):
        solution = least_squares(
            problem.error, q, problem.jacobian, bounds=(low, high), xtol=1e-12, ftol=1e-12, gtol=1e-12, max_nfev=200
        )
        q = solution.x
        progress(problem.evaluations, float(solution.cost))
        if problem.reweight(q):
            break
    warnings = [] if solution.success else ["the search stopped before it converged; the values are the best found"]
    ends, told = _intervals(problem, q)
    warnings += told
    warnings += [f"{n} ended at the limit of its range" for n, m in zip(names, solution.active_mask, strict=True) if m]
    values = problem.values(q)
    return Fit(
        {n: Estimate(values[n], problem.start[n], ends[n], problem.declared[n].unit) for n in names},
        problem.evaluations,
        warnings,
    )


def _intervals(problem: _Weighted, q: Array) -> tuple[dict[str, tuple[float, float]], list[str]]:
    """95 % intervals, and a sentence for parameters that the record does not determine."""
    error, jacobian = problem.evaluate(q)
    weighted = {o: problem.weight[o] * j for o, j in jacobian.items()}
    information = np.sum([j.T @ j for j in weighted.values()], axis=0)
    noise = [Noise(c, problem.weight[o] * np.sqrt(v)) for o, e in error.items() for c, v in [autoregression(e)]]
    spread = sandwich(covariance(information), weighted.values(), noise)
    half = float(norm.ppf(0.975)) * spread.standard_errors
    blind = set(np.flatnonzero(spread.unidentifiable).tolist())
    silent = set(np.flatnonzero(np.diag(information) == 0.0).tolist())
    ends: dict[str, tuple[float, float]] = {}
    for i, (name, scale) in enumerate(zip(problem.names, problem.scales, strict=True)):
        open_end = 0.0 if scale.logarithmic else -np.inf
        ends[name] = (open_end, np.inf) if i in blind else (scale.value(q[i] - half[i]), scale.value(q[i] + half[i]))
    vague = {i for i, s in enumerate(problem.scales) if s.logarithmic and half[i] > _VAGUE} - blind
    sentences = [
        (silent, "this record does not determine {}"),
        (blind - silent, "this record does not determine {} separately"),
        (vague, "this record hardly determines {}: the interval spans more than a factor of 100"),
    ]
    told = [text.format(", ".join(problem.names[i] for i in sorted(who))) for who, text in sentences if who]
    return ends, told + [_slow(o, e) for o, e in error.items() if _independent(e) < _FEW and problem.misses(o, e)]


def _independent(residual: Array) -> float:
    """Return how many independent values tell as much about a mean as this series, by its lag-1 autocorrelation."""
    power = float(residual @ residual)
    lag_one = float(residual[:-1] @ residual[1:]) / power if power > 0.0 else 0.0
    return len(residual) * (1.0 - lag_one) / (1.0 + lag_one)


def _slow(output: str, residual: Array) -> str:
    return (
        f"the residual of {output} varies slowly, as {_independent(residual):.0f} independent values would: the "
        "intervals are too narrow"
    )
