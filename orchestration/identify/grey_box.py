"""Grey-box identification: parameters of a model from a record, by the simulation error.

Output-error estimation (Ljung: System Identification, section 7.4): the model runs free over the
record and the sum of squared differences is minimised, each output weighted by its own residual.
Positive parameters are searched in their logarithm. The Jacobian is exact (forward sensitivities),
or by differences for an FMU without equations. Intervals allow for coloured residuals.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from itertools import count as counting
from math import log, sqrt
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import ndtri

from fmus.kit import UserError
from fmus.kit.arrays import Array, Interval, Signals
from fmus.kit.units import Described, format_range, format_value
from orchestration.identify import presentation
from orchestration.identify.fitting import (
    NO_ASSUMPTIONS,
    Assumptions,
    FitData,
    FitResult,
    FmuWithDifferences,
    JointProblem,
    Problem,
    Searches,
    Subject,
    fit_from_starts,
    fit_in_noise,
)
from orchestration.identify.metrics import finite_or_none, rms
from orchestration.identify.noise import Autoregression, fit_autoregression
from orchestration.identify.uncertainty import (
    LEVEL,
    Coordinate,
    Covariance,
    Estimate,
    Posterior,
    Profile,
    estimates_frame,
    joint_distribution,
    parameter_covariance,
    profile_likelihood,
    sample_posterior,
    sandwich_covariance,
)
from orchestration.reporting import Displayable, one_line, option

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure
    from rich.console import RenderableType

# standard error of a logarithm whose parameter is hardly determined
_VAGUE = log(10.0) / float(ndtri(0.975))
_COUPLED = 0.9  # correlation beyond which an interval of one parameter alone is misleading
# standard errors of a residual's size beyond which it is larger than noise that is known
_CLEARLY = 3.0
# share of the expected rise of the deviance at the end of an interval, below which it is too narrow
_FLAT = 0.8
_ONE_STEP = 2  # trial points of a search, of which the first is its start
_TO_THE_END = 200  # trial points of a search
_RESEMBLING = 0.5  # correlation of increments one sample apart: 6 samples of a period, or more
_FEW = 50  # independent values below which the colour of a residual is not known well enough


@dataclass(frozen=True)
class Fit(Displayable):
    """The result of :func:`fit_grey_box`.

    Attributes
    ----------
    estimates : dict of str to Estimate
    evaluations : int
        Simulations made.
    warnings : list of str
        Parameters that this record does not determine, or that ended at a limit of their range.
    declared : Mapping of str to Described
        Units in which they are read.
    correlations : dict of tuple of str to float
        Of every pair of estimates, in searched coordinates; zero where one is not determined.
    logarithmic : tuple of str
        Parameters that were searched in their logarithm.
    likelihood : Likelihood or None
        From which profiles are made; None in a copy and after pickling, because compiled code can
        be neither copied nor pickled.
    profiles : dict of str to Profile
        Profiles made so far, by parameter.
    samples : int
        Number of measured values.
    deviance : float
        Minus twice the log likelihood, up to ``samples * log(2 pi)``.
    searches : int
        Number of points from which a search began.
    ties : Mapping of str to tuple of (float, str)
        Factor, and the fitted parameter of which another one is that multiple.
    is_interrupted : bool
        Whether Ctrl-C ended the search; the values are then the best so far.
    """

    estimates: dict[str, Estimate]
    evaluations: int
    warnings: list[str]
    declared: Mapping[str, Described]
    correlations: dict[tuple[str, str], float]
    logarithmic: tuple[str, ...]
    likelihood: Likelihood | None = field(repr=False, compare=False)
    profiles: dict[str, Profile] = field(default_factory=dict, repr=False, compare=False)
    samples: int = 0
    deviance: float = float("nan")
    searches: int = 1
    ties: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    is_interrupted: bool = False

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes that are copied and pickled."""
        return self.__dict__ | {"likelihood": None}

    def profile(self, name: str, progress: Callable[[str], None] = lambda text: None) -> Profile:
        """Profile the likelihood of a parameter, for an interval without linearising.

        The parameter is held at values around its estimate, and the others are fitted anew.

        Parameters
        ----------
        name : str
            One that was fitted.
        progress : callable
            Called with a message before every fit.

        Returns
        -------
        Profile
            It is in ``profiles`` from now on, and is printed with the fit.

        Raises
        ------
        UserError
            If the parameter was not fitted, the fit is a copy or was pickled, or the FMU cannot be
            opened again.
        """
        if name not in self.estimates:
            raise UserError(
                f"no profile of {name}: it was not fitted; there are {', '.join(self.estimates)}"
            )
        if name not in self.profiles:
            self.profiles[name] = self._model_for(f"profile of {name}").profile(name, progress)
        return self.profiles[name]

    def posterior(
        self,
        count: int = 1000,
        seed: int = 0,
        progress: Callable[[str], None] = lambda text: None,
    ) -> Posterior:
        """Sample the posterior of the parameters, by emcee (the extra ``sampling``).

        The noise is held as it was given or estimated, and priors count.

        Parameters
        ----------
        count : int
            Independent samples.
        seed : int
            The same seed gives the same samples.
        progress : callable
            Called with a message every hundred steps.

        Raises
        ------
        UserError
            If the record does not determine a parameter, the fit is a copy or was pickled, or emcee
            is not installed.
        """
        return self._model_for("posterior").posterior(count, seed, progress)

    def _model_for(self, purpose: str) -> Likelihood:
        """Return the fitted problem; UserError in a copy, which has none."""
        if self.likelihood is None:
            raise UserError(
                f"no {purpose}: this is a copy of a fit, without its model; fit again for one"
            )
        return self.likelihood

    def plot_profiles(self, path: str | Path | None = None) -> Figure:
        """Draw the profiles that were made, with parabolas and intervals of the linearised fit.

        Parameters
        ----------
        path : str or Path, optional
            Picture (.png, .svg or .pdf) to write as well.

        Raises
        ------
        UserError
            If there are none, or the file cannot be written.
        """
        from orchestration.identify.uncertainty import draw_profiles
        from orchestration.reporting import pictures

        if not self.profiles:
            raise UserError("no profile was made yet: profile(name) makes one")
        return pictures.also_saved(draw_profiles([*self.profiles.values()]), path)

    @property
    def correlation_matrix(self) -> Array:
        """Correlations (p, p) of the estimates, in their order."""
        names = [*self.estimates]
        matrix = np.eye(len(names))
        for (one, other), r in self.correlations.items():
            i, j = names.index(one), names.index(other)
            matrix[[i, j], [j, i]] = r
        return matrix

    @property
    def coupled(self) -> dict[tuple[str, str], float]:
        """Correlations of strongly correlated pairs, the strongest first."""
        close = {pair: r for pair, r in self.correlations.items() if abs(r) > _COUPLED}
        return dict(sorted(close.items(), key=lambda item: -abs(item[1])))

    @property
    def tied(self) -> dict[str, Estimate]:
        """Estimates of the parameters that are a multiple of a fitted one."""
        tied = {}
        for name, (factor, source) in self.ties.items():
            one = self.estimates[source]
            value, nominal, *ends = (factor * x for x in (one.value, one.nominal, *one.interval))
            tied[name] = Estimate(value, nominal, (min(ends), max(ends)), one.unit)
        return tied

    @property
    def values(self) -> dict[str, float]:
        """Fitted values by name, ``NAME@RECORD`` for one of a single record; those of ties too."""
        return {name: e.value for name, e in (self.estimates | self.tied).items()}

    def values_of(self, record: str) -> dict[str, float]:
        """Return the values of the model's parameters in one of several records, by its label."""
        of_record = {}
        for name, value in self.values.items():
            plain, at, label = name.partition("@")
            if not at or label == record:
                of_record[plain] = value
        return of_record

    @property
    def intervals(self) -> dict[str, Interval]:
        """95 % confidence intervals by name, SI; infinite where not determined."""
        return {name: e.interval for name, e in self.estimates.items()}

    def draws(self, count: int, seed: int = 0) -> dict[str, Array]:
        """Draw parameters at random, as `sweep` takes them with ``kind="draws"``.

        Parameters
        ----------
        count : int
        seed : int
            The same seed gives the same draws.

        Returns
        -------
        dict of str to ndarray, shape (count,)
            SI, normally distributed with the covariance of the fit, in the logarithm where that was
            searched.

        Raises
        ------
        UserError
            If the record does not determine a parameter.
        """
        return joint_distribution(self.estimates, self.correlations, self.logarithmic).draws(
            count, seed
        )

    @property
    def all_warnings(self) -> list[str]:
        """Warnings of the fit and of its profiles."""
        return [*self.warnings, *(text for p in self.profiles.values() for text in p.warnings)]

    @property
    def warning_lines(self) -> list[str]:
        """Warnings as they are printed."""
        return [f"warning: {text}" for text in self.all_warnings]

    def overview(self) -> Iterator[RenderableType]:
        """Yield a table of the parameters, and the warnings."""
        yield presentation.parameters(self)
        yield from self.warning_lines

    def summary(self) -> str:
        """Return all figures of the fit as a text: parameters, correlations, statistics."""
        from orchestration.reporting.console import plain_text

        correlations = plain_text(presentation.correlations(self))
        return "\n\n".join([str(self), correlations, presentation.statistics(self)])

    def __repr__(self) -> str:
        values = ", ".join(
            f"{name} = {format_value(e.value, self.declared[name])}"
            for name, e in self.estimates.items()
        )
        return one_line(f"Fit {values}")

    def to_frame(self) -> pandas.DataFrame:
        """Return the parameters as a table, a row for each, those of ties included, SI.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        return estimates_frame(self.estimates | self.tied)

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON."""
        figures: dict[str, Any] = {
            "parameters": {
                name: e.to_dict() | {"logarithmic": name in self.logarithmic}
                for name, e in self.estimates.items()
            },
            "correlations": [
                {"between": [*pair], "value": r} for pair, r in self.correlations.items()
            ],
            "simulations": self.evaluations,
            "searches": self.searches,
            "samples": self.samples,
            "deviance": finite_or_none(self.deviance),
            "warnings": self.warnings,
        }
        if self.ties:
            figures["tied"] = {
                name: e.to_dict() | {"factor": self.ties[name][0]} for name, e in self.tied.items()
            }
        if self.profiles:
            figures["profiles"] = {name: p.to_dict() for name, p in self.profiles.items()}
        return figures


