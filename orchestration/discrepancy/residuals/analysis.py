"""Analysis of the residual of a fitted model by every test for structure beyond noise."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fmus.kit.arrays import Array, Mask
from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.discrepancy.data import Dataset, resolution_of
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.residuals.correlation import (
    CrossCorrelation,
    Feedback,
    cross_correlations,
)
from orchestration.discrepancy.residuals.excess_variance import (
    ExcessVariance,
    excess_variance_at_input_steps,
)
from orchestration.discrepancy.residuals.innovations import (
    Innovations,
    local_level,
    score_innovations,
)
from orchestration.discrepancy.residuals.lines import SpectralLine, spectral_lines
from orchestration.discrepancy.residuals.operating_regions import (
    ConditionalMean,
    OperatingRegion,
    conditional_means,
    find_operating_regions,
)
from orchestration.discrepancy.residuals.outliers import (
    LevelShift,
    find_outliers,
    interpolate_over,
    level_shifts,
)
from orchestration.discrepancy.residuals.random_walk import RandomWalkTest, random_walk_test
from orchestration.discrepancy.residuals.regression import ResidualRegression, regress
from orchestration.discrepancy.residuals.regressors import (
    Regressor,
    RegressorKind,
    make_regressors,
    simulate_regressors,
)
from orchestration.identify.noise import (
    ORDER,
    Noise,
    Whiteness,
    estimate_noise,
    segments,
    whiteness,
)

ALPHA = 1e-4  # probability of what counts as structure of a residual
Structure = RandomWalkTest | ExcessVariance | ConditionalMean | CrossCorrelation
_NOTED = 1.5  # times the level elsewhere, below which noise is as good as even
_ENOUGH = 3.2  # steps of noise, with which nothing is left of the error of rounding


@dataclass(frozen=True)
class ResidualAnalysis:
    """The residual of one output, measured minus simulated.

    Attributes
    ----------
    lines : list of SpectralLine
    level_shifts : list of LevelShift
    whiteness : Whiteness
        Of the innovations.
    input_steps : ExcessVariance
    random_walk : RandomWalkTest
    regions : list of OperatingRegion
        The most telling first.
    correlations : list of CrossCorrelation
        The strongest first.
    even : bool
        Whether samples are equally spaced; else only operating regions and means in them are
        judged.
    means : list of ConditionalMean
        The most telling first.
    feedback : list of Feedback
        Inputs that follow what was measured, the strongest first.
    samples, outliers : int
        Samples that were judged, and how many of them lie far from all others.
    rounding : float
        Largest mean error that the steps of a converter can leave, in the unit of the output: less
        is no structure.
    """

    lines: list[SpectralLine]
    level_shifts: list[LevelShift]
    whiteness: Whiteness
    input_steps: ExcessVariance
    random_walk: RandomWalkTest
    regions: list[OperatingRegion]
    correlations: list[CrossCorrelation]
    even: bool = True
    means: list[ConditionalMean] = field(default_factory=list)
    feedback: list[Feedback] = field(default_factory=list)
    samples: int = 0
    outliers: int = 0
    rounding: float = 0.0

    @property
    def structure(self) -> list[Structure]:
        """Significant tests beside lines and level shifts, the most telling first."""
        tests: list[Structure] = [*self.means]
        if self.even:
            tests = [self.random_walk, self.input_steps, *self.means, *self.correlations]
        return [test for test in tests if _telling(test, self.rounding)]


def _telling(test: Structure, rounding: float) -> bool:
    """Return True if a test shows structure that rounding cannot leave."""
    if isinstance(test, CrossCorrelation):
        return test.p_value < ALPHA
    if isinstance(test, RandomWalkTest):
        return test.significant and test.rms > rounding
    if isinstance(test, ConditionalMean):
        return test.significant and abs(test.mean) > rounding
    return test.significant


def analyse_residuals(model: FittedCandidate, data: Dataset) -> dict[str, ResidualAnalysis]:
    """Analyse the residual of every output of a fitted model.

    Parameters
    ----------
    model : FittedCandidate
    data : Dataset
        The data that it was fitted to.

    Returns
    -------
    dict of str to ResidualAnalysis
        By output.
    """
    signals = simulate_regressors(model, data)
    fit = model.fit
    return {
        output: analyse(output, residual, fit.noise[output], data, signals, model.problem.even)
        for output, residual in fit.residual.items()
    }


def has_structure(model: FittedCandidate, data: Dataset) -> bool:
    """Return True if the residual of any output has structure, a line or a level shift.

    Parameters
    ----------
    model, data
        As in :func:`analyse_residuals`.
    """
    signals = simulate_regressors(model, data)
    noise = model.fit.noise
    return _any_structure(
        [
            _Tests(output, residual, noise[output], data, signals, model.problem.even)
            for output, residual in model.fit.residual.items()
        ]
    )


def analyse(
    output: str,
    residual: Array,
    noise: Noise,
    data: Dataset,
    signals: Sequence[Regressor],
    even: bool = True,
) -> ResidualAnalysis:
    """Analyse the residual of one output.

    Parameters
    ----------
    output : str
    residual : ndarray, shape (m,)
        Measured minus simulated, where it was measured.
    noise : Noise
        Of the residual.
    data : Dataset
        The record.
    signals : sequence of Regressor
        Signals that the residual may depend on.
    even : bool
        Whether samples are equally spaced.

    Returns
    -------
    ResidualAnalysis
    """
    tests = _Tests(output, residual, noise, data, signals, even)
    return ResidualAnalysis(
        lines=tests.lines,
        level_shifts=tests.level_shifts,
        whiteness=whiteness(tests.whole.innovations.raw),
        input_steps=tests.input_steps([tests.whole.innovations, tests.levelled_innovations]),
        random_walk=tests.random_walk,
        regions=find_operating_regions(
            output, tests.cleaned.values, tests.cleaned.present, signals, bool(tests.feedback)
        ),
        correlations=tests.correlations,
        even=even,
        means=tests.means,
        feedback=tests.feedback,
        samples=tests.cleaned.innovations.at.size,
        outliers=int(tests.outliers.sum()) + tests.cleaned.innovations.outliers,
        rounding=tests.cleaned.rounding,
    )


class _Tests:
    """Tests of the residual of one output, as :func:`analyse` takes it, made as they are wanted."""

    def __init__(
        self,
        output: str,
        residual: Array,
        noise: Noise,
        data: Dataset,
        signals: Sequence[Regressor],
        even: bool,
    ):
        self.even = even
        self._output = output
        self._data = data
        self._signals = signals
        self._step = float(np.median(np.diff(data.time)))
        self.whole = _residual_of(data.measured[output], residual, noise)
        self._inputs = {name: values[self.whole.present] for name, values in data.inputs.items()}
        self.outliers = np.zeros(residual.size, dtype=bool)
        self.cleaned = self.whole
        if even:
            self.outliers = find_outliers(residual, self._inputs, self.whole.resolution)
        if self.outliers.any():  # they hide the colour of the noise
            self.cleaned = _interpolated(self.whole, self.outliers)

    @property
    def lines(self) -> list[SpectralLine]:
        """None if samples are uneven: they say nothing of frequencies."""
        if not self.even:
            return []
        return _lines(self.cleaned, self._data.measured[self._output], self._step)

    @property
    def level_shifts(self) -> list[LevelShift]:
        """None if samples are uneven: they say nothing of what is sudden."""
        if not self.even:
            return []
        time = self._data.time[self.cleaned.present]
        return level_shifts(self.cleaned.values, time, self._inputs, self.cleaned.resolution)

    @property
    def random_walk(self) -> RandomWalkTest:
        return _random_walk(self.cleaned, self._data)

    @cached_property
    def _correlated(self) -> tuple[list[CrossCorrelation], list[Feedback]]:
        return cross_correlations(
            self._output,
            self.cleaned.innovations,
            self.cleaned.noise,
            self._signals,
            self._step,
            inputs=list(self._data.inputs),
            within=self._data.within,
        )

    @property
    def correlations(self) -> list[CrossCorrelation]:
        """Those that are more than rounding leaves."""
        deviation = self.cleaned.noise.deviation
        least = self.cleaned.rounding
        return [c for c in self._correlated[0] if abs(c.strength) * deviation >= least]

    @property
    def feedback(self) -> list[Feedback]:
        return self._correlated[1]

    @property
    def means(self) -> list[ConditionalMean]:
        return conditional_means(
            self._output,
            self.cleaned.values,
            self.cleaned.innovations,
            self.cleaned.noise,
            self._signals,
            feedback=bool(self.feedback),
            within=self._data.within,
        )

    @property
    def levelled_innovations(self) -> Innovations:
        return _levelled_innovations(self.whole, self.even)

    def input_steps(self, innovations: Sequence[Innovations]) -> ExcessVariance:
        """Test the residual where inputs step, whitened in several ways."""
        return excess_variance_at_input_steps(
            innovations,
            self._data.inputs,
            late=int(bool(self.feedback)),
            rounding=self.cleaned.whitened_rounding,
        )


def _any_structure(outputs: Sequence[_Tests]) -> bool:
    """Return True if there is any structure; what takes longest is looked at last."""
    even = [tests for tests in outputs if tests.even]
    return (
        any(tests.level_shifts for tests in even)
        or any(_telling(tests.random_walk, tests.cleaned.rounding) for tests in even)
        or any(tests.lines for tests in even)
        or any(_telling(c, 0.0) for tests in even for c in tests.correlations)
        or any(_telling(m, tests.cleaned.rounding) for tests in outputs for m in tests.means)
        or any(_steps_show(tests) for tests in even)
    )


def _steps_show(tests: _Tests) -> bool:
    """Return True if innovations are larger where an input steps, whichever way they are made."""
    ways = [tests.whole.innovations]
    if not tests.input_steps(ways).significant:
        return False
    return tests.input_steps([*ways, tests.levelled_innovations]).significant


@dataclass(frozen=True)
class _Residual:
    """The residual of one output, with all that its tests need to know of it.

    Attributes
    ----------
    values : ndarray, shape (m,)
    present : ndarray of bool, shape (n,)
        Where there is one.
    noise : Noise
        Of the residual.
    simulated : ndarray, shape (n,)
        The output; zero where there is no residual.
    resolution : float
        Of the measurement.
    """

    values: Array
    present: Mask
    noise: Noise
    simulated: Array
    resolution: float

    @cached_property
    def innovations(self) -> Innovations:
        """Scored innovations."""
        return score_innovations(
            self.values, self.present, self.noise, self.simulated, self.resolution
        )

    @cached_property
    def bounded(self) -> Array:
        """The residual (m,) as it would be if no single innovation were far out."""
        return self.innovations.bounded(self.values, self.present, self.noise)

    @property
    def rounding(self) -> float:
        """Largest mean error that the steps of a converter can leave."""
        return rounding_error(self.resolution, self.noise.deviation)

    @property
    def whitened_rounding(self) -> float:
        """Standard deviation of independent errors of rounding, over that of the innovations."""
        gain = float(np.sqrt(1.0 + np.sum(self.noise.coefficients**2))) / self.noise.deviation
        return gain * self.resolution / np.sqrt(12.0)


def _residual_of(measured: Array, residual: Array, noise: Noise) -> _Residual:
    present = np.isfinite(measured)
    simulated = np.zeros(measured.size)
    simulated[present] = measured[present] - residual
    return _Residual(residual, present, noise, simulated, resolution_of(measured))


def _interpolated(whole: _Residual, outliers: Mask) -> _Residual:
    """Interpolate a residual over its outliers, and estimate its noise anew."""
    values = interpolate_over(whole.values, outliers)
    return replace(whole, values=values, noise=estimate_noise(values, whole.present))


def _levelled_innovations(whole: _Residual, even: bool) -> Innovations:
    """Divide a residual by its local level before it is whitened, not after."""
    levelled = whole.values / local_level(whole.values, whole.simulated[whole.present])
    noise = estimate_noise(levelled, whole.present, ORDER if even else 0)
    return score_innovations(levelled, whole.present, noise, whole.simulated)


def _lines(residual: _Residual, measured: Array, step: float) -> list[SpectralLine]:
    """Find spectral lines in the longest part of a residual without a gap."""
    first, last = max(segments(residual.present), key=lambda ends: ends[1] - ends[0])
    output = measured[residual.present][first:last]
    return spectral_lines(residual.bounded[first:last], step, output, residual.rounding)


def _random_walk(residual: _Residual, data: Dataset) -> RandomWalkTest:
    """Return the most significant random walk test of any run, its p-value Bonferroni's."""
    at = np.flatnonzero(residual.present)
    tests = [
        random_walk_test(residual.bounded[(run.first <= at) & (at < run.last)]) for run in data.runs
    ]
    best = min(tests, key=lambda test: test.p_value)
    return replace(best, p_value=min(1.0, len(tests) * best.p_value))


