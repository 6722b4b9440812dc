"""How far every measured output of a member is off, and what its residual holds that noise does not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.residuals.correlation import CrossCorrelation, cross_correlations
from orchestration.discrepancy.residuals.innovations import innovations_of
from orchestration.discrepancy.residuals.operating_regions import OperatingRegion, operating_regions
from orchestration.discrepancy.residuals.random_walk import RandomWalkTest, random_walk_test
from orchestration.discrepancy.residuals.regression import ResidualRegression, regress
from orchestration.discrepancy.residuals.regressors import RegressorKind, regressors
from orchestration.discrepancy.systems.member import MemberSimulation
from orchestration.identify.metrics import WHITENESS_SAMPLES, Whiteness, fit_percent, rms, whiteness
from orchestration.identify.noise.model import estimate, noise_std
from orchestration.system.check import interface

Array = NDArray[np.float64]
_NOT_ASSESSABLE = (
    0.5  # of the variation of an output: if that much is uncertain, nothing can be said of it
)
_MATTERS = 0.5  # noise widths that a fault must leave
# by which the input uncertainty, which is no more than an estimate, must be exceeded: to look, to blame
SUSPECT_FACTOR, WRONG_FACTOR = 0.5, 2.0
_UNMOVED = 1.5  # noise widths below which an output has not moved


@dataclass(frozen=True)
class OutputAssessment:
    """One output of one member, measured and simulated; a residual is measured minus simulated.

    Attributes
    ----------
    measured, simulated : ndarray, shape (n,)
        In the FMU's unit.
    unit : str
    fit_percent, rms : float
    noise_std : float
        Of the measurement, as the record itself tells: standard deviation of what changes from sample to sample.
    input_uncertainty : float
        What noise of the inputs, and their course between samples, can do to the output: rms.
    whiteness : Whiteness or None
        None if there are too few samples to test.
    regression : ResidualRegression
        Of the residual, by the member's inputs and outputs.
    random_walk : RandomWalkTest
    correlations : list of CrossCorrelation
        The strongest first.
    regions : list of OperatingRegion
        The most telling first.
    """

    measured: Array
    simulated: Array
    unit: str
    fit_percent: float
    rms: float
    noise_std: float
    input_uncertainty: float
    whiteness: Whiteness | None
    regression: ResidualRegression
    random_walk: RandomWalkTest
    correlations: list[CrossCorrelation]
    regions: list[OperatingRegion]

    @property
    def noise_ratio(self) -> float:
        """RMS of the residual in noise widths."""
        return self.rms / max(self.noise_std, 1e-300)

    @property
    def not_assessable(self) -> bool:
        """Whether the simulation runs away from whatever was measured, so that it says nothing."""
        return self.input_uncertainty > _NOT_ASSESSABLE * float(np.nanstd(self.measured))

    @property
    def unmoved(self) -> bool:
        """Whether it hardly moves in the record, which says little of it then."""
        return bool(np.nanstd(self.measured) < _UNMOVED * self.noise_std)

    @property
    def needs_fit(self) -> bool:
        """Whether so much is explained or wanders that the parameters should be looked at."""
        return self._exceeds(SUSPECT_FACTOR)

    @property
    def wrong(self) -> bool:
        """Whether more is explained or wanders than noise and uncertain inputs can account for."""
        return self._exceeds(WRONG_FACTOR)

    @property
    def most_telling(self) -> CrossCorrelation | OperatingRegion | None:
        """What says most of where the residual is from."""
        items: list[CrossCorrelation | OperatingRegion] = [*self.correlations, *self.regions]
        return next((item for item in items if item.significant), None)

    def _exceeds(self, factor: float) -> bool:
        matters = np.hypot(_MATTERS * self.noise_std, factor * self.input_uncertainty)
        explained = any(
            test.significant and test.rms > matters for test in (self.regression, self.random_walk)
        )
        # a residual that is large and no mere noise, though no regression follows it
        structured = self.most_telling is not None
        large = self.rms > (1.0 + factor / WRONG_FACTOR) * np.hypot(
            self.noise_std, self.input_uncertainty
        )
        return not self.not_assessable and bool(explained or (structured and large))


def assess_outputs(
    simulation: MemberSimulation, values: Mapping[str, float]
) -> dict[str, OutputAssessment]:
    """Simulate a member and assess every output that was measured.

    Parameters
    ----------
    simulation : MemberSimulation
    values : Mapping of str to float
        Parameters, besides those of the system.

    Returns
    -------
    dict of str to OutputAssessment

    Raises
    ------
    BudgetExceeded
        If there are no more simulations to make.
    UserError
        If the FMU fails.
    """
    simulated = simulation.simulate(values)
    uncertainty = simulation.input_uncertainty(simulated, values)
    isolated = simulation.isolated
    inputs = {
        n: source.values for n, source in isolated.inputs.items() if source.values is not None
    }
    model = interface(isolated.member)
    units = {n: s.unit for n, s in (*model.inputs.items(), *model.outputs.items())}
    signals = regressors(simulation.time, inputs, simulated, simulated, units)
    plain = [
        s for s in signals if s.kind is not RegressorKind.SQUARE
    ]  # a regression takes powers itself
    step = float(np.median(np.diff(simulation.time)))
    assessments = {}
    for output, y in isolated.outputs.items():
        present = np.isfinite(y)
        residual = (y - simulated[output])[present]
        noise = estimate(residual, present)
        innovations = innovations_of(residual, present, noise, simulated[output])
        correlations, feedback = cross_correlations(
            output, innovations, noise, signals, step, list(inputs)
        )
        assessments[output] = OutputAssessment(
            y,
            simulated[output],
            units[output],
            fit_percent(y, simulated[output]),
            rms(residual),
            noise_std(residual),
            uncertainty[output],
            whiteness(residual) if residual.size >= WHITENESS_SAMPLES else None,
            regress(residual, present, plain),
            random_walk_test(residual),
            correlations,
            operating_regions(output, residual, present, signals, bool(feedback)),
        )
    return assessments
