"""Corrections of laws as further causes of a diagnosis, judged like those of the catalogue.

Where a diagnosis leaves something, every law of the model is searched for what it lacks. A
correction that unseen data confirm becomes one more effect of the selection, under the name that
the catalogue has for it, if it has one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

from scipy.special import chdtrc

from fmus.kit import Effect
from fmus.kit.arrays import single_threaded
from fmus.kit.effects import effect_name, made_with
from orchestration.discrepancy.budget import Budget
from orchestration.discrepancy.candidates import FittedCandidate, own_parameters
from orchestration.discrepancy.conclude import Diagnosis, Verdict, conclude
from orchestration.discrepancy.final_model import DiagnosisData
from orchestration.discrepancy.laws import (
    Correction,
    Entry,
    LawMapResult,
    discover,
    effects_of,
    noise_of_inputs,
    search_of,
    with_denoised_inputs,
)
from orchestration.discrepancy.note import MIXED_UP, NoteCode
from orchestration.discrepancy.selection import (
    FAILURES,
    Search,
    Selection,
    Step,
    as_reported_models,
    interchangeable,
    needed,
    takes_enough,
)
from orchestration.discrepancy.validation import (
    ConfirmedSelection,
    confirm,
    errors_in_variables,
)

_RELAXATIONS = 3  # of one law and signal, one beside the other
# of BIC, by which a model may be worse and still count as fitting as well
_AS_GOOD = 6.0
# What a lag of a signal, added in proportion, is called among the arms of the kit.
_ARMS = {"lagged": "lagging", "leading": "leading", "heat": "warming"}
# Notes on the model that a diagnosis ends with: beside a correction they are made anew, and all
# others are kept.
_ON_THE_BEST_MODEL = {
    NoteCode.CONFOUNDED,
    NoteCode.SOMETHING_LEFT,
    NoteCode.OUTLYING_RESIDUALS,
    NoteCode.VARYING_NOISE,
    NoteCode.FEEDBACK,
    NoteCode.NOT_FOLLOWED,
    NoteCode.END_NOT_FOLLOWED,
    NoteCode.UNDETERMINED,
    NoteCode.DETERMINED_TOGETHER,
    NoteCode.STRAIGHT_PART,
    NoteCode.AT_BOUND,
    NoteCode.NOT_CONVERGED,
    NoteCode.NOT_MOVED,
    NoteCode.IMPLAUSIBLE,
    NoteCode.NO_GAIN,
    NoteCode.NOT_REFITTED,
}


@dataclass(frozen=True)
class LawSearch:
    """The corrections found for the laws of a diagnosed model.

    Attributes
    ----------
    found : LawMapResult
    known : FittedCandidate or None
        The model with the catalogue's own effect in place of the best correction, where one does
        the same.
    beside : LawSearch or None
        What the laws lack beside the best correction, which unseen data confirm as well.
    noise : dict of str to float
        Inputs that were freed of noise, and its standard deviation, SI.
    """

    found: LawMapResult
    known: FittedCandidate | None = None
    beside: LawSearch | None = None
    noise: dict[str, float] = field(default_factory=dict)

    @property
    def best(self) -> Correction | None:
        """The correction that is judged on unseen data, if there is any."""
        return next(iter(self.found.corrections), None)

    def with_errors(self, before: Mapping[str, float], after: Mapping[str, float]) -> LawSearch:
        """Return the same with the errors of the models reported without and with the best one."""
        best, *others = self.found.corrections
        judged = replace(best, errors=(dict(before), dict(after)))
        return replace(self, found=replace(self.found, corrections=[judged, *others]))

    @property
    def cause(self) -> FittedCandidate | None:
        """The model with the best correction, as the catalogue has it if it has it."""
        return self.known or (self.best.model if self.best else None)


def leaves_something(diagnosis: Diagnosis) -> bool:
    """Return whether neither parameters nor the causes named account for all of a record.

    Where one of the causes named accounts for all of it, the laws are not searched, though a record
    cannot tell which: they would be one more. Nor are they where columns look mixed up: then the
    record is wrong, and not a law.
    """
    if any(note.code in MIXED_UP for note in diagnosis.notes):
        return False
    if diagnosis.verdict is Verdict.UNEXPLAINED:
        return True
    beside = any(note.code is NoteCode.SOMETHING_LEFT for note in diagnosis.notes)
    return beside and diagnosis.verdict in (Verdict.CAUSE, Verdict.AMBIGUOUS)


def search_laws(
    diagnosis: Diagnosis,
    progress: Callable[[str], None] = lambda text: None,
    only: Entry | None = None,
    rounds: int = _RELAXATIONS,
    budget: Budget | None = None,
) -> tuple[LawSearch, Diagnosis]:
    """Search the laws for what they lack, and once more beside what unseen data confirm.

    After a relaxation another one of the same law and signal is searched for, as a spectrum has
    several; after anything else all laws are searched once more if it leaves something.

    Parameters
    ----------
    diagnosis, progress, only
        See `discover`.
    rounds : int
        Corrections that may stand one beside the other.
    budget : Budget, optional
        Time that all of it may take; without limit unless given.

    Returns
    -------
    laws : LawSearch
    corrected : Diagnosis
        With what is confirmed among its causes, and inputs without noise; the same where nothing
        is.
    """
    noise = noise_of_inputs(diagnosis)
    # a correction might undo what that does to the model, and be taken for what the model lacks
    denoised = with_denoised_inputs(diagnosis, noise, progress) if noise else diagnosis
    laws, corrected = _search_anew(denoised, progress, only, rounds, budget or Budget())
    return replace(laws, noise=noise), diagnosis if corrected is denoised else corrected


def _search_anew(
    diagnosis: Diagnosis,
    progress: Callable[[str], None],
    only: Entry | None,
    rounds: int,
    budget: Budget,
) -> tuple[LawSearch, Diagnosis]:
    """Search the laws without causes that leave something, and beside these where need be.

    Where a law lacks what no catalogue has, effects of the catalogue were named for it. Beside them
    it would look like another law.
    """
    if not diagnosis.selection.steps or not leaves_something(diagnosis):
        return _search_in_rounds(diagnosis, progress, only, rounds, budget)
    bare = _without_causes(diagnosis)
    laws, alone = _search_in_rounds(bare, progress, only, rounds, budget)
    if _is_as_good(alone, diagnosis) and not leaves_something(alone):
        return laws, alone
    laws_beside, beside = _search_in_rounds(diagnosis, progress, only, rounds, budget)
    return (laws, alone) if _is_as_good(alone, beside) else (laws_beside, beside)


def _without_causes(diagnosis: Diagnosis) -> Diagnosis:
    """Return a diagnosis that names nothing; the causes that it named are rejected."""
    selection = diagnosis.selection
    named = [(step.chosen, step.gain) for step in selection.steps]
    others = [other for step in selection.steps for other in step.rejected]
    rejected = [*others, *selection.rejected, *named]
    bare = replace(selection, steps=[], rejected=rejected)
    return replace(diagnosis, selection=bare, verdict=Verdict.UNEXPLAINED, confirmations={})


def _is_as_good(alone: Diagnosis, other: Diagnosis) -> bool:
    """Return whether laws alone account for a record as well as causes of the catalogue do too.

    What is left beside a law that has not quite its true form is no cause of its own.
    """
    if not alone.selection.steps:
        return False
    best = alone.selection.best
    richer = other.selection.best
    if best.fit.bic <= richer.fit.bic + _AS_GOOD:
        return True
    return not takes_enough(base=alone.selection.base, below=best, richer=richer)


def _search_in_rounds(
    diagnosis: Diagnosis,
    progress: Callable[[str], None],
    only: Entry | None,
    rounds: int,
    budget: Budget,
) -> tuple[LawSearch, Diagnosis]:
    """Search the laws; if a correction is confirmed, search those of the corrected model."""
    laws = _search_once(diagnosis, progress, only, budget)
    corrected = _with_correction(diagnosis, laws, progress)
    best = laws.best
    if corrected is diagnosis or best is None:
        return laws, corrected
    laws = laws.with_errors(diagnosis.after, corrected.after)
    if rounds == 1 or budget.spent():
        return laws, corrected
    if best.relaxation:
        beside, both = _search_in_rounds(corrected, progress, best.entry, rounds - 1, budget)
    elif only is None and leaves_something(corrected):
        beside, both = _search_in_rounds(corrected, progress, None, 1, budget)
    else:
        return laws, corrected
    if both is corrected:
        return laws, corrected
    return replace(laws, beside=beside), both


@single_threaded
def _search_once(
    diagnosis: Diagnosis, progress: Callable[[str], None], only: Entry | None, budget: Budget
) -> LawSearch:
    """Search every law of a diagnosed model, or one entry only, for what it lacks.

    The best correction is looked up in the catalogue.
    """
    law_map = discover(diagnosis, progress, only, budget)
    best = next(iter(law_map.corrections), None)
    return LawSearch(law_map, _fit_known_effect(diagnosis, law_map, best) if best else None)


def same_effect(known: Iterable[type[Effect]], correction: type[Effect]) -> type[Effect] | None:
    """Return the known effect that adds the same function to the same law as a correction does.

    Parameters
    ----------
    known : iterable of type[Effect]
        Of the component that is corrected.
    correction : type[Effect]
        Made by `fmus.kit.corrections.correction`.
    """
    given = made_with(correction)
    signal = given["signal"]
    shape = given["shape"]
    if given["kind"] != "add" or not isinstance(shape, str) or signal.zero:
        return None
    for effect in known:
        if (effect.term.law, effect.term.signal) != (given["law"], signal.name):
            continue
        if signal.memory:
            same = shape == "linear" and _is_lag_effect(effect, signal.memory)
        else:  # what stands behind a comma is a remark on the same formula
            same = effect.term.shape.split(",")[0] == correction.term.shape.split(",")[0]
        if same:
            return effect
    return None


def _is_lag_effect(effect: type[Effect], memory: str) -> bool:
    """Return whether an effect adds a lag of its signal of a certain kind."""
    kind = made_with(effect).get("kind")
    return kind is not None and kind == _ARMS.get(memory)


def _fit_known_effect(
    diagnosis: Diagnosis, law_map: LawMapResult, best: Correction
) -> FittedCandidate | None:
    """Fit the known effect that does what a correction does, from where that ended.

    Returns
    -------
    FittedCandidate or None
        None if there is no such effect, if it is named already, or if it fits worse.
    """
    correction = best.model.effect
    base = law_map.base
    effect = same_effect(effects_of(diagnosis), correction)
    if effect is None or effect_name(effect) in map(effect_name, base.candidate.effects):
        return None
    fitted = best.model.parameters
    ended = [fitted[name] for name in own_parameters(correction)]
    own = dict(zip(own_parameters(effect), ended, strict=False))
    try:
        search = search_of(diagnosis)
        start = {**search.fixed, **best.model.fit.values, **own}
        known = search.fit_from(base.candidate.with_effect(effect), base, start)
    except FAILURES:
        return None
    return known if known.fit.bic <= best.model.fit.bic + _AS_GOOD else None


@single_threaded
def _with_correction(
    diagnosis: Diagnosis, laws: LawSearch, progress: Callable[[str], None]
) -> Diagnosis:
    """Return a diagnosis with the best correction as a further cause, if unseen data confirm it.

    It is judged as a cause of the catalogue is, and the conclusion is that of the model with it.
    The diagnosis itself is returned where nothing is confirmed.

    Raises
    ------
    UserError
        If the corrected model cannot be simulated over the data.
    """
    best = laws.best
    cause = laws.cause
    if best is None or cause is None or not best.confirmed:
        return diagnosis
    search = search_of(diagnosis, progress)
    added = _add_correction(search, diagnosis.selection, laws.found, best, cause)
    reported = as_reported_models(search, needed(search, added))
    judged = confirm(reported, diagnosis.validation, search.trusted)
    # it is confirmed beside the causes named; before them, it need only not be refuted
    if cause.effect_name not in judged.confirmations:
        return diagnosis
    return _conclude_anew(diagnosis, search, judged)


def _add_correction(
    search: Search,
    selection: Selection,
    law_map: LawMapResult,
    best: Correction,
    cause: FittedCandidate,
) -> Selection:
    """Return a selection with one more step, which names a correction."""
    extended, chosen = _place_correction(search, selection, cause)
    below = extended.best
    gain = best.gain + below.fit.bic - law_map.base.fit.bic + cause.fit.bic - chosen.fit.bic
    step = Step(
        chosen=chosen,
        gain=gain,
        evidence=gain,
        p_value=_p_value(law_map, best),
        alternatives=[],
        rejected=extended.rejected,
        gains={chosen.effect_name: gain},
    )
    return replace(extended, steps=[*extended.steps, step], rejected=[])


def _place_correction(
    search: Search, selection: Selection, cause: FittedCandidate
) -> tuple[Selection, FittedCandidate]:
    """Return the selection that a correction is added to, and the model with it.

    A correction is added after the causes named. If the last of these are only other shapes of it,
    and it fits as well without them, it takes their place.
    """
    shortened = _without_interchangeable(selection, cause.effect)
    if len(shortened.steps) < len(selection.steps):
        alone = _fit_alone(search, shortened.best, cause)
        if alone is not None and alone.fit.bic <= cause.fit.bic + _AS_GOOD:
            return shortened, alone
    return selection, cause


def _without_interchangeable(selection: Selection, effect: type[Effect]) -> Selection:
    """Return a selection less its last steps that an effect may replace; these are rejected."""
    count = len(selection.steps)
    while count and interchangeable(selection.steps[count - 1].chosen.effect, effect):
        count -= 1
    replaced = selection.steps[count:]
    if not replaced:
        return selection
    rejected = [*replaced[0].rejected, *((step.chosen, step.gain) for step in replaced)]
    return replace(selection, steps=selection.steps[:count], rejected=rejected)


def _fit_alone(
    search: Search, below: FittedCandidate, cause: FittedCandidate
) -> FittedCandidate | None:
    """Fit a model with the effect of a cause and without those that it may replace."""
    start = {**search.fixed, **cause.fit.values}
    try:
        return search.fit_from(below.candidate.with_effect(cause.effect), below, start)
    except FAILURES:
        return None


def _p_value(law_map: LawMapResult, best: Correction) -> float:
    """Return the p-value of a correction's likelihood ratio, times the corrections looked at.

    A curve has as many parameters as knots.
    """
    if best.shape:
        freedom = max(best.model.fit.parameters - law_map.base.fit.parameters, 1)
    else:
        freedom = len(best.entry.basis.knots)
    ratio = law_map.base.fit.deviance - best.model.fit.deviance
    return float(min(1.0, max(len(law_map.entries), 1) * chdtrc(freedom, max(ratio, 0.0))))


def _conclude_anew(diagnosis: Diagnosis, search: Search, judged: ConfirmedSelection) -> Diagnosis:
    """Draw the conclusion of a diagnosis from a selection that has a confirmed correction."""
    usable = diagnosis.usable
    data = DiagnosisData(
        estimation=diagnosis.estimation,
        validation=diagnosis.validation,
        usable=usable,
        # blocks held out in between leave the time as long as it was, and are not fitted to
        more_than_estimation=len(usable.time) != len(diagnosis.estimation.time),
        parameters=search.parameters,
        intersample=diagnosis.intersample,
        input_noise=errors_in_variables.estimate_input_noise(search, judged.selection.base),
    )
    corrected = conclude(search, judged, data, improves=_no_error_grows)
    kept = [note for note in diagnosis.notes if note.code not in _ON_THE_BEST_MODEL]
    anew = [note for note in corrected.notes if note.code in _ON_THE_BEST_MODEL]
    return replace(corrected, notes=[*kept, *anew])


def _no_error_grows(before: Mapping[str, float], after: Mapping[str, float]) -> bool:
    """Return whether a correction makes no output worse, which a free curve easily would."""
    return all(after[o] <= before[o] for o in before)
