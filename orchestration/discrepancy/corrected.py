"""What laws were found to lack as a further cause: named as the catalogue names it, and judged as its causes are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from scipy.stats import chi2
from threadpoolctl import threadpool_limits

from fmus.kit import Component, Effect
from fmus.kit.component import effect_name
from fmus.kit.corrections import Of
from orchestration.discrepancy.candidates.candidate import own_parameters
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.diagnosis import Diagnosis, Verdict, _is_left
from orchestration.discrepancy.laws.base import search_of, usable
from orchestration.discrepancy.laws.calm import calmed, noise_of_inputs
from orchestration.discrepancy.laws.discovery import Correction, LawMapResult, discover
from orchestration.discrepancy.laws.entry import Entry
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.residuals.analysis import analyse_residuals
from orchestration.discrepancy.residuals.remarks import remarks
from orchestration.discrepancy.selection import intersample
from orchestration.discrepancy.selection.search import FAILURES, Search
from orchestration.discrepancy.selection.stepwise import Selection, Step, interchangeable
from orchestration.discrepancy.validation import errors_in_variables
from orchestration.discrepancy.validation.confirmation import Confirmed, Outcome, confirmed
from orchestration.discrepancy.validation.estimates import (
    estimates,
    implausible,
    significantly_changed,
)
from orchestration.discrepancy.validation.following import not_followed
from orchestration.discrepancy.validation.misfit import spread_beside
from orchestration.discrepancy.validation.reservations import reservations
from orchestration.discrepancy.validation.side_by_side import errors_side_by_side
from orchestration.fmu.effects import catalogue, families
from orchestration.records.joined import base_name

_RELAXATIONS = 3  # of one law and signal, one beside the other
_AS_GOOD = (
    6.0  # of BIC, by which an effect of the catalogue may fit worse than the correction that it is
)
# What a lag of a signal, added in proportion, is called among the arms of the kit.
_ARMS = {"lagged": "lagging", "leading": "leading", "heat": "warming"}
# Notes that are about the model as it ended, and so about another one beside a correction.
_OF_THE_END = {
    NoteCode.SOMETHING_LEFT,
    NoteCode.OUTLYING_RESIDUALS,
    NoteCode.VARYING_NOISE,
    NoteCode.FEEDBACK,
    NoteCode.NOT_FOLLOWED,
    NoteCode.END_NOT_FOLLOWED,
    NoteCode.UNDETERMINED,
    NoteCode.DETERMINED_TOGETHER,
    NoteCode.AT_BOUND,
    NoteCode.NOT_CONVERGED,
    NoteCode.NOT_MOVED,
    NoteCode.IMPLAUSIBLE,
    NoteCode.NO_GAIN,
    NoteCode.NOT_REFITTED,
}


@dataclass(frozen=True)
class Laws:
    """What the laws of a diagnosed model lack.

    Attributes
    ----------
    found : LawMapResult
    known : FittedCandidate or None
        The model with the catalogue's own effect in place of the best correction, where one does the same.
    beside : Laws or None
        What the laws lack beside the best correction, which unseen data confirm as well.
    noise : dict of str to float
        Inputs that were freed of noise, and its standard deviation, SI.
    """

    found: LawMapResult
    known: FittedCandidate | None = None
    beside: Laws | None = None
    noise: dict[str, float] = field(default_factory=dict)

    @property
    def best(self) -> Correction | None:
        """The correction that is judged on unseen data, if there is any."""
        return next(iter(self.found.corrections), None)

    @property
    def cause(self) -> FittedCandidate | None:
        """The model with the best correction, as the catalogue has it if it has it."""
        return self.known or (self.best.model if self.best else None)


def leaves_something(diagnosis: Diagnosis) -> bool:
    """Whether there is something that neither parameters nor the causes named account for.

    Where a record cannot tell causes apart, the laws are not asked: they would be one more.
    """
    beside = any(note.code is NoteCode.SOMETHING_LEFT for note in diagnosis.notes)
    return diagnosis.verdict is Verdict.UNEXPLAINED or (
        diagnosis.verdict is Verdict.CAUSE and beside
    )


def ask_on(
    diagnosis: Diagnosis,
    progress: Callable[[str], None] = lambda text: None,
    again: Entry | None = None,
    rounds: int = _RELAXATIONS,
) -> tuple[Laws, Diagnosis]:
    """Ask what the laws lack, and what is confirmed, what they lack beside it.

    A relaxation is asked for another one of the same law and signal, as a spectrum has several; anything else once more
    where it leaves something.

    Parameters
    ----------
    diagnosis, progress, again
        See `discover`.
    rounds : int
        Corrections that may stand one beside the other.

    Returns
    -------
    laws : Laws
    told : Diagnosis
        With what is confirmed among its causes, and inputs without noise; the same where nothing is.
    """
    noise = noise_of_inputs(diagnosis)
    # a correction might undo what that does to the model, and be taken for what the model lacks
    calm = calmed(diagnosis, noise, progress) if noise else diagnosis
    laws, told = _one_by_one(calm, progress, again, rounds)
    return replace(laws, noise=noise), diagnosis if told is calm else told


def _one_by_one(
    diagnosis: Diagnosis, progress: Callable[[str], None], again: Entry | None, rounds: int
) -> tuple[Laws, Diagnosis]:
    laws = ask(diagnosis, progress, again)
    told, best = with_cause(diagnosis, laws, progress), laws.best
    if told is diagnosis or best is None or rounds == 1:
        return laws, told
    if best.relaxation:
        more, both = _one_by_one(told, progress, best.entry, rounds - 1)
    elif again is None and leaves_something(told):
        more, both = _one_by_one(told, progress, None, 1)
    else:
        return laws, told
    return (laws, told) if both is told else (replace(laws, beside=more), both)


# as in a diagnosis: fits run side by side, and the matrices are narrow
@threadpool_limits.wrap(limits=1)
def ask(
    diagnosis: Diagnosis,
    progress: Callable[[str], None] = lambda text: None,
    again: Entry | None = None,
) -> Laws:
    """Ask every law of a diagnosed model what it lacks, and the catalogue whether it knows that.

    Parameters
    ----------
    diagnosis, progress, again
        See `discover`.
    """
    found = discover(diagnosis, progress, again)
    best = next(iter(found.corrections), None)
    return Laws(found, _known(diagnosis, found, best) if best else None)


def same_effect(cls: type[Component], correction: type[Effect]) -> type[Effect] | None:
    """Return the effect of a component's catalogue, or of its families, that adds the same function to the same law.

    Parameters
    ----------
    cls : type[Component]
        The component that is corrected, with effects laid over it or not.
    correction : type[Effect]
        Made by `fmus.kit.corrections.correction`.
    """
    law, of, shape, _, _, kind, *_ = vars(correction)["made_with"]
    if kind != "add" or not isinstance(shape, str) or Of(*of).zero:
        return None
    signal, memory = of[0], of[1]
    for effect in (*catalogue(cls).values(), *families(cls).values()):
        if (effect.term.law, effect.term.signal) != (law, signal):
            continue
        if memory:
            made: tuple[Any, ...] = getattr(effect, "made_with", ())
            same = shape == "linear" and len(made) > 2 and made[2] == _ARMS.get(memory)
        else:  # what stands behind a comma is a remark on the same formula
            same = effect.term.shape.split(",")[0] == correction.term.shape.split(",")[0]
        if same:
            return effect
    return None


def _known(diagnosis: Diagnosis, found: LawMapResult, best: Correction) -> FittedCandidate | None:
    """Fit the catalogue's effect from where the correction that does the same ended."""
    correction, base = best.model.effect, found.base
    effect = same_effect(base.candidate.cls, correction)
    if effect is None or effect_name(effect) in map(effect_name, base.candidate.effects):
        return None
    values = best.model.problem.start | best.model.fit.values
    own = dict(
        zip(own_parameters(effect), (values[n] for n in own_parameters(correction)), strict=False)
    )
    try:
        search = search_of(diagnosis)
        known = search.fit_from(
            base.candidate.with_effect(effect),
            base,
            {**search.fixed, **best.model.fit.values, **own},
        )
    except FAILURES:
        return None
    return known if known.fit.bic <= best.model.fit.bic + _AS_GOOD else None


