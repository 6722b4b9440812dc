"""Grey-box identification: a model's parameters from a record, on the simulation error.

Output-error estimation (Ljung: System Identification, section 7.4): the model runs free over the record and the sum of
squared differences is minimised, each output weighted by its own residual. Positive parameters are searched in their
logarithm. The Jacobian is exact (forward sensitivities), or by differences for an FMU without equations. Intervals
allow for coloured residuals.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from fmus.kit.errors import UserError
from fmus.kit.units import Described, allowed, shown
from orchestration.identify import prediction_error, presentation
from orchestration.identify.any_fmu import FmuWithDifferences
from orchestration.identify.covariance import Covariance, covariance, sandwich
from orchestration.identify.estimate import Estimate, distribution
from orchestration.identify.method import Method
from orchestration.identify.noise.autoregression import autoregression
from orchestration.identify.noise.model import Noise
from orchestration.identify.prediction_error import FitResult
from orchestration.identify.problem import Problem, Subject
from orchestration.identify.uncertainty.profile import LEVEL, Coordinate, Profile, profile
from orchestration.reporting.plain import plain_text, preformatted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
# nothing but the record holds the parameters, and values are what is asked for: to where rounding begins
_METHOD = Method(tolerance=1e-6, passes=5, settled=1e-3)
_VAGUE = float(
    np.log(10.0) / norm.ppf(0.975)
)  # standard error of a logarithm whose parameter is hardly determined
_COUPLED = 0.9  # correlation beyond which an interval of one parameter alone says little
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
        What this record does not determine, parameters at the end of their range.
    declared : Mapping of str to Described
        Units in which they are read.
    correlations : dict of tuple of str to float
        Of every pair of estimates, in searched coordinates; zero where one is not determined.
    logarithmic : tuple of str
        Parameters that were searched in their logarithm.
    likelihood : Likelihood or None
        What was fitted, from which profiles are made; a copy and what is pickled are without, for compiled code can be
        neither.
    profiles : dict of str to Profile
        Those that were made, by parameter.
    """

    estimates: dict[str, Estimate]
    evaluations: int
    warnings: list[str]
    declared: Mapping[str, Described]
    correlations: dict[tuple[str, str], float]
    logarithmic: tuple[str, ...]
    likelihood: Likelihood | None = field(repr=False, compare=False)
    profiles: dict[str, Profile] = field(default_factory=dict, repr=False, compare=False)

    def __getstate__(self) -> dict[str, Any]:
        """Return what is copied and pickled."""
        return self.__dict__ | {"likelihood": None}

    def profile(self, name: str, progress: Callable[[str], None] = lambda text: None) -> Profile:
        """Hold a parameter at values around its estimate and fit the others anew, for an interval without linearising.

        Parameters
        ----------
        name : str
            One that was fitted.
        progress : callable
            Told before every fit which it is.

        Returns
        -------
        Profile
            It is in ``profiles`` from now on, and in what is printed.

        Raises
        ------
        UserError
            If the parameter was not fitted, the fit is a copy or was pickled, or the FMU cannot be opened again.
        """
        if name not in self.estimates:
            raise UserError(
                f"no profile of {name}: it was not fitted; there are {', '.join(self.estimates)}"
            )
        if name not in self.profiles:
            if self.likelihood is None:
                raise UserError(
                    f"no profile of {name}: this is a copy of a fit, without its model; fit again for one"
                )
            self.profiles[name] = self.likelihood.profile(name, progress)
        return self.profiles[name]

    def plot_profiles(self, path: str | Path | None = None) -> Figure:
        """Draw the profiles that were made: deviance over parameter, the ellipse's parabola, and both intervals.

        Parameters
        ----------
        path : str or Path, optional
            Picture (.png, .svg or .pdf) to write as well.

        Raises
        ------
        UserError
            If there are none, or the file cannot be written.
        """
        from orchestration.identify.uncertainty.picture import draw

        if not self.profiles:
            raise UserError("no profile was made yet: profile(name) makes one")
        return draw([*self.profiles.values()], None if path is None else Path(path))

    @property
    def coupled(self) -> dict[tuple[str, str], float]:
        """Pairs that the record tells together better than each, the closest first, with their correlations."""
        close = {pair: r for pair, r in self.correlations.items() if abs(r) > _COUPLED}
        return dict(sorted(close.items(), key=lambda item: -abs(item[1])))

    @property
    def values(self) -> dict[str, float]:
        """Fitted values by name."""
        return {name: e.value for name, e in self.estimates.items()}

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """95 % confidence intervals by name, SI; infinite where the record says nothing of a parameter."""
        return {name: e.interval for name, e in self.estimates.items()}

    def draws(self, count: int, seed: int = 0) -> dict[str, Array]:
        """Draw parameters at random, as the record leaves them open; what `sweep` takes with ``kind="draws"``.

        Parameters
        ----------
        count : int
        seed : int
            The same seed comes to the same draws.

        Returns
        -------
        dict of str to ndarray, shape (count,)
            SI, normally distributed with the covariance of the fit, in the logarithm where that was searched.

        Raises
        ------
        UserError
            If the record does not determine a parameter.
        """
        return distribution(self.estimates, self.correlations, self.logarithmic).draws(count, seed)

    @property
    def all_warnings(self) -> list[str]:
        """Those of the fit, and those of its profiles."""
        return [*self.warnings, *(text for p in self.profiles.values() for text in p.warnings)]

    @property
    def warning_lines(self) -> list[str]:
        """Warnings as they are printed."""
        return [f"warning: {text}" for text in self.all_warnings]

    def __str__(self) -> str:
        return "\n".join([plain_text(presentation.parameters(self)), *self.warning_lines])

    def __repr__(self) -> str:
        values = ", ".join(
            f"{name} = {shown(e.value, self.declared[name])}" for name, e in self.estimates.items()
        )
        return f"<Fit {values}>"

    def _repr_html_(self) -> str:
        return preformatted(str(self))

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON: parameters, correlations, number of simulations, warnings."""
        figures: dict[str, Any] = {
            "parameters": {
                name: e.to_dict() | {"logarithmic": name in self.logarithmic}
                for name, e in self.estimates.items()
            },
            "correlations": [
                {"between": [*pair], "value": r} for pair, r in self.correlations.items()
            ],
            "simulations": self.evaluations,
            "warnings": self.warnings,
        }
        return figures | (
            {"profiles": {n: p.to_dict() for n, p in self.profiles.items()}}
            if self.profiles
            else {}
        )


@dataclass(frozen=True)
class Likelihood:
    """What was fitted, to be fitted again with one parameter held.

    Attributes
    ----------
    subject : type[Component] or FmuWithDifferences
    problem : Problem
    fitted : FitResult
    spread : Covariance
        Of the searched coordinates, as the intervals of the fit have it.
    """

    subject: Subject
    problem: Problem
    fitted: FitResult
    spread: Covariance

    def profile(self, name: str, progress: Callable[[str], None]) -> Profile:
        """Profile one of the parameters; see `Fit.profile`."""
        problem, i, fits = self.problem, self.problem.names.index(name), 0
        own = covariance(self.fitted.information).matrix
        least = sum(
            n.deviance(self.fitted.innovation[o], problem.present[o])
            for o, n in self.fitted.noise.items()
        )
        colour = self.spread.matrix[i, i] / own[i, i] if own[i, i] > 0.0 else 1.0
        tangent = own[i] / own[i, i] if own[i, i] > 0.0 else np.eye(len(own))[i]
        low, high = problem.bounds()

        def refit(start: Array) -> tuple[Array, float]:
            nonlocal fits
            fits += 1
            progress(f"profile of {name}, fit {fits}")
            q, deviance = prediction_error.fit_in_noise(
                problem, np.clip(start, low, high), self.fitted.noise, _METHOD
            )
            return q, (deviance - least) / (colour * LEVEL)

        scale = problem.scales[i]
        error = float(self.spread.standard_errors[i])
        along = Coordinate(i, scale.value, low[i], high[i], scale.logarithmic, tangent, error)
        problem.held = [i]
        try:
            with (
                self.subject.opened()
                if isinstance(self.subject, FmuWithDifferences)
                else nullcontext()
            ):
                return profile(name, problem.declared[name], refit, self.fitted.q, along)
        finally:
            problem.held = []


def fit(
    cls: Subject,
    time: Array,
    inputs: Mapping[str, Array],
    measured: Mapping[str, Array],
    names: Sequence[str],
    fixed: Mapping[str, float] | None = None,
) -> Fit:
    """Fit parameters so that the free-running simulation follows the record.

    Parameters
    ----------
    cls : type[Component] or FmuWithDifferences
    time : ndarray, shape (n,)
        Seconds.
    inputs, measured : Mapping[str, ndarray]
        Inputs and measured outputs of shape (n,), SI; NaN in an output is a gap.
    names : sequence of str
        Parameters to fit, start values of states included.
    fixed : Mapping[str, float], optional
        Values of others, and starting points of those to fit.

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
    problem = Problem(cls, time, inputs, measured, names, fixed or {}, order=0)
    if len(names) >= problem.samples:
        raise UserError(
            f"{len(names)} parameters cannot be fitted to {problem.samples} measured values"
        )
    for name in names:
        declared = problem.declared[name]
        if not declared.min <= problem.start[name] <= declared.max:
            start = shown(problem.start[name], declared)
            raise UserError(
                f"the fit of {name} cannot start at {start}; allowed is {allowed(declared)}"
            )
    noise = {o: Noise(np.empty(0), float(np.nanstd(y)) or 1.0) for o, y in problem.measured.items()}
    fitted = prediction_error.fit(problem, problem.position(problem.start), noise, method=_METHOD)
    spread, intervals, warnings = _intervals(problem, fitted)
    if not fitted.converged:
        warnings.insert(0, "the search stopped before it converged; the values are the best found")
    low, high = problem.bounds()
    at_limit = (fitted.q <= low) | (fitted.q >= high)
    warnings += [
        f"{name} ended at the limit of its range"
        for name, at in zip(names, at_limit, strict=True)
        if at
    ]
    return Fit(
        {
            n: Estimate(fitted.values[n], problem.start[n], intervals[n], problem.declared[n].unit)
            for n in names
        },
        problem.evaluations,
        warnings,
        {n: problem.declared[n] for n in names},
        spread.correlations(names),
        tuple(n for n, s in zip(names, problem.scales, strict=True) if s.logarithmic),
        Likelihood(cls, problem, fitted, spread),
    )