@dataclass(frozen=True)
class Likelihood:
    """The fitted problem, which is fitted again with one parameter at fixed values.

    Attributes
    ----------
    subject : type[Component] or FmuWithDifferences
    problem : Problem
    fitted : FitResult
    spread : Covariance
        Covariance of the searched coordinates that the intervals of the fit are from.
    """

    subject: Subject
    problem: Problem
    fitted: FitResult
    spread: Covariance

    @property
    def white_covariance(self) -> Array:
        """Covariance (p, p) of the searched coordinates as if the noise were white."""
        return parameter_covariance(self.fitted.information).matrix

    def coordinate(self, i: int) -> Coordinate:
        """Return a coordinate of the search, with its ends and the slopes of the others by it."""
        white = self.white_covariance
        scale = self.problem.scales[i]
        low, high = self.problem.bounds()
        return Coordinate(
            index=i,
            value=scale.value,
            low=low[i],
            high=high[i],
            logarithmic=scale.logarithmic,
            tangent=white[i] / white[i, i] if white[i, i] > 0.0 else np.eye(len(white))[i],
            standard_error=float(self.spread.standard_errors[i]),
        )

    def rise(self, i: int, start: Array, trials: int) -> tuple[Array, float]:
        """Fit the others with coordinate i held, from a point within the ranges.

        Parameters
        ----------
        i : int
        start : ndarray, shape (p,)
        trials : int
            Points that the search tries.

        Returns
        -------
        point : ndarray, shape (p,)
        rise : float
            Of the deviance, over the level at which the interval ends, and over the factor by which
            colour makes it rise too fast.
        """
        problem = self.problem
        inside = np.clip(start, *problem.bounds())
        problem.held = [i]
        try:
            q, deviance = fit_in_noise(problem, inside, self.fitted.noise, trials)
        finally:
            problem.held = []
        white = self.white_covariance[i, i]
        colour = float(self.spread.matrix[i, i] / white) if white > 0.0 else 1.0
        return q, (deviance - self.fitted.deviance) / (colour * LEVEL)

    def narrow_warnings(self) -> list[str]:
        """Return a warning for each end of an interval that is clearly too narrow.

        At that end of the ellipse's interval the deviance, with the others fitted by one step, is
        then well below the level, so that the profile reaches farther. It takes two simulations for
        each end.
        """
        warnings = []
        for i, name in enumerate(self.problem.names):
            at = self.coordinate(i)
            half = sqrt(LEVEL) * at.standard_error
            for word, side in (("below", -half), ("above", half)):
                if 0.0 < half < np.inf and self._is_flat(at, self.fitted.q + side * at.tangent):
                    warnings.append(
                        f"the interval of {name} is too narrow {word}: the model is not linear"
                        " there; a profile tells how far it reaches"
                    )
        return warnings

    def _is_flat(self, along: Coordinate, end: Array) -> bool:
        """Return whether the deviance at an end of an interval is clearly below the level."""
        try:
            inside = along.low <= end[along.index] <= along.high
            return inside and self.rise(along.index, end, _ONE_STEP)[1] < _FLAT
        except UserError:
            return False

    def profile(self, name: str, progress: Callable[[str], None]) -> Profile:
        """Profile one of the parameters; see `Fit.profile`."""
        i = self.problem.names.index(name)
        fits = counting(1)

        def refit(start: Array) -> tuple[Array, float]:
            progress(f"profile of {name}, fit {next(fits)}")
            return self.rise(i, start, _TO_THE_END)

        with _opened(self.subject):
            return profile_likelihood(
                name, self.problem.declared[name], refit, self.fitted.q, self.coordinate(i)
            )

    def posterior(self, count: int, seed: int, progress: Callable[[str], None]) -> Posterior:
        """Sample the posterior; see `Fit.posterior`."""
        problem = self.problem
        names = problem.names
        open_ended = np.flatnonzero(self.spread.unidentifiable)
        if open_ended.size:
            listed = ", ".join(names[i] for i in open_ended)
            raise UserError(
                f"no posterior: the record does not determine {listed}; hold it, or give a prior"
            )
        # the mean ratio of variances in the directions of the parameters
        colour = float(np.trace(self.fitted.information @ self.spread.matrix)) / len(names)

        def log_density(q: Array) -> float:
            try:
                deviance = problem.deviance(self.fitted.noise, problem.evaluate(q)[0])
            except UserError:
                return -np.inf
            return -0.5 * deviance / colour if np.isfinite(deviance) else -np.inf

        with _opened(self.subject, derivatives=False):
            return sample_posterior(
                log_density,
                {name: problem.declared[name] for name in names},
                [self.coordinate(i) for i in range(len(names))],
                self.fitted.q,
                self.spread.matrix,
                count=count,
                seed=seed,
                progress=progress,
            )


