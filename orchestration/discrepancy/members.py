"""Which member of a system is wrong: each is judged alone on what was measured at its ends, with or without equations.

``ppy diagnose RECORD --system S.ssp``. A member is first simulated as it is. If signals explain part of what it leaves,
its parameters are adjusted, and only what is still explained then is a fault of its structure. What noise of the inputs
and their course between samples can do to an output is not held against a member.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.discrepancy.adjusting import Adjusted, adjust
from orchestration.discrepancy.alone import Alone, floor, opened
from orchestration.discrepancy.associations import Association, Explained, Region, associations, explained, explaining
from orchestration.discrepancy.associations import regions as find_regions
from orchestration.discrepancy.cut import Cut, cut, read
from orchestration.discrepancy.in_loop import InLoop, Partner
from orchestration.discrepancy.noise import estimate
from orchestration.discrepancy.wandering import Slow, slow
from orchestration.fmu_file import read_description
from orchestration.identify.residuals import Whiteness, fit_percent, number, rms, whiteness
from orchestration.records import Record, parse_mapping
from orchestration.system import Port, System, ssp
from orchestration.system.check import check, interface

Array = NDArray[np.float64]
_LOST = 0.5  # of the variation of an output: if that much is in doubt, nothing can be said of it
_MATTERS = 0.5  # noise widths that a fault must leave
_HARDLY, _ROUGHLY = 0.5, 2.0  # by which doubt, which is no more than an estimate, must be exceeded: to look, to blame
_UNMOVED = 1.5  # noise widths below which an output has not moved
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


@dataclass(frozen=True)
class Judged:
    """One output of one member, simulated and measured.

    Attributes
    ----------
    measured, simulated : ndarray, shape (n,)
        In the FMU's unit.
    unit : str
    fit_percent, rms : float
    noise : float
        Of the measurement, as the record itself tells: standard deviation of what changes from sample to sample.
    doubt : float
        What noise of the inputs, and their course between samples, can do to the output: rms.
    whiteness : Whiteness or None
        None if there are too few samples to test.
    explained : Explained
        Of the residual, by the member's inputs and outputs.
    slow : Slow
    associations : list of Association
    regions : list of Region
    """

    measured: Array
    simulated: Array
    unit: str
    fit_percent: float
    rms: float
    noise: float
    doubt: float
    whiteness: Whiteness | None
    explained: Explained
    slow: Slow
    associations: list[Association]
    regions: list[Region]

    @property
    def lost(self) -> bool:
        """Whether the simulation runs away from whatever was measured, so that it says nothing."""
        return self.doubt > _LOST * float(np.nanstd(self.measured))

    @property
    def suspect(self) -> bool:
        """Whether so much is explained or wanders that the parameters should be looked at."""
        return self._more_than(_HARDLY)

    @property
    def wrong(self) -> bool:
        """Whether more is explained or wanders than noise and doubt can account for."""
        return self._more_than(_ROUGHLY)

    def _more_than(self, doubts: float) -> bool:
        matters = np.hypot(_MATTERS * self.noise, doubts * self.doubt)
        found = any(f.significant and f.rms > matters for f in (self.explained, self.slow))
        # a residual that is large and no mere noise, though no regression follows it
        structured = any(a.significant for a in self.associations) or any(r.significant for r in self.regions)
        large = self.rms > (1.0 + doubts / _ROUGHLY) * np.hypot(self.noise, self.doubt)
        return not self.lost and bool(found or (structured and large))


@dataclass(frozen=True)
class Changed:
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
    verdict : {"consistent", "recalibrate", "wrong", "cannot be judged"}
    why : str
        In words.
    fed : dict of str to str
        Where each input is from, and whether it is held or changes linearly between samples.
    before, after : dict of str to Judged
        By output; ``after`` with the adjusted parameters, empty if none were.
    parameters : dict of str to Changed
    simulations : int
    signals : dict of str to str
        Measured inputs and outputs of the FMU, and what each is called in the system.
    """

    name: str
    fmu: str
    model: str
    verdict: str
    why: str
    fed: dict[str, str] = field(default_factory=dict)
    before: dict[str, Judged] = field(default_factory=dict)
    after: dict[str, Judged] = field(default_factory=dict)
    parameters: dict[str, Changed] = field(default_factory=dict)
    simulations: int = 0
    signals: dict[str, str] = field(default_factory=dict)

    @property
    def ours(self) -> bool:
        """Whether the model is a component of this project by its name, so that its equations are known."""
        from fmus import COMPONENTS

        return self.model in COMPONENTS

    @property
    def final(self) -> dict[str, Judged]:
        """The last judgement of every output."""
        return self.after or self.before


@dataclass(frozen=True)
class SystemDiagnosis:
    """Which members are wrong.

    Attributes
    ----------
    system : str
    record : Record
    members : list of MemberDiagnosis
    """

    system: str
    record: Record
    members: list[MemberDiagnosis]

    @property
    def wrong(self) -> list[str]:
        """Members whose structure is wrong."""
        return [m.name for m in self.members if m.verdict == "wrong"]

    @property
    def verdict(self) -> str:
        """The gravest of all: wrong, recalibrate, consistent; cannot be judged if no member could be."""
        return min(
            (m.verdict for m in self.members), key=("wrong", "recalibrate", "consistent", "cannot be judged").index
        )

    def as_json(self) -> dict[str, Any]:
        """Figures, ready for JSON."""
        return {"system": self.system, "verdict": self.verdict, "members": [_member_json(m) for m in self.members]}


