"""What the residual of a fitted model holds that noise does not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.resolution import resolution_of
from orchestration.discrepancy.residuals.conditional_mean import ConditionalMean, conditional_means
from orchestration.discrepancy.residuals.correlation import (
    CrossCorrelation,
    Feedback,
    cross_correlations,
)
from orchestration.discrepancy.residuals.excess_variance import (
    ExcessVariance,
    excess_variance_at_input_steps,
)
from orchestration.discrepancy.residuals.innovations import innovations_of, local_level
from orchestration.discrepancy.residuals.jumps import LevelShift, level_shifts
from orchestration.discrepancy.residuals.lines import SpectralLine, spectral_lines
from orchestration.discrepancy.residuals.operating_regions import OperatingRegion, operating_regions
from orchestration.discrepancy.residuals.outliers import outlying, without
from orchestration.discrepancy.residuals.quantisation import systematic_error
from orchestration.discrepancy.residuals.random_walk import RandomWalkTest, random_walk_test
from orchestration.discrepancy.residuals.regressors import Regressor, regressors_of
from orchestration.identify.metrics import Whiteness, whiteness
from orchestration.identify.noise.autoregression import ORDER, segments
from orchestration.identify.noise.model import Noise, estimate

Array = NDArray[np.float64]
ALPHA = 1e-4  # probability of what counts as structure of a residual
Structure = RandomWalkTest | ExcessVariance | ConditionalMean | CrossCorrelation


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
        Whether samples are equally spaced; else only operating regions and means in them can be told.
    means : list of ConditionalMean
        The most telling first.
    feedback : list of Feedback
        Inputs that follow what was measured, the strongest first.
    samples, outliers : int
        Samples that were judged, and how many of them lie far from all others.
    rounding : float
        Largest mean error that the steps of a converter can leave, in the unit of the output: less is no structure.
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
        """What cannot be noise, beside lines and level shifts, the most telling first."""
        means = [m for m in self.means if m.significant and abs(m.mean) > self.rounding]
        if not self.even:
            return [*means]
        walk = (
            [self.random_walk]
            if self.random_walk.significant and self.random_walk.rms > self.rounding
            else []
        )
        steps = [self.input_steps] if self.input_steps.significant else []
        return [*walk, *steps, *means, *(c for c in self.correlations if c.p_value < ALPHA)]


def analyse_residuals(model: FittedCandidate, data: Dataset) -> dict[str, ResidualAnalysis]:
    """Analyse the residual of every output.

    Parameters
    ----------
    model : FittedCandidate
    data : Dataset
        What it was fitted to.

    Returns
    -------
    dict of str to ResidualAnalysis
        By output.
    """
    signals = regressors_of(model, data)
    return {output: _analyse(model, output, data, signals) for output in model.fit.residual}


def has_structure(model: FittedCandidate, data: Dataset) -> bool:
    """Whether a model leaves in some output what noise does not; parameters are those of :func:`analyse_residuals`."""
    left = analyse_residuals(model, data).values()
    return any(analysis.structure or analysis.lines or analysis.level_shifts for analysis in left)


def _analyse(
    model: FittedCandidate, output: str, data: Dataset, signals: list[Regressor]
) -> ResidualAnalysis:
    residual, noise, even = model.fit.residual[output], model.fit.noise[output], model.problem.even
    return analyse(output, residual, noise, data, signals, even)


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
        What the residual may depend on.
    even : bool
        Whether samples are equally spaced.

    Returns
    -------
    ResidualAnalysis
    """
    measured = data.measured[output]
    present = np.isfinite(measured)
    simulated = np.zeros(measured.size)
    simulated[present] = measured[present] - residual
    resolution = resolution_of(measured)
    plain = innovations_of(residual, present, noise, simulated, resolution)
    levelled = residual / local_level(
        residual, simulated[present]
    )  # colour first and level then, or the other way
    other = innovations_of(
        levelled, present, estimate(levelled, present, ORDER if even else 0), simulated
    )
    inputs = {name: values[present] for name, values in data.inputs.items()}
    far = outlying(residual, inputs, resolution) if even else np.zeros(residual.size, dtype=bool)
    if far.any():  # the colour of noise that outliers hide
        residual = without(residual, far)
        noise = estimate(residual, present)
        innovations = innovations_of(residual, present, noise, simulated, resolution)
    else:
        innovations = plain
    rounding = systematic_error(resolution, noise.deviation)
    step = float(np.median(np.diff(data.time)))
    lines: list[SpectralLine] = []
    shifts: list[LevelShift] = []
    bounded = innovations.bounded(residual, present, noise)
    if even:  # else samples say nothing of frequencies, nor of what is sudden
        a, b = max(segments(present), key=lambda ends: ends[1] - ends[0])
        lines = spectral_lines(bounded[a:b], step, measured[present][a:b], rounding)
        shifts = level_shifts(residual, data.time[present], inputs, resolution)
    correlations, feedback = cross_correlations(
        output, innovations, noise, signals, step, list(data.inputs), within=data.within
    )
    gain = float(np.sqrt(1.0 + np.sum(noise.coefficients**2))) / noise.deviation
    return ResidualAnalysis(
        lines,
        shifts,
        whiteness(plain.raw),
        excess_variance_at_input_steps(
            [plain, other], data.inputs, int(bool(feedback)), gain * resolution / np.sqrt(12.0)
        ),
        _random_walk(bounded, present, data),
        operating_regions(output, residual, present, signals, bool(feedback)),
        [c for c in correlations if abs(c.strength) * noise.deviation >= rounding],
        even,
        conditional_means(
            output, residual, innovations, noise, signals, bool(feedback), data.within
        ),
        feedback,
        innovations.at.size,
        int(far.sum()) + innovations.outliers,
        rounding,
    )


def _random_walk(residual: Array, present: NDArray[np.bool_], data: Dataset) -> RandomWalkTest:
    """Return the surest random walk in any run, by the probability of seeing it in any of them."""
    at = np.flatnonzero(present)
    tests = [random_walk_test(residual[(run.first <= at) & (at < run.last)]) for run in data.runs]
    surest = min(tests, key=lambda test: test.p_value)
    return replace(surest, p_value=min(1.0, len(tests) * surest.p_value))
