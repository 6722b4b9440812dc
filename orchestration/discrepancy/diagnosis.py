"""The diagnosis of a model on a record, from data to a verdict, in six steps.

`screen` decides what of the data can be trusted, `fit` fits the model without effects, `select`
looks for effects that explain what it gets wrong, `complete` fits to every sample what was found
in a stretch of a long record, `judge` holds it against unseen data, and `conclude` draws the
conclusion.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fmus.kit import Component, Effect
from fmus.kit.arrays import single_threaded
from orchestration.discrepancy.budget import Budget
from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.discrepancy.conclude import Diagnosis as Diagnosis
from orchestration.discrepancy.conclude import Verdict as Verdict
from orchestration.discrepancy.conclude import conclude
from orchestration.discrepancy.data import (
    Dataset,
    DividedData,
    has_transient,
    is_excited,
    note_of,
    screen_and_divide,
    searched_stretch,
    stretch_notes,
)
from orchestration.discrepancy.final_model import DiagnosisData
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.residuals import has_structure
from orchestration.discrepancy.selection import (
    Intersample,
    Search,
    Selection,
    all_samples,
    as_reported_models,
    by_another_clock,
    clock,
    filtered_both_ways,
    fitted_to_the_end,
    free_run_error,
    interpolation_hypotheses,
    intersample,
    mixed_up_columns,
    pieced_together,
    solver_error_notes,
)
from orchestration.discrepancy.validation import ConfirmedSelection, confirm, errors_in_variables
from orchestration.records.quality import ahead_of_inputs

_ALIKE = 1.2  # times the least error, up to which explanations of a record cannot be told apart
# of the error that a record read otherwise leaves, up to which causes must come to be named
_NEARER = 0.97
_SCALES = (NoteCode.OTHER_UNIT, NoteCode.OTHER_SIGN)
# readings by which outputs stay what they are: their errors can be held against those of causes
_COLUMNS = (*_SCALES, NoteCode.EXCHANGED)


@dataclass(frozen=True)
class ScreenedRecord:
    """A record of which it is known what can be trusted, and what it is divided into.

    Attributes
    ----------
    parts : DividedData
        Estimation and validation data, by the stamps of the record.
    more_than_estimation : bool
        Whether validation data were held out of the record, and are fitted to at the end.
    intersample : dict of str to Intersample
        What every input that moves is taken to do between samples.
    excited : bool
        Whether the inputs move any output by more than is lost in its noise.
    settles : bool
        Whether outputs move without that: they settle from where the record starts.
    """

    parts: DividedData
    more_than_estimation: bool
    intersample: dict[str, Intersample]
    excited: bool
    settles: bool

    @property
    def linear(self) -> frozenset[str]:
        """Inputs that go smoothly between samples."""
        return intersample.linear(self.intersample)


@dataclass(frozen=True)
class BaseFit:
    """The model without effects, fitted to the estimation data as the fit wants them taken.

    Attributes
    ----------
    record : ScreenedRecord
        With inputs between samples as the fit wants them.
    search : Search
        Fits of models over the estimation data; of parameters that leave a trace in these.
    base : FittedCandidate
    clock_notes : list of Note
        Say so if samples were taken evenly, whatever their stamps are.
    parameters : list of str
        All that may be searched, with or without a trace.
    """

    record: ScreenedRecord
    search: Search
    base: FittedCandidate
    clock_notes: list[Note]
    parameters: list[str]

    @property
    def starts(self) -> tuple[str, ...]:
        """Start values among the parameters."""
        known = self.search.base.layout.start_parameters
        return tuple(name for name in self.parameters if name in known)

    @property
    def informative(self) -> bool:
        """True if the record is informative.

        Without excitation it is if something settles, or ought to from a start that is known.
        """
        return self.record.excited or self.record.settles or not self.starts


@dataclass(frozen=True)
class SelectedEffects:
    """Effects for which the estimation data speak, with all that a conclusion needs beside them.

    Attributes
    ----------
    search : Search
    selection : Selection
    data : DiagnosisData
    """

    search: Search
    selection: Selection
    data: DiagnosisData


def searched_parameters(cls: type[Component]) -> list[str]:
    """Return the parameters of a component that every candidate refits.

    These are the physical ones, and the start values of continuous states; limits that are only
    compared with are none of them.
    """
    layout = cls.layout
    discrete = {d.name for d in layout.discretes}
    clocks = layout.clock_parameters
    return [
        p.name
        for p in layout.parameters
        if p.type == "real" and p.fitted and p.name not in clocks and p.starts not in discrete
    ]


@single_threaded
def diagnose(
    cls: type[Component],
    data: Dataset,
    effects: Sequence[type[Effect]],
    fixed: Mapping[str, float] | None = None,
    *,
    progress: Callable[[str], None] = lambda text: None,
    holdout: Dataset | None = None,
    held: Sequence[str] = (),
    budget: Budget | None = None,
    each: Sequence[str] = (),
    mixed_up: bool = True,
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
        Parameters that are known, and keep their values. Where no input moves, a record can be
        judged only if every start value is among them.
    budget : Budget, optional
        Time that it may take; without limit unless given. When it is spent, what was found by then
        is judged, and a note says so.
    each : sequence of str
        Parameters that differ from run to run: where they are is no change.
    mixed_up : bool
        Whether columns may be mixed up, which is looked at where the model misses much.

    Returns
    -------
    Diagnosis

    Raises
    ------
    UserError
        If the model cannot be simulated over the record, or no output can be trusted.
    """
    values = fixed or {}
    record = screen(cls, data, holdout, values, each)
    parameters = [name for name in searched_parameters(cls) if name not in held]
    seen = searched_stretch(record.parts.estimation)
    limit = budget or Budget()
    is_free = record.settles
    search = Search(seen, cls, parameters, values, progress, limit, each=each, free=is_free)
    with limit.paused():
        fitted, whole = fit_all_samples(fit(search, record))

    def completed(begin: BaseFit) -> SelectedEffects:
        chosen = select(begin, effects, mixed_up)
        with limit.paused():
            return complete(chosen, whole)

    selected = completed(fitted)
    if _shows_more(selected, fitted):
        longer = all_samples.over_longer(fitted.search, whole.search, whole.base)
        with limit.paused():
            further = replace(fitted, search=longer, base=longer.nominal())
        selected = completed(further)
    with limit.paused():
        return conclude(selected.search, judge(selected), selected.data)