def _member_json(m: MemberDiagnosis) -> dict[str, Any]:
    return {
        "member": m.name, "fmu": m.fmu, "model": m.model, "ours": m.ours,
        "verdict": m.verdict, "why": m.why, "fed": m.fed,
        "outputs": {o: _output_json(m, o) for o in m.final},
        "parameters": {n: asdict(c) for n, c in m.parameters.items()},
        "simulations": m.simulations,
    }  # fmt: skip


def _output_json(m: MemberDiagnosis, output: str) -> dict[str, Any]:
    before, after = m.before[output], m.final[output]
    return {
        "fit_percent_before": number(before.fit_percent), "fit_percent": number(after.fit_percent),
        "rms": number(after.rms), "unit": after.unit, "noise": after.noise, "doubt": after.doubt,
        "white": after.whiteness.is_white if after.whiteness else None,
        "explained": {"rms": after.explained.rms, "p_value": after.explained.p_value},
        "slow": {"rms": after.slow.rms, "p_value": after.slow.p_value},
        "associations": [a.text for a in after.associations if a.significant][:5],
        "regions": [r.text for r in after.regions if r.significant][:5],
    }  # fmt: skip


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
        ``column=signal`` entries; signals are named as `orchestration.discrepancy.cut.names` tells.
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
        work: dict[str, Alone] = {}
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
    system: System, name: str, work: Mapping[str, Alone], found: Mapping[str, MemberDiagnosis]
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


def _named(part: Cut, verdict: str, why: str) -> MemberDiagnosis:
    member = part.member
    return MemberDiagnosis(member.name, member.fmu.name, read_description(member.fmu).modelName, verdict, why)


def _judge(alone: Alone, effort: Effort, looped: Sequence[str] = ()) -> MemberDiagnosis:
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
    verdict, why = _verdict(before, after, changed, adjusted)
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


def _outputs(alone: Alone, values: Mapping[str, float]) -> dict[str, Judged]:
    simulated = alone.simulate(values)
    doubt = alone.doubt(simulated, values)
    inputs = {n: f.values for n, f in alone.cut.inputs.items() if f.values is not None}
    model = interface(alone.cut.member)
    units = {n: s.unit for n, s in (*model.inputs.items(), *model.outputs.items())}
    signals = explaining(alone.time, inputs, simulated, simulated, units)
    plain = [s for s in signals if not s.name.startswith("square of ")]  # a regression takes powers itself
    step = float(np.median(np.diff(alone.time)))
    judged = {}
    for output, y in alone.cut.outputs.items():
        present = np.isfinite(y)
        residual = (simulated[output] - y)[present]
        tested = whiteness(residual) if residual.size >= _TESTED else None
        judged[output] = Judged(
            y, simulated[output], units[output], fit_percent(y, simulated[output]), rms(residual), floor(residual),
            doubt[output], tested, explained(residual, present, plain), slow(residual),
            associations(output, residual, present, estimate(residual, present), signals, step),
            find_regions(output, residual, present, signals),
        )  # fmt: skip
    return judged


def _changed(alone: Alone, adjusted: Adjusted) -> dict[str, Changed]:
    parameters = interface(alone.cut.member).parameters
    found = {}
    for name, value in adjusted.values.items():
        moved, error = abs(adjusted.moved[name]), adjusted.error[name]
        differs = moved > _NOTICED and moved > _DIFFERS * error
        found[name] = Changed(value, adjusted.nominal[name], parameters[name].unit, differs)
    return found


def _verdict(
    before: Mapping[str, Judged], after: Mapping[str, Judged] | None, changed: Mapping[str, Changed],
    adjusted: Adjusted | None,
) -> tuple[str, str]:  # fmt: skip
    final = after or before
    lost = [o for o, j in final.items() if j.lost]
    aside = f"; {', '.join(lost)} says nothing: what its inputs do between samples, or their noise, moves it too far"
    aside = aside if lost else ""
    if len(lost) == len(final):
        return "cannot be judged", aside.removeprefix("; ")
    wrong = [o for o, j in final.items() if j.wrong]
    if wrong:
        worst = max(wrong, key=lambda o: final[o].rms / max(final[o].noise, 1e-300))
        j = final[worst]
        cause = next((a.text for a in j.associations if a.significant), "") or next(
            (r.text for r in j.regions if r.significant), ""
        )
        left = f"{worst} is off by {j.rms:.3g} {j.unit} rms, {j.rms / max(j.noise, 1e-300):.1f} noise widths"
        tried = ", whatever its parameters" if adjusted and adjusted.values else ""
        short = " (the search for parameters was cut short)" if adjusted and not adjusted.whole else ""
        return "wrong", f"{left}{tried}{short}" + (f"; {cause}" if cause else "") + aside
    differing = [n for n, c in changed.items() if c.differs]
    if differing:
        pairs = [(n, changed[n]) for n in differing]
        told = ", ".join(f"{n} is {c.value:.4g} {c.unit} instead of {c.nominal:.4g}" for n, c in pairs)
        return "recalibrate", told + aside
    still = [o for o, j in final.items() if np.nanstd(j.measured) < _UNMOVED * j.noise]
    aside += f"; {', '.join(still)} does not move in this record, which says little of it" if still else ""
    return "consistent", "nothing is left that noise cannot account for" + aside
