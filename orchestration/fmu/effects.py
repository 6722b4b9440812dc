"""Effects that can be laid over a model by name: its own catalogue, and those of measuring its outputs."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from fmus.kit.component import effect_name
from fmus.kit.errors import UserError, suggestion
from orchestration.fmu.loading import is_subclass

if TYPE_CHECKING:
    from fmus.kit import Component, Effect


def catalogue(cls: type[Component]) -> dict[str, type[Effect]]:
    """Known ways a component is wrong, by id.

    Parameters
    ----------
    cls : type[Component]
        One of ours, or one from a user's module, which lists them as ``EFFECTS``; with effects laid over or not.

    Raises
    ------
    UserError
        If the list is none.
    """
    from fmus import MODELS, component, effects
    from fmus.kit import Effect

    base = vars(cls).get("stacked", (cls, ()))[0]
    if base.name in MODELS and component(base.name) is base:
        return effects(base.name)
    module = sys.modules[base.__module__]
    listed = getattr(module, "EFFECTS", {})
    named = isinstance(listed, Mapping) and all(
        is_subclass(effect, Effect) and name in (effect.id, effect_name(effect))
        for name, effect in listed.items()
    )
    if not named:
        raise UserError(f"{module.__file__}: EFFECTS must be a dictionary from id to effect class")
    return dict(listed)


def known_effects(cls: type[Component]) -> dict[str, type[Effect]]:
    """Every effect that can be laid over a component, by name: its own by id, measurements as ``id(output)``."""
    from fmus.kit.sensors import measurement_effects

    if cls.engine is not None:
        return {}
    return {
        effect_name(effect): effect
        for effect in (*catalogue(cls).values(), *measurement_effects(cls))
    }


def families(
    cls: type[Component], scales: Mapping[str, float] | None = None
) -> dict[str, type[Effect]]:
    """Effects that fit a component's laws by their units, by name, but those that its own catalogue has.

    Parameters
    ----------
    cls : type[Component]
    scales : Mapping of str to float, optional
        Typical magnitudes of signals and laws, SI, from which searches begin; nominal values otherwise.
    """
    from fmus.kit.symbolic.families import families_for

    if cls.engine is not None:
        return {}
    own = {_what(effect) for effect in catalogue(cls).values()}
    base = vars(cls).get("stacked", (cls, ()))[0]
    return {effect_name(e): e for e in families_for(base, scales) if _what(e) not in own}


def _what(effect: type[Effect]) -> tuple[str, ...]:
    return effect.term.law, effect.term.signal, effect.term.shape


def find_effects(cls: type[Component], names: Sequence[str], of: str) -> list[type[Effect]]:
    """Effects of a component by their names.

    Parameters
    ----------
    cls : type[Component]
    names : sequence of str
        Such as ``strain_saturation`` or ``sensor_lag(voltage)``.
    of : str
        What the user calls the component.

    Raises
    ------
    UserError
        For a name that is none, with those that there are.
    """
    from fmus.kit.sensors import MEASUREMENTS

    if not names:
        return []
    known = known_effects(cls)
    if any(name not in known for name in names):
        known = families(cls) | known
    for name in names:
        if name not in known:
            outputs = list(dict.fromkeys(e.output for e in known.values() if e.output))
            there = [n for n, e in known.items() if not e.output]
            there += [f"{id}(OUTPUT)" for id in MEASUREMENTS] if outputs else []
            of_which = f", where OUTPUT is {', '.join(outputs)}" if outputs else ""
            hint = suggestion(name, known, few=0)
            raise UserError(
                f"{of}: no effect named {name!r}{hint}; there are: {', '.join(there) or 'none'}{of_which}"
            )
    return [known[name] for name in names]
