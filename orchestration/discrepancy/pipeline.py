"""The pipeline of ``ppy diagnose``, from records and a model to a diagnosis and its consequences.

These are the extended model, what its FMU gains on unseen data, and the next experiment.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fmus.kit import Component, Effect
from fmus.kit.build import build_cached
from fmus.kit.errors import UserError, suggestion
from fmus.kit.sensors import measurement_effects
from orchestration.discrepancy.budget import Budget, default_time
from orchestration.discrepancy.candidates import (
    catalogue,
    label,
    sampling_of,
    signal_scales,
    without_random,
)
from orchestration.discrepancy.conclude import Diagnosis, Verdict
from orchestration.discrepancy.data import (
    Dataset,
    gap_notes,
    joined_dataset,
)
from orchestration.discrepancy.design import design_experiment
from orchestration.discrepancy.diagnosis import diagnose as diagnose_data
from orchestration.discrepancy.extended_model import (
    ExtensionGain,
    extended_component,
    measure_gain,
)
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.experiment.design import DiscriminatingExperiment, menu
from orchestration.fmu import Model
from orchestration.fmu.model import catalogue as known_effects
from orchestration.fmu.model import families
from orchestration.records import Record, record_labels, refuse_same

FAMILIES = "families"  # instead of a name: all that fits the model's laws too


@dataclass(frozen=True)
class DiagnosisOptions:
    """The options of a diagnosis, beside its records and its model.

    Attributes
    ----------
    given : Mapping of str to float
        Values of parameters where the search starts, and of inputs that stayed at a value, SI.
    effects : sequence of str, optional
        Effects to consider, as ``id`` or ``id(output)``. ``"families"`` is the catalogue and what
        fits the model's laws by their units, which is what is considered where a model's file lists
        no effects; else the catalogue is.
    hold : sequence of str
        Parameters that are known and not fitted.
    each : sequence of str
        Parameters that differ from record to record.
    interpolate : bool, optional
        Whether inputs go smoothly between samples, or are held; None leaves it to the record.
    limits : Mapping of str to tuple of float, optional
        Of the rig by input, SI, within which an experiment is designed.
    highest_frequency : float
        Hz, of the rig, above which nothing may be in a designed stimulus.
    time : float, optional
        Seconds of processor time that the search for causes may take; `budget.default_time` unless
        given. When they are spent, the best answer so far is returned and a note says what was not
        tried.
    """

    given: Mapping[str, float] = field(default_factory=dict)
    effects: Sequence[str] | None = None
    hold: Sequence[str] = ()
    each: Sequence[str] = ()
    interpolate: bool | None = None
    limits: menu.Limits | None = None
    highest_frequency: float = np.inf
    time: float | None = None


@dataclass(frozen=True)
class Result:
    """A diagnosis with what follows from it.

    Attributes
    ----------
    records, holdouts : sequence of Record
        As they were given; of the latter none where some of the former was held out.
    model : Model
    effects : list of type[Effect]
        The catalogue that was considered.
    diagnosis : Diagnosis
    component : type[Component] or None
        The best model with fitted defaults; None where nothing could be said.
    gain : ExtensionGain or None
        The error of its FMU on the validation data, against that of the base model.
    experiment : DiscriminatingExperiment or None
        Where the verdict is ambiguous, the experiment that would tell more.
    notes : list of Note
        What could not be assessed, and why.
    """

    records: Sequence[Record]
    holdouts: Sequence[Record]
    model: Model
    effects: list[type[Effect]]
    diagnosis: Diagnosis
    component: type[Component] | None = None
    gain: ExtensionGain | None = None
    experiment: DiscriminatingExperiment | None = None
    notes: list[Note] = field(default_factory=list)

    @property
    def record(self) -> Record:
        """The first that was fitted to."""
        return self.records[0]

    @property
    def holdout(self) -> Record | None:
        """The first that was held out, if any was given."""
        return self.holdouts[0] if self.holdouts else None

    @property
    def files(self) -> str:
        """Names of the files that were fitted to."""
        return file_names(self.records)


def file_names(records: Sequence[Record]) -> str:
    """Return the names of the files of records, each once, as a list in words."""
    names = list(dict.fromkeys(record.source.name for record in records))
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def diagnose(
    record: Record | Sequence[Record],
    model: Model,
    holdout: Record | Sequence[Record] | None = None,
    options: DiagnosisOptions | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> Result:
    """Tell what a model gets wrong on a record, or on several, extend it, and measure the gain.

    Parameters
    ----------
    record : Record or sequence of Record
        Several have one set of parameters; each has starting states of its own.
    model : Model
        Of which the equations are known.
    holdout : Record or sequence of Record, optional
        Others to judge by; without them the last third of the record is held out, or the last third
        of the records.
    options : DiagnosisOptions, optional
    progress : callable
        Told what is being done.

    Returns
    -------
    Result

    Raises
    ------
    UserError
        If a record or the model cannot be used, or an effect or a parameter is unknown.
    """
    chosen = options or DiagnosisOptions()
    result, data = _diagnose_records(record, model, holdout, chosen, progress)
    if not result.diagnosis.inconclusive:
        progress("running the extended FMU over the validation data")
        result = _with_extended_model(result)
    if result.diagnosis.verdict is Verdict.AMBIGUOUS:
        result = _with_experiment(result, data, chosen, progress)
    return result


def diagnose_only(
    record: Record | Sequence[Record],
    model: Model,
    holdout: Record | Sequence[Record] | None = None,
    options: DiagnosisOptions | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> Result:
    """Do the same without what follows: build no FMU, and design no experiment; see `diagnose`."""
    return _diagnose_records(record, model, holdout, options or DiagnosisOptions(), progress)[0]


def _with_extended_model(result: Result) -> Result:
    """Add the extended model and the gain of its FMU; a note says so if that fails."""
    component = None
    try:
        component = extended_component(result.diagnosis, result.files)
        gain = measure_gain(result.diagnosis, build_cached(component, "native"))
    except Exception as error:  # whatever it was, the diagnosis stands without it
        note = Note(NoteCode.FMU_FAILED, "", {"reason": _reason(error)})
        return replace(result, component=component, notes=[*result.notes, note])
    return replace(result, component=component, gain=gain)


def _with_experiment(
    result: Result, data: Dataset, options: DiagnosisOptions, progress: Callable[[str], None]
) -> Result:
    """Add the experiment that would tell alternatives apart; a note says so if that fails."""
    try:
        experiment = design_experiment(
            result.diagnosis.selection,
            data,
            options.limits,
            options.highest_frequency,
            None,
            progress,
        )
    except Exception as error:  # whatever it was, the diagnosis stands without it
        note = Note(NoteCode.NO_EXPERIMENT, "", {"reason": _reason(error)})
        return replace(result, notes=[*result.notes, note])
    return replace(result, experiment=experiment)


def _diagnose_records(
    record: Record | Sequence[Record],
    model: Model,
    holdout: Record | Sequence[Record] | None,
    options: DiagnosisOptions,
    progress: Callable[[str], None],
) -> tuple[Result, Dataset]:
    """Diagnose a model on records.

    Returns
    -------
    result : Result
        Without what follows from a diagnosis.
    data : Dataset
        All that was given to fit to.
    """
    if options.time is not None and not options.time > 0.0:
        raise UserError(f"time: {options.time:g} s is no time; inf is without limit")
    if model.cls is None:
        raise UserError(
            f"{model.without_equations}; name a component or file.py:Class, or ask ppy diagnose"
            " about it"
        )
    _check_names(options, model)
    records = _listed(record)
    holdouts = _listed(holdout)
    every = (*records, *holdouts)
    refuse_same(every, model.outputs)
    data, judged = _datasets(records, holdouts, model, options)
    fixed = parameters_given(options, model)
    effects = _considered_effects(model.cls, data, fixed, options.effects)
    budget = budget_of(options, data)
    diagnosis = diagnose_data(
        model.cls,
        data,
        effects,
        fixed,
        progress=progress,
        holdout=judged,
        held=options.hold,
        budget=budget,
        each=options.each if len(every) > 1 else (),
    )
    notes = [*absent_inputs(model, every, options.given), *gap_notes(every), *diagnosis.notes]
    return Result(records, holdouts, model, effects, diagnosis, notes=notes), data


def parameters_given(options: DiagnosisOptions, model: Model) -> dict[str, float]:
    """Return the values of parameters among what was given, SI."""
    return {n: value for n, value in options.given.items() if n in model.parameters}


def budget_of(options: DiagnosisOptions, data: Dataset) -> Budget:
    """Return the time for one search over data."""
    return Budget(default_time(data.time.size) if options.time is None else options.time)


def _reason(error: Exception) -> str:
    """Return the reason of a failure: a user's error in its own words, of another its kind too."""
    return str(error) if isinstance(error, UserError) else f"{type(error).__name__}: {error}"


