"""Corrections of a model's laws on a record, with what every form of report derives from them."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fmus.kit import Component, Effect
from fmus.kit.arrays import Array
from fmus.kit.corrections import SignalTerm
from fmus.kit.curves import SHAPES
from fmus.kit.effects import effect_name, made_with
from fmus.kit.titles import effect_title, in_words, law_title, within_sentence
from fmus.kit.units import base_unit, write_prefixed
from orchestration.discrepancy.candidates import FittedCandidate, own_parameters
from orchestration.discrepancy.law_corrections import LawSearch
from orchestration.discrepancy.laws import Correction, LawMapResult, LawSignal, unit_of
from orchestration.discrepancy.pipeline import Result
from orchestration.discrepancy.validation import Outcome, parameter_estimates
from orchestration.identify.uncertainty import Estimate

_PLAIN_UNITS = ("N", "N*m", "V", "A", "W", "J", "Pa", "ohm", "C", "N/m")  # as engineers call them
_SIGNAL_WORDS = {  # by what is remembered of a signal; takes its name and a time constant
    "": "{0}",
    "lagged": "{0} lagged by {1:.3g} s",
    "leading": "{0} less itself lagged by {1:.3g} s",
    "heat": "the square of {0} lagged by {1:.3g} s",
    "integrated": "the integral of {0}",
    "throughput": "the integral of |{0}|",
}


@dataclass(frozen=True)
class LawReport:
    """Corrections of a model's laws, beside the diagnosis of the model as a whole.

    Attributes
    ----------
    result : Result
        Of the model as a whole.
    laws : LawSearch or None
        Corrections of its laws; None where no input moves, so that none can be judged.
    """

    result: Result
    laws: LawSearch | None

    @property
    def found(self) -> LawMapResult | None:
        """Map of laws over signals, and the corrections that were fitted."""
        return self.laws.found if self.laws else None

    @property
    def corrections(self) -> list[Correction]:
        """Corrections that were fitted, the best first."""
        return self.found.corrections if self.found else []

    @property
    def best(self) -> Correction | None:
        """The correction that is judged on unseen data, if there is any."""
        return next(iter(self.corrections), None)

    @property
    def rounds(self) -> list[LawReport]:
        """The report itself, and those of the searches after each correction that was confirmed."""
        beside = self.laws.beside if self.laws else None
        if beside is None:
            return [self]
        return [self, *LawReport(self.result, beside).rounds]

    @property
    def final_model(self) -> FittedCandidate:
        """The model with all corrections that were confirmed, or with the effects named before."""
        for law_report in reversed(self.rounds):
            if law_report.laws and law_report.laws.cause:
                return law_report.laws.cause
        return self.base_model

    def correction_values(self, model: FittedCandidate) -> dict[str, float]:
        """Return parameters of the best correction in a model that has the same from a catalogue.

        Parameters
        ----------
        model : FittedCandidate
            With the catalogue's effect, whose parameters have other names.

        Returns
        -------
        dict of str to float
            By the names of the correction's own parameters; empty if there is no such effect.
        """
        cause = self.laws.cause if self.laws else None
        if self.best is None or cause is None:
            return {}
        own_names = own_parameters(self.best.model.effect)
        catalogue_names = own_parameters(cause.effect)
        values = model.parameters
        return {
            own: values[name]
            for own, name in zip(own_names, catalogue_names, strict=False)
            if name in values
        }

    @property
    def relaxations(self) -> list[tuple[float, float]]:
        """Time constants, s, and amounts of relaxations beside each other, by time constants."""
        relaxations = []
        for law_report in self.rounds:
            if law_report.best is not None and law_report.best.relaxation:
                amount, constant = law_report.correction_values(self.final_model).values()
                relaxations.append((constant, amount))
        return sorted(relaxations)

    @property
    def base_model(self) -> FittedCandidate:
        """The model whose laws were judged, with the effects named before."""
        return self.found.base if self.found else self.result.diagnosis.selection.best

    @property
    def component(self) -> type[Component]:
        """The base model as a component."""
        return self.base_model.candidate.cls

    @property
    def causes(self) -> list[str]:
        """Effects that were named before the laws were judged."""
        return [effect_name(effect) for effect in self.base_model.candidate.effects]

    @property
    def cause_titles(self) -> list[str]:
        """Their names for people, as they stand in a sentence."""
        effects = self.base_model.candidate.effects
        return [within_sentence(effect_title(effect)) for effect in effects]

    def law_title(self, correction: Correction) -> str:
        """Return the name for people of the law that a correction changes."""
        return law_title(self.component, correction.entry.law)

    def effect_name(self, correction: Correction) -> str:
        """Return the name of an equivalent effect of the catalogue, or else ``LAW(SIGNAL)``."""
        if self.laws and self.laws.cause and correction is self.best:
            return self.laws.cause.effect_name
        return correction.model.effect_name

    def indistinguishable(self, correction: Correction) -> list[str]:
        """Return labels of what this record cannot tell from a correction, the nearest first."""
        labels = [e.label for e in correction.alike if e.label != correction.entry.label]
        return list(dict.fromkeys(labels))

    def units(self, correction: Correction) -> tuple[str, str]:
        """Return the SI units of the law, or of its factor, and of the signal."""
        entry = correction.entry
        law = "1" if entry.kind == "multiply" else plain_unit(unit_of(self.component, entry.law))
        return law, signal_unit(self.component, entry.signal)


def is_confirmed(correction: Correction) -> bool | None:
    """Return whether unseen data bear a correction out; None where it was not held against them."""
    return correction.confirmed if correction.errors[0] else None


def is_refuted(correction: Correction) -> bool:
    """Return whether unseen data surely speak against a correction."""
    confirmation = correction.confirmation
    return confirmation is not None and confirmation.outcome is Outcome.REFUTED


def describe_signal(signal: LawSignal) -> str:
    """Return a signal, or what is remembered of it, in words."""
    words = _SIGNAL_WORDS.get(signal.memory, "{0}")
    return words.format(in_words(signal.name), signal.constant)


def shape_estimates(correction: Correction) -> dict[str, Estimate]:
    """Return the parameters of the shape, or of the table, with their intervals: amount first."""
    estimates = parameter_estimates(correction.model)
    own_names = own_parameters(correction.model.effect)
    return {name: estimates[name] for name in own_names if name in estimates}


def law_and_signal(effect: type[Effect]) -> tuple[str, SignalTerm]:
    """Return the law that a correction changes, and the signal that it depends on."""
    given = made_with(effect)
    return given["law"], given["signal"]


def knots_and_values(effect: type[Effect]) -> tuple[Sequence[float], Sequence[float]]:
    """Return knots and values of a correction that is a table."""
    table = made_with(effect)["shape"]
    return table.knots, table.values


def shape_formula(correction: Correction) -> str:
    """Return the named shape as a formula of x, without its remark; empty where there is none."""
    if not correction.shape:
        return ""
    remark = r", [^()]*$"  # after a comma outside of brackets
    return re.sub(remark, "", correction.model.effect.term.shape)


def shape_width(correction: Correction) -> float | None:
    """Return where the named shape bends, in the unit of its signal; None if it has no width."""
    return correction.model.parameters.get(f"{correction.model.effect.neutral}_width")


def fitted_shape(correction: Correction) -> Callable[[Array], Array] | None:
    """Return the named shape, as it was fitted, as a function of its signal.

    Returns
    -------
    callable or None
        Of values of the signal, shape (n,), SI; None where the correction is a table.
    """
    if not correction.shape:
        return None
    shape = SHAPES[correction.shape]
    effect = correction.model.effect
    values = correction.model.parameters
    amount = values[effect.neutral]
    width = values.get(f"{effect.neutral}_width", 1.0)
    constant = values.get(f"{effect.neutral}_beside", 0.0)
    _, signal = law_and_signal(effect)

    def evaluate(x: Array) -> Array:
        return np.array(
            [
                amount * (float(shape.form(float(v), width, signal.scale)) + constant)
                for v in x - signal.zero
            ]
        )

    return evaluate


def shape_beside_line(correction: Correction, x: Array) -> Array | None:
    """Return the named shape as it was fitted, beside the straight line nearest to the curve.

    A straight part is what the model's own parameters can do too, and they are others beside the
    curve.

    Parameters
    ----------
    correction : Correction
    x : ndarray, shape (n,)
        Values of the signal, SI.

    Returns
    -------
    ndarray, shape (n,), or None
        None where the correction is a table.
    """
    shape = fitted_shape(correction)
    if shape is None:
        return None
    knots = np.asarray(correction.entry.basis.knots)
    curve, low, high = correction.band
    weight = 1.0 / np.maximum(high - low, 1e-9 * max(float(np.ptp(curve)), 1e-300))
    line = np.polyfit(knots, curve - shape(knots), min(1, len(knots) - 1), w=weight)
    return np.asarray(shape(x) + np.polyval(line, x))


def signal_unit(component: type[Component], signal: LawSignal) -> str:
    """Return the SI unit of a signal, or of what is remembered of it."""
    unit = plain_unit(unit_of(component, signal.name))
    remembered = SignalTerm(signal.name, signal.memory, signal.constant, unit).unit_of_memory
    return re.sub(r"\((\w+)\)", r"\1", remembered)  # one unit alone needs no brackets


def format_with_unit(value: float, unit: str) -> str:
    """Return a value of three digits with its unit."""
    return write_prefixed(value, unit)


def plain_unit(unit: str) -> str:
    """Return a product of base units as engineers call it: N*m for kg*m^2*rad/s^2.

    An angle in the product tells a torque from an energy.
    """
    if "kg" not in unit:
        return unit
    is_torque = "rad" in unit
    known = base_unit(unit)
    exponents = {base: power for base, power in known.exponents.items() if base != "rad"}
    for name in _PLAIN_UNITS:
        if name == ("J" if is_torque else "N*m"):
            continue
        plain = base_unit(name)
        if plain.exponents == exponents and abs(plain.factor / known.factor - 1.0) < 1e-9:
            return name
    return unit
