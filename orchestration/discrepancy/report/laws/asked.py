"""What was asked of a model's laws, and what is told of a correction wherever it is told."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit import Component, Effect
from fmus.kit.component import effect_name
from fmus.kit.corrections import Of
from fmus.kit.curves import SHAPES
from fmus.kit.units import registry
from orchestration.discrepancy.candidates.candidate import own_parameters
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.corrected import Laws
from orchestration.discrepancy.laws.discovery import Correction, LawMapResult
from orchestration.discrepancy.laws.fitting import unit_of
from orchestration.discrepancy.laws.signals import Signal
from orchestration.discrepancy.pipeline import Result
from orchestration.discrepancy.report.laws.formula import formula as taken_apart
from orchestration.discrepancy.validation.confirmation import Outcome
from orchestration.discrepancy.validation.estimates import estimates
from orchestration.identify.estimate import Estimate

Array = NDArray[np.float64]
_PLAIN = ("N", "N*m", "V", "A", "W", "J", "Pa", "ohm", "C", "N/m")  # as engineers call them
_REMEMBERED = {
    "": "{0}",
    "lagged": "{0} lagged by {1:.3g} s",
    "leading": "{0} less itself lagged by {1:.3g} s",
    "heat": "the square of {0} lagged by {1:.3g} s",
    "integrated": "the integral of {0}",
    "throughput": "the integral of |{0}|",
}


@dataclass(frozen=True)
class Asked:
    """A look at a model, and at its laws.

    Attributes
    ----------
    result : Result
        Of the model as a whole.
    laws : Laws or None
        Of its laws; None where no input moves, so that nothing can be asked.
    """

    result: Result
    laws: Laws | None

    @property
    def found(self) -> LawMapResult | None:
        """What was found of its laws."""
        return self.laws.found if self.laws else None

    @property
    def corrections(self) -> list[Correction]:
        """Best first."""
        return self.found.corrections if self.found else []

    @property
    def best(self) -> Correction | None:
        """The one that is judged on unseen data, if there is any."""
        return next(iter(self.corrections), None)

    @property
    def rounds(self) -> list[Asked]:
        """The same, and what was asked of the model with the best correction, where that was confirmed as well."""
        beside = self.laws.beside if self.laws else None
        return [self] if beside is None else [self, *Asked(self.result, beside).rounds]

    @property
    def last(self) -> FittedCandidate:
        """The model with all that was confirmed one beside the other, or with the best correction."""
        cause = next(
            (one.laws.cause for one in self.rounds[::-1] if one.laws and one.laws.cause), None
        )
        return self.base if cause is None else cause

    def own_values(self, model: FittedCandidate) -> dict[str, float]:
        """Parameters of the best correction by its own names, where a model has the catalogue's effect instead too."""
        values, cause = (
            model.problem.start | model.fit.values,
            self.laws.cause if self.laws else None,
        )
        effects = [self.best.model.effect, cause.effect] if self.best and cause else []
        pairs = zip(*map(own_parameters, effects), strict=False)
        return {own: values[name] for own, name in pairs if name in values}

    @property
    def spectrum(self) -> list[tuple[float, float]]:
        """Time constants, s, and amounts of relaxations that stand one beside the other, by time constants."""
        several = [
            one.own_values(self.last)
            for one in self.rounds
            if one.best is not None and one.best.relaxation
        ]
        return sorted((constant, amount) for amount, constant in (own.values() for own in several))

    @property
    def base(self) -> FittedCandidate:
        """The model that was asked, with the effects that were named."""
        return self.found.base if self.found else self.result.diagnosis.selection.best

    @property
    def component(self) -> type[Component]:
        """That model as a component."""
        return self.base.candidate.cls

    @property
    def causes(self) -> list[str]:
        """Effects that were named before the laws were asked."""
        return [effect_name(effect) for effect in self.base.candidate.effects]

    def effect(self, correction: Correction) -> str:
        """Name of a correction: that of the catalogue's effect which does the same, or ``LAW(SIGNAL)``."""
        if self.laws and self.laws.cause and correction is self.best:
            return self.laws.cause.effect_name
        return correction.model.effect_name

    def alike(self, correction: Correction) -> list[str]:
        """What this record cannot tell from a correction, what is nearest to the model first."""
        return list(
            dict.fromkeys(e.label for e in correction.alike if e.label != correction.entry.label)
        )

    def units(self, correction: Correction) -> tuple[str, str]:
        """Units of the law, or of its factor, and of the signal; SI."""
        entry = correction.entry
        law = "1" if entry.kind == "multiply" else plain_unit(unit_of(self.component, entry.law))
        return law, signal_unit(self.component, entry.signal)


