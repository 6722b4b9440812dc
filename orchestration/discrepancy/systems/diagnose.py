"""Diagnosis of a system: each member is judged alone on what was measured at its ends.

``ppy diagnose RECORD --system S.ssp``. A member is first simulated as it is. If signals explain
part of its residuals, its parameters are adjusted, and only what is still explained then is a fault
of its structure. Errors that noise of the inputs and their unknown course between samples can make
are no fault of a member. Its equations need not be known.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array, single_threaded
from fmus.kit.storage import scratch
from orchestration.discrepancy.systems.by_equations import diagnose_loop, has_shift
from orchestration.discrepancy.systems.cut import (
    IsolatedMember,
    Reason,
    ReasonCode,
    isolated_members,
)
from orchestration.discrepancy.systems.in_loop import (
    LoopSimulation,
    connections_between,
    loop_members,
    partners_of,
)
from orchestration.discrepancy.systems.loop_verdict import diagnoses_in_loop
from orchestration.discrepancy.systems.member import MemberSimulation, opened
from orchestration.discrepancy.systems.verdict import (
    Effort,
    MemberDiagnosis,
    MemberVerdict,
    SystemDiagnosis,
    diagnose_member,
    not_assessed,
)
from orchestration.records import parse_mapping
from orchestration.system import Port, System, check, columns_of, interface, read_system_record, ssp

# communication steps of the system that are made at once while two members hold each other
_LOOP_STEP = 5.0
# at most: they take several times as long; a foot has 48 parameters to look at
_LOOP_SIMULATIONS = 120
_SHORTEST = 100  # samples


@single_threaded
def diagnose_system(
    record_path: Path,
    ssp_path: Path,
    mapping: Sequence[str] = (),
    settings: Sequence[str] = (),
    progress: Callable[[str], None] = lambda text: None,
    effort: Effort | None = None,
) -> SystemDiagnosis:
    """Diagnose which members of a system a record contradicts.

    Parameters
    ----------
    record_path, ssp_path : Path
    mapping : sequence of str
        ``column=signal`` entries; signals have the names of `orchestration.system.signal_names`.
    settings : sequence of str
        ``member.variable=value[unit]``: parameters, and inputs that stayed at a value.
    progress : callable
        Told what is being done.
    effort : Effort, optional

    Returns
    -------
    SystemDiagnosis

    Raises
    ------
    UserError
        If the system or the record cannot be used.
    """
    with scratch.folder("ssp") as folder:
        system = ssp.read(ssp_path, folder)
        check(system)
        system, given = _configured(system, settings)
        renamed = parse_mapping(mapping)
        record, measured = read_system_record(record_path, system, renamed)
        if record.time.size < _SHORTEST:
            raise UserError(
                f"{record_path}: {record.time.size} samples are too few; {_SHORTEST} are the least"
            )
        members = _Members(system, record.time, effort or Effort(), progress)
        diagnosed = members.diagnose_all(isolated_members(system, measured, given))
        return SystemDiagnosis(system.name, record, diagnosed, columns_of(system, record, renamed))


def _configured(system: System, settings: Sequence[str]) -> tuple[System, dict[Port, float]]:
    """Set parameters in a system; return the values of inputs that are given besides."""
    given: dict[Port, float] = {}
    members = {member.name: member for member in system.members}
    for text in settings:
        name, _, amount = text.partition("=")
        port = system.port(name.strip())
        member = members[port.member]
        model = interface(member)
        value = model.settings([f"{port.variable}={amount}"])[port.variable]
        if port.variable in model.inputs:
            given[port] = float(value)
        else:
            parameters = {**member.parameters, port.variable: value}
            members[member.name] = replace(member, parameters=parameters)
    return replace(system, members=tuple(members.values())), given


@dataclass
class _Members:
    """The members of a system under diagnosis.

    Attributes
    ----------
    system : System
    time : ndarray, shape (n,)
        Of the record, seconds.
    effort : Effort
    progress : callable
        Told what is being done.
    simulations : dict of str to MemberSimulation
        Of the members that can be simulated.
    diagnoses : dict of str to MemberDiagnosis
    """

    system: System
    time: Array
    effort: Effort
    progress: Callable[[str], None]
    simulations: dict[str, MemberSimulation] = field(default_factory=dict)
    diagnoses: dict[str, MemberDiagnosis] = field(default_factory=dict)

    def diagnose_all(self, members: Sequence[IsolatedMember]) -> list[MemberDiagnosis]:
        """Judge every member by itself, and in its loop where that says nothing."""
        with ExitStack() as stack:
            for isolated in members:
                self.diagnoses[isolated.member.name] = self._alone(isolated, stack)
            # those that could be opened stay open until loops are judged
            for name in self.simulations:
                if self.diagnoses[name].in_loop or self._judged_by_equations(name):
                    continue
                if not self.diagnoses[name].assessable:
                    self.diagnoses[name] = self._in_loop(name)
        return list(self.diagnoses.values())

    def _alone(self, isolated: IsolatedMember, stack: ExitStack) -> MemberDiagnosis:
        """Judge a member by itself; its simulation stays open as long as a stack of contexts."""
        name = isolated.member.name
        reasons = isolated.reason_not_assessable
        if reasons:
            return not_assessed(isolated, reasons)
        try:
            self.simulations[name] = stack.enter_context(
                opened(isolated, self.time, self.effort.simulations, self._counter(name))
            )
            in_loop = bool(loop_members(self.system, name))
            return diagnose_member(self.simulations[name], self.effort, defer_fit=in_loop)
        except UserError as error:
            failure = Reason(ReasonCode.SIMULATION_FAILED, {"message": str(error)})
            return not_assessed(isolated, [failure])

    def _in_loop(self, name: str) -> MemberDiagnosis:
        """Judge a member that runs away by itself."""
        simulation = self.simulations[name]
        partners = partners_of(self.system, name, self.simulations, self.diagnoses)
        if not partners and loop_members(self.system, name):  # they cannot hold it
            return diagnose_member(simulation, self.effort)
        spacing = float(np.median(np.diff(self.time))) / (2.0 * _LOOP_STEP * self.system.step)
        try:
            loop = LoopSimulation(
                simulation.isolated,
                self.time,
                simulation.folder,
                min(self.effort.simulations, _LOOP_SIMULATIONS),
                self._counter(f"{name} in its loop"),
                partners=partners,
                connections=connections_between(self.system, name, [p.name for p in partners]),
                parts=2 * max(1, round(spacing)),
            )
            return diagnose_member(loop, self.effort, revisit_interpolation=False)
        except UserError as error:
            alone = self.diagnoses[name]
            reason = Reason(ReasonCode.LOOP_SIMULATION_FAILED, {"message": str(error)})
            return replace(alone, reasons=[*alone.reasons, reason])

    def _judged_by_equations(self, name: str) -> bool:
        """Judge a member and its partners by their equations; return whether that says anything.

        There is no need where a cut shows a member to be fine, or where one without a sampled clock
        can be cut; and where a partner is wrong, it would be blamed for that.
        """
        alone = self.diagnoses[name]
        partners = loop_members(self.system, name)
        isolated = self.simulations[name].isolated
        can_be_cut = alone.assessable and not has_shift(isolated.member)
        is_fine = alone.assessable and alone.verdict is MemberVerdict.CONSISTENT
        wrong = [p for p in partners if self.diagnoses[p].verdict is MemberVerdict.WRONG]
        is_open = not partners or not self.simulations.keys() >= set(partners)
        if can_be_cut or is_fine or wrong or is_open:
            return False
        try:
            loop = diagnose_loop(
                isolated,
                [self.simulations[partner].isolated for partner in partners],
                connections_between(self.system, name, partners),
                self.time,
                self.progress,
            )
        except UserError:
            return False  # their FMUs tell what can be said
        if loop is None:
            return False
        self.diagnoses |= diagnoses_in_loop(loop, self.diagnoses)
        return True

    def _counter(self, subject: str) -> Callable[[int], None]:
        """Return a function that reports every tenth simulation of a subject."""

        def report(used: int) -> None:
            if used % 10 == 1:
                self.progress(f"judging {subject}: {used} simulations")

        return report
