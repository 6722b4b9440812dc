"""Sentences that a diagnosis is told in, made of its codes: for the page, the terminal and JSON."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

from fmus.kit import Effect
from fmus.kit.titles import capitalised, effect_title, in_words, law_title, within_sentence
from fmus.kit.units import format_prefixed
from orchestration.discrepancy.candidates import FittedCandidate, own_parameters
from orchestration.discrepancy.diagnosis import Diagnosis, Verdict
from orchestration.discrepancy.note import MIXED_UP, Note, NoteCode
from orchestration.discrepancy.pipeline import Result
from orchestration.discrepancy.residuals import (
    OperatingRegion,
)
from orchestration.discrepancy.selection import ACCEPT, Step
from orchestration.discrepancy.validation import Outcome
from orchestration.identify.effect_sizes import (
    NOT_DETERMINED,
    FittedSize,
    fitted_sizes,
    format_estimated,
    meanings,
)
from orchestration.records.quality import FAULTS, Fault
from orchestration.records.runs import base_name, shown_name
from orchestration.reporting import format_percent, option

# models that a diagnosis compares
NOMINAL, REFITTED, EXTENDED = "as it is", "parameters refitted", "with the effect"
INCONCLUSIVE = "This record cannot tell whether anything is wrong: no input moves."
_NAMED = 3  # parameters that are told in a sentence
_NO_PHRASES: Mapping[str, str] = MappingProxyType({})
UNSEEN = "data that no fit has seen"
REFUTED = "unseen data refute it"
_LISTED = 5  # names of many that are listed
_MORE_DIGITS = 4  # that may tell two shares apart; beyond it is no gain
_NO_DIFFERENCE = 0.05  # of BIC, below which a choice makes none
# notes without which a verdict is misread
IN_HEADLINE = (
    NoteCode.ABSENT_INPUT,
    NoteCode.INTERSAMPLE_CONTRADICTED,
    NoteCode.UNDETERMINED,
    NoteCode.DETERMINED_TOGETHER,
    NoteCode.AT_BOUND,
    NoteCode.NOT_CONVERGED,
    NoteCode.NOT_MOVED,
)
# notes that say why something is unexplained
_REASONS = (
    NoteCode.IMPLAUSIBLE,
    NoteCode.NOT_FOLLOWED,
    NoteCode.END_NOT_FOLLOWED,
    NoteCode.LARGE_ERROR,
)
_MISUSE = (*MIXED_UP, NoteCode.UNRELATED)  # what is wrong with the record, not with the model
_NOTES = {
    NoteCode.LARGE_ERROR: (
        "the model misses {share} of the spread of {outputs}, most of it more slowly than from"
        " sample to sample; units, signs and columns are the first to look at"
    ),
    NoteCode.SOLVER_ERROR: (
        "the record has no noise, and the model misses at most {share} of the spread of an output,"
        " which is no more than a solver with other steps does: no further cause is looked for"
    ),
    NoteCode.EXCHANGED: (
        "{columns} look exchanged{others}: the model misses {share}, and with them the other way"
        " round {instead}"
    ),
    NoteCode.OTHER_SIGN: (
        "{columns} looks to be of the other sign{others}: the model misses {share}, and with it"
        " changed {instead}"
    ),
    NoteCode.OTHER_UNIT: (
        "{columns} looks to be in {unit}{others}: as it stands the model misses {share} or needs"
        " parameters that no specimen has, and read as such it misses {instead} with ordinary ones"
    ),
    NoteCode.DIFFERENTIATED: (
        "{columns} looks to be a rate of change of what the model shows{others}: the model misses"
        " {share}, and with it integrated {instead}"
    ),
    NoteCode.INTEGRATED: (
        "{columns} looks to be an integral of what the model shows{others}: the model misses"
        " {share}, and with it differentiated {instead}"
    ),
    NoteCode.FILTERED: (
        "outputs have nothing beyond {frequency:.3g} Hz, no noise either, and look to have been"
        " filtered forwards and backwards: the model misses {share}, and with inputs filtered alike"
        " {instead}; what was measured is needed as it was"
    ),
    NoteCode.RUNS_AHEAD: (
        "the clock of {columns} looks to be {ahead:.4g} s ahead of that of the inputs: the model"
        " misses {share}, and with them that much later {instead}"
    ),
    NoteCode.OTHER_CLOCK: (
        "the clock of {columns} looks to be another than that of the inputs, {rate} off: the model"
        " misses {share}, and with it put right {instead}"
    ),
    NoteCode.UNSIGNED: (
        "the sign of {columns} looks to be lost{others}: the model misses {share}, and of what is"
        " shown without sign {instead}"
    ),
    NoteCode.PIECED: (
        "outputs jump at {instants}, and nothing that was fed makes them: the model misses {share},"
        " and where it starts anew there {instead}; was the record cut, or put together from"
        " pieces? Give each as a record of its own"
    ),
    NoteCode.OTHER_SPECIMEN: (
        "outputs jump at {instants}, and the record looks to be of another specimen from there on:"
        " the model misses {share}, and with parameters of its own for each part {instead}; give"
        " the parts as records, to fit both ({EACH}) or to compare them ({COMPARE})"
    ),
    NoteCode.UNRELATED: (
        "outputs do not follow inputs: the model misses {share} of the spread of {outputs},"
        " whatever its parameters, and no other unit, sign, column or clock brings it near; are"
        " inputs and outputs of one run, and is it this plant?"
    ),
    NoteCode.INTERSAMPLE: (
        "taken to {course} between samples, {basis}{margin}; {LINEAR} or {HELD} forces it"
    ),
    NoteCode.INTERSAMPLE_OPEN: (
        "taken to {course} between samples, {basis}, but not surely{margin}: the other way,"
        " {parameter} would be {factor:.4g} times as large; {LINEAR} or {HELD}"
        " forces it"
    ),
    NoteCode.INTERSAMPLE_CONTRADICTED: (
        "taken to {course} between samples as asked, but its course is one of {other}: a lag or a"
        " lead of half a sample may be nothing but that; leave out {asked}"
    ),
    NoteCode.INPUT_NOISE: (
        "noise of {deviation:.3g}, {share} of its range, was measured with it and does not drive"
        " the outputs: {parameter} comes out {bias} off by that, and evidence for effects counts"
        " only beyond what such noise makes"
    ),
    NoteCode.EVEN_CLOCK: (
        "samples were taken evenly, as the outputs tell{margin}: times scatter by {jitter:.3g} s,"
        " which is left out"
    ),
    NoteCode.SEARCHED_IN_PART: (
        "causes were searched for in {samples} of {of} samples, from {first:.6g} s to {last:.6g} s;"
        " the models with them are fitted to all samples and judged by all, and what acts elsewhere"
        " only shows there as structure without a cause"
    ),
    NoteCode.EXCITATION_BELOW_NOISE: (
        "no input moves by more than is lost in the noise of the outputs: nothing can be judged"
    ),
    NoteCode.FREE_RESPONSE: (
        "no input moves an output by more than its noise: the model is judged by its free response,"
        " by how the outputs settle from where they start, which is fitted unless it is held"
    ),
    NoteCode.ABSENT_INPUT: (
        "{record} has no {subject}: taken to be {value:g} {unit} throughout; {SET_IT} says"
        " otherwise"
    ),
    NoteCode.GAPS: (
        "{record} has gaps in time, of up to {longest:.4g} s: nobody knows what the inputs did"
        " there, so after each it starts anew; {pieces} runs{lost}"
    ),
    NoteCode.TOO_FEW_SAMPLES: "too few samples to say anything",
    NoteCode.ENDS_EARLY: "ends at {time:.6g} s, long before the others, and is not used",
    NoteCode.MANY_GAPS: "too little of it is without gaps to say anything",
    NoteCode.NOT_IN_VALIDATION_DATA: "not in the record held out, so nothing of it is judged there",
    NoteCode.NO_TRACE: "{subject} was not judged: it leaves no trace in what was measured",
    NoteCode.UNIDENTIFIABLE: (
        "{subject} was not judged: this record cannot tell it from parameters of the model"
    ),
    NoteCode.NOT_SIMULATED: "{subject} was not judged: {reason}",
    NoteCode.NOT_IN_ALL_SAMPLES: (
        "fits the stretch of the record better in which causes were searched for, but not all of"
        " its samples, and is not claimed"
    ),
    NoteCode.NOT_VALIDATED: (
        "fits the estimation data better, but not the part held out (log-likelihood {score:+.3g}"
        " where {expected:+.3g} is expected of it), and is not claimed"
    ),
    NoteCode.MAY_BE_NEUTRAL: (
        "not claimed: fitted to all that was measured, {parameter} is {value:.3g} {unit}, and its"
        " 95 % interval, {low:.3g} to {high:.3g} {unit}, holds {neutral:g}, where it does nothing"
    ),
    NoteCode.INPUT_NOISE_DOES_THE_SAME: (
        "not claimed: noise on {inputs} makes as much evidence by itself (BIC falls by {gain:.3g})"
    ),
    NoteCode.CONFOUNDED: "much of what it does, others would do: {shares}",
    NoteCode.SOMETHING_LEFT: (
        "something is left beside what was named; how much, the residuals tell"
    ),
    NoteCode.OUTLYING_RESIDUALS: (
        "{count} samples, {share}, lie far from what is fitted and from all others: no verdict"
        " rests on them"
    ),
    NoteCode.VARYING_NOISE: (
        "its noise is not of one level, {ratio:.1f} times as large in some range of {signal} as"
        " elsewhere: that alone is no fault of the model"
    ),
    NoteCode.FEEDBACK: (
        "{input} follows it (correlation {strength:+.2f}, {lag:.3g} s later): the loop is closed."
        " What comes after is not held against the model, but estimates may be biased where the"
        " noise has a colour that is not its model's"
    ),
    NoteCode.NOT_FOLLOWED: (
        "the record held out is not followed{records} (error {errors} what the fit lets expect): it"
        " is of another specimen, or some parameters are others there ({EACH}), or it shows"
        " what the fitted record does not"
    ),
    NoteCode.END_NOT_FOLLOWED: (
        "the part held out is not followed (error {errors} what the fit lets expect): something"
        " changed on the way, or shows there alone; give the two parts as records, to fit both"
        " ({EACH}) or to compare them ({COMPARE})"
    ),
    NoteCode.UNDETERMINED: (
        "the record does not determine {names}: hold what you know ({HOLD}), or move or record"
        " what tells of it"
    ),
    NoteCode.DETERMINED_TOGETHER: (
        "{names} are determined together only, and each may be far off: hold one that you know"
        " ({HOLD}), or move another input"
    ),
    NoteCode.STRAIGHT_PART: (
        "{names}: not determined apart from {subject}, which adds a curve to the law of which this"
        " is the slope over the same signal"
    ),
    NoteCode.AT_BOUND: (
        "{names} ended at an end of what is allowed: look at units and signs, or hold it ({HOLD})"
    ),
    NoteCode.NOT_CONVERGED: (
        "the refit did not settle: start it elsewhere ({SET}), or hold what you know ({HOLD})"
    ),
    NoteCode.NOT_MOVED: (
        "the refit found no better values than those it began with: start it elsewhere ({SET}), or"
        " look at units, signs and columns"
    ),
    NoteCode.IMPLAUSIBLE: "out of all reason: {ratios}; look at units, signs and columns first",
    NoteCode.NO_GAIN: (
        "no gain is claimed: with what was named the part held out is likelier, given how uncertain"
        " the parameters are, but the error there is not smaller in every output"
    ),
    NoteCode.FMU_FAILED: "the extended FMU could not be run over the part held out: {reason}",
    NoteCode.NO_EXPERIMENT: "no experiment could be designed: {reason}",
    NoteCode.NOT_REFITTED: (
        "what was found could not be fitted to all of the record, only to its first part: {reason}"
    ),
    NoteCode.TIME_SPENT: (
        "the {seconds:g} s that there were are spent: this is the best answer so far, and on"
        " another machine it may be another; {untried}; {TIME} gives more"
    ),
}


class Answer(NamedTuple):
    """A verdict in sentences of the domain.

    Attributes
    ----------
    first : str
        The sentence that says cause and size.
    support : tuple of str
        Sentences on what that does to the error, how sure it is, and what is left.
    """

    first: str
    support: tuple[str, ...] = ()

    def __str__(self) -> str:
        return " ".join((self.first, *self.support))


def sentence(diagnosis: Diagnosis) -> str:
    """Return the verdict in sentences."""
    return str(answer(diagnosis))


def answer(diagnosis: Diagnosis, phrases: Mapping[str, str] = _NO_PHRASES) -> Answer:
    """Return the verdict in sentences of the domain.

    Parameters
    ----------
    diagnosis : Diagnosis
    phrases : Mapping of str to str
        By the name of an effect, what is said of it in place of its parameters.
    """
    if diagnosis.inconclusive:
        return Answer(INCONCLUSIVE)
    first, *support = _VERDICTS[diagnosis.verdict](diagnosis, phrases)
    if _has_note(diagnosis, NoteCode.SOMETHING_LEFT):
        left = "; ".join(_unexplained_findings(diagnosis))
        support.append(f"Beside that, something is left that no known effect explains: {left}.")
    if _has_note(diagnosis, NoteCode.TIME_SPENT):
        support.append("(The time was spent before all was tried.)")
    return Answer(first, tuple(support))


def headline(result: Result, phrases: Mapping[str, str] = _NO_PHRASES) -> Answer:
    """Return the verdict with the notes that must be read with it, such as inputs that are missing.

    The reasons why something is unexplained are part of that verdict, and notes of any other.
    """
    found = answer(result.diagnosis, phrases)
    notes = [note for note in result.notes if note.code in IN_HEADLINE]
    if result.diagnosis.verdict is not Verdict.UNEXPLAINED:
        notes += [note for note in result.notes if note.code in _REASONS]
    if not notes:
        return found
    messages = "; ".join(message(note) for note in notes)
    return Answer(found.first, (*found.support, f"Note: {messages}."))


def _consistent(diagnosis: Diagnosis, phrases: Mapping[str, str]) -> list[str]:
    return [
        "The model agrees with the record: nothing is wrong beyond noise.",
        *_remaining_error(diagnosis),
    ]


def _recalibrate(diagnosis: Diagnosis, phrases: Mapping[str, str]) -> list[str]:
    changes = [describe_changed_parameter(diagnosis, name) for name in diagnosis.changed]
    more = len(changes) - _NAMED
    listed = "; ".join(changes[:_NAMED]) + (f"; and {more} more" if more > 0 else "")
    return [
        f"The form of the model is right, but not the values of its parameters: {listed}.",
        *_remaining_error(diagnosis),
    ]


def _remaining_error(diagnosis: Diagnosis) -> list[str]:
    """Return how far off the refitted model is on unseen data, and how far the nominal one was."""
    output = max(diagnosis.before, key=lambda o: diagnosis.before[o])
    if not math.isfinite(diagnosis.before[output]):
        return []
    nominal = diagnosis.judged_errors.get("untouched", {}).get(output, math.nan)
    before, after = _told_apart(nominal, diagnosis.before[output])
    subject = f"the error{_of_output(diagnosis, output)}"
    if diagnosis.changed and nominal > diagnosis.before[output] and before != after:
        return [f"Refitted, {subject} is {after} instead of {before} on {UNSEEN}."]
    return [f"{capitalised(subject)} is {after} on {UNSEEN}."]


def describe_changed_parameter(diagnosis: Diagnosis, name: str) -> str:
    """Return a parameter that differs, its value, the nominal one, and the change in percent."""
    e = diagnosis.estimates[name]
    declared = diagnosis.final.problem.declared[name]
    change = f" ({100.0 * (e.value / e.nominal - 1.0):+.0f} %)" if e.nominal else ""
    return (
        f"{parameter_title(diagnosis, name)} {format_estimated(e, declared)} instead of"
        f" {format_prefixed(e.nominal, declared, like=e.value)}{change}"
    )


def parameter_title(diagnosis: Diagnosis, name: str) -> str:
    """Return the name for people of a parameter, with the record that it is of."""
    base = base_name(name)
    title = diagnosis.final.problem.declared[name].title or in_words(base)
    return shown_name(name).replace(base, title, 1)


def _cause(diagnosis: Diagnosis, phrases: Mapping[str, str]) -> list[str]:
    strong: list[str] = []
    weak: list[str] = []
    for cause, *_ in diagnosis.selection.by_cause:
        group = strong if cause in diagnosis.selection.strong else weak
        group.append(_describe_cause(diagnosis, cause, phrases))
    named = "; and ".join(_as_sentence(strong or weak))
    much_weaker = f"; and, much weaker, {'; '.join(map(within_sentence, weak))}" if strong else ""
    return [
        f"{named}{much_weaker if weak else ''}.",
        *_gain(diagnosis),
        *_shapes(diagnosis),
        *_confirmations(diagnosis),
    ]


def _as_sentence(phrases: Sequence[str]) -> list[str]:
    return [capitalised(phrases[0]), *map(within_sentence, phrases[1:])]


def _ambiguous(diagnosis: Diagnosis, phrases: Mapping[str, str]) -> list[str]:
    named = [
        _describe_cause(diagnosis, cause, phrases) for cause, *_ in diagnosis.selection.by_cause
    ]
    return [
        f"{'; and '.join(_as_sentence(named))}: this record cannot tell which.",
        *_gain(diagnosis),
        *_shapes(diagnosis),
        *_confirmations(diagnosis),
    ]


def _describe_cause(diagnosis: Diagnosis, step: Step, phrases: Mapping[str, str]) -> str:
    """Return an effect that was named, with its size, and what cannot be told apart from it."""
    title = effect_title(step.chosen.effect)
    size = phrases.get(step.chosen.effect_name) or _size(diagnosis, step.chosen)
    if not step.alternatives:
        return f"{title}: {size}" if size else title
    others = [within_sentence(effect_title(other.effect)) for other in step.alternatives]
    own = f"{within_sentence(title)}, {size}," if size else within_sentence(title)
    return f"either {own} or {' or '.join(others)}"


def sizes_of(diagnosis: Diagnosis, effect: type[Effect]) -> list[FittedSize]:
    """Return the sizes of an effect of the final model."""
    return fitted_sizes(effect, diagnosis.estimates, diagnosis.final.problem.declared)


def meanings_of(diagnosis: Diagnosis, effect: type[Effect], name: str) -> list[str]:
    """Return what a parameter of an effect means where its value alone does not say it."""
    return meanings(sizes_of(diagnosis, effect), name)


def _size(diagnosis: Diagnosis, chosen: FittedCandidate) -> str:
    """Return how large an effect is; of one that does not say how, the values of its parameters."""
    told = [size.text for size in sizes_of(diagnosis, chosen.effect)]
    return ", ".join((told or _own_values(diagnosis, chosen))[:_NAMED])


def _own_values(diagnosis: Diagnosis, chosen: FittedCandidate) -> list[str]:
    """Return the values of an effect's own parameters, with the names of those without a unit."""
    values = []
    for name in own_parameters(chosen.effect):
        if name not in diagnosis.estimates:
            continue
        declared = diagnosis.final.problem.declared[name]
        value = format_estimated(diagnosis.estimates[name], declared)
        is_named = declared.title or declared.unit == "1"
        values.append(f"{parameter_title(diagnosis, name)} {value}" if is_named else value)
    return values


