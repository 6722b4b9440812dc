"""What was asked of a model's laws, and what is told of a correction wherever it is told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit import Component, Effect
from fmus.kit.corrections import Of
from fmus.kit.curves import SHAPES
from fmus.kit.units import registry
from orchestration.discrepancy.candidates.candidate import own_parameters
from orchestration.discrepancy.laws.discovery import Correction, LawMapResult, unit_of
from orchestration.discrepancy.laws.map import Entry
from orchestration.discrepancy.laws.signals import Signal
from orchestration.discrepancy.pipeline import Result
from orchestration.discrepancy.validation.confirmation import Outcome
from orchestration.discrepancy.validation.estimates import estimates
from orchestration.identify.estimate import Estimate

Array = NDArray[np.float64]
_ALIKE, _LISTED = 0.99, 5  # correlation of what corrections do, from which on a record cannot tell them apart
_PLAIN = ("N", "N*m", "V", "A", "W", "J", "Pa", "ohm", "C", "N/m")  # as engineers call them
_REMEMBERED = {
    "": "{0}", "lagged": "{0} lagged by {1:.3g} s", "leading": "{0} less itself lagged by {1:.3g} s",
    "heat": "the square of {0} lagged by {1:.3g} s",
    "integrated": "the integral of {0}", "throughput": "the integral of |{0}|",
}  # fmt: skip


@dataclass(frozen=True)
class Asked:
    """A look at a model, and at its laws.

    Attributes
    ----------
    result : Result
        Of the model as a whole.
    found : LawMapResult or None
        Of its laws; None where no input moves, so that nothing can be asked.
    """

    result: Result
    found: LawMapResult | None

    @property
    def corrections(self) -> list[Correction]:
        """Best first."""
        return self.found.corrections if self.found else []

    @property
    def best(self) -> Correction | None:
        """The one that is judged on unseen data, if there is any."""
        return next(iter(self.corrections), None)

    @property
    def component(self) -> type[Component]:
        """The model that was asked, with the effects that were named."""
        return self.result.diagnosis.selection.best.candidate.cls

    def alike(self, correction: Correction) -> list[str]:
        """What does so nearly the same to the outputs that this record cannot tell it from a correction."""
        entry, entries = correction.entry, self.found.entries if self.found else []
        near = [e for e in entries if e is not entry and _correlation(e, entry) >= _ALIKE]
        return list(dict.fromkeys(e.label for e in near if e.label != entry.label))[:_LISTED]

    def units(self, correction: Correction) -> tuple[str, str]:
        """Units of the law, or of its factor, and of the signal; SI."""
        entry = correction.entry
        law = "1" if entry.kind == "multiply" else plain_unit(unit_of(self.component, entry.law))
        return law, signal_unit(self.component, entry.signal)


def _correlation(a: Entry, b: Entry) -> float:
    return abs(float(a.direction @ b.direction)) if a.direction.shape == b.direction.shape else 0.0


def verdict(correction: Correction) -> bool | None:
    """Whether unseen data bear a correction out; None where they were not asked."""
    return correction.confirmed if correction.errors[0] else None


def refuted(correction: Correction) -> bool:
    """Whether unseen data surely speak against a correction."""
    return correction.confirmation is not None and correction.confirmation.outcome is Outcome.REFUTED


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


def formula(shape: str) -> str:
    """A shape as a formula of x."""
    return SHAPES[shape].text


def shape_values(correction: Correction, x: Array) -> Array | None:
    """The named shape over values of its signal, as it was fitted, beside the straight line that is nearest.

    A straight part is what the model's own parameters can do too, and they are others beside the curve.
    """
    if not correction.shape:
        return None
    shape, effect = SHAPES[correction.shape], correction.model.effect
    values = correction.model.problem.start | correction.model.fit.values
    of = signal_of(effect)[1]
    width = values.get(f"{effect.neutral}_width", 1.0)

    def form(at: Array) -> Array:
        return np.array([values[effect.neutral] * float(shape.form(float(one), width, of.scale)) for one in at])

    knots, (curve, low, high) = np.asarray(correction.entry.basis.knots), correction.band
    weight = 1.0 / np.maximum(high - low, 1e-9 * max(float(np.ptp(curve)), 1e-300))
    line = np.polyfit(knots, curve - form(knots), min(1, len(knots) - 1), w=weight)
    return np.asarray(form(x) + np.polyval(line, x))


def signal_unit(component: type[Component], signal: Signal) -> str:
    """SI unit of a signal, or of what is remembered of it."""
    return Of(signal.name, signal.memory, signal.constant, plain_unit(unit_of(component, signal.name))).unit_of_memory


def plain_unit(unit: str) -> str:
    """Call a product of base units as engineers do: N*m for kg*m^2*rad/s^2, in which the angle tells a torque."""
    if "kg" not in unit:
        return unit
    torque = "rad" in unit
    one = registry().Quantity(1.0, registry().Unit(unit.replace("rad", "dimensionless") if torque else unit))
    for name in _PLAIN:
        if name == ("J" if torque else "N*m"):
            continue
        other: Any = registry().Quantity(1.0, name)
        if other.dimensionality == one.dimensionality and abs(other.to(one.units).magnitude - 1.0) < 1e-9:
            return name
    return unit