@threadpool_limits.wrap(limits=1)
def with_cause(
    diagnosis: Diagnosis, laws: Laws, progress: Callable[[str], None] = lambda text: None
) -> Diagnosis:
    """Return a diagnosis with what its laws were found to lack as a further cause, if unseen data confirm it.

    Everything that is told of the model is that of the model with it, judged as a cause of the catalogue is. The
    diagnosis itself stays as it is, and is returned where nothing is confirmed.

    Parameters
    ----------
    diagnosis : Diagnosis
    laws : Laws
    progress : callable
        Told what is being done.

    Raises
    ------
    UserError
        If the corrected model cannot be simulated over the data.
    """
    best, cause = laws.best, laws.cause
    if best is None or cause is None or not best.confirmed:
        return diagnosis
    search = search_of(diagnosis, progress)
    selection = _with_step(search, diagnosis.selection, laws.found, best, cause)
    judged = confirmed(selection, diagnosis.validation)
    found = judged.confirmations.get(cause.effect_name)
    if found is None or found.outcome is not Outcome.CONFIRMED:
        return diagnosis
    return _told_anew(diagnosis, search, judged)


def _with_step(
    search: Search, before: Selection, found: LawMapResult, best: Correction, cause: FittedCandidate
) -> Selection:
    """Name a correction after the causes, or in place of the last ones if they are only another shape of it."""
    kept, chosen = list(before.steps), cause
    while kept and interchangeable(kept[-1].chosen.effect, cause.effect):
        kept.pop()
    below, rejected = (kept[-1].chosen if kept else before.base), before.rejected
    replaced = before.steps[len(kept) :]
    if replaced:
        try:
            alone = search.fit_from(
                below.candidate.with_effect(cause.effect),
                below,
                {**search.fixed, **cause.fit.values},
            )
        except FAILURES:
            alone = None
        if alone is not None and alone.fit.bic <= cause.fit.bic + _AS_GOOD:
            chosen, rejected = (
                alone,
                [*replaced[0].rejected, *((s.chosen, s.gain) for s in replaced)],
            )
        else:
            kept, below = list(before.steps), before.best
    gain = best.gain + below.fit.bic - found.base.fit.bic + cause.fit.bic - chosen.fit.bic
    chosen, p_value = search.trusted(chosen, below), _p_value(found, best)
    step = Step(chosen, gain, gain, p_value, [], rejected, gains={chosen.effect_name: gain})
    return replace(before, steps=[*kept, step], rejected=[])


