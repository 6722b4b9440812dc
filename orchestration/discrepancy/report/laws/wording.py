"""What a model's laws lack, in the words of an engineer."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from orchestration.discrepancy.laws.discovery import Correction
from orchestration.discrepancy.laws.signals import Signal
from orchestration.discrepancy.report import wording
from orchestration.discrepancy.report.laws.asked import (
    Asked,
    formula,
    named,
    plain_unit,
    refuted,
    shape_estimates,
    signal_of,
    signal_unit,
    unit_of,
    verdict,
    with_unit,
)
from orchestration.discrepancy.report.laws.quantities import quantities
from orchestration.identify.estimate import Estimate

NOTHING = "No law is found to lack anything."
_LETTERS = {"": "a", "_width": "w", "_beside": "b"}  # by what the name of a parameter ends with
_NAMES = {
    "linear": "a straight line",
    "asymmetric": "a magnitude",
    "quadratic": "a square",
    "odd_quadratic": "a square with the sign of its signal",
    "cubic": "a cube",
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
_BROAD = 10.0  # ratio of the time constants of a spectrum, from which on it is broad
_WIDE = 0.5  # of what the curve spans, from which on its band is wide


def sentence(asked: Asked) -> str:
    """What was found, with what unseen data say of it."""
    return " ".join(filter(None, (*map(_sentence, asked.rounds), _spectrum(asked))))


def _spectrum(asked: Asked) -> str:
    """What several relaxations are together."""
    spectrum, best = asked.spectrum, asked.best
    if len(spectrum) < 2 or best is None:
        return ""
    law, signal = asked.units(best)
    unit = law if signal == "1" else f"{law}/{signal}"
    parts = [f"{amount:.3g} {unit} at {constant:.3g} s" for constant, amount in spectrum]
    broad = len(spectrum) > 2 and spectrum[-1][0] > _BROAD * spectrum[0][0]
    return f"Together these are relaxations of {', '.join(parts[:-1])} and {parts[-1]}" + (
        ": a broad spectrum, such as diffusion has." if broad else "."
    )


def _sentence(asked: Asked) -> str:
    best = asked.best
    if asked.found is None:
        return wording.sentence(asked.result.diagnosis)
    beside = f"Beside {' and '.join(asked.causes)}: " if asked.causes else ""
    if best is None:
        return beside + (f"{NOTHING[:1].lower()}{NOTHING[1:]}" if beside else NOTHING)
    entry = best.entry
    if verdict(best):
        factor = ", as a factor," if entry.kind == "multiply" else ""
        said = f"{entry.law} depends on {named(entry.signal)}{factor} beyond what the model has"
        return f"{beside}{said}: {looks(asked, best)}; {errors(best)}."
    why = f"data that no fit has seen {'speak against it' if refuted(best) else 'tell too little of it'}"
    return (
        f"{beside}{entry.law}{' as a factor' if entry.kind == 'multiply' else ''} over {named(entry.signal)} would be "
        f"worth looking at ({looks(asked, best)}), but {why}."
    )


def looks(asked: Asked, correction: Correction) -> str:
    """Which shape a correction has, in quantities that mean something."""
    comes_to = quantities(asked, correction)
    if not correction.shape:
        return f"it looks like no simple shape, is given as a curve, and {comes_to}"
    return (
        f"it looks like {shape_name(correction.shape)}, which {comes_to} "
        f"({formula(correction)} with {amounts(asked, correction)})"
    )


def shape_name(shape: str) -> str:
    """A shape in words."""
    return _NAMES.get(shape, shape.replace("_", " "))


def amounts(asked: Asked, correction: Correction) -> str:
    """Values of a shape: its amount a and its width w, and the lag of what is remembered."""
    own, texts = shape_estimates(correction), []
    for name, e in own.items():
        letter = _LETTERS.get(name.removeprefix(correction.model.effect.neutral), "a lag")
        unit = unit_text(asked, correction, e)
        texts.append(
            f"{letter}{' = ' if len(letter) == 1 else ' of '}{e.value:.3g}{f' {unit}' if unit != '1' else ''}"
        )
    zero = signal_of(correction.model.effect)[1].zero
    if zero and correction.shape:
        unit = asked.units(correction)[1]
        texts.append(f"x counted from {zero:g}{f' {unit}' if unit != '1' else ''}")
    return (
        ", ".join(texts[:-1]) + (" and " if len(texts) > 1 else "") + texts[-1]
        if texts
        else "what it was given"
    )


def unit_text(asked: Asked, correction: Correction, e: Estimate) -> str:
    """Unit of a parameter, the law's own in it called as engineers do."""
    whole = unit_of(asked.component, correction.entry.law)
    simple = plain_unit(whole)
    if simple == whole:
        return e.unit
    return e.unit.replace(f"({whole})", f"({simple})" if "/" in simple else simple).replace(
        whole, simple
    )


