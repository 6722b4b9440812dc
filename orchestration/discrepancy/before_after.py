"""The comparison of two records of one specimen: both are diagnosed, and then fitted together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from fmus.kit import UserError
from orchestration.discrepancy.candidates import Candidate, FittedCandidate, own_parameters
from orchestration.discrepancy.changes import AFTER, BEFORE, find_changes
from orchestration.discrepancy.conclude import Diagnosis
from orchestration.discrepancy.data import Dataset, dataset_of
from orchestration.discrepancy.diagnosis import diagnose as diagnose_data
from orchestration.discrepancy.note import Note, UnusableRecordError
from orchestration.discrepancy.pipeline import (
    DiagnosisOptions,
    Result,
    absent_inputs,
    budget_of,
    parameters_given,
)
from orchestration.identify.changes import Change
from orchestration.records import Record, refuse_same
from orchestration.records.runs import base_name
from orchestration.reporting import option


@dataclass(frozen=True)
class RecordComparison:
    """The changes from a record to a later one, and the diagnosis of the later one by itself.

    Attributes
    ----------
    changes : list of Change
    later : Result
        Diagnosis of the later record, without FMU, gain and experiment.
    notes : list of Note
        On time that the comparison took, if it was spent.
    """

    changes: list[Change]
    later: Result
    notes: list[Note]


def compare(
    result: Result,
    after: Record,
    options: DiagnosisOptions | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> RecordComparison:
    """Tell which parameters of a diagnosed model, or of its effects, differ in a later record.

    Parameters
    ----------
    result : Result
        Of the record before.
    after : Record
    options : DiagnosisOptions, optional
        That the diagnosis was made with.
    progress : callable
        Told what is being done.

    Returns
    -------
    RecordComparison

    Raises
    ------
    UserError
        If the later record cannot be used.
    """
    chosen = options or DiagnosisOptions()
    before = result.diagnosis
    later = _diagnose_later(result, after, chosen, progress)
    data = Dataset.joined({**_usable_runs(before, BEFORE), **_usable_runs(later, AFTER)})
    model = _join_models(_explaining_model(before), _explaining_model(later))
    own = {*model.candidate.cls.layout.start_parameters, *chosen.each}
    names = list(dict.fromkeys(model.parameters))
    budget = budget_of(chosen, data)
    changes = find_changes(
        model.candidate,
        data,
        parameters=[name for name in names if name not in own],
        own=[name for name in names if name in own],
        fixed=model.values,
        progress=progress,
        budget=budget,
    )
    if budget.notes or later.inconclusive or before.inconclusive:
        # a change that could not be asked about is not denied
        changes = [replace(change, uncertain=not change.changed) for change in changes]
    notes = [*absent_inputs(result.model, [after], chosen.given), *later.notes]
    there = Result([after], [], result.model, result.effects, later, notes=notes)
    return RecordComparison(changes, there, budget.notes)


def _diagnose_later(
    result: Result, after: Record, options: DiagnosisOptions, progress: Callable[[str], None]
) -> Diagnosis:
    """Diagnose the later record as the one before was, with inputs taken in the same way."""
    before = result.diagnosis.estimation
    whole = dataset_of(after, result.model, options.given, options.interpolate)
    data = replace(whole.only(before.measured), linear=before.linear)
    missing = [output for output in before.measured if output not in data.measured]
    if missing:
        raise UserError(
            f"{after.source}: it lacks an output of the record before, {', '.join(missing)}"
        )
    refuse_same([*result.records, after], result.model.outputs, option("compare"))
    progress(f"diagnosing {after.source.name}")
    try:
        return diagnose_data(
            result.diagnosis.selection.base.candidate.cls,
            data,
            result.effects,
            parameters_given(options, result.model),
            progress=progress,
            held=options.hold,
            budget=budget_of(options, data),
        )
    except UnusableRecordError:
        raise
    except UserError as error:
        raise UserError(f"{after.source.name}: {error}") from error


def _usable_runs(diagnosis: Diagnosis, label: str) -> dict[str, Dataset]:
    """Return the records of a diagnosis by their labels, less what could not be trusted."""
    usable = diagnosis.usable
    return usable.by_run() if usable.several else {label: usable}


def _explaining_model(diagnosis: Diagnosis) -> FittedCandidate:
    """Return the model that explains a record: with the effects named if nothing else is wrong.

    Where something remains, what was named may stand in for it, and would bend the parameters.
    """
    return diagnosis.selection.best if diagnosis.explained else diagnosis.selection.base


@dataclass(frozen=True)
class _JointModel:
    """A model with every effect of either record.

    Attributes
    ----------
    candidate : Candidate
    parameters : list of str
        That may have changed.
    values : dict of str to float
        Where the search starts, SI.
    """

    candidate: Candidate
    parameters: list[str]
    values: dict[str, float]


def _join_models(before: FittedCandidate, after: FittedCandidate) -> _JointModel:
    """Lay the effects of the later model over the earlier one; only their strengths may change."""
    candidate = before.candidate
    parameters = [base_name(name) for name in before.problem.names]
    values: dict[str, float] = {}
    for effect in after.candidate.effects:
        if effect not in candidate.effects:
            candidate = candidate.with_effect(effect)
            parameters.append(effect.neutral)
            values |= {name: after.fit.values[name] for name in own_parameters(effect)}
    return _JointModel(candidate, parameters, values | before.parameters)