def rounding_error(step: float, deviation: float) -> float:
    """Return the largest mean error that rounding leaves where a signal passes again and again.

    Noise of the deviation s before the converter leaves ``step / pi * exp(-2 (pi s / step)^2)`` of
    it and less (Widrow and Kollár: Quantization Noise, 2008, chapter 4); without any it is half a
    step. Both are bounded by half a step times that exponential, which from half a step of noise on
    is next to nothing.

    Parameters
    ----------
    step : float
        Of the converter; 0 if there is none.
    deviation : float
        Standard deviation of the innovations after the converter, in the same unit. Rounding is in
        it.

    Returns
    -------
    float
        In the same unit.
    """
    if not step > 0.0:
        return 0.0
    steps = min(deviation, _ENOUGH * step) / step  # the square of more may be no number
    before = max(steps**2 - 1.0 / 12.0, 0.0)
    return 0.5 * step * float(np.exp(-2.0 * np.pi**2 * before))


@dataclass(frozen=True)
class SignalTests:
    """Tests of the residual of one output against the signals of a model, whatever its equations.

    Attributes
    ----------
    regression : ResidualRegression
        On inputs and outputs, their rates and integrals.
    random_walk : RandomWalkTest
    correlations : list of CrossCorrelation
        The strongest first.
    regions : list of OperatingRegion
        The most telling first.
    """

    regression: ResidualRegression
    random_walk: RandomWalkTest
    correlations: list[CrossCorrelation]
    regions: list[OperatingRegion]


