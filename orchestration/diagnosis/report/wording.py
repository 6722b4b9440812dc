"""A diagnosis in words, which terminal, page and JSON share; nothing is decided here."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from fmus.kit.units import format_value
from orchestration.diagnosis.cause import Cause
from orchestration.diagnosis.engine import Diagnosis
from orchestration.diagnosis.readings import Reading
from orchestration.diagnosis.remainder import Remainder
from orchestration.diagnosis.term_names import sentence
from orchestration.diagnosis.terms import Term
from orchestration.identify.uncertainty import Estimate
from orchestration.reporting import option
from orchestration.reporting.html import format_ends

_NUMBERS = ("no term", "one term", "two terms", "three terms", "four terms", "five terms")


def percent(share: float) -> str:
    """Return a probability in percent; neither 0 nor 100, which no record shows."""
    if share > 0.995:
        return "> 99 %"
    return "< 1 %" if share < 0.005 else f"{100.0 * share:.0f} %"


def error_text(share: float | None) -> str:
    """Return an error in percent of a spread."""
    return "" if share is None else f"{100.0 * share:.3g} %"


def number_of_terms(count: int) -> str:
    """Return a number of terms in words."""
    return _NUMBERS[count] if count < len(_NUMBERS) else f"{count} terms"


def cause_text(diagnosis: Diagnosis, cause: Cause) -> str:
    """Return the leading part of a cause for people."""
    return part_text(diagnosis, cause.parts[0])


def part_text(diagnosis: Diagnosis, part: Reading | Term) -> str:
    """Return a part of a cause for people: a term, or a fault of the files."""
    if isinstance(part, Reading):
        return f"{part.sentence} in {files(diagnosis)}"
    return sentence(diagnosis.subject.problem.model.cls, part)


def name(part: Reading | Term) -> str:
    """Return the name of a part of a cause: ``LAW(SIGNAL)``, or that of an effect."""
    return part.name if isinstance(part, Term) else str(part)


def files(diagnosis: Diagnosis) -> str:
    """Return the names of the files of a diagnosis."""
    records = (*diagnosis.records, *diagnosis.holdouts)
    return _listed(list(dict.fromkeys(record.source.name for record in records)))


def alias_lines(diagnosis: Diagnosis) -> list[str]:
    """Return a sentence for each effect of the catalogue that acts like laws."""
    return [
        f"{', '.join(cause.aliases)} acts like {cause_text(diagnosis, cause)} on this record, and"
        " is counted with it."
        for cause in diagnosis.causes
        if cause.aliases
    ]


def headline(diagnosis: Diagnosis) -> str:
    """Return the answer: causes with their probabilities, or what was found in their place."""
    if diagnosis.verdict == "consistent":
        return "nothing is missing that this record can show"
    if diagnosis.verdict == "recalibrate":
        return f"the laws hold with other values of {_listed(diagnosis.changed)}"
    if not diagnosis.causes:
        return "the model misses much, and no term that was tried explains it"
    parts = [f"{percent(c.probability)} {cause_text(diagnosis, c)}" for c in diagnosis.causes]
    other = 1.0 - sum(c.probability for c in diagnosis.causes)
    answer = "; ".join([*parts, f"{percent(other)} other"])
    return answer if diagnosis.is_named else f"no cause is sure; best guesses: {answer}"


def support(diagnosis: Diagnosis) -> str:
    """Return the effect on the error of samples that nobody chose by, and what is left."""
    before = diagnosis.errors(diagnosis.found.base)
    after = diagnosis.errors(diagnosis.final)
    known = [name for name, value in before.items() if value is not None]
    sentences = []
    if diagnosis.is_named and known:
        changes = [
            f"{name} {error_text(before[name])} → {error_text(after[name])}" for name in known
        ]
        sentences.append(f"Error on samples by which nothing was chosen: {', '.join(changes)}.")
    sentences += [remainder_sentence(one) for one in _largest_first(diagnosis.remainders)[:1]]
    return " ".join(sentences)


def noise_widths(one: Remainder) -> str:
    """Return the size of what is left in widths of the noise; empty without noise."""
    if one.noise_widths is None:
        return ""
    return f"{one.noise_widths:.1f}" if one.noise_widths < 10.0 else f"{one.noise_widths:.0f}"


def remainder_sentence(one: Remainder) -> str:
    """Return what is left of an output."""
    widths = noise_widths(one)
    noise = f", {widths} noise widths" if widths else ""
    pace = "slow" if one.is_slow else "fast"
    return (
        f"Left in {one.output}: {error_text(one.share)} of its spread{noise}, {pace}"
        f" (neighbouring samples correlate by {one.correlation:.2f})."
    )


def next_step(diagnosis: Diagnosis) -> str:
    """Return what to do next, for every verdict."""
    largest = _largest_first(diagnosis.remainders)
    output = largest[0].output if largest else "the output"
    if diagnosis.verdict == "consistent":
        return "use the model as it is; a record at another level tests it where this one did not."
    if diagnosis.verdict == "recalibrate":
        sets = [f"{n}={diagnosis.parameters[n].value:.4g}" for n in diagnosis.changed]
        return f"use the model with {', '.join(sets)}; {option('fmu', 'fitted.fmu')} builds it."
    if diagnosis.is_named and diagnosis.causes[0].reading is not None:
        return _next_of_misread(diagnosis, diagnosis.causes[0].reading)
    if diagnosis.verdict == "cause":
        more = ""
        if largest and largest[0].is_more_than_noise:
            more = f" What is left in {output} is more than noise: the terms are not all of it."
        return (
            f"build the extended model with {option('fmu', 'extended.fmu')}, and try it on a record"
            f" that it has not met.{more}"
        )
    if diagnosis.verdict == "ambiguous":
        return _next_of_ambiguous(diagnosis)
    return (
        f"look at the residual of {output} where it is largest, check signs, units and clocks of"
        f" the file, and compare with {option('engine', 'old')}."
    )


def _next_of_misread(diagnosis: Diagnosis, reading: Reading) -> str:
    """Return how to correct the files."""
    ways = " or ".join(one.correction for one in (reading, *reading.instead))
    check = "" if diagnosis.verdict == "cause" else "check how it was recorded: if so, "
    return (
        f"{check}{ways} in {files(diagnosis)}, and diagnose it again;"
        f" {option('fmu', 'fitted.fmu')} builds the model fitted to the corrected values."
    )


def _next_of_ambiguous(diagnosis: Diagnosis) -> str:
    """Return the experiment that would tell the causes of a group apart."""
    leads = [cause.parts[0] for cause in diagnosis.causes]
    terms = [part for part in leads if isinstance(part, Term)]
    signals = list(dict.fromkeys(t.signal or "the operating point" for t in terms))
    if len(signals) > 1:
        change = f"{_listed(signals)} do not move together, such as slow and fast, small and large"
    else:
        change = f"{signals[0]} reaches other levels and rates"
    return f"record a run in which {change}, and diagnose both records."


def quantity(diagnosis: Diagnosis, name: str, value: float) -> str:
    """Return a value of a parameter in its display unit."""
    declared = {p.name: p for p in diagnosis.subject.problem.model.parameters}
    base = name.partition("@")[0]
    if base in declared:
        return format_value(value, declared[base], 4)
    unit = diagnosis.parameters[name].unit
    return f"{value:.4g}" + ("" if unit == "1" else f" {unit}")


def interval(diagnosis: Diagnosis, name: str, estimate: Estimate) -> str:
    """Return an interval of 95 %; an open one says at least or at most."""
    low, high = estimate.interval
    if isfinite(low) and isfinite(high):
        return format_ends(quantity(diagnosis, name, low), quantity(diagnosis, name, high))
    if isfinite(low) and low != 0.0:
        return f"at least {quantity(diagnosis, name, low)}"
    if isfinite(high):
        return f"at most {quantity(diagnosis, name, high)}"
    return "not determined"


def _largest_first(remainders: Sequence[Remainder]) -> list[Remainder]:
    return sorted(remainders, key=lambda one: -one.share)


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