def _gain(diagnosis: Diagnosis) -> list[str]:
    """Return what the effects do to the error that falls most on unseen data."""
    before = diagnosis.before
    after = diagnosis.after
    output = max(before, key=lambda o: (before[o] - after[o]) / (before[o] or 1.0))
    if not after[output] < before[output]:
        return []
    effects = "them" if diagnosis.causes[1:] else "it"
    moves = format_move(before[output], after[output], f" ({REFITTED})")
    return [
        f"With {effects} in the model the error{_of_output(diagnosis, output)} {moves} on {UNSEEN}."
    ]


def _of_output(diagnosis: Diagnosis, output: str) -> str:
    """Return which output an error is of, where there are several."""
    cls = diagnosis.selection.base.candidate.cls
    return f" of the {law_title(cls, output)}" if len(diagnosis.before) > 1 else ""


def _shapes(diagnosis: Diagnosis) -> list[str]:
    """Return which effects make up for the shape of a cause that is not quite the catalogue's."""
    sentences = []
    for cause, *corrections in diagnosis.selection.by_cause:
        if corrections:
            titles = [within_sentence(effect_title(each.chosen.effect)) for each in corrections]
            verb = "correct" if corrections[1:] else "corrects"
            sentences.append(
                f"The shape of {within_sentence(effect_title(cause.chosen.effect))} is not quite"
                f" the catalogue's: {' and '.join(titles)} {verb} it."
            )
    return sentences


