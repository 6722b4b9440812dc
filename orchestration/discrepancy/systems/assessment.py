"""Assessment of the measured outputs of a member: size of the residuals, and their structure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fmus.kit.arrays import Array
from orchestration.discrepancy.residuals import (
    CrossCorrelation,
    OperatingRegion,
    SignalTests,
    analyse_outputs,
)
from orchestration.discrepancy.systems.cut import IsolatedMember
from orchestration.discrepancy.systems.member import MemberSimulation
from orchestration.identify import fit_percent, rms
from orchestration.identify.noise import WHITENESS_SAMPLES, Whiteness, noise_std, whiteness
from orchestration.system import interface

# of the variation of an output: if that much is uncertain, nothing can be said of it
_NOT_ASSESSABLE = 0.5
_MATTERS = 0.5  # noise widths that a fault must leave
# by which the input uncertainty, which is no more than an estimate, must be exceeded: to look, to
# say that a parameter differs, to blame the structure
SUSPECT_FACTOR = 0.5
DOUBT_FACTOR = 1.0
WRONG_FACTOR = 2.0
_UNMOVED = 1.5  # noise widths below which an output has not moved


@dataclass(frozen=True)
class OutputAssessment(SignalTests):
    """One output of one member, measured and simulated; a residual is measured minus simulated.

    The residual is tested against the inputs and outputs of the member.

    Attributes
    ----------
    measured, simulated : ndarray, shape (n,)
        In the FMU's unit.
    unit : str
    fit_percent, rms : float
    noise_std : float
        Of the measurement, estimated from the record itself: standard deviation of what changes
        from sample to sample.
    input_uncertainty : float
        RMS of the change of the output that noise of the inputs, and their unknown course between
        samples, can make.
    whiteness : Whiteness or None
        None if there are too few samples to test.
    """

    measured: Array
    simulated: Array
    unit: str
    fit_percent: float
    rms: float
    noise_std: float
    input_uncertainty: float
    whiteness: Whiteness | None

    @property
    def noise_ratio(self) -> float:
        """RMS of the residual in noise widths."""
        return self.rms / max(self.noise_std, 1e-300)

    @property
    def not_assessable(self) -> bool:
        """True if the simulation runs away from whatever was measured, so that it says nothing."""
        return self.input_uncertainty > _NOT_ASSESSABLE * float(np.nanstd(self.measured))

    @property
    def unmoved(self) -> bool:
        """True if it hardly moves in the record, which says little of it then."""
        return bool(np.nanstd(self.measured) < _UNMOVED * self.noise_std)

    @property
    def needs_fit(self) -> bool:
        """True if so much is explained or wanders that the parameters should be looked at."""
        return self._exceeds(SUSPECT_FACTOR)

    @property
    def beyond_doubt(self) -> bool:
        """True if more is explained or wanders than lies within the input uncertainty."""
        return self._exceeds(DOUBT_FACTOR)

    @property
    def wrong(self) -> bool:
        """True if more is explained or wanders than noise and uncertain inputs can account for."""
        return self._exceeds(WRONG_FACTOR)

    @property
    def most_telling(self) -> CrossCorrelation | OperatingRegion | None:
        """The first significant correlation or else operating region, if there is one."""
        items: list[CrossCorrelation | OperatingRegion] = [*self.correlations, *self.regions]
        return next((item for item in items if item.significant), None)

    def _exceeds(self, factor: float) -> bool:
        """Return True if the residual is beyond noise and so many times the input uncertainty."""
        if self.not_assessable:
            return False
        least = np.hypot(_MATTERS * self.noise_std, factor * self.input_uncertainty)
        if any(
            test.significant and test.rms > least for test in (self.regression, self.random_walk)
        ):
            return True
        # a residual that is large and no mere noise, though no regression follows it
        usual = np.hypot(self.noise_std, self.input_uncertainty)
        large = bool(self.rms > (1.0 + factor / WRONG_FACTOR) * usual)
        return large and self.most_telling is not None


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
    return assessed(simulation.isolated, simulation.time, simulated, uncertainty)


def assessed(
    isolated: IsolatedMember,
    time: Array,
    simulated: Mapping[str, Array],
    uncertainty: Mapping[str, float],
) -> dict[str, OutputAssessment]:
    """Assess every output of a member that was measured.

    Parameters
    ----------
    isolated : IsolatedMember
    time : ndarray, shape (n,)
        Seconds.
    simulated : Mapping of str to ndarray, shape (n,)
        Outputs, also such as were not measured.
    uncertainty : Mapping of str to float
        RMS of what its inputs leave unknown of every measured output.

    Returns
    -------
    dict of str to OutputAssessment
    """
    inputs = {
        n: source.values for n, source in isolated.inputs.items() if source.values is not None
    }
    model = interface(isolated.member)
    units = {n: s.unit for n, s in (*model.inputs.items(), *model.outputs.items())}
    tests = analyse_outputs(time, inputs, simulated, isolated.outputs, units)
    assessments = {}
    for output, y in isolated.outputs.items():
        residual = (y - simulated[output])[np.isfinite(y)]
        assessments[output] = OutputAssessment(
            tests[output].regression,
            tests[output].random_walk,
            tests[output].correlations,
            tests[output].regions,
            measured=y,
            simulated=simulated[output],
            unit=units[output],
            fit_percent=fit_percent(y, simulated[output]),
            rms=rms(residual),
            noise_std=noise_std(residual),
            input_uncertainty=uncertainty[output],
            whiteness=whiteness(residual) if residual.size >= WHITENESS_SAMPLES else None,
        )
    return assessments
