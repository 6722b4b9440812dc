"""Diagnosis of a system: which member a record contradicts, and by which cause.

Each member that was recorded at its ports is cut there, and is a component with a record of its
own. Members between which nothing was recorded, and those of a loop in which one cannot be run by
what was recorded, are closed over their connections, and are one component together: nothing
between samples is unknown there, and no noise of a measurement goes in.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property

import numpy as np

from fmus.kit import Effect, UserError
from fmus.kit.errors import suggestion
from orchestration.diagnosis.cause import Cause
from orchestration.diagnosis.engine import Diagnosis, diagnose, is_followed
from orchestration.diagnosis.foreign import diagnose_fmu, reals
from orchestration.diagnosis.options import Options
from orchestration.diagnosis.remainder import Remainder
from orchestration.diagnosis.systems.fused_component import Fused, full_name, fused
from orchestration.diagnosis.systems.parts import Cuts, InputSource, Part
from orchestration.diagnosis.systems.program import program_constants
from orchestration.diagnosis.terms import Term
from orchestration.fmu import Model
from orchestration.fmu.model import catalogue, declared_model_of
from orchestration.identify.uncertainty import Estimate
from orchestration.records import Record, Source
from orchestration.reporting import option
from orchestration.system import (
    Member,
    Port,
    System,
    check,
    columns_of,
    interface,
    read_system_record,
)

_SHORTEST = 100  # samples
# of a loop of several members: a run takes a step for every millisecond, and terms are many
_LONGEST = 1000  # samples, or so many seconds as follow
_SECONDS = 10.0


@dataclass(frozen=True)
class SystemOptions:
    """Options of the diagnosis of a system.

    Attributes
    ----------
    mapping : Mapping of str to str
        Signal by column; signals have the names of `orchestration.system.signal_names`.
    settings : Mapping of str to float or str
        Values of parameters, and of inputs that stayed where they were, by ``member.variable``: in
        the units of the member, or with a unit.
    hold : sequence of str
        Parameters that keep their values, by ``member.parameter``.
    time : float or None
        Processor time of the search in each part, s; by default without a limit.
    """

    mapping: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, float | str] = field(default_factory=dict)
    hold: Sequence[str] = ()
    time: float | None = None


class MemberVerdict(StrEnum):
    """Verdict on a member, the gravest first."""

    WRONG = "wrong"  # in its laws
    RECALIBRATE = "recalibrate"
    CONSISTENT = "consistent"
    CANNOT_BE_JUDGED = "cannot be judged"


@dataclass(frozen=True, eq=False)
class Judgement:
    """The diagnosis of a part of a system.

    Attributes
    ----------
    part : Part
    diagnosis : Diagnosis or None
        None if the part cannot be judged.
    reason : str
        Why not.
    whole : Fused or None
        The component that several members are together.
    names : Mapping of str to str
        Of variables of an FMU without equations, by those of the component that corrects it.
    """

    part: Part
    diagnosis: Diagnosis | None = None
    reason: str = ""
    whole: Fused | None = None
    names: Mapping[str, str] = field(default_factory=dict)

    def origin(self, name: str) -> tuple[str, str]:
        """Return the member of a variable, law or effect of the part, and its name there."""
        if self.whole is None:
            return self.part.names[0], self.names.get(name, name)
        return self.whole.origin(name)

    def name(self, member: str, variable: str) -> str:
        """Return the name of a variable of a member in the part."""
        return variable if self.whole is None else full_name(member, variable)


@dataclass(frozen=True, eq=False)
class MemberDiagnosis:
    """The diagnosis of one member.

    Attributes
    ----------
    name, fmu : str
        In the system, and of its file.
    model : str
        The name that the FMU gives its model: for one of ours that of the component.
    judgement : Judgement
        Of the part that it belongs to.
    """

    name: str
    fmu: str
    model: str
    judgement: Judgement

    @property
    def partners(self) -> list[str]:
        """Members with which it was judged in one loop."""
        return [name for name in self.judgement.part.names if name != self.name]

    @cached_property
    def causes(self) -> list[tuple[str, Cause]]:
        """Causes of the part that are its own, the most probable first, by their name in it."""
        diagnosis = self.judgement.diagnosis
        own = []
        for cause in diagnosis.causes if diagnosis else ():
            member, name = self._name_of(cause)
            if member == self.name:
                own.append((name, cause))
        return own

    @cached_property
    def probability(self) -> float:
        """Probability that a cause is in it."""
        return float(sum(cause.probability for _, cause in self.causes))

    @cached_property
    def verdict(self) -> MemberVerdict:
        """Wrong if the most probable cause of its part is its own, or nothing explains the part."""
        diagnosis = self.judgement.diagnosis
        if diagnosis is None:
            return MemberVerdict.CANNOT_BE_JUDGED
        if diagnosis.verdict not in ("consistent", "recalibrate"):
            leading = diagnosis.causes[:1]
            if not leading or leading[0] in [cause for _, cause in self.causes]:
                return MemberVerdict.WRONG
            if self.causes:
                return MemberVerdict.CANNOT_BE_JUDGED
        changed = any(p.differs for p in self.parameters.values())
        return MemberVerdict.RECALIBRATE if changed else MemberVerdict.CONSISTENT

    @cached_property
    def parameters(self) -> dict[str, MemberParameter]:
        """Fitted parameters by name, those of its causes among them, without start states."""
        diagnosis = self.judgement.diagnosis
        if diagnosis is None:
            return {}
        model = diagnosis.found.subject.problem.model
        starts = {model.parameters[i].name for i in model.start_positions}
        result = {}
        for full, estimate in diagnosis.parameters.items():
            member, name = self.judgement.origin(full)
            if member == self.name and full not in starts:
                differs = full in diagnosis.changed
                result[name] = MemberParameter(estimate, differs)
        return result

    @cached_property
    def outputs(self) -> dict[str, MemberOutput]:
        """Its measured outputs, by name."""
        diagnosis = self.judgement.diagnosis
        if diagnosis is None:
            return {}
        before = diagnosis.errors_before
        after = diagnosis.errors_after
        found = {}
        for remainder in diagnosis.remainders:
            member, name = self.judgement.origin(remainder.output)
            if member == self.name:
                known = before[remainder.output], after[remainder.output]
                found[name] = MemberOutput(remainder, *known)
        return found

    @property
    def inputs(self) -> dict[str, InputSource]:
        """Sources of its inputs, by name."""
        sources = self.judgement.part.inputs.items()
        return {port.variable: source for port, source in sources if port.member == self.name}

    def _name_of(self, cause: Cause) -> tuple[str, str]:
        """Return the member of a cause, and its name there; of a reading its first column's."""
        lead = cause.parts[0]
        if not isinstance(lead, Term):
            column = next(iter(lead.columns), "")
            return self.judgement.origin(column)[0], str(lead)
        member, _ = self.judgement.origin(lead.law or lead.name)
        name = lead.name
        for other in self.judgement.part.names:
            prefix = self.judgement.name(other, "")
            own = "" if other == member else f"{other}."
            name = name.replace(prefix, own) if prefix else name
        return member, name