def _listed(records: Record | Sequence[Record] | None) -> list[Record]:
    """Return records as a list, be it one, several or none."""
    return [records] if isinstance(records, Record) else list(records or ())


def _check_names(options: DiagnosisOptions, model: Model) -> None:
    """Refuse names of parameters that a model does not have, or that are both held and free."""
    for option, names in (("hold", options.hold), ("each", options.each)):
        for name in names:
            if name not in model.parameters:
                near = suggestion(name, model.parameters)
                raise UserError(f"{option}: {model.name} has no parameter named {name!r}{near}")
    both = [name for name in options.each if name in options.hold]
    if both:
        raise UserError(f"each: {both[0]} is held, so it cannot differ from record to record")


def _datasets(
    records: Sequence[Record], holdouts: Sequence[Record], model: Model, options: DiagnosisOptions
) -> tuple[Dataset, Dataset | None]:
    """Return the data to fit to, and other data to judge by if there are any.

    Raises
    ------
    UserError
        If the other data have none of the outputs that are fitted.
    """
    # of one record nothing differs, and by itself it needs no label
    alone = len(records) == 1 and len(holdouts) < 2 and not (options.each and holdouts)
    every = [*records, *holdouts]
    names = [""] * len(every) if alone else record_labels(every)
    count = len(records)

    def joined(part: slice) -> Dataset:
        named = dict(zip(names[part], every[part], strict=True))
        return joined_dataset(named, model, options.given, options.interpolate)

    data = joined(slice(count))
    if not holdouts:
        return data, None
    judged = joined(slice(count, None)).only(data.measured)
    if not judged.measured:
        outputs = ", ".join(data.measured)
        raise UserError(
            f"{file_names(holdouts)}: it has none of the outputs of the record, {outputs}"
        )
    return data, judged