def _confirmations(diagnosis: Diagnosis) -> list[str]:
    """Return what the part held out says of the causes: in one sentence where it is the same."""
    outcomes = {
        effect_title(cause.chosen.effect): confirmation(diagnosis, cause.chosen.effect_name)
        for cause, *_ in diagnosis.selection.by_cause
    }
    if len(set(outcomes.values())) == 1:
        outcomes = {"": next(iter(outcomes.values()))}
    return [
        f"{f'{title}: {outcome}' if title else capitalised(outcome)}."
        for title, outcome in outcomes.items()
        if outcome
    ]


def _unexplained(diagnosis: Diagnosis, phrases: Mapping[str, str]) -> list[str]:
    wrong = [message(note) for note in diagnosis.notes if note.code in _MISUSE]
    findings = _unexplained_findings(diagnosis)
    reasons = [message(note) for note in diagnosis.notes if note.code in _REASONS]
    if wrong:
        first, *others = [*wrong, *findings, *reasons]
        answer_first = f"{capitalised(first)}."
    else:
        first, *others = [*findings, *reasons] or ["more than noise"]
        answer_first = f"Something is wrong that no known effect explains: {first}."
    more = [f"{capitalised(text)}." for text in others]
    return [in_words(answer_first), *more]


_VERDICTS: dict[Verdict, Callable[[Diagnosis, Mapping[str, str]], list[str]]] = {
    Verdict.CONSISTENT: _consistent,
    Verdict.RECALIBRATE: _recalibrate,
    Verdict.CAUSE: _cause,
    Verdict.AMBIGUOUS: _ambiguous,
    Verdict.UNEXPLAINED: _unexplained,
}