@dataclass(frozen=True)
class MemberParameter:
    """A parameter of a member as it was fitted.

    Attributes
    ----------
    estimate : Estimate
    differs : bool
        Significantly and noticeably.
    """

    estimate: Estimate
    differs: bool


@dataclass(frozen=True)
class MemberOutput:
    """A measured output of a member.

    Attributes
    ----------
    remainder : Remainder
        What the final model leaves.
    before, after : float or None
        Errors over the size of the output where nothing was fitted: of the model with fitted
        parameters, and of the final one.
    """

    remainder: Remainder
    before: float | None
    after: float | None


@dataclass(frozen=True, eq=False)
class SystemDiagnosis:
    """The diagnoses of all members of a system.

    Attributes
    ----------
    system : str
    record : Record
    members : list of MemberDiagnosis
    columns : dict of Port to tuple of str
        Column of the file from which every port can be read, see `orchestration.system.columns_of`.
    """

    system: str
    record: Record
    members: list[MemberDiagnosis]
    columns: dict[Port, tuple[str, str]] = field(default_factory=dict)

    @property
    def parts(self) -> list[Judgement]:
        """The parts that were judged, each once, in the order of their first members."""
        return list(dict.fromkeys(member.judgement for member in self.members))

    @property
    def wrong(self) -> list[MemberDiagnosis]:
        """Members whose laws are wrong, the first suspect first."""
        found = [m for m in self.members if m.verdict is MemberVerdict.WRONG]
        return sorted(found, key=lambda member: -member.probability)

    @property
    def verdict(self) -> MemberVerdict:
        """The gravest of all; no member could be judged if that is the verdict."""
        gravity = list(MemberVerdict)
        return min((m.verdict for m in self.members), key=gravity.index)


