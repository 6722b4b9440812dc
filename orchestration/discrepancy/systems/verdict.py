"""What is said of the members of a system, and why: consistent, recalibrate, wrong or cannot be judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from orchestration.discrepancy.systems.adjust import AdjustmentResult
from orchestration.discrepancy.systems.assessment import OutputAssessment
from orchestration.discrepancy.systems.cut import InputSource
from orchestration.discrepancy.systems.reason import Reason, ReasonCode
from orchestration.fmu.signal import Value
from orchestration.records import Record
from orchestration.system.model import Port


class MemberVerdict(StrEnum):
    """What the diagnosis of a member comes to, the gravest first."""

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
        Surely, and by more than is worth a word.
    """

    value: float
    nominal: float
    unit: str
    differs: bool


@dataclass(frozen=True)
class MemberDiagnosis:
    """What is said of one member.

    Attributes
    ----------
    name, fmu, model : str
        In the system, the file, and the name that the FMU gives its model: for one of ours that of the component.
    verdict : MemberVerdict
    reasons : list of Reason
    settings : dict of str to float or str
        Parameters, and inputs that stay at a value, in the system.
    inputs : dict of str to InputSource
        What it was fed.
    linear : list of str
        Inputs that change linearly between samples; the other measured ones are held.
    before, after : dict of str to OutputAssessment
        By output; ``after`` with the adjusted parameters, empty if none were.
    parameters : dict of str to AdjustedParameter
    simulations : int
        That it took.
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

    @property
    def equations_known(self) -> bool:
        """Whether the model is a component of this project by its name, so that a cause can be named."""
        from fmus import COMPONENTS

        return self.model in COMPONENTS

    @property
    def final(self) -> dict[str, OutputAssessment]:
        """The last assessment of every output."""
        return self.after or self.before

    @property
    def measured(self) -> dict[str, Port]:
        """Measured inputs and outputs of the FMU, and where in the system each was measured."""
        fed = {
            name: source.signal for name, source in self.inputs.items() if source.signal is not None
        }
        return fed | {output: Port(self.name, output) for output in self.before}

    @property
    def assessable(self) -> bool:
        """Whether, with its parameters as they came, all measured outputs follow what it is fed."""
        return not any(assessment.not_assessable for assessment in self.before.values())


@dataclass(frozen=True)
class SystemDiagnosis:
    """Which members are wrong.

    Attributes
    ----------
    system : str
    record : Record
    members : list of MemberDiagnosis
    columns : dict of Port to tuple of str
        Which column of the file every port can be read from, see `systems.system_record.columns_of`.
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


def verdict_of(
    final: Mapping[str, OutputAssessment],
    parameters: Mapping[str, AdjustedParameter],
    adjusted: AdjustmentResult | None,
) -> tuple[MemberVerdict, list[Reason]]:
    """Tell the verdict and why.

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
        worst = max(wrong, key=lambda o: final[o].noise_ratio)
        facts = {
            "output": worst,
            "rms": final[worst].rms,
            "unit": final[worst].unit,
            "noise_ratio": final[worst].noise_ratio,
            "adjusted": bool(adjusted and adjusted.values),
            "complete": adjusted is None or adjusted.complete,
            "most_telling": final[worst].most_telling,
        }
        return MemberVerdict.WRONG, [Reason(ReasonCode.RESIDUAL_BEYOND_NOISE, facts), *aside]
    changed = {name: parameter for name, parameter in parameters.items() if parameter.differs}
    if changed:
        return MemberVerdict.RECALIBRATE, [
            Reason(ReasonCode.PARAMETERS_CHANGED, {"parameters": changed}),
            *aside,
        ]
    unmoved = _about(
        ReasonCode.OUTPUTS_UNMOVED, [o for o, assessment in final.items() if assessment.unmoved]
    )
    return MemberVerdict.CONSISTENT, [Reason(ReasonCode.RESIDUAL_IS_NOISE), *aside, *unmoved]


def _about(code: ReasonCode, outputs: Sequence[str]) -> list[Reason]:
    """A reason about some outputs, if there are any."""
    return [Reason(code, {"outputs": list(outputs)})] if outputs else []