def _p_value(found: LawMapResult, best: Correction) -> float:
    """Of so large a likelihood ratio without it, a curve having as many parameters as knots; times what was asked."""
    freedom = best.model.fit.parameters - found.base.fit.parameters
    freedom = max(freedom, 1) if best.shape else len(best.entry.basis.knots)
    ratio = found.base.fit.deviance - best.model.fit.deviance
    return float(min(1.0, max(len(found.entries), 1) * chi2.sf(max(ratio, 0.0), freedom)))


def _told_anew(diagnosis: Diagnosis, search: Search, judged: Confirmed) -> Diagnosis:
    """Everything that a diagnosis tells of the model that it ends with, of another selection."""
    selection, predictions, validation = judged.selection, judged.predictions, diagnosis.validation
    final, failed = _of_all(diagnosis, search, selection)
    residuals = analyse_residuals(selection.best, diagnosis.estimation)
    noise = errors_in_variables.assess(search, selection.base)
    known = noise.spread_of(final.problem.names), intersample.spread(diagnosis.intersample, final)
    more = spread_beside(final, known, selection, residuals)
    values, declared = estimates(final, more), final.problem.declared
    physical = [
        n
        for n in map(base_name, selection.base.problem.names)
        if n in declared and not declared[n].starts
    ]
    odd = implausible(values, physical)
    excused = errors_in_variables.excused(residuals, selection, search, noise)
    before, after = predictions[0].errors, predictions[-1].errors
    fitted_errors, judged_errors = errors_side_by_side(predictions, validation)
    notes = [
        *(note for note in diagnosis.notes if note.code not in _OF_THE_END),
        *failed,
        *reservations(final, physical),
        *([Note(NoteCode.IMPLAUSIBLE, "", {"ratios": odd})] if odd else []),
        *remarks(residuals),
        *not_followed(validation, predictions[-1]),
        *([Note(NoteCode.SOMETHING_LEFT)] if _is_left(selection, residuals, excused) else []),
        *([] if all(after[o] <= before[o] for o in before) else [Note(NoteCode.NO_GAIN)]),
    ]
    return replace(
        diagnosis,
        verdict=Verdict.CAUSE,
        selection=selection,
        estimates=values,
        residuals=residuals,
        final=final,
        changed=significantly_changed(final, physical, more),
        fitted_errors=fitted_errors,
        judged_errors=judged_errors,
        notes=notes,
        excused=excused,
        confirmations=judged.confirmations,
    )


def _of_all(
    diagnosis: Diagnosis, search: Search, selection: Selection
) -> tuple[FittedCandidate, list[Note]]:
    """The best model fitted to all that was measured; if that fails, as it was fitted to the first part."""
    best, data = selection.best, usable(diagnosis)
    if len(data.time) == len(best.problem.time):
        return best, []
    try:
        whole = replace(search, data=data)
        return whole.trusted(whole.refit(best)), []
    except FAILURES as error:
        return best, [Note(NoteCode.NOT_REFITTED, "", {"reason": str(error)})]
