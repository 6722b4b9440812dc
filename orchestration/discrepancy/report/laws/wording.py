"""Sentences on what the laws of a model lack, in the words of an engineer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.corrections import correction as make_correction
from fmus.kit.curves import SHAPES
from fmus.kit.effects import effect_name, made_by
from fmus.kit.titles import capitalised, effect_title, in_words, within_sentence
from fmus.kit.units import printed
from orchestration.discrepancy.laws import Correction, LawSignal, unit_of
from orchestration.discrepancy.pipeline import Result
from orchestration.discrepancy.report import wording
from orchestration.discrepancy.report.laws.law_report import (
    LawReport,
    describe_signal,
    fitted_shape,
    format_with_unit,
    is_confirmed,
    is_refuted,
    law_and_signal,
    plain_unit,
    shape_estimates,
    shape_formula,
    shape_width,
    signal_unit,
)
from orchestration.discrepancy.report.wording import Answer, format_move
from orchestration.identify.uncertainty import Estimate
from orchestration.reporting import format_percent, option

_NOTHING = "No law is found to lack anything."
_LETTERS = {"": "a", "_width": "w", "_beside": "b"}  # by what the name of a parameter ends with
_SHAPES = {
    "linear": "a straight line",
    "asymmetric": "a magnitude",
    "quadratic": "a square",
    "odd_quadratic": "a square with the sign of its signal",
    "cubic": "a cube",
    "quartic": "a fourth power",
    "saturating": "a saturation",
    "sign": "a sign",
    "exponential": "an exponential",
    "square_root": "a square root",
    "stribeck": "Stribeck's curve",
    "stops": "a stop on either side",
    "weir": "a weir",
    "upper_stop": "a stop above",
    "lower_stop": "a stop below",
    "sign_beyond": "a sign beyond a dead zone",
    "levelling": "a line with a flat middle",
}
# by shape whose width is a place, not a distance from zero on either side: where that is
_SIDES = {"weir": 1.0, "upper_stop": 1.0, "lower_stop": -1.0}
# ratio of the effects at both ends of a signal, from which on that at the upper end is stated
_AS_LARGE = 0.9
_BROAD = 10.0  # ratio of the time constants of a spectrum, from which on it is broad
_WIDE = 0.5  # of what the curve spans, from which on its band is wide


def headline(result: Result) -> Answer:
    """Return the verdict, in which a law that lacks something is told by its shape.

    What is not among the causes, because unseen data do not confirm it, comes after them.
    """
    law_report = LawReport(result, result.laws)
    found = wording.headline(result, _phrases(law_report))
    return found._replace(support=(*found.support, *_beside_verdict(law_report)))


def _phrases(law_report: LawReport) -> dict[str, str]:
    """Return what is said of every correction that was confirmed, by the name of its effect."""
    phrases = {}
    for each in law_report.rounds:
        cause = each.laws.cause if each.laws else None
        if each.best is not None and cause is not None and made_by(cause.effect) is make_correction:
            quantities = describe_quantities(each, each.best)
            looks = shape_name(each.best.shape) if each.best.shape else "no simple shape"
            phrases[each.effect_name(each.best)] = f"it looks like {looks}, and {quantities}"
    return phrases


def _beside_verdict(law_report: LawReport) -> list[str]:
    """Return sentences on laws that the verdict does not have: what may lack, what was replaced."""
    named = law_report.result.diagnosis.causes
    sentences = [
        _round_sentence(each)
        for each in law_report.rounds
        if each.best is not None and each.effect_name(each.best) not in named
    ]
    replaced = [
        within_sentence(effect_title(effect))
        for effect in law_report.base_model.candidate.effects
        if effect_name(effect) not in named
    ]
    if law_report.best is not None and replaced:
        sentences.append(f"This takes the place of {' and '.join(replaced)}.")
    return [*sentences, *filter(None, [_relaxations_sentence(law_report)])]


def sentence(law_report: LawReport) -> str:
    """Return what the laws lack, with what unseen data say of it."""
    rounds = [_round_sentence(each) for each in law_report.rounds]
    parts = [*rounds, _relaxations_sentence(law_report)]
    return " ".join(part for part in parts if part)


def _relaxations_sentence(law_report: LawReport) -> str:
    """Return what several relaxations are together; empty if there are not several."""
    relaxations = law_report.relaxations
    if len(relaxations) < 2 or law_report.best is None:
        return ""
    law, signal = law_report.units(law_report.best)
    unit = printed(law if signal == "1" else f"{law}/{signal}")
    parts = [f"{amount:.3g} {unit} at {constant:.3g} s" for constant, amount in relaxations]
    text = f"Together these are relaxations of {', '.join(parts[:-1])} and {parts[-1]}"
    shortest, _ = relaxations[0]
    longest, _ = relaxations[-1]
    if len(relaxations) > 2 and longest > _BROAD * shortest:
        return f"{text}: a broad spectrum, such as diffusion has."
    return f"{text}."


def _round_sentence(law_report: LawReport) -> str:
    """Return what the laws lack beside the effects that the model has already."""
    if law_report.found is None:
        return wording.INCONCLUSIVE
    best = law_report.best
    causes = law_report.cause_titles
    if best is None:
        if not causes:
            return _NOTHING
        return f"Beside {' and '.join(causes)}: {_NOTHING[:1].lower()}{_NOTHING[1:]}"
    beside = f"Beside {' and '.join(causes)}: " if causes else ""
    law = law_report.law_title(best)
    signal = describe_signal(best.entry.signal)
    factor = ", as a factor" if best.entry.kind == "multiply" else ""
    shape = describe_shape(law_report, best)
    if is_confirmed(best):
        text = (
            f"{beside}{law} depends on {signal}{factor} beyond what the model has: {shape};"
            f" {describe_errors(best)}."
        )
    else:
        outcome = "speak against it" if is_refuted(best) else "tell too little of it"
        text = (
            f"{beside}{law} over {signal}{factor} would be worth looking at ({shape}), but"
            f" {wording.UNSEEN} {outcome}."
        )
    return capitalised(text)


def describe_shape(law_report: LawReport, correction: Correction) -> str:
    """Return which shape a correction has, in quantities that mean something."""
    quantities = describe_quantities(law_report, correction)
    if not correction.shape:
        return f"it looks like no simple shape, is given as a curve, and {quantities}"
    return (
        f"it looks like {shape_name(correction.shape)}, which {quantities} "
        f"({shape_formula(correction)} with {describe_shape_parameters(law_report, correction)})"
    )


def describe_quantities(law_report: LawReport, correction: Correction) -> str:
    """Return where a correction bends, and its effect where the record goes farthest.

    Parameters
    ----------
    law_report : LawReport
    correction : Correction

    Returns
    -------
    str
        Such as ``levels off beyond about 2.1 rad/s, and makes 0.0098 N*m more at 95 rad/s``.
    """
    bend = _describe_bend(law_report, correction)
    effect = _describe_effect(law_report, correction)
    return f"{bend}, and {effect}" if bend else effect


def _describe_effect(law_report: LawReport, correction: Correction) -> str:
    """Return what a correction makes of its law at that end of its signal where it is largest."""
    law, signal = law_report.units(correction)
    entry = correction.entry
    ends = np.array([entry.visited.min(), entry.visited.max()])
    effects = _evaluate(correction, ends)
    farthest = 1 if abs(effects[1]) >= _AS_LARGE * abs(effects[0]) else 0
    amount = float(effects[farthest])
    share = f"{100.0 * abs(amount):.3g} %"
    size = share if entry.kind == "multiply" else format_with_unit(abs(amount), law)
    place = format_with_unit(float(ends[farthest]), signal)
    return f"makes {size} {'less' if amount < 0.0 else 'more'} at {place}"


def _evaluate(correction: Correction, x: Array) -> Array:
    """Return the correction, its shape or else its curve, at values of its signal, shape (n,)."""
    shape = fitted_shape(correction)
    if shape is not None:
        return shape(x)
    return np.interp(x, correction.entry.basis.knots, correction.band[0])


def _describe_bend(law_report: LawReport, correction: Correction) -> str:
    """Return where the shape of a correction bends; empty if it has no such place."""
    template = SHAPES[correction.shape].bend if correction.shape else ""
    width = shape_width(correction)
    if not template or width is None:
        return ""
    _, unit = law_report.units(correction)
    zero = law_and_signal(correction.model.effect)[1].zero
    side = _SIDES.get(correction.shape, 0.0)
    bend = template.format(format_with_unit(zero + side * width if side else width, unit))
    if zero and not side and correction.shape != "exponential":
        return f"{bend} from {format_with_unit(zero, unit)}"
    return bend


def shape_name(shape: str) -> str:
    """Return a shape in words."""
    return _SHAPES.get(shape, shape.replace("_", " "))


def describe_shape_parameters(law_report: LawReport, correction: Correction) -> str:
    """Return the fitted parameters of a shape: ``a = 0.01 N*m, w = 2 rad/s and a lag of 0.7 s``.

    The letters are those of the formula of the shape.
    """
    switch = correction.model.effect.neutral
    texts = []
    for name, e in shape_estimates(correction).items():
        value = format_with_unit(e.value, parameter_unit(law_report, correction, e))
        letter = _LETTERS.get(name.removeprefix(switch))
        texts.append(f"a lag of {value}" if letter is None else f"{letter} = {value}")
    zero = law_and_signal(correction.model.effect)[1].zero
    if zero and correction.shape:
        _, unit = law_report.units(correction)
        texts.append(f"x counted from {zero:g}{_unit_suffix(unit)}")
    if not texts:
        return "what it was given"
    return _join_with_and(texts)


def _join_with_and(texts: Sequence[str]) -> str:
    if len(texts) == 1:
        return texts[0]
    return f"{', '.join(texts[:-1])} and {texts[-1]}"


def _unit_suffix(unit: str) -> str:
    return "" if unit == "1" else f" {printed(unit)}"


def parameter_unit(law_report: LawReport, correction: Correction, e: Estimate) -> str:
    """Return the unit of a parameter, with the law's own in it called as engineers do."""
    law_unit = unit_of(law_report.component, correction.entry.law)
    plain = plain_unit(law_unit)
    if plain == law_unit:
        return e.unit
    bracketed = f"({plain})" if "/" in plain else plain
    return e.unit.replace(f"({law_unit})", bracketed).replace(law_unit, plain)