def absent_inputs(
    model: Model, records: Sequence[Record], given: Mapping[str, float]
) -> list[Note]:
    """Note inputs that are neither in records nor given, each of them once for every file."""
    notes: list[Note] = []
    seen: list[list[Note]] = []
    for record in records:
        absent = _absent_from(record, model, given)
        if absent not in seen:  # several runs may be of one file
            notes += absent
        seen.append(absent)
    return notes


def _absent_from(record: Record, model: Model, given: Mapping[str, float]) -> list[Note]:
    """Note inputs that are neither in a record nor given."""
    return [
        Note(
            NoteCode.ABSENT_INPUT,
            n,
            {"record": record.source.name, "value": signal.start, "unit": signal.unit},
        )
        for n, signal in model.inputs.items()
        if signal.type == "real" and n not in record.signals and n not in given
    ]


def _considered_effects(
    cls: type[Component], data: Dataset, fixed: Mapping[str, float], wanted: Sequence[str] | None
) -> list[type[Effect]]:
    """Pick effects by name or id.

    Unless some are wanted, they are the component's own that are not random, or families if it
    lists none.
    """
    own = known_effects(cls)
    sampling = sampling_of(data.time)
    known = catalogue(cls, own, data.measured, sampling)
    if wanted is None and own:
        return without_random(known)
    names = (FAMILIES,) if wanted is None else wanted
    if _names_of(known).issuperset(names):
        return [effect for effect in known if _is_named(effect, names)]
    scales = signal_scales(cls, data.time, data.inputs, fixed)
    known += families(cls, scales, sampling).values()
    there = {FAMILIES} | _names_of(known)
    unmeasured = _names_of(measurement_effects(cls))
    for name in names:
        if name not in there and name in unmeasured:
            outputs = ", ".join(data.measured)
            raise UserError(
                f"effects: {name} is of an output that the record does not have (it has: {outputs})"
            )
        if name not in there:
            hint = suggestion(name, sorted(there))
            raise UserError(
                f"effects: no effect named {name!r}{hint}; ppy info {cls.name} lists the catalogue"
            )
    return [effect for effect in known if FAMILIES in names or _is_named(effect, names)]


def _names_of(effects: Sequence[type[Effect]]) -> set[str]:
    """Return the labels and ids of effects."""
    return {label(effect) for effect in effects} | {effect.id for effect in effects}


def _is_named(effect: type[Effect], names: Sequence[str]) -> bool:
    """Return whether the id or the label of an effect is among names."""
    return effect.id in names or label(effect) in names