_NEXT = {
    Verdict.CONSISTENT: (
        "Nothing has to change. A record that moves more asks more of the model.",
    ),
    Verdict.RECALIBRATE: (
        "Take the fitted values over: repeat the diagnosis with {FMU} to write that model.",
        "Confirm them on another record: {HOLDOUT}.",
    ),
    Verdict.CAUSE: ("Go on with the extended model: repeat the diagnosis with {FMU} to write it.",),
    Verdict.AMBIGUOUS: (
        "Run an experiment that tells these apart ({EXPERIMENT} writes one), and diagnose"
        " its record.",
    ),
    Verdict.UNEXPLAINED: (
        "Look at the bench: a line at one frequency is mostly mains, a fan or a pump, and a jump"
        " mostly a clamp or a contact.",
        "Ask the laws of the model what they lack: ppy laws.",
    ),
}
_NEXT_WHERE_MISREAD = "Put the record right as it says above, and diagnose it again."
_NEXT_WHERE_NOTHING_MOVES = "Record again with inputs that move."
_NEXT_WHERE_UNCONFIRMED = (
    "Confirm it on another record, in which it acts: {HOLDOUT}. Until then it is no more than"
    " likely."
)
_NEXT_WHERE_SOMETHING_IS_LEFT = (
    "Then diagnose the extended model with the same record: something is left, which is described"
    " below."
)


