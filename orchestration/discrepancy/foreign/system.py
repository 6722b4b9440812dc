"""An FMU with what stands behind it, corrected, as a system: the original FMU, and a component of ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fmus.kit import Component, Effect, stack
from fmus.kit.errors import UserError
from orchestration.discrepancy.foreign.component import IN_FMU, ahead, behind
from orchestration.discrepancy.foreign.surrounding import Surrounded
from orchestration.fmu.signal import Value
from orchestration.system.model import Connection, Member, Port, System

_FMU, _AHEAD, _BEHIND = "fmu", "feed", "correction"


def corrected(around: Surrounded, component: type[Component]) -> System:
    """Connect an FMU, with the parameters that were found, to its corrections.

    Parameters
    ----------
    around : Surrounded
    component : type[Component]
        What a diagnosis made of the component behind the FMU.

    Returns
    -------
    System
        With a member ahead of the FMU where an input was found to be another.

    Raises
    ------
    UserError
        If what the FMU gets was found to hang on what it gives.
    """
    original, names = around.original, around.behind.names
    fitted = {p.name: p.start for p in component.layout.parameters}
    measured = [
        o
        for o in original.outputs
        if names.get(o) in {v.name for v in around.behind.cls.layout.outputs}
    ]
    stop, step = around.behind.cls.experiment
    effects = vars(component)["stacked"][1]
    of_inputs = [effect for effect in effects if _acts_ahead(effect, around.moved)]
    plain = behind(original, measured, {}, stop, step)
    after = _laid(plain.cls, [effect for effect in effects if effect not in of_inputs], fitted)
    members = [Member(_FMU, original.path, _parameters(around, fitted)), Member.of(_BEHIND, after)]
    connections = [
        Connection(Port(_FMU, o), Port(_BEHIND, plain.simulated(o)))
        for o in original.outputs
        if o in names
    ]
    inputs = {
        i: [Port(_FMU, i), *([Port(_BEHIND, names[i])] if i in names else [])]
        for i in original.inputs
        if i not in around.settings
    }
    if of_inputs:
        moved = [i for i in inputs if names.get(i) in around.moved]
        members.append(Member.of(_AHEAD, _ahead(around, moved, of_inputs, fitted)))
        for i in inputs:
            inputs[i] += [Port(_AHEAD, names[i])] if i in names else []
        for i in moved:
            inputs[i].remove(Port(_FMU, i))
            connections.append(Connection(Port(_AHEAD, IN_FMU.format(names[i])), Port(_FMU, i)))
    outside = {i: tuple(ports) for i, ports in inputs.items()}
    outputs, doc = (
        {o: Port(_BEHIND, names[o]) for o in measured},
        f"{original.path.name}, corrected",
    )
    return System(
        plain.cls.name, tuple(members), tuple(connections), outside, outputs, doc, step, stop
    )


def _acts_ahead(effect: type[Effect], moved: Sequence[str]) -> bool:
    """Whether an effect is of what the FMU gets, instead of what it gives."""
    of_input = not effect.term.law and effect.term.qualifier in moved
    return of_input or effect.term.law in {IN_FMU.format(name) for name in moved}


def _ahead(
    around: Surrounded,
    moved: Sequence[str],
    effects: Sequence[type[Effect]],
    fitted: Mapping[str, float],
) -> type[Component]:
    stop, step = around.behind.cls.experiment
    try:
        return _laid(ahead(around.original, moved, stop, step), effects, fitted)
    except UserError as error:
        raise UserError(
            f"{around.original.path.name}: what it gets was found to hang on what it gives ({error}); as a system that "
            "is a loop, which is not made"
        ) from error


def _laid(
    base: type[Component], effects: Sequence[type[Effect]], fitted: Mapping[str, float]
) -> type[Component]:
    """Effects over a component, with fitted values."""
    over = stack(base, *effects)
    own = {p.name for p in over.layout.parameters}
    return stack(
        over, name=base.name, defaults={n: value for n, value in fitted.items() if n in own}
    )


def _parameters(around: Surrounded, fitted: Mapping[str, float]) -> dict[str, Value]:
    """Parameters of the FMU, those that were fitted as they were found beside the correction."""
    return dict(around.settings) | {p: fitted[name] for p, name in around.behind.fitted.items()}
