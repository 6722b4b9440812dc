"""Diagnosis of the members of a system: consistent, recalibrate, wrong or cannot be judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

from orchestration.discrepancy.systems.adjustment import AdjustmentResult, adjust
from orchestration.discrepancy.systems.assessment import OutputAssessment, assess_outputs
from orchestration.discrepancy.systems.cut import InputSource, IsolatedMember, Reason, ReasonCode
from orchestration.discrepancy.systems.member import MemberSimulation, choose_interpolation
from orchestration.fmu import Value, read_description
from orchestration.identify.uncertainty import is_significantly_different
from orchestration.records import Record
from orchestration.system import Port, interface

_LAST_ASSESSMENT = 8  # simulations, whatever the search has used


class MemberVerdict(StrEnum):
    """Verdict on a member, the gravest first."""

    WRONG = "wrong"  # in its structure
    RECALIBRATE = "recalibrate"
    CONSISTENT = "consistent"
    CANNOT_BE_JUDGED = "cannot be judged"


@dataclass(frozen=True)
class AdjustedParameter:
    """A parameter that was adjusted, in the FMU's unit.

    Attributes
    ----------
    value, nominal : float
    unit : str
    differs : bool
        Surely, and by more than a little.
    interval : tuple of float or None
        95 % confidence interval; None where the record does not determine it.
    """

    value: float
    nominal: float
    unit: str
    differs: bool
    interval: tuple[float, float] | None = None


@dataclass(frozen=True)
class MemberDiagnosis:
    """The diagnosis of one member.

    Attributes
    ----------
    name, fmu, model : str
        In the system, the file, and the name that the FMU gives its model: for one of ours that of
        the component.
    verdict : MemberVerdict
    reasons : list of Reason
    settings : dict of str to float or str
        Parameters, and inputs that stay at a value, in the system.
    inputs : dict of str to InputSource
    linear : list of str
        Inputs that change linearly between samples; the other measured ones are held.
    before, after : dict of str to OutputAssessment
        By output; ``after`` with the adjusted parameters, empty if none were.
    parameters : dict of str to AdjustedParameter
    simulations : int
        Number of them that it took.
    causes, alternatives : list of str
        Effects that the model of the member lacks, and those that the record cannot tell from them.
    in_loop : bool
        Whether it was judged by equations, in the loop with its partners.
    """

    name: str
    fmu: str
    model: str
    verdict: MemberVerdict
    reasons: list[Reason]
    settings: dict[str, Value] = field(default_factory=dict)
    inputs: dict[str, InputSource] = field(default_factory=dict)
    linear: list[str] = field(default_factory=list)
    before: dict[str, OutputAssessment] = field(default_factory=dict)
    after: dict[str, OutputAssessment] = field(default_factory=dict)
    parameters: dict[str, AdjustedParameter] = field(default_factory=dict)
    simulations: int = 0
    causes: list[str] = field(default_factory=list)
    alternatives: list[str] = field(default_factory=list)
    in_loop: bool = False

    @property
    def is_component(self) -> bool:
        """True if a registered component has its name, by which a diagnosis names causes."""
        from fmus.kit import registry

        return self.model in registry.components()

    @property
    def final(self) -> dict[str, OutputAssessment]:
        """The last assessment of every output."""
        return self.after or self.before

    @property
    def measured(self) -> dict[str, Port]:
        """Measured inputs and outputs of the FMU, with the ports at which they were measured."""
        fed = {
            name: source.signal for name, source in self.inputs.items() if source.signal is not None
        }
        return fed | {output: Port(self.name, output) for output in self.before}

    @property
    def assessable(self) -> bool:
        """True if, with its parameters as they came, all measured outputs follow what it is fed."""
        return not any(assessment.not_assessable for assessment in self.before.values())


@dataclass(frozen=True)
class SystemDiagnosis:
    """The diagnoses of all members of a system.

    Attributes
    ----------
    system : str
    record : Record
    members : list of MemberDiagnosis
    columns : dict of Port to tuple of str
        Which column of the file every port can be read from, see
        `orchestration.system.columns_of`.
    """

    system: str
    record: Record
    members: list[MemberDiagnosis]
    columns: dict[Port, tuple[str, str]] = field(default_factory=dict)

    @property
    def wrong(self) -> list[str]:
        """Members whose structure is wrong."""
        return [m.name for m in self.members if m.verdict is MemberVerdict.WRONG]

    @property
    def verdict(self) -> MemberVerdict:
        """The gravest of all; no member could be judged if that is the verdict."""
        gravity = list(MemberVerdict)
        return min((m.verdict for m in self.members), key=gravity.index)


@dataclass(frozen=True)
class Effort:
    """Limits of the work that is done.

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
    """Diagnose a member: simulate and assess it, adjust it if it is off, and assess it again.

    Parameters
    ----------
    simulation : MemberSimulation
    effort : Effort
    defer_fit : bool
        Whether parameters stay as they are where an output cannot be assessed: a simulation in its
        loop will show more.
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
    after: dict[str, OutputAssessment] = {}
    adjusted = None
    deferred = defer_fit and any(a.not_assessable for a in before.values())
    if any(a.needs_fit for a in before.values()) and not deferred:
        simulated = {output: a.simulated for output, a in before.items()}
        adjusted = adjust(simulation, simulated, effort.parameters, revisit_interpolation)
        if adjusted.values:
            simulation.budget += _LAST_ASSESSMENT
            after = assess_outputs(simulation, adjusted.values)
    parameters = _parameters(simulation.isolated, adjusted) if adjusted else {}
    if not any(a.beyond_doubt for a in before.values()):
        # what made parameters move lies within what the inputs leave unknown
        parameters = {n: replace(p, differs=False) for n, p in parameters.items()}
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
    """Return the diagnosis of a member of which nothing can be said, with the reasons."""
    member = isolated.member
    return MemberDiagnosis(
        member.name,
        member.fmu.name,
        read_description(member.fmu).modelName,
        MemberVerdict.CANNOT_BE_JUDGED,
        list(reasons),
        dict(member.parameters),
    )


def _parameters(
    isolated: IsolatedMember, adjusted: AdjustmentResult
) -> dict[str, AdjustedParameter]:
    """Return adjusted parameters with their units, and which of them surely differ."""
    declared = interface(isolated.member).parameters
    parameters = {}
    for name, value in adjusted.values.items():
        differs = is_significantly_different(adjusted.change[name], adjusted.standard_error[name])
        unit = declared[name].unit
        interval = adjusted.interval[name]
        parameters[name] = AdjustedParameter(value, adjusted.nominal[name], unit, differs, interval)
    return parameters


def verdict_of(
    final: Mapping[str, OutputAssessment],
    parameters: Mapping[str, AdjustedParameter],
    adjusted: AdjustmentResult | None,
) -> tuple[MemberVerdict, list[Reason]]:
    """Return the verdict on a member, and the reasons.

    Parameters
    ----------
    final : Mapping of str to OutputAssessment
        By output; with the adjusted parameters if any were.
    parameters : Mapping of str to AdjustedParameter
    adjusted : AdjustmentResult, optional
        None if nothing was searched.

    Returns
    -------
    verdict : MemberVerdict
    reasons : list of Reason
        The most important first.
    """
    uncertain = [o for o, assessment in final.items() if assessment.not_assessable]
    aside = _about(ReasonCode.TOO_UNCERTAIN, uncertain)
    if len(uncertain) == len(final):
        return MemberVerdict.CANNOT_BE_JUDGED, aside
    wrong = [o for o, assessment in final.items() if assessment.wrong]
    if wrong:
        complete = adjusted is None or adjusted.complete
        is_adjusted = bool(adjusted and adjusted.values)
        reason = residual_reason(final, wrong, is_adjusted, complete)
        return MemberVerdict.WRONG, [reason, *aside]
    changed = {name: parameter for name, parameter in parameters.items() if parameter.differs}
    if changed:
        return MemberVerdict.RECALIBRATE, [parameters_reason(changed), *aside]
    still = [o for o, assessment in final.items() if assessment.unmoved]
    unmoved = _about(ReasonCode.OUTPUTS_UNMOVED, still)
    return MemberVerdict.CONSISTENT, [Reason(ReasonCode.RESIDUAL_IS_NOISE), *aside, *unmoved]


def residual_reason(
    final: Mapping[str, OutputAssessment],
    outputs: Sequence[str],
    adjusted: bool,
    complete: bool = True,
) -> Reason:
    """Return the reason that the residual of the worst of some outputs is no noise.

    Parameters
    ----------
    final : Mapping of str to OutputAssessment
    outputs : sequence of str
    adjusted, complete : bool
        Whether parameters were adjusted, and whether that came to its end.
    """
    worst = max(outputs, key=lambda o: final[o].noise_ratio)
    facts = {
        "output": worst,
        "rms": final[worst].rms,
        "unit": final[worst].unit,
        "noise_ratio": final[worst].noise_ratio,
        "adjusted": adjusted,
        "complete": complete,
        "most_telling": final[worst].most_telling,
    }
    return Reason(ReasonCode.RESIDUAL_BEYOND_NOISE, facts)


def parameters_reason(changed: Mapping[str, AdjustedParameter]) -> Reason:
    """Return the reason that parameters differ."""
    return Reason(ReasonCode.PARAMETERS_CHANGED, {"parameters": dict(changed)})


def _about(code: ReasonCode, outputs: Sequence[str]) -> list[Reason]:
    """Return a reason about some outputs, if there are any."""
    return [Reason(code, {"outputs": list(outputs)})] if outputs else []
