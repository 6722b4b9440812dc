"""Candidates: what may be wrong with a model, each an effect laid over it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from fmus.kit import Component, Effect, stack
from fmus.kit.component import effect_name as label
from fmus.kit.sensors import measurement_effects


@dataclass(frozen=True)
class Candidate:
    """A model with effects, none for the base.

    Attributes
    ----------
    effects : tuple of type[Effect]
    cls : type[Component]
        The model with them.
    starts : tuple of str
        Start values of the effects' states that are searched too; the others are at rest.
    """

    effects: tuple[type[Effect], ...]
    cls: type[Component]
    starts: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Ids of the effects, with the output that a measurement effect is of."""
        return " + ".join(map(label, self.effects)) or "base"

    @property
    def parameters(self) -> list[str]:
        """Parameters that the effects bring, without start values; of each effect its switch first."""
        return [name for effect in self.effects for name in own_parameters(effect)]

    def with_effect(self, effect: type[Effect]) -> Candidate:
        """Lay one more effect over it."""
        return Candidate((*self.effects, effect), stack(self.cls, effect), self.starts)


def own_parameters(effect: type[Effect]) -> list[str]:
    """Real parameters that an effect declares, its switch first."""
    names = [p.name for p in effect.layout.parameters if p.type == "real" and not p.starts]
    return sorted(names, key=lambda name: name != effect.neutral)


def catalogue(
    cls: type[Component], physics: Mapping[str, type[Effect]], measured: Iterable[str]
) -> list[type[Effect]]:
    """Every effect that a record with these outputs can speak of, but those that are laid over already.

    Parameters
    ----------
    cls : type[Component]
    physics : Mapping of str to type[Effect]
        The component's own effects by id.
    measured : iterable of str
        Outputs in the record.

    Returns
    -------
    list of type[Effect]
    """
    wanted, there = (
        set(measured),
        {label(effect) for effect in vars(cls).get("stacked", (cls, ()))[1]},
    )
    known = [
        *physics.values(),
        *(effect for effect in measurement_effects(cls) if effect.output in wanted),
    ]
    return [effect for effect in known if label(effect) not in there]