def screen(
    cls: type[Component],
    data: Dataset,
    holdout: Dataset | None,
    fixed: Mapping[str, float],
    each: Sequence[str],
) -> ScreenedRecord:
    """Decide what of a record can be trusted, and divide it into estimation and validation data.

    Parameters
    ----------
    cls, data, holdout, fixed, each
        See `diagnose`.

    Returns
    -------
    ScreenedRecord

    Raises
    ------
    UserError
        If the record is too short, or no output can be both fitted and judged.
    """
    choose = intersample.by_course if data.linear is None else intersample.given
    chosen = choose(cls, data)
    linear = intersample.linear(chosen)
    own = None if holdout is None else replace(holdout, linear=linear)
    parts = screen_and_divide(cls, replace(data, linear=linear), own, fixed, bool(each))
    excited = is_excited(cls, parts.estimation, fixed)
    settles = not excited and has_transient(parts.estimation)
    return ScreenedRecord(parts, holdout is None, chosen, excited, settles)


def fit(search: Search, record: ScreenedRecord) -> BaseFit:
    """Fit the model without effects, and let the fit decide on clock and inputs between samples.

    Parameters
    ----------
    search : Search
        Of all parameters that may be searched, over the estimation data of the record or a stretch
        of them.
    record : ScreenedRecord

    Returns
    -------
    BaseFit

    Raises
    ------
    UserError
        If the model cannot be simulated over the record.
    """
    nominal = search.nominal()
    fitted = BaseFit(record, search, nominal, [], list(search.parameters))
    if not fitted.informative:
        return fitted
    by_stamps = search.drop_insensitive(nominal)
    timed_search, timed_base, clock_notes = clock.by_fit(*by_stamps)
    own_search, base, chosen = intersample.by_fit(timed_search, timed_base, record.intersample)
    return replace(
        fitted,
        record=replace(record, intersample=chosen),
        search=own_search,
        base=base,
        clock_notes=clock_notes,
    )