def next_steps(result: Result) -> list[str]:
    """Return what to do next, a sentence or two each, the first thing first."""
    diagnosis = result.diagnosis
    if diagnosis.inconclusive:
        return [_NEXT_WHERE_NOTHING_MOVES]
    if any(note.code in _MISUSE for note in diagnosis.notes):
        return [_NEXT_WHERE_MISREAD]
    steps = [*_NEXT[diagnosis.verdict]]
    outcomes = [confirmed.outcome for confirmed in diagnosis.confirmations.values()]
    if diagnosis.causes and any(outcome is not Outcome.CONFIRMED for outcome in outcomes):
        steps.append(_NEXT_WHERE_UNCONFIRMED)
    if _has_note(diagnosis, NoteCode.SOMETHING_LEFT):
        steps.append(_NEXT_WHERE_SOMETHING_IS_LEFT)
    options = {
        "FMU": option("fmu", "better.fmu"),
        "HOLDOUT": option("holdout", ["other.csv"]),
        "EXPERIMENT": option("experiment", "experiment.toml"),
    }
    return [step.format(**options) for step in steps]


def _has_note(diagnosis: Diagnosis, code: NoteCode) -> bool:
    return any(note.code is code for note in diagnosis.notes)


def confirmation(diagnosis: Diagnosis, effect: str) -> str:
    """Return what the part held out says of a cause; empty where it was not judged there."""
    confirmed = diagnosis.confirmations.get(effect)
    if confirmed is None:
        return ""
    validation = diagnosis.validation
    is_last_third = validation.continued and validation.first
    part = "the held-out third" if is_last_third else "the held-out part"
    if confirmed.outcome is Outcome.CONFIRMED:
        return f"confirmed on {part}"
    if not confirmed.idle:
        reason = f"{part} tells too little of it"
    elif confirmed.at_rest:
        reason = f"{part} is at rest"
    else:
        reason = f"it does next to nothing in {part}"
    return f"could not be confirmed here: {reason}"