def describe_errors(correction: Correction) -> str:
    """Return the error that falls most, on data that no fit has seen."""
    before, after = correction.errors
    output = max(before, key=lambda o: (before[o] - after[o]) / (before[o] or 1.0))
    moves = format_move(before[output], after[output])
    return f"on {wording.UNSEEN} the error of {in_words(output)} {moves}"


def unseen_data_outcome(correction: Correction) -> str:
    """Return what unseen data say of a correction, in a word."""
    if is_refuted(correction):
        return "refuted"
    return {True: "confirmed", False: "not confirmed", None: "not asked"}[is_confirmed(correction)]


def describe_smoothing(law_report: LawReport) -> str:
    """Return a further sentence on noise of inputs that was smoothed away; empty if none was."""
    deviations = law_report.laws.noise if law_report.laws else {}
    if not deviations:
        return ""
    texts = []
    for name, deviation in deviations.items():
        unit = signal_unit(law_report.component, LawSignal(name))
        texts.append(f"{name} ({format_with_unit(deviation, unit)})")
    return (
        f" Noise on {' and '.join(texts)}, which the outputs do not follow, was smoothed away"
        " before."
    )


def next_steps(law_report: LawReport) -> list[str]:
    """Return advice on what to do with the corrections, a sentence or two each."""
    best = law_report.best
    if law_report.found is None:
        return [
            "Take a record in which the inputs move: a law that is never exercised cannot be asked"
            " anything."
        ]
    if best is None:
        return [
            "The laws need nothing. If ppy diagnose is not content either, look at the sensors,"
            " and at signals that act on the specimen and that the model does not have."
        ]
    signal = best.entry.signal.name
    indistinguishable = law_report.indistinguishable(best)
    if is_confirmed(best):
        steps = [
            f"Go on with it: {option('effect_out', 'law.py')} writes it as a class of a few lines"
            f" to lay over the model, and {option('fmu', 'better.fmu')} the model with it."
        ]
    else:
        steps = [
            f"Do not build on it yet. Take another record in which {signal} goes through"
            f" the same range, and give it as {option('holdout')}: what is real is there again."
        ]
    if indistinguishable:
        steps.append(
            f"This record cannot tell it from {', '.join(indistinguishable)}. Move the inputs so"
            " that these signals go different ways, or ask which of them makes sense."
        )
    if not best.shape:
        steps.append(
            f"Look up which law has such a curve over {signal}. The table holds where"
            " the record has been, and goes straight on beyond."
        )
    steps += _advice_on_wide_band(law_report, best)
    if len(law_report.corrections) > 1:
        steps.append(
            "Corrections further down the table stand instead of the first one, not beside it: ask"
            " again with the first one laid over the model."
        )
    return steps


def _advice_on_wide_band(law_report: LawReport, best: Correction) -> list[str]:
    """Return where the record tells little of the curve, if it tells more elsewhere."""
    curve, low, high = best.band
    knots = np.asarray(best.entry.basis.knots)
    wide = knots[(high - low) > _WIDE * max(float(np.ptp(curve)), 1e-300)]
    if not len(wide) or len(wide) == len(knots):
        return []
    _, unit = law_report.units(best)
    span = f"{wide.min():.3g} to {wide.max():.3g}" if len(wide) > 1 else f"{wide[0]:.3g}"
    return [
        f"The band is wide at {span}{_unit_suffix(unit)}: stay there for longer in the next record."
    ]


def error_rows(best: Correction) -> list[list[str]]:
    """Return rows of an output and its errors on unseen data, without and with a correction."""
    before, after = best.errors
    return [
        [output, format_percent(before[output]), format_percent(after[output])] for output in before
    ]