def fit_all_samples(fitted: BaseFit) -> tuple[BaseFit, BaseFit]:
    """Fit the model without effects to every sample, where it was fitted to a stretch of them.

    Parameters
    ----------
    fitted : BaseFit

    Returns
    -------
    fitted : BaseFit
        Over the stretch in which causes should be searched for: where the model is worst.
    whole : BaseFit
        Over every sample.

    Raises
    ------
    UserError
        If the model cannot be simulated over all of the record.
    """
    taken = _as_taken(fitted, fitted.record.parts.estimation)
    if len(fitted.search.data.time) == len(taken.time):
        return fitted, fitted
    search, base = all_samples.base_over_all_samples(
        fitted.search, fitted.base, taken, fitted.parameters
    )
    whole = replace(fitted, search=search, base=base)
    worst = all_samples.at_worst(fitted.search, search, base)
    if worst is fitted.search or not fitted.informative:
        return fitted, whole
    return replace(fitted, search=worst, base=worst.nominal()), whole


def select(
    fitted: BaseFit, effects: Sequence[type[Effect]], mixed_up: bool = True
) -> SelectedEffects:
    """Select the effects that explain what the model gets wrong, and that noise on inputs does not.

    Parameters
    ----------
    fitted : BaseFit
    effects : sequence of type[Effect]
        The catalogue.
    mixed_up : bool
        Whether columns may be mixed up.

    Returns
    -------
    SelectedEffects
    """
    if not fitted.informative:
        return _nothing_selected(fitted, [])
    is_copied = any(note.code is NoteCode.COPIED for note in fitted.record.parts.notes)
    notes = _misuse_notes(fitted) if mixed_up and not is_copied else []
    is_certain = any(note.code not in _COLUMNS for note in notes)
    if is_copied or is_certain or solver_error_notes(fitted.base):
        return _nothing_selected(fitted, notes)
    selected = _selected_causes(fitted, effects)
    # with other columns a record may look better than with a model that lacks something
    return _nothing_selected(fitted, notes) if notes and not _nearer(selected, notes) else selected


def _nothing_selected(fitted: BaseFit, notes: list[Note]) -> SelectedEffects:
    """Return the model without effects, and notes on why none was selected."""
    noise = errors_in_variables.no_input_noise(fitted.base)
    data = _conclusion_data(fitted, fitted.base, noise, notes)
    return SelectedEffects(fitted.search, Selection(fitted.base), data)


def _nearer(selected: SelectedEffects, notes: Sequence[Note]) -> bool:
    """Return whether causes were selected that come nearer to a record than it read otherwise.

    A sensor's gain that does what another unit or sign does is that unit or sign.
    """
    steps = selected.selection.steps
    is_scaled = any(note.code in _SCALES for note in notes)
    if not steps or (is_scaled and steps[0].chosen.effect.id == "sensor_gain"):
        return False
    least = min(note.facts["instead"] for note in notes)
    return free_run_error(steps[-1].chosen) < _NEARER * least


def _selected_causes(fitted: BaseFit, effects: Sequence[type[Effect]]) -> SelectedEffects:
    """Select the effects that explain the record as it stands."""
    way, candidates = interpolation_hypotheses.selected(
        fitted.search, fitted.base, fitted.record.intersample, effects
    )
    noise = errors_in_variables.estimate_input_noise(way.search, candidates.base)
    selection, noise_notes = errors_in_variables.drop_indefensible(candidates, way.search, noise)
    taken = replace(fitted, record=replace(fitted.record, intersample=way.chosen))
    data = _conclusion_data(taken, candidates.base, noise, noise_notes)
    return SelectedEffects(way.search, selection, data)


def _misuse_notes(fitted: BaseFit) -> list[Note]:
    """Return the notes on a record that is not what it says, which no cause explains.

    Of several explanations it is the one with which the model comes nearest to the record, and
    those that cannot be told from that.
    """
    explanations = [by_another_clock, filtered_both_ways]
    data = fitted.search.data
    ahead = [] if data.several else list(map(note_of, ahead_of_inputs(data.channels)))
    if not ahead:
        explanations += [pieced_together, mixed_up_columns]
    notes = [note for explain in explanations for note in explain(fitted.search, fitted.base)]
    least = min((note.facts["instead"] for note in notes), default=0.0)
    return [note for note in notes if note.facts["instead"] <= _ALIKE * least] or ahead