def _unexplained_findings(diagnosis: Diagnosis) -> list[str]:
    """Return the most telling finding of every kind in the residual of every output."""
    findings = []
    for output, analysis in diagnosis.residuals.items():
        for line in analysis.lines[:1]:
            findings.append(f"a line at {line.frequency:.3g} Hz in {output}")
        shifts = len(analysis.level_shifts)
        if shifts:
            findings.append(f"{shifts} {'jump' if shifts == 1 else 'jumps'} of {output}")
        for item in diagnosis.unexplained_structure(output)[:1]:
            findings.append(item.describe(output))
    return findings


def message(note: Note) -> str:
    """Return a note in one sentence."""
    if note.code in FAULTS:
        text = Fault(note.code, note.subject, note.facts).sentence
    else:
        text = _message(note)
    return f"in the record held out: {text}" if note.held_out else text


def _message(note: Note) -> str:
    template = _NOTES[note.code]
    facts = {name: _format_fact(name, value) for name, value in note.facts.items()}
    text = template.format(subject=note.subject, **facts, **_options(note.subject))
    return f"{note.subject}: {text}" if note.subject and "{subject}" not in template else text


def _options(subject: str) -> dict[str, str]:
    """Return the options that notes advise, as they are written, by their place in the text."""
    return {
        "EACH": option("each", ["NAME"]),
        "HOLD": option("hold", ["NAME"]),
        "COMPARE": option("compare"),
        "SET": option("settings"),
        "SET_IT": option("settings", {subject: "..."}),
        "TIME": option("time"),
        "LINEAR": option("interpolate", True),
        "HELD": option("interpolate", False),
    }


