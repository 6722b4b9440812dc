"""Candidate models: a component with effects laid over it, each of which may be missing."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from fmus.kit import Component, Effect, stack
from fmus.kit.effects import effect_name as label
from fmus.kit.effects import unstack
from fmus.kit.sampling import Sampling
from fmus.kit.sensors import measurement_effects


@dataclass(frozen=True)
class Candidate:
    """A model with the effects laid over it, none for the base.

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
        """Parameters of the effects, without start values; of each effect its switch first."""
        return [name for effect in self.effects for name in own_parameters(effect)]

    def with_effect(self, effect: type[Effect]) -> Candidate:
        """Return the model with one more effect."""
        return Candidate((*self.effects, effect), stack(self.cls, effect), self.starts)


def own_parameters(effect: type[Effect]) -> list[str]:
    """Return the real parameters that an effect declares, its switch first."""
    names = [p.name for p in effect.layout.parameters if p.type == "real" and not p.starts]
    return sorted(names, key=lambda name: name != effect.neutral)


def catalogue(
    cls: type[Component],
    physics: Mapping[str, type[Effect]],
    measured: Iterable[str],
    sampling: Sampling | None = None,
) -> list[type[Effect]]:
    """Return the effects that a record of these outputs can show, without those already present.

    Parameters
    ----------
    cls : type[Component]
    physics : Mapping of str to type[Effect]
        The component's own effects by id.
    measured : iterable of str
        Outputs in the record.
    sampling : Sampling, optional
        Of the record.

    Returns
    -------
    list of type[Effect]
    """
    outputs = set(measured)
    _, stacked = unstack(cls)
    present = {label(effect) for effect in stacked}
    made = measurement_effects(cls, sampling)
    of_sensors = [effect for effect in made if effect.output in outputs]
    return [effect for effect in (*physics.values(), *of_sensors) if label(effect) not in present]


def without_random(effects: Iterable[type[Effect]]) -> list[type[Effect]]:
    """Return the effects but those of random numbers, of which a record has others."""
    return [effect for effect in effects if not effect.is_random]
