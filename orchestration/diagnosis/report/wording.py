"""A diagnosis in words, which terminal, page and JSON share; nothing is decided here."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import isclose, isfinite

from fmus.kit.titles import law_title
from fmus.kit.units import format_value
from orchestration.diagnosis.cause import Cause
from orchestration.diagnosis.comparison import WEIGHTS
from orchestration.diagnosis.engine import Diagnosis
from orchestration.diagnosis.readings import Reading
from orchestration.diagnosis.remainder import Remainder
from orchestration.diagnosis.term_names import estimates, fed_laws, sentence, stems
from orchestration.diagnosis.terms import NamedTerm, Term
from orchestration.identify.effect_sizes import FittedSize, fitted_sizes
from orchestration.identify.uncertainty import Estimate
from orchestration.records.quality import FAULTS, Fault
from orchestration.reporting import option
from orchestration.reporting.html import format_ends

_HEADLINE = 80  # characters of causes in a headline, which is of two lines with all around them
_AT = 1e-6  # relative distance from a bound at which a search ends, and of a nominal value from 0
_NAMES = 4  # of parameters in a headline
CHANGES_MEANING = (
    "Changed is what differs significantly, and without which the model is worse on fitted samples"
    " and on others; unchanged, what does not, and differs at most by the bound (95 %); uncertain,"
    " what differs but is not needed there, or does as well in place of another. Gain is its share"
    " of the squared error that letting all values"
    " differ takes off."
)


LAW_MAP_MEANING = (
    "Gain is the log likelihood of the fitted samples that the best term of this law over this"
    " signal gains in the linear response of the model without terms, less what its parameters and"
    " its words cost, in nats. Laws that act alike are one, named by that which depends on the"
    " signal."
)


def error_meaning(diagnosis: Diagnosis) -> str:
    """Return what all errors are."""
    return (
        f"Errors are root mean squares of measured minus {_simulated(diagnosis)}, in percent of the"
        " standard deviation of the measurement, on samples by which nothing was fitted or chosen;"
        " they are slow if neighbouring samples correlate by more than 0.5."
    )


def _simulated(diagnosis: Diagnosis) -> str:
    """Return how outputs are simulated."""
    observer = diagnosis.observer
    if observer is None:
        return "simulated in a free run"
    return f"predicted by an observer with a memory of {observer.memory:.2g} s"


def runs(diagnosis: Diagnosis) -> str:
    """Return by which runs models are fitted and compared."""
    return "free runs" if diagnosis.observer is None else "predictions by an observer"


def percent(share: float) -> str:
    """Return a probability in percent; neither 0 nor 100, which no record shows."""
    if share > 0.995:
        return "> 99 %"
    return "< 1 %" if share < 0.005 else f"{100.0 * share:.0f} %"


def error_text(share: float | None) -> str:
    """Return an error in percent."""
    return "" if share is None else f"{100.0 * share:.3g} %"


def cause_text(diagnosis: Diagnosis, cause: Cause) -> str:
    """Return the leading part of a cause for people."""
    lead = cause.parts[0]
    cls = diagnosis.cls
    if isinstance(lead, Term) and lead.law in fed_laws(cls):
        return sentence(cls, lead, float(cause.judged.fit.values_of(lead)[0]))
    return part_text(diagnosis, lead)


def cause_with_size(diagnosis: Diagnosis, cause: Cause) -> str:
    """Return the leading part of a cause, and of an effect that says it how large it is."""
    texts = [size.text for size in sizes(diagnosis, cause)]
    return f"{cause_text(diagnosis, cause)}{': ' if texts else ''}{', '.join(texts)}"


def sizes(diagnosis: Diagnosis, cause: Cause) -> list[FittedSize]:
    """Return the sizes of a cause as they were fitted; empty if it is no effect that has any."""
    lead = cause.parts[0]
    if not isinstance(lead, NamedTerm):
        return []
    effect = diagnosis.subject.problem.model.effects[lead.effect]
    fitted = estimates(cause.judged.fit, stems(diagnosis.cls, cause.terms))
    declared = {p.name: p for p in effect.layout.parameters}
    return fitted_sizes(effect, fitted, declared)


def part_text(diagnosis: Diagnosis, part: Reading | Term) -> str:
    """Return a part of a cause for people: a term, or a fault of the files."""
    if isinstance(part, Reading):
        return f"{part.sentence} in {files(diagnosis)}"
    return sentence(diagnosis.cls, part)


def name(part: Reading | Term) -> str:
    """Return the name of a part of a cause: ``LAW(SIGNAL)``, or that of an effect."""
    return part.name if isinstance(part, Term) else str(part)


def files(diagnosis: Diagnosis) -> str:
    """Return the names of the files of a diagnosis."""
    records = (*diagnosis.records, *diagnosis.holdouts)
    return _listed(list(dict.fromkeys(record.source.name for record in records)))


def alias_lines(diagnosis: Diagnosis) -> list[str]:
    """Return a sentence for each cause that other laws are in other words."""
    return [
        f"Laws that act like {cause_text(diagnosis, cause)} on this record, and count with it:"
        f" {', '.join(cause.aliases)}."
        for cause in diagnosis.causes
        if cause.aliases
    ]


def answer(diagnosis: Diagnosis) -> str:
    """Return the answer, and what supports it."""
    return f"{headline(diagnosis)}. {support(diagnosis)}".strip()


def headline(diagnosis: Diagnosis) -> str:
    """Return the headline: causes with their probabilities, or what was found in their place."""
    if diagnosis.verdict == "consistent":
        return "nothing is missing that this record can show"
    if diagnosis.verdict == "recalibrate":
        starts = ["the start states"] if diagnosis.begins_elsewhere else []
        changed = [*starts, *diagnosis.changed]
        if len(changed) > _NAMES:
            changed[_NAMES - 1 :] = [f"{len(changed) - _NAMES + 1} others"]
        return f"the laws hold with other values of {_listed(changed)}"
    if not diagnosis.causes:
        return "the model misses something, and nothing that was tried explains it"
    other = 1.0 - sum(c.probability for c in diagnosis.causes)
    answer = f"{_leading(diagnosis)}; {percent(other)} something else"
    if diagnosis.is_named:
        return answer
    lead = "no cause explains enough" if _explain_too_little(diagnosis) else "no cause is sure"
    return f"{lead}; best guesses: {answer}"


def _explain_too_little(diagnosis: Diagnosis) -> bool:
    """Return whether best guesses are what is likeliest, and still leave most of the error."""
    return sum(cause.probability for cause in diagnosis.causes) >= WEIGHTS.group


def _leading(diagnosis: Diagnosis) -> str:
    """Return the causes with their probabilities, as many as two lines have room for."""
    parts: list[str] = []
    for k, cause in enumerate(diagnosis.causes):
        room = _HEADLINE - len("; ".join(parts))
        texts = (cause_with_size(diagnosis, cause), cause_text(diagnosis, cause))
        fitting = (text for text in texts if len(text) <= room)
        text = next(fitting, None if parts else texts[-1])
        if text is None:
            rest = sum(c.probability for c in diagnosis.causes[k:])
            return "; ".join([*parts, f"{percent(rest)} {len(diagnosis.causes) - k} others"])
        parts.append(f"{percent(cause.probability)} {text}")
    return "; ".join(parts)


def support(diagnosis: Diagnosis) -> str:
    """Return the effect on the error of samples that nobody chose by, and what is left."""
    after = diagnosis.errors_after
    changes = [
        f"{name} {error_text(before)} → {error_text(after[name])}"
        for name, before in diagnosis.errors_before.items()
        if before is not None
    ]
    sentences = []
    if diagnosis.is_named and changes:
        sentences.append(f"Error on unseen samples: {', '.join(changes)}.")
    sentences += [remainder_sentence(one) for one in _structured_first(diagnosis.remainders)[:1]]
    return " ".join(sentences)


def noise_widths(one: Remainder) -> str:
    """Return the size of what is left in widths of the noise; empty without noise."""
    if one.noise_widths is None:
        return ""
    return f"{one.noise_widths:.1f}" if one.noise_widths < 10.0 else f"{one.noise_widths:.0f}"


def fit_percent(error: float | None) -> float | None:
    """Return the share of an output that a model follows, by its error over the spread."""
    return None if error is None else 100.0 * (1.0 - error)


def remainder_sentence(one: Remainder) -> str:
    """Return what is left of an output."""
    widths = noise_widths(one)
    noise = f", {widths} noise widths" if widths else ""
    more = ": more than noise" if one.is_more_than_noise else ""
    known = f"{one.pace} (neighbouring samples correlate by {one.correlation:.2f}){more}"
    unknown = f"slow or fast ({one.pairs} pairs of neighbouring samples do not tell)"
    return (
        f"Left in {one.output}: {error_text(one.share)} of its standard deviation{noise},"
        f" {unknown if one.pace == 'unknown' else known}."
    )


def next_step(diagnosis: Diagnosis, written: Mapping[str, str] | None = None) -> str:
    """Return what to do next, for every verdict; a file that cannot be believed goes first.

    Parameters
    ----------
    diagnosis : Diagnosis
    written : Mapping of str to str, optional
        Files that are written with it, by the option that names them: what is done is not advised.
    """
    written = written or {}
    doubtful = {code for code in FAULTS if Fault(code).discredits} | _DOUBTFUL
    doubts = [text for code, _, text in diagnosis.notes if code in doubtful]
    if doubts:
        return (
            f"put the record right, and diagnose it again: {doubts[0]}. Until then this answer"
            " counts for little."
        )
    if diagnosis.is_named and diagnosis.causes[0].reading is not None:
        return _next_of_misread(diagnosis, diagnosis.causes[0].reading, written)
    return _NEXT[diagnosis.verdict](diagnosis, written)


def _next_of_consistent(diagnosis: Diagnosis, written: Mapping[str, str]) -> str:
    """Return how far the model may be used."""
    largest = max(diagnosis.remainders, key=lambda one: one.share, default=None)
    error = f", within {error_text(largest.share)} of {largest.output}" if largest else ""
    return (
        f"use the model as it is{error}; a record at other levels and rates tests it where this one"
        " does not."
    )


def _next_of_recalibrate(diagnosis: Diagnosis, written: Mapping[str, str]) -> str:
    """Return the values to use."""
    if diagnosis.begins_elsewhere:
        return _next_of_start(diagnosis, written)
    values = ", ".join(_settings(diagnosis, diagnosis.changed))
    model = _model_in(written)
    if model:
        return f"use the model with {values}: {model} has them."
    return f"use the model with {values}; {_built(diagnosis, 'fitted')} builds it."


def _settings(diagnosis: Diagnosis, names: Sequence[str]) -> list[str]:
    """Return fitted values as they are set, with the record that one is of alone."""
    texts = []
    for name in names:
        base, _, record = name.partition("@")
        of = f" in {record}" if record else ""
        texts.append(f"{base}={diagnosis.parameters[name].value:.4g}{of}")
    return texts


def _next_of_cause(diagnosis: Diagnosis, written: Mapping[str, str]) -> str:
    """Return how to use the extended model."""
    left = [one.output for one in diagnosis.remainders if one.is_more_than_noise]
    more = f" It does not explain all of {_listed(left)} yet." if left else ""
    model = _model_in(written)
    step = f"build the extended model with {_built(diagnosis, 'extended')}"
    if diagnosis.holdouts:
        return f"{f'use the extended model, {model}' if model else step}.{more}"
    record = "on a record that it has not seen"
    if "ssp" in written:
        return f"compare the corrected system, {model}, with a record that it has not seen.{more}"
    if model:
        return f"test the extended model {record}, with {option('model', model)}.{more}"
    return f"{step}, and test it {record}, with {option('holdout', 'NEW.csv')}.{more}"


def _model_in(written: Mapping[str, str]) -> str:
    """Return the file of the model with the answer; empty if none is written."""
    return written.get("fmu") or written.get("ssp") or ""


def _built(diagnosis: Diagnosis, name: str) -> str:
    """Return the option that builds a model: an FMU without equations is a part of a system."""
    of_equations = option("fmu", f"{name}.fmu")
    return str(of_equations if diagnosis.has_equations else option("ssp", f"{name}.ssp"))


def _next_of_misread(diagnosis: Diagnosis, reading: Reading, written: Mapping[str, str]) -> str:
    """Return how to correct the files."""
    ways = " or ".join(one.correction for one in (reading, *reading.instead))
    check = "" if diagnosis.verdict == "cause" else "check file and wiring; if it is so, "
    model = _model_in(written)
    fitted = f"{model} is" if model else f"{_built(diagnosis, 'fitted')} builds"
    if reading.dead_time and diagnosis.has_equations:
        return (
            f"it is a dead time, or the column is early: then {ways} ({files(diagnosis)}), and"
            f" diagnose it again; {fitted} the model with the dead time, which takes the values as"
            " they were recorded."
        )
    return (
        f"{check}{ways} ({files(diagnosis)}), and diagnose it again; {fitted} the model fitted to"
        " the corrected values."
    )


def _next_of_start(diagnosis: Diagnosis, written: Mapping[str, str]) -> str:
    """Return where the model is to start, and other values to use."""
    declared = diagnosis.subject.problem.model
    starts = [declared.parameters[i].name for i in declared.start_positions]
    # of several records each has its own
    estimates = [(n, diagnosis.parameters[n]) for n in starts if n in diagnosis.parameters]
    other = [n for n, e in estimates if not e.interval[0] <= e.nominal <= e.interval[1]]
    common = [name for name in diagnosis.changed if "@" not in name]
    sets = " ".join(str(option("set", text)) for text in _settings(diagnosis, [*other, *common]))
    ways = f"start the model there, with {sets}," if sets else "start the model where the run does"
    model = _model_in(written)
    built = f"{model} starts" if model else f"{_built(diagnosis, 'fitted')} builds it"
    return f"{ways} or begin a record at rest; {built} so."


def _next_of_ambiguous(diagnosis: Diagnosis, written: Mapping[str, str]) -> str:
    """Return the experiment that would tell the causes of a group apart."""
    told = f" {diagnosis.experiment.sentence}" if diagnosis.experiment else ""
    records = "both records" if len(diagnosis.records) == 1 else "all records"
    return f"{_experiment(diagnosis, written)}, and diagnose {records} together.{told}"


def _next_of_unexplained(diagnosis: Diagnosis, written: Mapping[str, str]) -> str:
    """Return where to look for what no term explains."""
    largest = _structured_first(diagnosis.remainders)
    output = largest[0].output if largest else "the output"
    look = (
        f"look where measured minus simulated of {output} is largest, and for an input that was not"
        " recorded"
    )
    if not diagnosis.causes:
        return f"{look}."
    if _explain_too_little(diagnosis):
        return f"{look}. What is missing is not among what was tried."
    told = f" {diagnosis.experiment.sentence}" if diagnosis.experiment else ""
    return f"{look}; {_experiment(diagnosis, written)}.{told}"


_DOUBTFUL = {"pieced", "other_specimen", "unrelated"}  # notes on files by what a model follows
_NEXT: dict[str, Callable[[Diagnosis, Mapping[str, str]], str]] = {
    "consistent": _next_of_consistent,
    "recalibrate": _next_of_recalibrate,
    "cause": _next_of_cause,
    "ambiguous": _next_of_ambiguous,
    "unexplained": _next_of_unexplained,
}


def _experiment(diagnosis: Diagnosis, written: Mapping[str, str]) -> str:
    """Return the record that would tell the causes of a group apart."""
    if diagnosis.experiment is not None:
        if "experiment" in written:
            return f"make the experiment {written['experiment']}"
        return f"make the experiment that {option('experiment', 'next.toml')} writes"
    if any(code == "futile_experiment" for code, _, _ in diagnosis.notes):
        return "record another signal as well, on which the causes act in another way"
    terms = [t for cause in diagnosis.causes for t in cause.parts[:1] if isinstance(t, Term)]
    cls = diagnosis.cls
    titles = (law_title(cls, t.signal) if t.signal else "the operating point" for t in terms)
    signals = list(dict.fromkeys(titles))
    if len(signals) > 1:
        change = f"{_listed(signals)} do not move together, such as slow and fast, small and large"
    else:
        change = f"{(*signals, 'the input')[0]} reaches other levels and rates"
    return f"record a run in which {change}"


def quantity(diagnosis: Diagnosis, name: str, value: float) -> str:
    """Return a value of a parameter in its display unit."""
    declared = {p.name: p for p in diagnosis.subject.problem.model.parameters}
    base = name.partition("@")[0]
    if base in declared:
        return format_value(value, declared[base], 4)
    unit = diagnosis.parameters[name].unit
    return f"{value:.4g}" + ("" if unit == "1" else f" {unit}")


def interval(diagnosis: Diagnosis, name: str, estimate: Estimate) -> str:
    """Return an interval of 95 %; an open one says at least or at most, and a bound is named."""
    text = ends(estimate.interval, lambda value: quantity(diagnosis, name, value))
    declared = {p.name: p for p in diagnosis.subject.problem.model.parameters}
    parameter = declared.get(name.partition("@")[0])
    if parameter is None:
        return text
    low, high = estimate.interval
    for bound, is_beyond in (
        (parameter.min, low < parameter.min),
        (parameter.max, high > parameter.max),
    ):
        near = isclose(estimate.value, bound, rel_tol=_AT, abs_tol=_AT * parameter.nominal)
        if is_beyond and near:
            return f"{text}, at its bound {quantity(diagnosis, name, bound)}"
    return text


def ends(interval: tuple[float, float], written: Callable[[float], str]) -> str:
    """Return the ends of an interval, each as a function writes it."""
    low, high = interval
    if isfinite(low) and isfinite(high):
        return format_ends(written(low), written(high))
    if isfinite(low) and low != 0.0:
        return f"at least {written(low)}"
    if isfinite(high):
        return f"at most {written(high)}"
    return "not determined"


def _structured_first(remainders: Sequence[Remainder]) -> list[Remainder]:
    """Return remainders that are more than noise first, and each kind by its size."""
    return sorted(remainders, key=lambda one: (not one.is_more_than_noise, -one.share))


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