def _format_fact(name: str, value: Any) -> Any:
    """Return a fact of a note as its sentence takes it."""
    if name in _FACT_WORDS:
        return _FACT_WORDS[name].get(value, value)
    if name in _FACT_FORMATS:
        return _FACT_FORMATS[name](value)
    return ",".join(value) if isinstance(value, tuple) else value


def _format_ratios(ratios: Mapping[str, float]) -> str:
    return ", ".join(f"{parameter} times {ratio:.3g}" for parameter, ratio in ratios.items())


def _format_shares(shares: Mapping[str, float]) -> str:
    return ", ".join(f"{effect} ({100.0 * share:.0f} %)" for effect, share in shares.items())


def _format_errors(errors: Mapping[str, float]) -> str:
    return ", ".join(f"of {output} {ratio:.3g} times" for output, ratio in errors.items())


def _format_names(names: Sequence[str]) -> str:
    """Return the first few of many names, and how many more there are."""
    more = len(names) - _LISTED
    return ", ".join(names[:_LISTED]) + (f" and {more} more" if more > 0 else "")


def _format_others(others: Sequence[str]) -> str:
    return f" (or {' or '.join(others)})" if others else ""


def _format_lost_samples(count: int) -> str:
    return f", and {count} samples between gaps too close to use" if count else ""


def _format_records(labels: Sequence[str]) -> str:
    return f" in {_format_names(labels)}" if labels else ""


