"""The whole of a diagnosis: record and model in; verdict, extended model, gain and next experiment out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fmus.kit import Component, Effect
from fmus.kit.build import build_cached
from fmus.kit.errors import UserError, suggestion
from orchestration.discrepancy.budget import Budget, default_time
from orchestration.discrepancy.candidates.candidate import catalogue, label
from orchestration.discrepancy.candidates.typical import typical
from orchestration.discrepancy.corrected import Laws, ask_on, leaves_something
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.records import gap_notes, joined_dataset, labels, refuse_same
from orchestration.discrepancy.design.experiment import DiscriminatingExperiment, design
from orchestration.discrepancy.design.stimuli import Limits
from orchestration.discrepancy.diagnosis import Diagnosis, Verdict
from orchestration.discrepancy.diagnosis import diagnose as _diagnose
from orchestration.discrepancy.extended_model import Gain, extended, measured_gain
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.fmu.effects import families
from orchestration.fmu.model import Model
from orchestration.fmu.model import catalogue as known_effects
from orchestration.records import Record

FAMILIES = "families"  # instead of a name: all that fits the model's laws too


@dataclass(frozen=True)
class Options:
    """What may be asked of a diagnosis beside a record and a model.

    Attributes
    ----------
    given : Mapping of str to float
        Values of parameters where the search starts, and of inputs that stayed at a value, SI.
    effects : sequence of str, optional
        Effects to consider, as ``id`` or ``id(output)``. ``"families"`` is the catalogue and what fits the model's laws
        by their units, which is what is considered where a model's file lists no effects; else the catalogue is.
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
        Seconds that the search for causes may take; `budget.default_time` unless given. When they are spent, the best
        answer so far is returned and a note says what was not tried.
    """

    given: Mapping[str, float] = field(default_factory=dict)
    effects: Sequence[str] | None = None
    hold: Sequence[str] = ()
    each: Sequence[str] = ()
    interpolate: bool | None = None
    limits: Limits | None = None
    highest_frequency: float = np.inf
    time: float | None = None
    laws: bool = False


@dataclass(frozen=True)
class Result:
    """A diagnosis with what follows from it.

    Attributes
    ----------
    records, holdouts : sequence of Record
        What was given; of the latter none where some of the former was held out.
    model : Model
    effects : list of type[Effect]
        The catalogue that was considered.
    diagnosis : Diagnosis
        With what the laws lack among its causes, if that is confirmed.
    component : type[Component] or None
        The best model with fitted defaults; None where nothing could be said.
    gain : Gain or None
        What its FMU gains on the validation data.
    experiment : DiscriminatingExperiment or None
        Where the verdict is ambiguous, the experiment that would tell more.
    notes : list of Note
        What could not be assessed, and why.
    laws : Laws or None
        What the laws lack; None where they were not asked.
    """

    records: Sequence[Record]
    holdouts: Sequence[Record]
    model: Model
    effects: list[type[Effect]]
    diagnosis: Diagnosis
    component: type[Component] | None
    gain: Gain | None
    experiment: DiscriminatingExperiment | None
    notes: list[Note]
    laws: Laws | None = None

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
    """Names of the files of records, each once."""
    names = list(dict.fromkeys(record.source.name for record in records))
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def diagnose(
    record: Record | Sequence[Record],
    model: Model,
    holdout: Record | Sequence[Record] | None = None,
    options: Options | None = None,
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
        Others to judge by; without them the last third of the record is held out, or the last third of the records.
    options : Options, optional
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
    result, data = _judged(record, model, holdout, options or Options(), progress)
    diagnosis, chosen, notes = result.diagnosis, options or Options(), list(result.notes)
    component = gain = experiment = None
    if not diagnosis.inconclusive:
        progress("running the extended FMU over the validation data")
        try:
            component = extended(diagnosis, result.files)
            gain = measured_gain(diagnosis, build_cached(component, "native"))
        except Exception as error:  # whatever it was, the diagnosis stands without it
            notes.append(Note(NoteCode.FMU_FAILED, "", {"reason": _reason(error)}))
    if diagnosis.verdict is Verdict.AMBIGUOUS and not diagnosis.unsettled:
        try:
            limits, highest = chosen.limits, chosen.highest_frequency
            experiment = design(diagnosis.selection, data, limits, highest, None, progress)
        except Exception as error:  # as above
            notes.append(Note(NoteCode.NO_EXPERIMENT, "", {"reason": _reason(error)}))
    return replace(result, component=component, gain=gain, experiment=experiment, notes=notes)


def judge(
    record: Record | Sequence[Record],
    model: Model,
    holdout: Record | Sequence[Record] | None = None,
    options: Options | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> Result:
    """Do the same without what follows: no FMU is built, and no experiment is designed; see `diagnose`."""
    return _judged(record, model, holdout, options or Options(), progress)[0]


def _judged(
    record: Record | Sequence[Record],
    model: Model,
    holdout: Record | Sequence[Record] | None,
    chosen: Options,
    progress: Callable[[str], None],
) -> tuple[Result, Dataset]:
    """The diagnosis, and the data that it was made of."""
    if chosen.time is not None and not chosen.time > 0.0:
        raise UserError(f"time: {chosen.time:g} s is no time; inf is without limit")
    if model.cls is None:
        raise UserError(
            f"{model.name} is an FMU without equations; name a component or file.py:Class, or ask ppy diagnose about it"
        )
    _check_names(chosen, model)
    records, holdouts = _listed(record), _listed(holdout)
    every = (*records, *holdouts)
    refuse_same(every, model.outputs)
    data, judged = _data(records, holdouts, model, chosen)
    if judged is not None and not judged.measured:
        outputs = ", ".join(data.measured)
        raise UserError(
            f"{file_names(holdouts)}: it has none of the outputs of the record, {outputs}"
        )
    fixed = parameters_given(chosen, model)
    effects = _considered(model.cls, data, fixed, chosen.effects)
    budget = budget_of(chosen, data)
    each = chosen.each if len(every) > 1 else ()
    diagnosis = _diagnose(
        model.cls, data, effects, fixed, progress, judged, chosen.hold, budget, each
    )
    laws, diagnosis = _asked(diagnosis, budget, progress) if chosen.laws else (None, diagnosis)
    notes = [*absent_inputs(model, every, chosen.given), *gap_notes(every), *diagnosis.notes]
    return Result(records, holdouts, model, effects, diagnosis, None, None, None, notes, laws), data


def _asked(
    diagnosis: Diagnosis, budget: Budget, progress: Callable[[str], None]
) -> tuple[Laws | None, Diagnosis]:
    """What the laws lack, and the diagnosis with it, where something is left and there is time."""
    if not leaves_something(diagnosis):
        return None, diagnosis
    if budget.spent():
        budget.leave(["what its laws lack"])
        others = [note for note in diagnosis.notes if note.code is not NoteCode.TIME_SPENT]
        return None, replace(diagnosis, notes=[*others, *budget.notes])
    try:
        return ask_on(diagnosis, progress)
    except Exception as error:  # whatever it was, the diagnosis stands without it
        note = Note(NoteCode.NOT_SIMULATED, "what its laws lack", {"reason": _reason(error)})
        return None, replace(diagnosis, notes=[*diagnosis.notes, note])


def parameters_given(options: Options, model: Model) -> dict[str, float]:
    """Values of parameters among what was given, SI."""
    return {n: value for n, value in options.given.items() if n in model.parameters}


def budget_of(options: Options, *data: Dataset) -> Budget:
    """Time for one search over records."""
    return Budget(
        default_time(sum(one.time.size for one in data)) if options.time is None else options.time
    )


def _reason(error: Exception) -> str:
    """What to say of a failure: a user's in its own words, of another what it is."""
    return str(error) if isinstance(error, UserError) else f"{type(error).__name__}: {error}"