def _opened(subject: Subject, derivatives: bool = True) -> AbstractContextManager[None]:
    """Return a context in which the subject of a fit can be simulated."""
    if isinstance(subject, FmuWithDifferences):
        return subject.opened(derivatives)
    return nullcontext()


def fit_grey_box(
    cls: Subject,
    time: Array,
    inputs: Signals,
    measured: Signals,
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
        If a name is unknown or given twice, a starting point is out of range, or there is nothing
        to fit to.
    """
    return fit_records(cls, [FitData(time, inputs, measured)], names, fixed or {})


def fit_records(
    cls: Subject,
    records: Sequence[FitData],
    names: Sequence[str],
    fixed: Mapping[str, float],
    assumptions: Assumptions = NO_ASSUMPTIONS,
    progress: Callable[[str], None] = lambda text: None,
) -> Fit:
    """Fit parameters of one model to several records at once.

    Parameters
    ----------
    cls, names, fixed
        See :func:`fit_grey_box`.
    records : sequence of FitData
        With one set of parameters, but for start values of states and `Assumptions.each`.
    assumptions : Assumptions
    progress : callable
        See `fit_from_starts`.

    Returns
    -------
    Fit

    Raises
    ------
    UserError
        As :func:`fit_grey_box`, or if an assumption cannot be made.
    """
    if len(set(names)) < len(names):
        raise UserError(f"a parameter to fit is named twice in {', '.join(names)}")
    problem = _problem_of(cls, records, names, fixed, assumptions)
    _check_problem(problem)
    start = problem.position(problem.start)
    searches = fit_from_starts(problem, start, assumptions.starts, progress)
    fitted = searches.best
    spread = _coloured_covariance(problem, fitted)
    ties = dict(problem.assumptions.ties)
    intervals = problem.intervals(fitted.q, spread.standard_errors)
    declared = {name: problem.declared[name] for name in (*problem.names, *ties)}
    return Fit(
        estimates={
            name: Estimate(value, problem.start[name], intervals[name], declared[name].unit)
            for name, value in fitted.values.items()
        },
        evaluations=problem.evaluations,
        warnings=[
            *_search_warnings(problem, searches),
            *_weak_warnings(problem, fitted, spread),
            *_noise_warnings(problem, fitted),
        ],
        declared=declared,
        correlations=spread.correlations(problem.names),
        logarithmic=tuple(
            name
            for name, scale in zip(problem.names, problem.scales, strict=True)
            if scale.logarithmic
        ),
        likelihood=Likelihood(cls, problem, fitted, spread),
        samples=problem.samples,
        deviance=fitted.deviance,
        searches=searches.made,
        is_interrupted=searches.is_interrupted,
        ties=ties,
    )


def held_warnings(
    fit: Fit,
    records: Sequence[FitData],
    names: Sequence[str],
    fixed: Mapping[str, float],
    assumptions: Assumptions,
) -> Iterator[str]:
    """Yield a warning if a fit depends on smooth inputs being held between samples.

    If they go in straight lines instead, their integral is half a sample earlier. A resistance in
    series with a capacitance makes up for that, so that no record can tell.

    Parameters
    ----------
    fit : Fit
        By equations.
    records, names, fixed, assumptions
        As :func:`fit_records` took them.
    """
    is_smooth = any(_is_smooth(course) for one in records for course in one.inputs.values())
    if assumptions.linear or fit.is_interrupted or not is_smooth:
        return
    assert fit.likelihood is not None
    fitted = fit.likelihood.fitted
    linear = replace(assumptions, linear=True)
    other = _problem_of(fit.likelihood.subject, records, names, fixed, linear)
    try:
        q, deviance = fit_in_noise(other, fitted.q, fitted.noise, _TO_THE_END)
    except UserError:
        return
    values = other.values(q)
    moved = [
        f"{name} {format_value(values[name], fit.declared[name])}"
        for name, (low, high) in fit.intervals.items()
        if not low <= values[name] <= high
    ]
    if moved and deviance - fitted.deviance < LEVEL:
        yield (
            "inputs are taken as constant between samples; if they are linear"
            f" ({option('interpolate', True)}) the record follows the model"
            f" {'better' if fitted.deviance - deviance > LEVEL else 'as well'} with"
            f" {', '.join(moved)}"
        )


def _is_smooth(course: Array) -> bool:
    """Return whether increments (n - 1,) of an input resemble those before, as steps do not."""
    increments = np.diff(course)
    power = float(increments @ increments)
    return power > 0.0 and float(increments[1:] @ increments[:-1]) > _RESEMBLING * power


def _problem_of(
    cls: Subject,
    records: Sequence[FitData],
    names: Sequence[str],
    fixed: Mapping[str, float],
    assumptions: Assumptions,
) -> Problem:
    """Return the problem of one record or of several."""
    if len(records) > 1:
        return JointProblem(cls, records, names, fixed, assumptions)
    if assumptions.each:
        raise UserError(f"each {', '.join(assumptions.each)}: there is only one record")
    return Problem(cls, *records[0][:3], names, fixed, assumptions=assumptions)


def _check_problem(problem: Problem) -> None:
    """Refuse too few measured values, and starting points out of range."""
    names = problem.names
    if len(names) >= problem.samples + len(problem.assumptions.priors):
        raise UserError(
            f"{len(names)} parameters cannot be fitted to {problem.samples} measured values"
        )
    for name in names:
        declared = problem.declared[name]
        if not declared.min <= problem.start[name] <= declared.max:
            start = format_value(problem.start[name], declared)
            raise UserError(
                f"the fit of {name} cannot start at {start}; allowed is {format_range(declared)}"
            )


def _coloured_covariance(problem: Problem, fitted: FitResult) -> Covariance:
    """Return the covariance of a fit, with the colour of its residual (Ljung, section 9.4)."""
    slopes = problem.evaluate(fitted.q)[1]
    weighted = []
    noise = []
    for output, model in fitted.noise.items():
        information = np.sqrt(model.information)
        weighted.append(information * (slopes[output] / model.deviation))
        score = fitted.weights[output] * fitted.innovation[output] / information
        is_given = output in problem.given
        noise.append(Autoregression(np.empty(0), 1.0) if is_given else fit_autoregression(score))
    return sandwich_covariance(fitted.covariance, weighted, noise)


def _search_warnings(problem: Problem, searches: Searches) -> Iterator[str]:
    """Yield warnings of other minima, of a search without an end or a way, and of ranges."""
    fitted = searches.best
    if searches.gain > 0.0:
        yield (
            "the error has several minima: from the start the search ends at one whose deviance is"
            f" {searches.gain:.3g} higher; these values are the best of {searches.made} searches"
        )
    if searches.is_interrupted:
        yield "interrupted: the values are the best so far"
    elif not fitted.converged:
        yield "the search stopped before it converged; the values are the best found"
    if np.array_equal(fitted.q, problem.position(problem.start)):
        yield "the search has not left its start: no other value nearby fits better"
    low, high = problem.bounds()
    for i in np.flatnonzero((fitted.q <= low) | (fitted.q >= high)):
        yield f"{problem.names[i]} ended at the limit of its range"


def _weak_warnings(problem: Problem, fitted: FitResult, spread: Covariance) -> Iterator[str]:
    """Yield a warning for each kind of parameters that the record determines badly."""
    silent = np.diag(fitted.information) == 0.0
    open_ended = spread.unidentifiable
    logarithmic = np.array([scale.logarithmic for scale in problem.scales])
    wide = logarithmic & (spread.standard_errors > _VAGUE) & ~open_ended
    for weak, text in (
        (silent, "this record does not determine {}"),
        (open_ended & ~silent, "this record does not determine {} separately"),
        (wide, "this record hardly determines {}: the interval spans more than a factor of 100"),
    ):
        if weak.any():
            yield text.format(", ".join(problem.names[i] for i in np.flatnonzero(weak)))


def _noise_warnings(problem: Problem, fitted: FitResult) -> Iterator[str]:
    """Yield warnings of residuals too slow for their colour to be known, or larger than the noise.

    Residuals of the size of rounding errors are left out.
    """
    for output, y in problem.measured.items():
        residual = fitted.residual[output]
        spread = np.std(y[problem.present[output]])
        if _effective_samples(residual) < _FEW and np.std(residual) > 1e-6 * spread:
            yield f"the residual of {output} varies slowly: the intervals are too narrow"
        ratio = rms(fitted.innovation[output])
        known = output in problem.assumptions.noise
        if known and ratio > 1.0 + _CLEARLY / np.sqrt(2.0 * len(residual)):
            yield (
                f"the residual of {output} is {ratio:.2g} times the noise that was given: the"
                " intervals are too narrow"
            )


def _effective_samples(residual: Array) -> float:
    """Return the number of independent values with the information of a series about its mean.

    It is ``n (1 - r) / (1 + r)`` with the autocorrelation r at lag one.
    """
    power = float(residual @ residual)
    lag_one = float(residual[:-1] @ residual[1:]) / power if power > 0.0 else 0.0
    return len(residual) * (1.0 - lag_one) / (1.0 + lag_one)
