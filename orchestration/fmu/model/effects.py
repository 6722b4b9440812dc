"""Effects that can be added to a model by name: of its catalogue, of sensors and of inputs."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from fmus.kit.effects import effect_name, effects_by_name, unstack
from fmus.kit.errors import UserError, suggestion
from orchestration.fmu.model.loading import is_subclass, load_subclass, names_class

if TYPE_CHECKING:
    from fmus.kit import Component, Effect
    from fmus.kit.sampling import Sampling


def catalogue(cls: type[Component]) -> dict[str, type[Effect]]:
    """Return the effects that a component's authors list as its known discrepancies, by id.

    Parameters
    ----------
    cls : type[Component]
        One of ours, or one of a user's module, which lists them as ``EFFECTS``; with or without
        added effects.

    Returns
    -------
    dict of str to type[Effect]

    Raises
    ------
    UserError
        If ``EFFECTS`` is no dictionary from ids to effects.
    """
    from fmus.kit import Effect, registry

    base = unstack(cls)[0]
    if registry.is_registered(base):
        return registry.effects(base.name)
    module = sys.modules[base.__module__]
    listed = getattr(module, "EFFECTS", {})
    is_valid = isinstance(listed, Mapping) and all(
        is_subclass(effect, Effect) and name in (effect.id, effect_name(effect))
        for name, effect in listed.items()
    )
    if not is_valid:
        raise UserError(f"{module.__file__}: EFFECTS must be a dictionary from id to effect class")
    return dict(listed)


def check_catalogue(cls: type[Component]) -> None:
    """Check the laws of the catalogue of a user's file, with each effect added to the component.

    A file with several components is not checked, because an effect may belong to another one.

    Parameters
    ----------
    cls : type[Component]

    Raises
    ------
    UserError
        With file, line and correction.
    """
    from fmus.kit import Component, stack
    from fmus.kit.symbolic import check_component

    module = sys.modules[unstack(cls)[0].__module__]
    components = {c for c in vars(module).values() if is_subclass(c, Component) and c.name}
    if len(components) == 1:
        for effect in catalogue(cls).values():
            check_component(stack(cls, effect))


def known_effects(
    cls: type[Component], sampling: Sampling | None = None, inputs: bool = False
) -> dict[str, type[Effect]]:
    """Return the catalogue by id, and the measurement effects of the outputs as ``id(output)``.

    Parameters
    ----------
    cls : type[Component]
    sampling : Sampling, optional
        Sampling of the record for which measurement effects are made.
    inputs : bool
        Whether effects of inputs are among them, which any component has.

    Returns
    -------
    dict of str to type[Effect]
    """
    from fmus.kit.sensors import measurement_effects

    if cls.engine is not None:  # without laws of its own, which an effect could change
        return {}
    known = effects_by_name(*catalogue(cls).values(), *measurement_effects(cls, sampling))
    if not inputs:
        return known
    # first in order, and in value where an input's effect has the same name
    return known | effects_of_inputs(cls, sampling) | known


def effects_of_inputs(
    cls: type[Component], sampling: Sampling | None = None
) -> dict[str, type[Effect]]:
    """Return the effects of a component's inputs, as ``id(input)``.

    Parameters
    ----------
    cls : type[Component]
    sampling : Sampling, optional
        Sampling of the record for which the effects are made.

    Returns
    -------
    dict of str to type[Effect]
    """
    from fmus.kit.inputs import input_effects

    if cls.engine is not None:  # without laws of its own
        return {}
    return {effect_name(effect): effect for effect in input_effects(unstack(cls)[0], sampling)}


def find_effects(
    cls: type[Component],
    names: Sequence[str],
    model_name: str,
    sampling: Sampling | None = None,
) -> list[type[Effect]]:
    """Return effects of a component by their names.

    Parameters
    ----------
    cls : type[Component]
    names : sequence of str
        Names such as ``strain_saturation``, ``sensor_lag(voltage)``, ``dead_zone(current)`` or
        ``path/to/file.py:Effect``.
    model_name : str
        Name of the component in messages.
    sampling : Sampling, optional
        Sampling of the record for which the effects are made.

    Returns
    -------
    list of type[Effect]
        In the order of the names.

    Raises
    ------
    UserError
        For an unknown name, with the nearest known one and the command that lists all, or a
        user's effect that changes nothing of the component.
    """
    if not names:
        return []
    user_effects = {name: _load_effect(name, cls) for name in names if names_class(name)}
    known = known_effects(cls, sampling) | user_effects
    if any(name not in known for name in names):
        known = known_effects(cls, sampling, inputs=True) | known
    for name in names:
        if name not in known:
            raise UserError(
                f"{model_name}: no effect named {name!r}{suggestion(name, known)}; ppy info"
                f" {model_name} lists them"
            )
    return [known[name] for name in names]


def _load_effect(place: str, cls: type[Component]) -> type[Effect]:
    """Return the effect of a user's file, which overrides a law, an input or an output.

    Raises
    ------
    UserError
        If it cannot be loaded, or nothing of the component is called as what it defines.
    """
    from fmus.kit import Effect

    effect: type[Effect] = load_subclass(place, Effect)[2]
    layers = effect.__mro__[: effect.__mro__.index(Effect)]
    defined = {name for layer in layers for name in vars(layer) if not hasattr(Effect, name)}
    if defined.isdisjoint([*dir(cls), *cls.layout.names]):
        laws = sorted(name for name in defined if callable(getattr(effect, name, None)))
        missing = " or ".join(laws) or "such law"
        raise UserError(f"{place}: changes nothing of {cls.name}, which has no {missing}")
    return effect
