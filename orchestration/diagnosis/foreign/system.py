"""An FMU connected to its corrections, as a system that can be exported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fmus.kit import Component, Effect, stack
from fmus.kit.effects import made_with, unstack
from fmus.kit.law_terms import LawTerm
from orchestration.diagnosis.foreign.component import input_correction, output_correction, reals
from orchestration.diagnosis.foreign.diagnosis import FmuDiagnosis
from orchestration.system import Connection, Member, Port, System

# members of the corrected system
_FMU = "fmu"
_FEED = "feed"
_CORRECTION = "correction"


def corrected_system(found: FmuDiagnosis) -> System:
    """Connect an FMU, with the parameters that were estimated, to its corrections.

    Parameters
    ----------
    found : FmuDiagnosis

    Returns
    -------
    System
        With a member ahead of the FMU where a correction is of an input.

    Notes
    -----
    A correction of an input that depends on what the FMU gives closes a loop, in which the FMU gets
    at each communication point what follows from its outputs there.
    """
    fmu, names = found.fmu, found.names
    component = found.diagnosis.component
    ahead, behind = _effects_by_place(component, found)
    inputs = [*reals(fmu.inputs)]
    plain = output_correction(fmu, names, inputs, found.measured, found.experiment)
    members = [
        Member(_FMU, fmu.path, dict(found.settings)),
        Member.of(_CORRECTION, _with_effects(plain, behind, component)),
    ]
    connections = [
        Connection(Port(_FMU, output), Port(_CORRECTION, name))
        for output, name in names.simulated.items()
    ]
    free = [name for name in fmu.inputs if name not in found.settings]
    moved = [name for name in free if ahead and name in found.moved]
    ports = {name: [Port(_CORRECTION, names.variables[name])] for name in inputs if name in free}
    if moved:
        fed_back = _fed_back(ahead, found)
        plain = input_correction(fmu, names, moved, fed_back, found.experiment)
        members.append(Member.of(_FEED, _with_effects(plain, ahead, component)))
        for name in ports:
            ports[name].append(Port(_FEED, names.variables[name]))
        for name in moved:
            connections.append(Connection(Port(_FEED, names.in_fmu[name]), Port(_FMU, name)))
        for name in fed_back:
            connections.append(Connection(Port(_FMU, name), Port(_FEED, names.simulated[name])))
    for name in free:
        if name not in moved:
            ports.setdefault(name, []).insert(0, Port(_FMU, name))
    stop, step = found.experiment
    return System(
        plain.name,
        tuple(members),
        tuple(connections),
        {name: tuple(fed) for name, fed in ports.items()},
        {name: Port(_CORRECTION, names.variables[name]) for name in found.measured},
        f"{fmu.path.name}, corrected",
        step,
        stop,
    )


def _effects_by_place(
    component: type[Component], found: FmuDiagnosis
) -> tuple[list[type[Effect]], list[type[Effect]]]:
    """Divide the effects of a component into those of what the FMU gets, and of what it gives."""
    names = found.names
    of_inputs = {*names.in_fmu.values(), *(names.variables[name] for name in found.moved)}
    _, effects = unstack(component)
    ahead = [e for e in effects if (e.term.law or e.term.qualifier) in of_inputs]
    return ahead, [effect for effect in effects if effect not in ahead]


def _fed_back(effects: Sequence[type[Effect]], found: FmuDiagnosis) -> list[str]:
    """Return the outputs of the FMU on which effects of what it gets depend."""
    terms: list[LawTerm] = [made_with(e)["term"] for e in effects if "term" in made_with(e)]
    signals = {name for term in terms for name in (term.signal, term.factor)}
    return [output for output, name in found.names.simulated.items() if name in signals]


def _with_effects(
    base: type[Component], effects: Sequence[type[Effect]], fitted: type[Component]
) -> type[Component]:
    """Lay effects over a component, with values of the parameters of a fitted one."""
    extended = stack(base, *effects)
    own = {p.name for p in extended.layout.parameters}
    defaults: Mapping[str, float] = {
        p.name: p.start for p in fitted.layout.parameters if p.name in own
    }
    return stack(extended, name=base.name, defaults=defaults)