def analyse_outputs(
    time: Array,
    inputs: Mapping[str, Array],
    simulated: Mapping[str, Array],
    measured: Mapping[str, Array],
    units: Mapping[str, str],
) -> dict[str, SignalTests]:
    """Test the residuals of a simulation of which inputs and outputs are all that is known.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds, equally spaced.
    inputs, simulated, measured : Mapping of str to ndarray, shape (n,)
        NaN in a measured output is a gap. Outputs may be simulated that were not measured.
    units : Mapping of str to str
        Of inputs and outputs.

    Returns
    -------
    dict of str to SignalTests
        By measured output.
    """
    # the states are not known: outputs stand in for them
    signals = make_regressors(time, inputs, states=simulated, outputs=simulated, units=units)
    without_squares = [s for s in signals if s.kind is not RegressorKind.SQUARE]
    step = float(np.median(np.diff(time)))
    tests = {}
    for output, y in measured.items():
        present = np.isfinite(y)
        residual = (y - simulated[output])[present]
        noise = estimate_noise(residual, present)
        innovations = score_innovations(residual, present, noise, simulated[output])
        correlations, feedback = cross_correlations(
            output, innovations, noise, signals, step, inputs=list(inputs)
        )
        tests[output] = SignalTests(
            regress(residual, present, without_squares),  # it makes the powers itself
            random_walk_test(residual),
            correlations,
            find_operating_regions(output, residual, present, signals, bool(feedback)),
        )
    return tests


def residual_notes(residuals: Mapping[str, ResidualAnalysis]) -> Iterator[Note]:
    """Yield notes on what is no fault of a model: outliers, varying noise and feedback.

    Parameters
    ----------
    residuals : Mapping of str to ResidualAnalysis
        By output.

    Yields
    ------
    Note
    """
    for output, analysis in residuals.items():
        if analysis.outliers:
            counted = {"count": analysis.outliers, "share": analysis.outliers / analysis.samples}
            yield Note(NoteCode.OUTLYING_RESIDUALS, output, counted)
        varying = [r for r in analysis.regions if r.p_value < ALPHA and r.rms_ratio > _NOTED]
        if varying and not analysis.structure and max(r.rms for r in varying) > analysis.rounding:
            worst = max(varying, key=lambda region: region.rms_ratio)
            ratio = {"ratio": worst.rms_ratio, "signal": worst.signal}
            yield Note(NoteCode.VARYING_NOISE, output, ratio)
        surest = next((f for f in analysis.feedback if f.p_value < ALPHA), None)
        if surest is not None:
            facts = {"input": surest.input, "strength": surest.strength, "lag": surest.lag}
            yield Note(NoteCode.FEEDBACK, output, facts)
