"""What the residual of a fitted model holds that noise does not."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.residuals.correlation import CrossCorrelation, cross_correlations
from orchestration.discrepancy.residuals.jumps import (
    ExcessVariance,
    LevelShift,
    excess_variance_at_input_steps,
    level_shifts,
)
from orchestration.discrepancy.residuals.lines import SpectralLine, spectral_lines
from orchestration.discrepancy.residuals.operating_regions import OperatingRegion, operating_regions
from orchestration.discrepancy.residuals.random_walk import RandomWalkTest, random_walk_test
from orchestration.discrepancy.residuals.regressors import Regressor, regressors_of
from orchestration.identify.metrics import Whiteness, whiteness
from orchestration.identify.noise import segments

Array = NDArray[np.float64]
ALPHA = 1e-4  # probability of what counts as structure of a residual
Structure = RandomWalkTest | ExcessVariance | OperatingRegion | CrossCorrelation


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
        Whether samples are equally spaced; else only operating regions can be told.
    """

    lines: list[SpectralLine]
    level_shifts: list[LevelShift]
    whiteness: Whiteness
    input_steps: ExcessVariance
    random_walk: RandomWalkTest
    regions: list[OperatingRegion]
    correlations: list[CrossCorrelation]
    even: bool = True

    @property
    def structure(self) -> list[Structure]:
        """What cannot be noise, beside lines and level shifts, the most telling first."""
        regions = [region for region in self.regions if region.p_value < ALPHA]
        if not self.even:
            return [*regions]
        walk = [self.random_walk] if self.random_walk.significant else []
        steps = [self.input_steps] if self.input_steps.p_value < ALPHA else []
        return [*walk, *steps, *regions, *(c for c in self.correlations if c.p_value < ALPHA)]


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


def _analyse(model: FittedCandidate, output: str, data: Dataset, signals: list[Regressor]) -> ResidualAnalysis:
    residual, innovation, noise = model.fit.residual[output], model.fit.innovation[output], model.fit.noise[output]
    present, even = model.problem.present[output], model.problem.even
    step = float(np.median(np.diff(data.time)))
    lines: list[SpectralLine] = []
    shifts: list[LevelShift] = []
    if even:  # else samples say nothing of frequencies, nor of what is sudden
        a, b = max(segments(present), key=lambda ends: ends[1] - ends[0])
        lines = spectral_lines(residual[a:b], step, data.measured[output][present][a:b])
        inputs = {name: values[present] for name, values in data.inputs.items()}
        shifts = level_shifts(residual, data.time[present], inputs)
    return ResidualAnalysis(
        lines,
        shifts,
        whiteness(innovation),
        excess_variance_at_input_steps(innovation, np.flatnonzero(present), data.inputs),
        _random_walk(residual, present, data),
        operating_regions(output, residual, present, signals),
        cross_correlations(output, residual, present, noise, signals, step, within=data.within),
        even,
    )


def _random_walk(residual: Array, present: NDArray[np.bool_], data: Dataset) -> RandomWalkTest:
    """Return the surest random walk in any run, by the probability of seeing it in any of them."""
    at = np.flatnonzero(present)
    tests = [random_walk_test(residual[(run.first <= at) & (at < run.last)]) for run in data.runs]
    surest = min(tests, key=lambda test: test.p_value)
    return replace(surest, p_value=min(1.0, len(tests) * surest.p_value))
