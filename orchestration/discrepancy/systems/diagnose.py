"""Which member of a system is wrong: each is judged alone on what was measured at its ends, with or without equations.

``ppy diagnose RECORD --system S.ssp``. A member is first simulated as it is. If signals explain part of what it leaves,
its parameters are adjusted, and only what is still explained then is a fault of its structure. What noise of the inputs
and their course between samples can do to an output is not held against a member.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.discrepancy.residuals.correlation import cross_correlations, regressors
from orchestration.discrepancy.residuals.operating_regions import regions
from orchestration.discrepancy.residuals.random_walk import slow
from orchestration.discrepancy.residuals.regression import explained
from orchestration.discrepancy.systems.adjust import AdjustmentResult, adjust
from orchestration.discrepancy.systems.cut import IsolatedMember, cut, read
from orchestration.discrepancy.systems.in_loop import InLoop, Partner
from orchestration.discrepancy.systems.member import MemberSimulation, floor, opened
from orchestration.discrepancy.systems.verdict import (
    AdjustedParameter,
    MemberDiagnosis,
    OutputAssessment,
    SystemDiagnosis,
    verdict_of,
)
from orchestration.fmu.archive import read_description
from orchestration.identify.metrics import fit_percent, rms, whiteness
from orchestration.identify.noise import estimate
from orchestration.records import parse_mapping
from orchestration.system import Port, System, ssp
from orchestration.system.check import check, interface

Array = NDArray[np.float64]
_LOOP_STEP = 5.0  # communication steps of the system that are made at once while two members hold each other
_LOOP_SIMULATIONS = 50  # at most: they take several times as long
_DIFFERS, _NOTICED = 5.0, 0.02  # standard errors, and share, by which a parameter counts as another
_SHORTEST = 100  # samples
_TESTED = 20  # samples that a test of whiteness needs


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
        ``column=signal`` entries; signals are named as `orchestration.discrepancy.systems.cut.names` tells.
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
    with tempfile.TemporaryDirectory(prefix="ppy-ssp-", ignore_cleanup_errors=True) as folder:
        system = ssp.read(ssp_path, Path(folder))
        check(system)
        system, given = _set(system, settings)
        record, measured = read(record_path, system, parse_mapping(mapping))
        if record.time.size < _SHORTEST:
            raise UserError(f"{record_path}: {record.time.size} samples are too few; {_SHORTEST} are the least")
        members = judge(system, record.time, measured, given, progress, effort or Effort())
        return SystemDiagnosis(system.name, record, members)


def _set(system: System, settings: Sequence[str]) -> tuple[System, dict[Port, float]]:
    """Give parameters their values; return those of inputs too."""
    given: dict[Port, float] = {}
    for text in settings:
        port = system.port(text.partition("=")[0].strip())
        model = interface(system.member(port.member))
        value = model.settings([f"{port.variable}={text.partition('=')[2]}"])[port.variable]
        if port.variable in model.inputs:
            given[port] = value
            continue
        members = [
            replace(m, parameters={**m.parameters, port.variable: value}) if m.name == port.member else m
            for m in system.members
        ]
        system = replace(system, members=tuple(members))
    return system, given


def judge(
    system: System, time: Array, measured: Mapping[Port, Array], given: Mapping[Port, float],
    progress: Callable[[str], None], effort: Effort,
) -> list[MemberDiagnosis]:  # fmt: skip
    """Judge every member of a system by itself, and in its loop where that says nothing."""
    cuts = {c.member.name: c for c in cut(system, measured, given)}
    with ExitStack() as stack:
        found: dict[str, MemberDiagnosis] = {}
        work: dict[str, MemberSimulation] = {}
        for name, part in cuts.items():
            if part.obstacle:
                found[name] = _named(part, "cannot be judged", part.obstacle)
                continue
            try:
                work[name] = stack.enter_context(opened(part, time, effort.simulations, _teller(progress, name)))
                found[name] = _judge(work[name], effort, _looped(system, name))
            except UserError as error:
                found[name] = _named(part, "cannot be judged", str(error))
        for name, alone in work.items():
            if not any(j.lost for j in found[name].before.values()):
                continue
            partners = _partners(system, name, work, found)
            if not partners and _looped(system, name):
                found[name] = _judge(alone, effort)
                continue
            wires = [c for c in system.connections if _between(c.source.member, c.target.member, name, partners)]
            spacing = float(np.median(np.diff(time))) / (2.0 * _LOOP_STEP * system.step)
            loop = InLoop(
                alone.cut, time, alone.folder, min(effort.simulations, _LOOP_SIMULATIONS),
                _teller(progress, f"{name} in its loop"),
                partners=partners, connections=wires, parts=2 * max(1, round(spacing)),
            )  # fmt: skip
            try:
                found[name] = _judge(loop, effort)
            except UserError as error:
                found[name] = replace(found[name], why=f"{found[name].why}; in its loop: {error}")
    return [found[name] for name in cuts]


def _teller(progress: Callable[[str], None], name: str) -> Callable[[int], None]:
    """Tell of every tenth simulation."""
    return lambda made: progress(f"judging {name}: {made} simulations") if made % 10 == 1 else None


def _looped(system: System, name: str) -> list[str]:
    """Members that feed a member and are fed by it."""
    fed = {c.target.member for c in system.connections if c.source.member == name}
    feeding = {c.source.member for c in system.connections if c.target.member == name}
    return [m.name for m in system.members if m.name in fed & feeding]


def _partners(
    system: System, name: str, work: Mapping[str, MemberSimulation], found: Mapping[str, MemberDiagnosis]
) -> list[Partner]:
    """Partners of a member, if all of them follow what they are fed and were measured where they feed it."""
    others = _looped(system, name)
    to = {
        other: [c for c in system.connections if (c.source.member, c.target.member) == (other, name)]
        for other in others
    }
    for other, wires in to.items():
        if other not in work or any(j.lost for j in found[other].before.values()):
            return []
        if any(c.source.variable not in work[other].cut.outputs for c in wires):
            return []
        if any(not np.isfinite(work[other].cut.outputs[c.source.variable]).all() for c in wires):
            return []
    return [Partner(work[n], {p: c.value for p, c in found[n].parameters.items()}) for n in others]


def _between(source: str, target: str, name: str, partners: Sequence[Partner]) -> bool:
    others = {p.alone.cut.member.name for p in partners}
    return (source == name and target in others) or (target == name and source in others)


def _named(part: IsolatedMember, verdict: str, why: str) -> MemberDiagnosis:
    member = part.member
    return MemberDiagnosis(member.name, member.fmu.name, read_description(member.fmu).modelName, verdict, why)


def _judge(alone: MemberSimulation, effort: Effort, looped: Sequence[str] = ()) -> MemberDiagnosis:
    """Judge a member; where an output of one that has partners says nothing, parameters are left for later."""
    alone.choose_holding({})
    before = _outputs(alone, {})
    later = looped and any(j.lost for j in before.values())
    adjusted = after = None
    if any(j.suspect for j in before.values()) and not later:
        views = not isinstance(alone, InLoop)
        adjusted = adjust(alone, {o: j.simulated for o, j in before.items()}, effort.parameters, views)
        if adjusted.values:
            alone.most += 8  # a last look
            after = _outputs(alone, adjusted.values)
    changed = _changed(alone, adjusted) if adjusted else {}
    verdict, why = verdict_of(before, after, changed, adjusted)
    fed = {}
    for name, given in alone.cut.inputs.items():
        course = "linear between samples" if name in alone.moving else "held between samples"
        fed[name] = f"{given.value:g} ({given.source})" if given.value is not None else f"{given.source}, {course}"
    own = {n: f"{alone.cut.member.name}.{n}" for n in (*alone.cut.inputs, *alone.cut.outputs)}
    driven = {n: f.source for n, f in alone.cut.inputs.items() if f.values is not None}
    signals = {n: own[n] if source == "measured" else source for n, source in driven.items()}
    signals |= {n: own[n] for n in alone.cut.outputs}
    return replace(
        _named(alone.cut, verdict, why), fed=fed, before=before, after=after or {}, parameters=changed,
        simulations=alone.made, signals=signals,
    )  # fmt: skip


def _outputs(alone: MemberSimulation, values: Mapping[str, float]) -> dict[str, OutputAssessment]:
    simulated = alone.simulate(values)
    doubt = alone.doubt(simulated, values)
    inputs = {n: f.values for n, f in alone.cut.inputs.items() if f.values is not None}
    model = interface(alone.cut.member)
    units = {n: s.unit for n, s in (*model.inputs.items(), *model.outputs.items())}
    signals = regressors(alone.time, inputs, simulated, simulated, units)
    plain = [s for s in signals if not s.name.startswith("square of ")]  # a regression takes powers itself
    step = float(np.median(np.diff(alone.time)))
    judged = {}
    for output, y in alone.cut.outputs.items():
        present = np.isfinite(y)
        residual = (simulated[output] - y)[present]
        tested = whiteness(residual) if residual.size >= _TESTED else None
        judged[output] = OutputAssessment(
            y, simulated[output], units[output], fit_percent(y, simulated[output]), rms(residual), floor(residual),
            doubt[output], tested, explained(residual, present, plain), slow(residual),
            cross_correlations(output, residual, present, estimate(residual, present), signals, step),
            regions(output, residual, present, signals),
        )  # fmt: skip
    return judged


def _changed(alone: MemberSimulation, adjusted: AdjustmentResult) -> dict[str, AdjustedParameter]:
    parameters = interface(alone.cut.member).parameters
    found = {}
    for name, value in adjusted.values.items():
        moved, error = abs(adjusted.moved[name]), adjusted.error[name]
        differs = moved > _NOTICED and moved > _DIFFERS * error
        found[name] = AdjustedParameter(value, adjusted.nominal[name], parameters[name].unit, differs)
    return found