def verdict(correction: Correction) -> bool | None:
    """Whether unseen data bear a correction out; None where they were not asked."""
    return correction.confirmed if correction.errors[0] else None


def refuted(correction: Correction) -> bool:
    """Whether unseen data surely speak against a correction."""
    return (
        correction.confirmation is not None and correction.confirmation.outcome is Outcome.REFUTED
    )


def named(signal: Signal) -> str:
    """A signal in words."""
    return _REMEMBERED.get(signal.memory, "{0}").format(signal.name, signal.constant)


def shape_estimates(correction: Correction) -> dict[str, Estimate]:
    """Parameters of the shape, or of the table, with their intervals: the amount first."""
    own, known = own_parameters(correction.model.effect), estimates(correction.model)
    return {name: known[name] for name in own if name in known}


def signal_of(effect: type[Effect]) -> tuple[str, Of]:
    """The law that a correction is of, and the signal."""
    given = vars(effect)["made_with"]
    of = next((one for one in given if isinstance(one, Of)), None)
    return given[0], of or Of(*given[1])


def table_of(effect: type[Effect]) -> tuple[Sequence[float], Sequence[float]]:
    """Knots and values of a correction that is a table."""
    knots, values = [one for one in vars(effect)["made_with"][2:] if isinstance(one, tuple | list)]
    return knots, values


def formula(correction: Correction) -> str:
    """The named shape as a formula of x, without what is remarked on it; empty where there is none."""
    text = correction.model.effect.term.shape if correction.shape else ""
    return text and text.removesuffix(f", {taken_apart(text).remark}")


def shape_width(correction: Correction) -> float | None:
    """Where the named shape bends, in the unit of its signal; None where it has no width."""
    return _values(correction).get(f"{correction.model.effect.neutral}_width")


def _values(correction: Correction) -> dict[str, float]:
    return correction.model.problem.start | correction.model.fit.values


def shape_form(correction: Correction) -> Callable[[Array], Array] | None:
    """The named shape as it was fitted, over values of its signal; None where there is none."""
    if not correction.shape:
        return None
    shape, effect = SHAPES[correction.shape], correction.model.effect
    values, own, of = _values(correction), effect.neutral, signal_of(effect)[1]
    amount, width, beside = (
        values[own],
        values.get(f"{own}_width", 1.0),
        values.get(f"{own}_beside", 0.0),
    )
    return lambda x: np.array(
        [amount * (float(shape.form(float(v), width, of.scale)) + beside) for v in x - of.zero]
    )


def shape_values(correction: Correction, x: Array) -> Array | None:
    """The named shape over values of its signal, as it was fitted, beside the straight line that is nearest.

    A straight part is what the model's own parameters can do too, and they are others beside the curve.
    """
    if (form := shape_form(correction)) is None:
        return None
    knots, (curve, low, high) = np.asarray(correction.entry.basis.knots), correction.band
    weight = 1.0 / np.maximum(high - low, 1e-9 * max(float(np.ptp(curve)), 1e-300))
    line = np.polyfit(knots, curve - form(knots), min(1, len(knots) - 1), w=weight)
    return np.asarray(form(x) + np.polyval(line, x))


def signal_unit(component: type[Component], signal: Signal) -> str:
    """SI unit of a signal, or of what is remembered of it."""
    unit = Of(
        signal.name, signal.memory, signal.constant, plain_unit(unit_of(component, signal.name))
    ).unit_of_memory
    return re.sub(r"\((\w+)\)", r"\1", unit)  # one unit alone needs no brackets


def with_unit(value: float, unit: str) -> str:
    """A value of three digits with its unit."""
    return f"{value:.3g}" if unit == "1" else f"{value:.3g} {unit}"


def plain_unit(unit: str) -> str:
    """Call a product of base units as engineers do: N*m for kg*m^2*rad/s^2, in which the angle tells a torque."""
    if "kg" not in unit:
        return unit
    torque = "rad" in unit
    one = registry().Quantity(
        1.0, registry().Unit(unit.replace("rad", "dimensionless") if torque else unit)
    )
    for name in _PLAIN:
        if name == ("J" if torque else "N*m"):
            continue
        other: Any = registry().Quantity(1.0, name)
        if (
            other.dimensionality == one.dimensionality
            and abs(other.to(one.units).magnitude - 1.0) < 1e-9
        ):
            return name
    return unit