def errors(correction: Correction) -> str:
    """The error that falls most, on data that no fit has seen."""
    before, after = correction.errors
    output = max(before, key=lambda o: (before[o] - after[o]) / (before[o] or 1.0))
    moves = "falls" if after[output] < before[output] else "goes"
    return (
        f"on data that no fit has seen the error of {output} {moves} from {percent(before[output])} to "
        f"{percent(after[output])}"
    )


def percent(share: float) -> str:
    """A share with two digits."""
    value = 100.0 * share
    return f"{value:.0f} %" if value >= 100.0 else f"{value:.2g} %"


def said_of(correction: Correction) -> str:
    """What unseen data say of a correction, in a word."""
    if refuted(correction):
        return "refuted"
    return {True: "confirmed", False: "not confirmed", None: "not asked"}[verdict(correction)]


def smoothed(asked: Asked) -> str:
    """Which noise of inputs was smoothed away before, as a further sentence; empty where there is none."""
    noise = asked.laws.noise if asked.laws else {}
    several = [
        f"{name} ({with_unit(deviation, signal_unit(asked.component, Signal(name)))})"
        for name, deviation in noise.items()
    ]
    if not several:
        return ""
    return f" Noise on {' and '.join(several)}, which the outputs do not follow, was smoothed away before."


def next_steps(asked: Asked) -> list[str]:
    """What to do about it."""
    best = asked.best
    if asked.found is None:
        return [
            "Take a record in which the inputs move: a law that is never exercised cannot be asked anything."
        ]
    if best is None:
        return [
            "The laws need nothing. If ppy diagnose is not content either, look at the sensors, and at signals that "
            "act on the specimen and that the model does not have.",
        ]
    entry, alike, steps = best.entry, asked.alike(best), []
    if verdict(best):
        steps.append(
            "Go on with it: --effect-out law.py writes it as a class of a few lines to lay over the model, and "
            "--fmu better.fmu the model with it."
        )
    else:
        steps.append(
            f"Do not build on it yet. Take another record in which {entry.signal.name} goes through the same range, "
            "and give it as --holdout: what is real is there again."
        )
    if alike:
        steps.append(
            f"This record cannot tell it from {', '.join(alike)}. Move the inputs so that these signals go different "
            "ways, or ask which of them makes sense."
        )
    if not best.shape:
        steps.append(
            f"Look up which law has such a curve over {entry.signal.name}. The table holds where the record has been, "
            "and goes straight on beyond."
        )
    steps += _wide(asked, best)
    if len(asked.corrections) > 1:
        steps.append(
            "Corrections further down the table stand instead of the first one, not beside it: ask again "
            "with the first one laid over the model."
        )
    return steps


def _wide(asked: Asked, best: Correction) -> list[str]:
    """Where the record tells little of the curve."""
    values, low, high = best.band
    knots = np.asarray(best.entry.basis.knots)
    wide = knots[(high - low) > _WIDE * max(float(np.ptp(values)), 1e-300)]
    if not len(wide) or len(wide) == len(knots):
        return []
    unit = asked.units(best)[1]
    span = f"{wide.min():.3g} to {wide.max():.3g}" if len(wide) > 1 else f"{wide[0]:.3g}"
    return [
        f"The band is wide at {span}{f' {unit}' if unit != '1' else ''}: stay there for longer in the next record."
    ]


def error_rows(best: Correction) -> list[list[str]]:
    """Output, and its errors on unseen data before and after."""
    before, after = best.errors
    return [[output, percent(before[output]), percent(after[output])] for output in before]


def own_changes(asked: Asked, correction: Correction) -> Mapping[str, tuple[float, float]]:
    """The model's own parameters before and beside a correction."""
    fitted, base = correction.model.fit.values, asked.base.fit.values
    return {name: (base[name], fitted[name]) for name in base if name in fitted}