def diagnose_system(
    source: Source | Record,
    system: System,
    options: SystemOptions | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> SystemDiagnosis:
    """Diagnose which members of a system a record contradicts, and by which causes.

    Parameters
    ----------
    source : Source or Record
        The record; one that was read has signals named as in the system.
    system : System
    options : SystemOptions, optional
    progress : callable
        Called with a text about each step of the work.

    Raises
    ------
    UserError
        If the system or the record cannot be used, or a name in the options is unknown.
    """
    options = options or SystemOptions()
    check(system)
    system, given = _configured(system, options.settings)
    held = [_held(system, name) for name in options.hold]
    record, measured = read_system_record(source, system, options.mapping)
    if record.time.size < _SHORTEST:
        raise UserError(
            f"{record.source}: {record.time.size} samples are too few; {_SHORTEST} are the least"
        )
    cuts = Cuts(system, measured, given, held)
    judged = judgements(cuts, record, progress, options.time)
    members = [_member(member, judged) for member in system.members]
    columns = columns_of(system, record, options.mapping)
    return SystemDiagnosis(system.name, record, members, columns)


def _held(system: System, name: str) -> Port:
    """Return a parameter that keeps its value."""
    port = system.port(name)
    parameters = interface(system.member(port.member)).parameters
    if port.variable not in parameters:
        raise UserError(
            f"{option('hold', [name])}: {port.member} has no parameter named"
            f" {port.variable!r}{suggestion(port.variable, parameters)}"
        )
    return port


def _member(member: Member, judged: Sequence[Judgement]) -> MemberDiagnosis:
    judgement = next(one for one in judged if member.name in one.part.names)
    model = interface(member).name
    return MemberDiagnosis(member.name, member.fmu.name, model, judgement)


def _configured(
    system: System, settings: Mapping[str, float | str]
) -> tuple[System, dict[Port, float]]:
    """Set parameters in a system; return the values of inputs that are given besides."""
    given: dict[Port, float] = {}
    members = {member.name: member for member in system.members}
    for name, amount in settings.items():
        port = system.port(name)
        member = members[port.member]
        model = interface(member)
        value = model.settings([f"{port.variable}={amount}"])[port.variable]
        if port.variable in model.inputs:
            given[port] = float(value)
        else:
            parameters = {**member.parameters, port.variable: value}
            members[member.name] = replace(member, parameters=parameters)
    return replace(system, members=tuple(members.values())), given


def judgements(
    cuts: Cuts, record: Record, progress: Callable[[str], None], time: float | None
) -> list[Judgement]:
    """Judge the parts of a system, with members in their loops that cannot be judged by cuts."""
    cut = cuts.parts()
    open_ones = []
    for part in cut:
        if _can_be_closed(part, cuts) and not _is_followed(part, cuts, record):
            open_ones += part.names
    parts = cuts.closed(cut, open_ones)
    return [_judgement(part, record, progress, time) for part in parts]


def _can_be_closed(part: Part, cuts: Cuts) -> bool:
    """Return whether a part is in a loop with others whose equations are all known."""
    partners = {other for name in part.names for other in cuts.loop_members(name)}
    if partners <= set(part.names) or part.missing:
        return False
    whole = next(p for p in cuts.closed(cuts.parts(), part.names) if part.names[0] in p.names)
    return whole.classes is not None and not whole.missing


def _is_followed(part: Part, cuts: Cuts, record: Record) -> bool:
    """Return whether a part runs by what was recorded at its ports, in step with its clocks."""
    classes = part.classes
    if classes is None or not part.outputs:
        return True
    fed = [classes[name] for name in cuts.fed_by_loops(part)]
    if any(clock.shift for cls in fed for clock, _ in cls.layout.sampled):
        return False  # what it samples changes between samples of the record
    try:
        subject = _subject(part, record)
        return is_followed([subject.record], subject.model, subject.options)
    except UserError:
        return False


@dataclass(frozen=True, eq=False)
class _PartSubject:
    """A part as a model with a record."""

    model: Model
    record: Record
    options: Options
    whole: Fused | None


def _subject(part: Part, record: Record, time: float | None = None) -> _PartSubject:
    """Return a part as a model with a record; several members are one component."""
    options = Options(time=time)
    if len(part.members) == 1:
        whole, model = None, part.models[part.names[0]]
    else:
        whole, effects = _fused(part)
        model = declared_model_of(whole.cls)
        options = replace(options, catalogue=effects)
        record = _beginning(record)

    def name(port: Port) -> str:
        return port.variable if whole is None else full_name(port.member, port.variable)

    signals = {name(port): values for port, values in part.outputs.items()}
    signals |= {name(p): s.values for p, s in part.inputs.items() if s.values is not None}
    signals = {name: values[: len(record.time)] for name, values in signals.items()}
    held = [name(port) for port in part.hold]
    held += [] if model.cls is None else program_constants(model.cls, signals)
    given = {name(port): value for port, value in _given(part)}
    options = replace(options, given=given, hold=held)
    return _PartSubject(model, replace(record, signals=signals), options, whole)


def _fused(part: Part) -> tuple[Fused, dict[str, type[Effect]]]:
    """Return members as one component, with the effects of their catalogues.

    Raises
    ------
    UserError
        If the equations of one are unknown.
    """
    if part.classes is None:
        names = ", ".join(name for name, model in part.models.items() if model.cls is None)
        raise UserError(f"the equations of {names} are unknown, so that its loop stays open")
    values = {member.name: member.parameters for member in part.members}
    whole = fused("_".join(part.names), part.classes, values, part.connections)
    return whole, whole.lifted({name: catalogue(cls) for name, cls in part.classes.items()})


def _given(part: Part) -> Iterator[tuple[Port, float]]:
    """Yield the ports and parameters of a part whose values are known, SI."""
    for port, source in part.inputs.items():
        if source.values is None and source.value is not None:
            yield port, source.value
    for member in part.members:
        for variable, value in member.parameters.items():
            port = Port(member.name, variable)
            if port not in part.inputs and not isinstance(value, str):
                yield port, float(value)


def _beginning(record: Record) -> Record:
    """Return the beginning of a record, which is enough of a loop."""
    count = max(int(np.searchsorted(record.time, record.time[0] + _SECONDS)), _LONGEST)
    return record.part(slice(count))


def _judgement(
    part: Part, record: Record, progress: Callable[[str], None], time: float | None
) -> Judgement:
    """Diagnose a part: by the catalogues of its members, and by all laws if no cause is there.

    A loop has the laws and signals of all members, and a search among them takes minutes.
    """
    if part.missing:
        told = [f"{name} is not measured (measure {signal})" for name, signal in part.missing]
        return Judgement(part, reason="; ".join(told))
    if not part.outputs:
        return Judgement(part, reason="none of its outputs is measured")

    def tell(text: str) -> None:
        progress(f"judging {part.label}: {text}")

    try:
        subject = _subject(part, record, time)
        records = [subject.record]
        if subject.model.cls is None:
            return _judgement_of_fmu(part, subject, tell)
        if subject.whole is None:
            return Judgement(part, diagnose(records, subject.model, (), subject.options, tell))
        by_effects = replace(subject.options, laws=False, thorough=False)
        diagnosis = diagnose(records, subject.model, (), by_effects, tell)
        leaves_more = any(one.is_more_than_noise for one in diagnosis.remainders)
        if leaves_more and not diagnosis.is_named:
            diagnosis = diagnose(records, subject.model, (), subject.options, tell)
        return Judgement(part, diagnosis, whole=subject.whole)
    except UserError as error:
        return Judgement(part, reason=str(error))


def _judgement_of_fmu(
    part: Part, subject: _PartSubject, progress: Callable[[str], None]
) -> Judgement:
    """Diagnose a member without equations by corrections at its ports, all its reals fitted."""
    fmu = subject.model
    fitted = [name for name in reals(fmu.parameters) if name not in subject.options.hold]
    options = replace(subject.options, fit=fitted, hold=())
    record = replace(
        subject.record,
        units={name: {**fmu.inputs, **fmu.outputs}[name].unit for name in subject.record.signals},
    )
    settings = subject.options.given
    found = diagnose_fmu([record], fmu, (), settings, options, progress)
    names = {ours: name for name, ours in found.names.variables.items()}
    return Judgement(part, found.diagnosis, names=names)