def _intervals(
    problem: Problem, fitted: FitResult
) -> tuple[Covariance, dict[str, tuple[float, float]], list[str]]:
    """Covariance, 95 % intervals, and a sentence for parameters that the record does not determine."""
    slopes = problem.evaluate(fitted.q)[1]
    information = {o: np.sqrt(n.information) for o, n in fitted.noise.items()}
    weighted = {
        o: information[o] * n.whiten(slopes[o], problem.present[o]) for o, n in fitted.noise.items()
    }
    scores = {o: fitted.weights[o] * fitted.innovation[o] / information[o] for o in fitted.noise}
    noise = [Noise(c, np.sqrt(v)) for c, v in map(autoregression, scores.values())]
    spread = sandwich(fitted.covariance, weighted.values(), noise)
    unidentifiable = set(np.flatnonzero(spread.unidentifiable).tolist())
    silent = set(np.flatnonzero(np.diag(fitted.information) == 0.0).tolist())
    wide = np.array([s.logarithmic for s in problem.scales]) & (spread.standard_errors > _VAGUE)
    sentences = [
        (silent, "this record does not determine {}"),
        (unidentifiable - silent, "this record does not determine {} separately"),
        (
            set(np.flatnonzero(wide).tolist()) - unidentifiable,
            "this record hardly determines {}: the interval spans more than a factor of 100",
        ),
    ]
    warnings = [
        text.format(", ".join(problem.names[i] for i in sorted(who)))
        for who, text in sentences
        if who
    ]
    intervals = problem.intervals(fitted.q, spread.standard_errors)
    return (
        spread,
        intervals,
        warnings + [_slow(o, e) for o, e in fitted.residual.items() if _too_slow(problem, o, e)],
    )


def _too_slow(problem: Problem, output: str, residual: Array) -> bool:
    """Whether a residual is too slow for its colour to be known, and is one at all, beyond rounding."""
    measured = problem.measured[output][problem.present[output]]
    return _independent(residual) < _FEW and bool(np.std(residual) > 1e-6 * np.std(measured))


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
