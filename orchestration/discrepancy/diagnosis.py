"""From a record to a verdict: screen the data, fit, select effects, validate them, analyse what the model leaves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
from threadpoolctl import threadpool_limits

from fmus.kit import Component, Effect
from orchestration.discrepancy.budget import Budget
from orchestration.discrepancy.candidates.candidate import label
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.holdout import ValidationData
from orchestration.discrepancy.data.screening import DividedData, divided, is_excited
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.residuals.analysis import (
    ResidualAnalysis,
    Structure,
    analyse_residuals,
)
from orchestration.discrepancy.residuals.innovations import power
from orchestration.discrepancy.residuals.remarks import remarks
from orchestration.discrepancy.selection import both_ways, clock, intersample
from orchestration.discrepancy.selection.intersample import Intersample
from orchestration.discrepancy.selection.search import FAILURES, Search
from orchestration.discrepancy.selection.stepwise import Selection
from orchestration.discrepancy.validation import errors_in_variables
from orchestration.discrepancy.validation.confirmation import Confirmation, confirmed
from orchestration.discrepancy.validation.estimates import (
    estimates,
    implausible,
    significantly_changed,
)
from orchestration.discrepancy.validation.following import not_followed
from orchestration.discrepancy.validation.misfit import spread_beside
from orchestration.discrepancy.validation.prediction import Prediction
from orchestration.discrepancy.validation.reservations import reservations
from orchestration.discrepancy.validation.side_by_side import Errors, errors_side_by_side
from orchestration.identify.estimate import Estimate
from orchestration.records.joined import base_name

DEGRADED = 1.1  # times the error before, above which it has grown
# Share of the structure in a residual that may be left beside a cause, which never has quite the catalogue's form.
TOLERATED_STRUCTURE = 0.25
CONFOUNDED_SHARE = 0.75  # of what an effect does that another would do too, to be noted


class Verdict(StrEnum):
    """What a diagnosis comes to (DESIGN, section 8)."""

    CONSISTENT = "consistent"
    RECALIBRATE = "recalibrate"
    CAUSE = "cause"
    AMBIGUOUS = "ambiguous"
    UNEXPLAINED = "unexplained"


@dataclass(frozen=True)
class Diagnosis:
    """The verdict and what it rests on.

    Attributes
    ----------
    verdict : Verdict
    selection : Selection
        Effects that were named and not refuted, and what was tried beside them.
    estimates : dict of str to Estimate
        Of the best model, fitted to all that was measured.
    changed : list of str
        Parameters that differ significantly from nominal, the surest first.
    residuals : dict of str to ResidualAnalysis
        By output, of the best model over the estimation data.
    fitted_errors, judged_errors : dict of str to dict of str to float
        Normalised RMS errors of free runs over the estimation and the validation data, by model and output; see
        `errors_side_by_side`.
    estimation : Dataset
        What was fitted to.
    validation : ValidationData
        What was held out.
    final : FittedCandidate
        The best model fitted to all that was measured, now that its gain is known; the estimates are its.
    notes : list of Note
        What could not be assessed, and why.
    intersample : dict of str to Intersample
        What every input that moves is taken to do between samples.
    excused : frozenset of tuple of str and type
        Kinds of structure, by output, that noise on the inputs makes by itself.
    confirmations : dict of str to Confirmation
        What the validation data say of every effect that was named, by its name.
    """

    verdict: Verdict
    selection: Selection
    estimates: dict[str, Estimate]
    changed: list[str]
    residuals: dict[str, ResidualAnalysis]
    fitted_errors: Errors
    judged_errors: Errors
    estimation: Dataset
    validation: ValidationData
    final: FittedCandidate
    notes: list[Note] = field(default_factory=list)
    intersample: dict[str, Intersample] = field(default_factory=dict)
    excused: frozenset[tuple[str, type]] = frozenset()
    confirmations: dict[str, Confirmation] = field(default_factory=dict)

    def unexplained(self, output: str) -> list[Structure]:
        """Structure in the residual of an output that noise on the inputs does not make, the most telling first."""
        return [
            s for s in self.residuals[output].structure if (output, type(s)) not in self.excused
        ]

    @property
    def before(self) -> dict[str, float]:
        """Normalised RMS error of the refitted model on the validation data, by output."""
        return self.judged_errors["refitted"]

    @property
    def after(self) -> dict[str, float]:
        """Normalised RMS error of the best model on the validation data, by output."""
        return self.judged_errors.get("extended", self.before)

    @property
    def causes(self) -> list[str]:
        """Effects named, in the order in which they were found."""
        return [step.chosen.effect_name for step in self.selection.steps]

    @property
    def explained(self) -> bool:
        """Whether what was named, or parameters, account for all that the record shows."""
        beside = {NoteCode.SOMETHING_LEFT, NoteCode.IMPLAUSIBLE}
        return self.verdict is not Verdict.UNEXPLAINED and not beside & {
            note.code for note in self.notes
        }

    @property
    def unsettled(self) -> bool:
        """Whether time was spent before the model was fitted, and no cause was named, so that nothing is claimed."""
        codes = {note.code for note in self.notes}
        return {NoteCode.NOT_CONVERGED, NoteCode.TIME_SPENT} <= codes and not self.causes

    @property
    def inconclusive(self) -> bool:
        """Whether the record excites nothing or nothing was fitted, so that nothing can be said of the model."""
        return self.verdict is Verdict.AMBIGUOUS and not self.causes


def searched(cls: type[Component]) -> list[str]:
    """Parameters that every candidate refits: the physical ones, and where the continuous states start."""
    layout = cls.layout
    discrete, periods = {d.name for d in layout.discretes}, {d.period for d in layout.discretes}
    real = (p for p in layout.parameters if p.type == "real")
    return [p.name for p in real if p.name not in periods and p.starts not in discrete]


# fits run side by side, and the matrices are narrow: a thread for each product would only wait for the others
@threadpool_limits.wrap(limits=1)
def diagnose(
    cls: type[Component],
    data: Dataset,
    effects: Sequence[type[Effect]],
    fixed: Mapping[str, float] | None = None,
    progress: Callable[[str], None] = lambda text: None,
    holdout: Dataset | None = None,
    held: Sequence[str] = (),
    budget: Budget | None = None,
    each: Sequence[str] = (),
) -> Diagnosis:
    """Tell what a model gets wrong on a record, or on several with one set of parameters.

    Parameters
    ----------
    cls : type[Component]
    data : Dataset
        The record.
    effects : sequence of type[Effect]
        The catalogue.
    fixed : Mapping of str to float, optional
        Values of parameters where the search starts.
    progress : callable
        Told what is being done.
    holdout : Dataset, optional
        Another record to judge by; without it the last third of the record is held out.
    held : sequence of str
        Parameters that are known, and keep their values. Where no input moves, a record can be judged only if every
        start value is among them.
    budget : Budget, optional
        Time that it may take; without limit unless given. When it is spent, what was found by then is judged, and a
        note says so.
    each : sequence of str
        Parameters that differ from run to run: where they are is no change.

    Returns
    -------
    Diagnosis

    Raises
    ------
    UserError
        If the model cannot be simulated over the record, or no output can be trusted.
    """
    chosen = (
        intersample.given(cls, data)
        if data.linear is not None
        else intersample.by_course(cls, data)
    )
    data = replace(data, linear=intersample.linear(chosen))
    holdout = replace(holdout, linear=data.linear) if holdout is not None else None
    parts = divided(cls, data, holdout, fixed or {}, bool(each))
    free = [n for n in searched(cls) if n not in held]
    search = Search(
        parts.estimation, cls, free, fixed or {}, progress, budget or Budget(), each=each
    )
    starts = tuple(name for name in free if name in cls.layout.start_parameters)
    physical = [name for name in free if name not in starts]
    excited = is_excited(cls, parts.estimation, fixed or {})
    inconclusive = (
        bool(starts) and not excited
    )  # not knowing where it starts, how it settles tells nothing
    selection, by_clock = Selection(base := search.nominal()), list[Note]()
    if not inconclusive:
        search, base, by_clock = clock.by_fit(*search.heard(base))
        search, base, chosen = intersample.by_fit(search, base, chosen)
        way, selection = both_ways.selected(search, base, chosen, effects)
        search, base, chosen = way.search, selection.base, way.chosen
    estimation, validation, usable = _as_taken(parts, by_clock, intersample.linear(chosen))
    noise = (
        errors_in_variables.nothing(base)
        if inconclusive
        else errors_in_variables.assess(search, base)
    )
    selection, by_noise = errors_in_variables.defensible(selection, search, noise)
    judged = confirmed(_trusted(search, selection), validation)
    selection, predictions = judged.selection, judged.predictions
    final, failed = _refitted(
        replace(search, data=usable, parameters=free), selection.best, holdout is None
    )
    residuals = analyse_residuals(selection.best, estimation)
    known = noise.spread_of(final.problem.names), intersample.spread(chosen, final)
    more = spread_beside(final, known, selection, residuals)
    values = estimates(final, more)
    unfitted = not final.fit.converged and bool(
        search.budget.notes
    )  # where it ended tells of the clock alone
    changed = [] if inconclusive or unfitted else significantly_changed(final, free, more)
    odd = {} if unfitted else implausible(values, physical)
    excused = errors_in_variables.excused(residuals, selection, search, noise)
    astray = not_followed(validation, predictions[-1])
    left = _is_left(selection, residuals, excused)
    notes = [
        *_excitation_notes([*parts.notes, *by_clock], estimation, excited, starts),
        *intersample.remarks(chosen),
        *errors_in_variables.remarks(noise, base, estimation.inputs),
        *(by_noise + judged.notes + failed),
        *([] if inconclusive else reservations(final, physical)),
        *([Note(NoteCode.IMPLAUSIBLE, "", {"ratios": odd})] if odd else []),
        *(note for _, note in sorted(search.not_assessed.items())),
        *_remarks(selection, residuals, [*astray, *_doubts(predictions, left)]),
        *search.budget.notes,
    ]
    unknown, wrong = (
        inconclusive or (unfitted and not selection.steps),
        left or bool(odd) or bool(astray),
    )
    verdict = Verdict.AMBIGUOUS if unknown else _verdict(selection, changed, wrong)
    return Diagnosis(
        verdict,
        selection,
        values,
        changed,
        residuals,
        *errors_side_by_side(predictions, validation),
        estimation,
        validation,
        final,
        notes,
        chosen,
        excused,
        judged.confirmations,
    )


def _as_taken(
    parts: DividedData, by_clock: Sequence[Note], linear: frozenset[str]
) -> tuple[Dataset, ValidationData, Dataset]:
    """Estimation and validation data, and all of both, by the clock and with inputs as they were found to be."""
    parts = parts.taken(lambda part: replace(clock.by(by_clock, part), linear=linear))
    return parts.estimation, parts.validation, parts.usable


def _refitted(
    search: Search, best: FittedCandidate, more: bool
) -> tuple[FittedCandidate, list[Note]]:
    """Fit what was found to all that was measured; if that fails, it stands as it was fitted to the first part.

    Where there is not more than that part, only what was left out of the search comes back.
    """
    if not more and {*map(base_name, best.problem.names)}.issuperset(search.parameters):
        return best, []
    try:
        return search.trusted(search.refit(best)), []
    except FAILURES as error:
        return best, [Note(NoteCode.NOT_REFITTED, "", {"reason": str(error)})]


def _trusted(search: Search, selection: Selection) -> Selection:
    """Return a selection with the fits that are reported."""
    models = [search.trusted(selection.base)]
    for step in selection.steps:
        models.append(search.trusted(step.chosen, models[-1]))
    steps = [
        replace(step, chosen=chosen)
        for step, chosen in zip(selection.steps, models[1:], strict=True)
    ]
    return replace(selection, base=models[0], steps=steps)


def _excitation_notes(
    notes: Sequence[Note], data: Dataset, excited: bool, starts: tuple[str, ...]
) -> list[Note]:
    """Notes on the data, with what follows from inputs that move too little."""
    if excited:
        return list(notes)
    if not starts:  # everything is known of where it started, so that how it settles can be judged
        return [note for note in notes if note.code is not NoteCode.NO_EXCITATION]
    moving = any(np.ptp(values) > 0.0 for values in data.inputs.values())
    lost = [Note(NoteCode.EXCITATION_BELOW_NOISE)] if moving else []
    return [*notes, *lost, Note(NoteCode.UNKNOWN_START, "", {"parameters": starts})]


def _gained(predictions: Sequence[Prediction]) -> bool:
    """Whether the error fell in some output and grew in none."""
    before, after = predictions[0].errors, predictions[-1].errors
    return any(after[o] < before[o] for o in before) and not any(
        after[o] > DEGRADED * before[o] for o in before
    )


def _doubts(predictions: Sequence[Prediction], left: bool) -> list[Note]:
    """What stands beside causes that were named: something left, or an error that is no smaller where it was judged."""
    if len(predictions) == 1:
        return []
    return [
        *([Note(NoteCode.SOMETHING_LEFT)] if left else []),
        *([] if _gained(predictions) else [Note(NoteCode.NO_GAIN)]),
    ]


def _remarks(
    selection: Selection, residuals: Mapping[str, ResidualAnalysis], astray: Sequence[Note]
) -> list[Note]:
    """What to mind of what was named, and of what is left where was fitted and where was not."""
    return [*_confounders(selection), *remarks(residuals), *astray]


def _confounders(selection: Selection) -> list[Note]:
    """What else may be behind part of what was named."""
    named = {label(effect) for effect in selection.best.candidate.effects}
    notes = []
    for step in selection.steps:
        known = named | {alternative.effect_name for alternative in step.alternatives}
        near = {
            n: share
            for n, share in step.confounding.items()
            if share > CONFOUNDED_SHARE and n not in known
        }
        if near:
            others = dict(sorted(near.items(), key=lambda item: -item[1]))
            notes.append(Note(NoteCode.CONFOUNDED, step.chosen.effect_name, {"shares": others}))
    return notes


def _verdict(selection: Selection, changed: Sequence[str], amiss: bool) -> Verdict:
    """What was found; a cause that was named and not refuted is told whatever is left beside it."""
    if selection.steps:
        return (
            Verdict.AMBIGUOUS
            if any(step.alternatives for step in selection.strong)
            else Verdict.CAUSE
        )
    if amiss:
        return Verdict.UNEXPLAINED
    return Verdict.RECALIBRATE if changed else Verdict.CONSISTENT


def _is_left(
    selection: Selection,
    residuals: Mapping[str, ResidualAnalysis],
    excused: frozenset[tuple[str, type]],
) -> bool:
    """Whether there is structure in a residual that neither noise on the inputs makes nor the form of a cause.

    What was named is never quite of the form that the catalogue gives it, and that leaves something where it acts.
    """
    if any(analysis.lines or analysis.level_shifts for analysis in residuals.values()):
        return True
    before, after = selection.base.fit, selection.best.fit
    noise = {o: power(after.innovation[o]) * n.deviation**2 for o, n in after.noise.items()}
    small = {
        o: bool(selection.steps)
        and power(after.residual[o]) - noise[o]
        < TOLERATED_STRUCTURE * (power(before.residual[o]) - noise[o])
        for o in residuals
    }
    left = [
        o
        for o, analysis in residuals.items()
        for s in analysis.structure
        if (o, type(s)) not in excused
    ]
    return not all(small[o] for o in left)