def complete(selected: SelectedEffects, whole: BaseFit) -> SelectedEffects:
    """Fit what was selected in a stretch of a long record to every sample.

    Parameters
    ----------
    selected : SelectedEffects
    whole : BaseFit
        Over every sample.

    Returns
    -------
    SelectedEffects
        With its models fitted to the end, where the time was spent before they were.

    Raises
    ------
    UserError
        If the model cannot be simulated over all of the record.
    """
    data = selected.data
    notes = stretch_notes(data.estimation, selected.search.data)
    if not notes:
        ended = fitted_to_the_end(selected.search, selected.selection)
        return replace(selected, selection=ended)
    search = whole.search
    base = whole.base
    if data.estimation.linear != search.data.linear:
        search, base = all_samples.base_over_all_samples(
            selected.search, selected.selection.base, data.estimation, whole.parameters
        )
    selection = all_samples.steps_over_all_samples(search, base, selected.selection)
    notes += all_samples.dropped_notes(selected.selection, selection)
    noise = data.input_noise
    if noise.deviation:
        noise = errors_in_variables.estimate_input_noise(search, base)
    else:
        noise = errors_in_variables.no_input_noise(base)
    known = replace(data, input_noise=noise, notes=[*data.notes, *notes])
    return SelectedEffects(search, selection, known)


def _shows_more(selected: SelectedEffects, fitted: BaseFit) -> bool:
    """Return whether all of a record shows that a model is wrong, and a stretch of it no cause."""
    search = selected.search
    if not fitted.informative or len(search.data.time) == len(fitted.search.data.time):
        return False
    if selected.selection.steps or search.budget.spent():
        return False
    if solver_error_notes(selected.selection.base):
        return False
    return has_structure(selected.selection.base, search.data)


def judge(selected: SelectedEffects) -> ConfirmedSelection:
    """Hold every selected effect against unseen data, and drop those that these refute.

    Parameters
    ----------
    selected : SelectedEffects

    Returns
    -------
    ConfirmedSelection

    Raises
    ------
    UserError
        If a model cannot be simulated over the validation data.
    """
    search = selected.search

    def as_reported(fitted: FittedCandidate, below: FittedCandidate) -> FittedCandidate:
        return search.trusted(search.renewed(fitted), below)

    reported = as_reported_models(search, selected.selection)
    return confirm(reported, selected.data.validation, as_reported)


def _as_taken(fitted: BaseFit, part: Dataset) -> Dataset:
    """Return data by the clock and with inputs between samples as the fit wants them."""
    return replace(clock.by(fitted.clock_notes, part), linear=fitted.record.linear)


def _conclusion_data(
    fitted: BaseFit,
    base: FittedCandidate,
    noise: errors_in_variables.InputNoise,
    noise_notes: Sequence[Note],
) -> DiagnosisData:
    """Gather the data as the fits want them taken, with the notes on them."""
    record = fitted.record

    parts = record.parts.taken(lambda part: _as_taken(fitted, part))
    notes = [
        *_excitation_notes(fitted, parts.estimation),
        *intersample.remarks(record.intersample),
        *errors_in_variables.input_noise_notes(noise, base, parts.estimation.inputs),
        *noise_notes,
    ]
    return DiagnosisData(
        estimation=parts.estimation,
        validation=parts.validation,
        usable=parts.usable,
        more_than_estimation=record.more_than_estimation,
        parameters=fitted.parameters,
        intersample=record.intersample,
        input_noise=noise,
        informative=fitted.informative,
        notes=notes,
    )


def _excitation_notes(fitted: BaseFit, data: Dataset) -> list[Note]:
    """Return the notes on the data, with what follows from inputs that move too little."""
    notes = [*fitted.record.parts.notes, *fitted.clock_notes]
    if fitted.record.excited:
        return notes
    if fitted.informative:
        others = [note for note in notes if note.code is not NoteCode.NO_EXCITATION]
        return [*others, Note(NoteCode.FREE_RESPONSE)]
    if any(np.ptp(values) > 0.0 for values in data.inputs.values()):
        notes.append(Note(NoteCode.EXCITATION_BELOW_NOISE))
    return notes
