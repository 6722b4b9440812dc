"""Which member of a system is wrong: each is judged alone on what was measured at its ends, with or without equations.

``ppy diagnose RECORD --system S.ssp``. A member is first simulated as it is. If signals explain part of its residuals,
its parameters are adjusted, and only what is still explained then is a fault of its structure. What noise of the inputs
and their course between samples can do to an output is not held against a member.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from fmus.kit.storage import scratch
from orchestration.discrepancy.systems.cut import IsolatedMember, isolated_members
from orchestration.discrepancy.systems.in_loop import LoopSimulation
from orchestration.discrepancy.systems.member import MemberSimulation, opened
from orchestration.discrepancy.systems.member_diagnosis import Effort, diagnose_member, not_assessed
from orchestration.discrepancy.systems.partners import (
    connections_between,
    loop_members,
    partners_of,
)
from orchestration.discrepancy.systems.reason import Reason, ReasonCode
from orchestration.discrepancy.systems.system_record import columns_of, read_system_record
from orchestration.discrepancy.systems.verdict import MemberDiagnosis, SystemDiagnosis
from orchestration.records import parse_mapping
from orchestration.system import Port, System, ssp
from orchestration.system.check import check, interface

Array = NDArray[np.float64]
_LOOP_STEP = (
    5.0  # communication steps of the system that are made at once while two members hold each other
)
_LOOP_SIMULATIONS = (
    120  # at most: they take several times as long; a foot has 48 parameters to look at
)
_SHORTEST = 100  # samples


def diagnose_system(
    record_path: Path,
    ssp_path: Path,
    mapping: Sequence[str] = (),
    settings: Sequence[str] = (),
    progress: Callable[[str], None] = lambda text: None,
    effort: Effort | None = None,
) -> SystemDiagnosis:
    """Tell which member of a system a record contradicts.

    Parameters
    ----------
    record_path, ssp_path : Path
    mapping : sequence of str
        ``column=signal`` entries; signals are named as `systems.system_record.signal_names` tells.
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
        diagnosed = members.diagnosed(isolated_members(system, measured, given))
        return SystemDiagnosis(system.name, record, diagnosed, columns_of(system, record, renamed))


def _configured(system: System, settings: Sequence[str]) -> tuple[System, dict[Port, float]]:
    """Give parameters their values; return those of inputs too."""
    given: dict[Port, float] = {}
    for text in settings:
        port = system.port(text.partition("=")[0].strip())
        model = interface(system.member(port.member))
        value = model.settings([f"{port.variable}={text.partition('=')[2]}"])[port.variable]
        if port.variable in model.inputs:
            given[port] = float(value)
            continue
        members = [
            replace(m, parameters={**m.parameters, port.variable: value})
            if m.name == port.member
            else m
            for m in system.members
        ]
        system = replace(system, members=tuple(members))
    return system, given


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

    def diagnosed(self, members: Sequence[IsolatedMember]) -> list[MemberDiagnosis]:
        """Judge every member by itself, and in its loop where that says nothing."""
        with ExitStack() as stack:
            for isolated in members:
                name = isolated.member.name
                if reasons := isolated.reason_not_assessable:
                    self.diagnoses[name] = not_assessed(isolated, reasons)
                    continue
                try:
                    self.simulations[name] = stack.enter_context(
                        opened(isolated, self.time, self.effort.simulations, self._counter(name))
                    )
                    in_loop = bool(loop_members(self.system, name))
                    self.diagnoses[name] = diagnose_member(
                        self.simulations[name], self.effort, defer_fit=in_loop
                    )
                except UserError as error:
                    reason = Reason(ReasonCode.SIMULATION_FAILED, {"message": str(error)})
                    self.diagnoses[name] = not_assessed(isolated, [reason])
            for name in self.simulations:
                if not self.diagnoses[name].assessable:
                    self.diagnoses[name] = self._in_loop(name)
        return list(self.diagnoses.values())

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
                connections=connections_between(
                    self.system, name, [p.simulation.name for p in partners]
                ),
                parts=2 * max(1, round(spacing)),
            )
            return diagnose_member(loop, self.effort, revisit_interpolation=False)
        except UserError as error:
            alone = self.diagnoses[name]
            reason = Reason(ReasonCode.LOOP_SIMULATION_FAILED, {"message": str(error)})
            return replace(alone, reasons=[*alone.reasons, reason])

    def _counter(self, what: str) -> Callable[[int], None]:
        """Tell of every tenth simulation."""
        return lambda used: (
            self.progress(f"judging {what}: {used} simulations") if used % 10 == 1 else None
        )
