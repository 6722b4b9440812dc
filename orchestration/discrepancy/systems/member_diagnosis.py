"""The diagnosis of one member: simulated as it is, adjusted if its residuals ask for it, and judged by what remains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from orchestration.discrepancy.systems.adjust import AdjustmentResult, adjust
from orchestration.discrepancy.systems.assessment import assess_outputs
from orchestration.discrepancy.systems.cut import IsolatedMember
from orchestration.discrepancy.systems.interpolation import choose_interpolation
from orchestration.discrepancy.systems.member import MemberSimulation
from orchestration.discrepancy.systems.reason import Reason
from orchestration.discrepancy.systems.verdict import (
    AdjustedParameter,
    MemberDiagnosis,
    MemberVerdict,
    verdict_of,
)
from orchestration.fmu.archive import read_description
from orchestration.identify.estimate import significantly_different
from orchestration.system.check import interface

_LAST_ASSESSMENT = 8  # simulations, whatever the search has used


@dataclass(frozen=True)
class Effort:
    """How much work is done.

    Attributes
    ----------
    simulations : int
        Of each member, at most.
    parameters : int
        That are adjusted in each, at most.
    """

    simulations: int = 200
    parameters: int = 6


def diagnose_member(
    simulation: MemberSimulation,
    effort: Effort,
    defer_fit: bool = False,
    revisit_interpolation: bool = True,
) -> MemberDiagnosis:
    """Judge a member.

    Parameters
    ----------
    simulation : MemberSimulation
    effort : Effort
    defer_fit : bool
        Whether parameters stay as they are where an output cannot be assessed: a simulation in its loop will tell more.
    revisit_interpolation : bool
        Whether what inputs do between samples is looked at again with the parameters free.

    Returns
    -------
    MemberDiagnosis

    Raises
    ------
    BudgetExceeded
        If the simulations are too few even for a look at the member as it is.
    UserError
        If the FMU fails.
    """
    choose_interpolation(simulation, {})
    before = assess_outputs(simulation, {})
    deferred = defer_fit and any(a.not_assessable for a in before.values())
    adjusted, after = None, {}
    if any(a.needs_fit for a in before.values()) and not deferred:
        simulated = {output: a.simulated for output, a in before.items()}
        adjusted = adjust(simulation, simulated, effort.parameters, revisit_interpolation)
        if adjusted.values:
            simulation.budget += _LAST_ASSESSMENT
            after = assess_outputs(simulation, adjusted.values)
    parameters = _parameters(simulation.isolated, adjusted) if adjusted else {}
    verdict, reasons = verdict_of(after or before, parameters, adjusted)
    return replace(
        not_assessed(simulation.isolated, reasons),
        verdict=verdict,
        inputs=simulation.isolated.inputs,
        linear=simulation.inputs.linear,
        before=before,
        after=after,
        parameters=parameters,
        simulations=simulation.used,
    )


def not_assessed(isolated: IsolatedMember, reasons: Sequence[Reason]) -> MemberDiagnosis:
    """The diagnosis of a member of which nothing can be said, and why."""
    member = isolated.member
    model = read_description(member.fmu).modelName
    verdict, settings = MemberVerdict.CANNOT_BE_JUDGED, dict(member.parameters)
    return MemberDiagnosis(member.name, member.fmu.name, model, verdict, list(reasons), settings)


def _parameters(
    isolated: IsolatedMember, adjusted: AdjustmentResult
) -> dict[str, AdjustedParameter]:
    declared = interface(isolated.member).parameters
    parameters = {}
    for name, value in adjusted.values.items():
        differs = significantly_different(adjusted.change[name], adjusted.standard_error[name])
        parameters[name] = AdjustedParameter(
            value, adjusted.nominal[name], declared[name].unit, differs
        )
    return parameters