def _listed(records: Record | Sequence[Record] | None) -> list[Record]:
    return [records] if isinstance(records, Record) else list(records or ())


def _check_names(options: Options, model: Model) -> None:
    for option, names in (("hold", options.hold), ("each", options.each)):
        for name in names:
            if name not in model.parameters:
                near = suggestion(name, model.parameters)
                raise UserError(f"{option}: {model.name} has no parameter named {name!r}{near}")
    both = [name for name in options.each if name in options.hold]
    if both:
        raise UserError(f"each: {both[0]} is held, so it cannot differ from record to record")


def _data(
    records: Sequence[Record], holdouts: Sequence[Record], model: Model, options: Options
) -> tuple[Dataset, Dataset | None]:
    """What is fitted to, and other records to judge by if there are any; by themselves they need no labels."""
    given, interpolate = options.given, options.interpolate
    if (
        len(records) == 1 and len(holdouts) < 2 and not (options.each and holdouts)
    ):  # of one record nothing differs
        data = joined_dataset({"": records[0]}, model, given, interpolate)
        return data, joined_dataset({"": holdouts[0]}, model, given, interpolate).only(
            data.measured
        ) if holdouts else None
    named = dict(zip(labels([*records, *holdouts]), [*records, *holdouts], strict=True))
    fitted, judged = list(named)[: len(records)], list(named)[len(records) :]
    data = joined_dataset({label: named[label] for label in fitted}, model, given, interpolate)
    if not judged:
        return data, None
    others = joined_dataset({label: named[label] for label in judged}, model, given, interpolate)
    return data, others.only(data.measured)


def absent_inputs(
    model: Model, records: Sequence[Record], given: Mapping[str, float]
) -> list[Note]:
    """Inputs that are neither in records nor given, each of them once for every file."""
    absent = [_absent(model, record, given) for record in records]
    return [note for k, some in enumerate(absent) for note in some if some not in absent[:k]]


def _absent(model: Model, record: Record, given: Mapping[str, float]) -> list[Note]:
    """Inputs that are neither in a record nor given."""
    return [
        Note(
            NoteCode.ABSENT_INPUT,
            n,
            {"record": record.source.name, "value": signal.start, "unit": signal.unit},
        )
        for n, signal in model.inputs.items()
        if signal.type == "real" and n not in record.signals and n not in given
    ]


def _considered(
    cls: type[Component], data: Dataset, fixed: Mapping[str, float], wanted: Sequence[str] | None
) -> list[type[Effect]]:
    """Pick effects by name or id; unless some are wanted, the component's own, or families if it lists none."""
    own = known_effects(cls)
    if wanted is None and not own:
        wanted = (FAMILIES,)
    known = catalogue(cls, own, data.measured)
    there = {label(effect) for effect in known} | {effect.id for effect in known}
    if wanted is None or there.issuperset(wanted):
        return [e for e in known if wanted is None or e.id in wanted or label(e) in wanted]
    known += families(cls, typical(cls, data.time, data.inputs, fixed)).values()
    there |= {FAMILIES} | {label(effect) for effect in known} | {effect.id for effect in known}
    for name in wanted:
        if name not in there:
            raise UserError(f"effects: no effect named {name!r}{suggestion(name, sorted(there))}")
    return [e for e in known if FAMILIES in wanted or e.id in wanted or label(e) in wanted]
