"""The words of a diagnosis: sentences made of its codes, shared by the page, the terminal and JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from orchestration.discrepancy.changes import Change
from orchestration.discrepancy.design.experiment import DiscriminatingExperiment
from orchestration.discrepancy.diagnosis import Diagnosis, Verdict
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.pipeline import Result
from orchestration.discrepancy.residuals.analysis import Structure
from orchestration.discrepancy.residuals.conditional_mean import ConditionalMean
from orchestration.discrepancy.residuals.correlation import CrossCorrelation
from orchestration.discrepancy.residuals.excess_variance import ExcessVariance
from orchestration.discrepancy.residuals.operating_regions import OperatingRegion
from orchestration.discrepancy.residuals.random_walk import RandomWalkTest
from orchestration.discrepancy.selection.stepwise import ACCEPT
from orchestration.discrepancy.validation.confirmation import Outcome

_VERDICTS = {
    Verdict.CONSISTENT: "The model is consistent with the record: nothing is wrong beyond noise.",
    Verdict.RECALIBRATE: "The structure of the model is fine; parameters differ from nominal: {changed}.",
    Verdict.CAUSE: "What the model gets wrong: {causes}.",
    Verdict.AMBIGUOUS: "Something is wrong that this record cannot tell apart: {causes}.",
    Verdict.UNEXPLAINED: "Something is left that nothing in the catalogue accounts for: {unexplained}.",
}
_BESIDE = " Beside that, something is left that nothing in the catalogue accounts for: {left}."
_LISTED = 5  # names of many
_NO_DIFFERENCE = 0.05  # of BIC
IN_HEADLINE = (
    NoteCode.ABSENT_INPUT,
    NoteCode.INTERSAMPLE_CONTRADICTED,
    NoteCode.UNDETERMINED,
    NoteCode.DETERMINED_TOGETHER,
    NoteCode.AT_BOUND,
    NoteCode.NOT_CONVERGED,
    NoteCode.NOT_MOVED,
)
_REASONS = (
    NoteCode.IMPLAUSIBLE,
    NoteCode.NOT_FOLLOWED,
    NoteCode.END_NOT_FOLLOWED,
)  # why something is unexplained
_NOTES = {
    NoteCode.CLIPPED: "cut off at its {end} {level:.6g}, {share} of the samples",
    NoteCode.CLIPPED_REPEATEDLY: "cut off at its {end} {level:.6g}, {times} times, {share} of the samples",
    NoteCode.STUCK: "stands still for up to {samples} samples in a row, {share} of the samples",
    NoteCode.STUCK_WHILE_DRIVEN: "stands still at {level:.6g} for {samples} samples in a row while inputs move, {share} of the samples",
    NoteCode.DEAD_CONSTANT: "constant at {level:.6g} while inputs move: a dead sensor, or nothing drives it; it is not used",
    NoteCode.DEAD_TOGGLING: "only toggles between neighbouring steps of {resolution:.4g} whatever the inputs do: it is not used",
    NoteCode.DEAD_TO_THE_END: "stands still at {level:.6g} to the end: a dead sensor, {share} of the samples",
    NoteCode.DEAD_WHILE_DRIVEN: "stands still at {level:.6g} to the end while inputs move, {share} of the samples",
    NoteCode.STANDS_STILL: "stands still at {level:.6g} for up to {samples} samples in a row while inputs move, {share} of the samples: "
    "kept, as what a dead zone, dry friction or a stop does",
    NoteCode.OUTLIERS: "{count} single samples far from their neighbours",
    NoteCode.QUANTISED: "steps of {resolution:.4g}, coarser than its noise: nothing finer can be judged",
    NoteCode.UNUSABLE: "{usable} of its samples are left: it is not used at all",
    NoteCode.NOTHING_USABLE: "no output is left that could be trusted: nothing can be judged",
    NoteCode.INTERSAMPLE: "taken to {course} between samples, {basis}{margin}; --interpolate or --no-interpolate forces it",
    NoteCode.INTERSAMPLE_OPEN: "taken to {course} between samples, {basis}, but not surely{margin}: the other way, {parameter} "
    "would be {factor:.4g} times as large; --interpolate or --no-interpolate forces it",
    NoteCode.INTERSAMPLE_CONTRADICTED: "taken to {course} between samples as asked, but its course is one of {other}: a lag or a lead of half a "
    "sample may be nothing but that; leave out {option}",
    NoteCode.INPUT_NOISE: "noise of {deviation:.3g}, {share} of its range, was measured with it and does not drive the outputs: "
    "{parameter} comes out {bias} off by that, and evidence for effects counts only beyond what such noise makes",
    NoteCode.EVEN_CLOCK: "samples were taken evenly, as the outputs tell{margin}: times scatter by {jitter:.3g} s, which is left out",
    NoteCode.CONSTANT_INPUT: "constant at {value:.6g} throughout: what only answers to its changes cannot be judged, and effects that need "
    "them cannot be told apart",
    NoteCode.NO_EXCITATION: "no input moves: neither a cause nor a parameter can be judged, only how the record settles",
    NoteCode.EXCITATION_BELOW_NOISE: "no input moves by more than is lost in the noise of the outputs: nothing can be judged",
    NoteCode.UNKNOWN_START: "if it started at rest, say so, and it can be judged how it settled: --hold {parameters}",
    NoteCode.ABSENT_INPUT: "{record} has no {subject}: taken to be {value:g} {unit} throughout; --set {subject}=... says otherwise",
    NoteCode.GAPS: "{record} has gaps in time, of up to {longest:.4g} s: nobody knows what the inputs did there, so after each it "
    "starts anew; {pieces} runs{lost}",
    NoteCode.TOO_FEW_SAMPLES: "too few samples to say anything",
    NoteCode.ENDS_EARLY: "ends at {time:.6g} s, long before the others, and is not used",
    NoteCode.MANY_GAPS: "too little of it is without gaps to say anything",
    NoteCode.NOT_IN_VALIDATION_DATA: "not in the record held out, so nothing of it is judged there",
    NoteCode.NO_TRACE: "{subject} was not judged: it leaves no trace in what was measured",
    NoteCode.UNIDENTIFIABLE: "{subject} was not judged: on this record other parameters do the same",
    NoteCode.NOT_SIMULATED: "{subject} was not judged: {reason}",
    NoteCode.NOT_VALIDATED: "fits the estimation data better, but not the part held out (log-likelihood {score:+.3g} where {expected:+.3g} "
    "is expected of it), and is not claimed",
    NoteCode.INPUT_NOISE_DOES_THE_SAME: "not claimed: noise on {inputs} makes as much evidence by itself (BIC falls by {gain:.3g})",
    NoteCode.CONFOUNDED: "much of what it does, others would do: {shares}",
    NoteCode.SOMETHING_LEFT: "something is left beside what was named; how much, the residuals tell",
    NoteCode.OUTLYING_RESIDUALS: "{count} samples, {share}, lie far from what is fitted and from all others: no verdict rests on them",
    NoteCode.VARYING_NOISE: "its noise is not of one level, {ratio:.1f} times as large in some range of {signal} as elsewhere: that alone "
    "is no fault of the model",
    NoteCode.FEEDBACK: "{input} follows it (correlation {strength:+.2f}, {lag:.3g} s later): the loop is closed. What comes after is "
    "not held against the model, but estimates may be biased where the noise has a colour that is not its model's",
    NoteCode.NOT_FOLLOWED: "the record held out is not followed{records} (error {errors} what the fit lets expect): it is of another "
    "specimen, or some parameters are others there (--each NAME), or it shows what the fitted record does not",
    NoteCode.END_NOT_FOLLOWED: "the part held out is not followed (error {errors} what the fit lets expect): something changed on the way, or "
    "shows there alone; give the two parts as records, to fit both (--each NAME) or to compare them (--compare)",
    NoteCode.UNDETERMINED: "the record does not determine {names}: hold what you know (--hold NAME), or move or record what tells of it",
    NoteCode.DETERMINED_TOGETHER: "{names} are determined together only, and each may be far off: hold one that you know (--hold NAME), or move "
    "another input",
    NoteCode.AT_BOUND: "{names} ended at an end of what is allowed: look at units and signs, or hold it (--hold NAME)",
    NoteCode.NOT_CONVERGED: "the refit did not settle: start it elsewhere (--set), or hold what you know (--hold NAME)",
    NoteCode.NOT_MOVED: "the refit found no better values than those it began with: start it elsewhere (--set), or look at units, "
    "signs and columns",
    NoteCode.IMPLAUSIBLE: "out of all reason: {ratios}; look at units, signs and columns first",
    NoteCode.NO_GAIN: "no gain is claimed: with what was named the part held out is likelier, given how uncertain the parameters "
    "are, but the error there is not smaller in every output",
    NoteCode.FMU_FAILED: "the extended FMU could not be run over the part held out: {reason}",
    NoteCode.NO_EXPERIMENT: "no experiment could be designed: {reason}",
    NoteCode.NOT_REFITTED: "what was found could not be fitted to all of the record, only to its first part: {reason}",
    NoteCode.TIME_SPENT: "the {seconds:g} s that there were are spent: this is the best answer so far, and on another machine it may be "
    "another; {untried}; --time gives more",
}


def sentence(diagnosis: Diagnosis) -> str:
    """The verdict in one sentence."""
    hurried = any(note.code is NoteCode.TIME_SPENT for note in diagnosis.notes)
    suffix = " (The time was spent before all was tried.)" if hurried else ""
    if diagnosis.unsettled:
        return f"The model is not fitted to the end, so that nothing is claimed.{suffix}"
    if diagnosis.inconclusive:
        return "This record cannot tell whether anything is wrong: no input moves."
    left = _left(diagnosis)
    reasons = [message(note) for note in diagnosis.notes if note.code in _REASONS]
    said = _VERDICTS[diagnosis.verdict].format(
        changed=", ".join(diagnosis.changed),
        causes=_causes(diagnosis),
        unexplained="; ".join(left + reasons),
    )
    beside = any(note.code is NoteCode.SOMETHING_LEFT for note in diagnosis.notes)
    return said + (_BESIDE.format(left="; ".join(left)) if beside else "") + suffix


def headline(result: Result) -> str:
    """The verdict, and what must be known to read it: inputs that are missing, parameters that are not determined."""
    told = [note for note in result.notes if note.code in IN_HEADLINE]
    if result.diagnosis.verdict is not Verdict.UNEXPLAINED:  # of which they are the reason
        told += [note for note in result.notes if note.code in _REASONS]
    told_with_it = "; ".join(message(note) for note in told)
    return sentence(result.diagnosis) + (f" Note: {told_with_it}." if told_with_it else "")


def _causes(diagnosis: Diagnosis) -> str:
    """Name the effects with what cannot be told apart from them, what unseen data say, and which are much weaker."""
    steps = diagnosis.selection.steps
    named = [
        " or ".join(e.effect_name for e in (step.chosen, *step.alternatives))
        + (f" ({said})" if (said := confirmation(diagnosis, step.chosen.effect_name)) else "")
        for step in steps
    ]
    strong = [
        name for name, step in zip(named, steps, strict=True) if step in diagnosis.selection.strong
    ]
    weak = [name for name in named if name not in strong]
    return "; ".join(strong) + (f"; and, much weaker, {', '.join(weak)}" if weak else "")


def confirmation(diagnosis: Diagnosis, effect: str) -> str:
    """What the part held out says of a cause; empty where it was not asked."""
    found, validation = diagnosis.confirmations.get(effect), diagnosis.validation
    if found is None:
        return ""
    part = (
        "the held-out third" if validation.continued and validation.first else "the held-out part"
    )
    if found.outcome is Outcome.CONFIRMED:
        return f"confirmed on {part}"
    idle = f"{part} is at rest" if found.at_rest else f"it does next to nothing in {part}"
    return (
        f"could not be confirmed here: {idle if found.idle else f'{part} tells too little of it'}"
    )


def _left(diagnosis: Diagnosis) -> list[str]:
    """What tells most of what is unexplained, output by output."""
    parts = []
    for output, analysis in diagnosis.residuals.items():
        parts += [f"a line at {line.frequency:.3g} Hz in {output}" for line in analysis.lines[:1]]
        shifts = len(analysis.level_shifts)
        parts += [f"{shifts} {'jump' if shifts == 1 else 'jumps'} of {output}"] if shifts else []
        parts += [structure(item, output) for item in diagnosis.unexplained(output)[:1]]
    return parts


def message(note: Note) -> str:
    """A note in one sentence."""
    template = _NOTES[note.code]
    text = template.format(
        subject=note.subject, **{name: _fact(name, value) for name, value in note.facts.items()}
    )
    text = f"{note.subject}: {text}" if note.subject and "{subject}" not in template else text
    return f"in the record held out: {text}" if note.held_out else text


def _fact(name: str, value: Any) -> Any:
    """Return a fact as its sentence takes it."""
    if name == "ratios":
        return ", ".join(f"{parameter} times {ratio:.3g}" for parameter, ratio in value.items())
    if name == "shares":
        return ", ".join(f"{effect} ({100.0 * share:.0f} %)" for effect, share in value.items())
    if name == "course":
        return {"linear": "go smoothly", "held": "be held"}.get(value, value)
    if name == "other":
        return {"steps": "steps with rest between them", "smooth": "a smooth signal"}.get(
            value, value
        )
    if name == "basis":
        return {
            "course": "as it moves",
            "fit": "as the outputs tell",
            "default": "as nothing tells otherwise",
        }.get(value, value)
    if name == "names":
        return _some(value)
    if name == "lost":
        return f", and {value} samples between gaps too close to use" if value else ""
    if name == "errors":
        return ", ".join(f"of {output} {ratio:.3g} times" for output, ratio in value.items())
    if name == "records":
        return f" in {_some(value)}" if value else ""
    if name == "margin":
        return (
            f" (BIC {'falls' if value > 0.0 else 'rises'} by {abs(value):.3g})"
            if abs(value) >= _NO_DIFFERENCE
            else ""
        )
    if name == "bias":
        return f"{100.0 * value:+.2g} %"
    if name == "untried":
        return f"not tried: {_some(value)}" if value else "fits were ended early"
    if name in ("share", "usable"):
        return f"{100.0 * value:.2g} %"
    return ",".join(value) if isinstance(value, tuple) else value


def _some(names: tuple[str, ...]) -> str:
    """The first few of many names, and how many more there are."""
    more = len(names) - _LISTED
    return ", ".join(names[:_LISTED]) + (f" and {more} more" if more > 0 else "")


def structure(item: Structure, output: str) -> str:
    """What a residual of an output holds, in one line."""
    if isinstance(item, RandomWalkTest):
        return f"{output} wanders slowly"
    if isinstance(item, ExcessVariance):
        return f"{output} is worse where an input steps"
    return mean(item) if isinstance(item, ConditionalMean) else correlation(item)


def region(item: OperatingRegion) -> str:
    """Where a residual is larger than elsewhere."""
    return f"{item.output} is {item.rms_ratio:.1f}× worse where {_where(item)}"


def mean(item: ConditionalMean) -> str:
    """Where the mean of a residual is furthest from zero."""
    return f"the residual of {item.output} is {item.bias:+.2f} of its RMS on average where {_where(item)}"


def _where(item: OperatingRegion | ConditionalMean) -> str:
    """In which range of a signal."""
    unit = "" if item.unit == "1" else f" {item.unit}"
    low, high = (f"{end:.3g}{unit}" for end in (item.low, item.high))
    if math.isfinite(item.low) and math.isfinite(item.high):
        return f"{item.signal} is between {low} and {high}"
    return (
        f"{item.signal} is above {low}"
        if math.isinf(item.high)
        else f"{item.signal} is below {high}"
    )


def most_telling(regions: list[OperatingRegion]) -> list[str]:
    """Of every signal the region that tells most, if it is more than chance."""
    first: dict[str, OperatingRegion] = {}
    for item in regions:
        if item.significant:
            first.setdefault(item.signal, item)
    return [region(item) for item in first.values()]


def correlation(item: CrossCorrelation) -> str:
    """With which signal a residual correlates, and when."""
    when = (
        f"{abs(item.lag):.3g} s {'later' if item.lag > 0 else 'earlier'}" if item.lag else "at once"
    )
    what = f"{item.output} correlates with {item.signal}"
    return f"{what}: {item.strength:+.2f} {when} (99 % band ±{item.band:.2f})"


def why_not(gains: list[float], named: str, unsure: bool = False) -> str:
    """Why an effect was not named.

    Parameters
    ----------
    gains : list of float
        Fall of BIC that it brought, in the first step and in every later one.
    named : str
        What was named before the last step.
    unsure : bool
        Whether noise of a varying level could make as much.
    """
    if len(gains) > 1 and gains[0] > ACCEPT >= gains[-1]:
        return f"alone it lowers BIC by {gains[0]:.1f}; beside {named} it is not needed"
    if gains[-1] > ACCEPT and unsure:
        return "too unsure: noise of a varying level can do as much"
    if gains[-1] > ACCEPT:
        return "another explains the record much better"
    if gains[-1] > 0.0:
        return f"too little: {ACCEPT:g} would be evidence"
    return "it explains less than its parameters cost"


def experiment(design: DiscriminatingExperiment) -> str:
    """What an experiment is for, in one sentence."""
    if not design.expected:
        return "An experiment in which every input moves tells what can be told."
    hardest = min(design.expected, key=lambda e: e.bic)
    pair = f"{hardest.true_model} and {hardest.candidate}"
    if design.is_worthwhile:
        return (
            f"The experiment should tell {pair} apart: BIC would fall by {hardest.bic:.0f} or more."
        )
    return (
        f"No experiment within these limits that was looked at tells {pair} apart: BIC would fall by "
        f"{max(hardest.bic, 0.0):.1f} only."
    )


def comparison(found: Sequence[Change]) -> str:
    """What changed from one record to another, in one sentence."""
    claimed = [change for change in found if change.changed]
    unsure = ", ".join(
        f"{c.effect} ({c.name})" if c.effect else c.name for c in found if c.uncertain
    )
    if claimed:
        told = f"What changed: {'; '.join(map(_changed, claimed))}."
    else:
        told = "Nothing surely changed." if unsure else "Nothing changed beyond noise."
    return f"{told} Uncertain: {unsure}." if unsure else told


def _changed(change: Change) -> str:
    """One change in words; of an effect that one record does not have, that it came or went."""
    if change.lacking[0] != change.lacking[1]:
        return f"{change.effect} {'appeared' if change.lacking[0] else 'vanished'}"
    name = f"{change.effect} ({change.name})" if change.effect else change.name
    return f"{name}, times {change.after / change.before:.3g}" if change.before else name