def _format_untried(effects: Sequence[str]) -> str:
    return f"not tried: {_format_names(effects)}" if effects else "fits were ended early"


def _format_instants(instants: Sequence[float]) -> str:
    return _format_names([f"{instant:.6g} s" for instant in instants])


def _format_margin(margin: float) -> str:
    """Return by how much BIC speaks for a choice; empty where it makes no difference."""
    if abs(margin) < _NO_DIFFERENCE:
        return ""
    return f" (BIC {'falls' if margin > 0.0 else 'rises'} by {abs(margin):.3g})"


def format_error(error: float) -> str:
    """Return an error over the spread of a signal in percent; a dash where it has none.

    That is where the signal is constant, or the simulation runs away.
    """
    return format_percent(error) if math.isfinite(error) else "–"


def format_interval(interval: tuple[float, float], write: Callable[[float], str]) -> str:
    """Return an interval, whose ends a function writes; in words if an end is infinite."""
    if not all(map(math.isfinite, interval)):
        return NOT_DETERMINED
    return " … ".join(map(write, interval))


def _told_apart(before: float, after: float) -> tuple[str, str]:
    """Return two shares with as many digits as tell them apart, or as usual if these are many."""
    pairs = [
        (format_percent(before, more), format_percent(after, more)) for more in range(_MORE_DIGITS)
    ]
    return next((pair for pair in pairs if pair[0] != pair[1]), pairs[0])


def format_move(before: float, after: float, about: str = "") -> str:
    """Return from where to where an error goes, with words about the first of them."""
    first, last = _told_apart(before, after)
    if first == last:
        return f"stays at {last}"
    return f"{'falls' if after < before else 'goes'} from {first}{about} to {last}"


def _format_signed_share(share: float) -> str:
    return f"{100.0 * share:+.2g} %"


_FACT_WORDS = {  # by the name of a fact: what is said for each of its values
    "course": {"linear": "go smoothly", "held": "be held"},
    "other": {"steps": "steps with rest between them", "smooth": "a smooth signal"},
    "basis": {
        "course": "as it moves",
        "fit": "as the outputs tell",
        "default": "as nothing tells otherwise",
    },
}
_FACT_FORMATS: dict[str, Callable[[Any], str]] = {
    "asked": lambda linear: option("interpolate", linear),
    "ratios": _format_ratios,
    "shares": _format_shares,
    "errors": _format_errors,
    "names": _format_names,
    "others": _format_others,
    "lost": _format_lost_samples,
    "records": _format_records,
    "untried": _format_untried,
    "margin": _format_margin,
    "bias": _format_signed_share,
    "rate": _format_signed_share,
    "instants": _format_instants,
    "share": format_percent,
    "instead": format_percent,
}


def describe_worst_regions(regions: Sequence[OperatingRegion]) -> list[str]:
    """Return the first significant region of every signal, in words.

    Parameters
    ----------
    regions : sequence of OperatingRegion
        The most telling first.
    """
    first_by_signal: dict[str, OperatingRegion] = {}
    for region in regions:
        if region.significant:
            first_by_signal.setdefault(region.signal, region)
    return [region.describe(region.output) for region in first_by_signal.values()]


def why_not(
    gains: Sequence[float],
    causes: str,
    unsure: bool = False,
    rival: str = "",
    refuted: bool = False,
) -> str:
    """Return why an effect was not named.

    Parameters
    ----------
    gains : sequence of float
        Fall of BIC that it brought, in the first step and in every later one.
    causes : str
        Effects that were named before the last step.
    unsure : bool
        Whether noise of a varying level could make as much.
    rival : str
        Effect that explains the record better; empty where there is none.
    """
    if len(gains) > 1 and gains[0] > ACCEPT >= gains[-1]:
        return f"alone it lowers BIC by {gains[0]:.1f}; beside {causes} it is not needed"
    if gains[-1] > ACCEPT and unsure:
        return "too unsure: noise of a varying level can do as much"
    if gains[-1] > ACCEPT:
        if rival:
            return f"{rival} explains the record much better"
        return "no likelier in noise of its own, or no nearer in blocks that were left out"
    if gains[-1] > 0.0:
        return f"too little: {ACCEPT:g} would be evidence"
    return "it explains less than its parameters cost"
