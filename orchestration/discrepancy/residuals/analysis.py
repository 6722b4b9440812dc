"""Analysis of the residual of a fitted model by every test for structure beyond noise."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fmus.kit.arrays import Array
from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.discrepancy.data import Dataset
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.residuals.correlation import (
    CrossCorrelation,
    Feedback,
    cross_correlations,
)
from orchestration.discrepancy.residuals.innovations import score_innovations
from orchestration.discrepancy.residuals.lines import SpectralLine
from orchestration.discrepancy.residuals.operating_regions import (
    OperatingRegion,
    find_operating_regions,
)
from orchestration.discrepancy.residuals.outliers import LevelShift
from orchestration.discrepancy.residuals.output_residual import OutputResidual
from orchestration.discrepancy.residuals.random_walk import RandomWalkTest, random_walk_test
from orchestration.discrepancy.residuals.regression import ResidualRegression, regress
from orchestration.discrepancy.residuals.regressors import (
    Regressor,
    RegressorKind,
    make_regressors,
    simulate_regressors,
)
from orchestration.discrepancy.residuals.residual_test import ALPHA, ResidualTest, residual_tests
from orchestration.identify.noise import Noise, Whiteness, estimate_noise, whiteness

_NOTED = 1.5  # times the level elsewhere, below which noise is as good as even


@dataclass(frozen=True)
class ResidualAnalysis:
    """The residual of one output, measured minus simulated.

    Attributes
    ----------
    lines : list of SpectralLine
    level_shifts : list of LevelShift
    whiteness : Whiteness
        Of the innovations.
    tests : list of ResidualTest
        Results of all tests, the most telling test first.
    regions : list of OperatingRegion
        The most telling first.
    even : bool
        Whether samples are equally spaced; else only operating regions and tests that need no even
        samples are judged.
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
    tests: list[ResidualTest]
    regions: list[OperatingRegion]
    even: bool = True
    feedback: list[Feedback] = field(default_factory=list)
    samples: int = 0
    outliers: int = 0
    rounding: float = 0.0

    @property
    def structure(self) -> list[ResidualTest]:
        """Significant tests beside lines and level shifts, the most telling first."""
        judged = [test for test in self.tests if self.even or not test.needs_even_samples]
        return [test for test in judged if test.is_structure(self.rounding)]


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
    even = model.problem.even
    residuals = [
        OutputResidual(output, residual, noise[output], data, signals, even)
        for output, residual in model.fit.residual.items()
    ]
    judged = [test for test in residual_tests() if even or not test.needs_even_samples]
    return (
        any(residual.level_shifts for residual in residuals)
        or any(residual.lines for residual in residuals)
        or any(test.finds_structure(residual) for test in judged for residual in residuals)
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
    found = OutputResidual(output, residual, noise, data, signals, even)
    cleaned = found.cleaned
    return ResidualAnalysis(
        lines=found.lines,
        level_shifts=found.level_shifts,
        whiteness=whiteness(found.whole.innovations.raw),
        tests=[result for test in residual_tests() for result in test.of(found)],
        regions=find_operating_regions(
            output, cleaned.values, cleaned.present, signals, bool(found.feedback)
        ),
        even=even,
        feedback=found.feedback,
        samples=cleaned.innovations.at.size,
        outliers=int(found.outliers.sum()) + cleaned.innovations.outliers,
        rounding=cleaned.rounding,
    )


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
