"""What changed from a record to a later one: both are diagnosed, and then held against each other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from fmus.kit.errors import UserError
from orchestration.discrepancy.candidates.candidate import own_parameters
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.changes import AFTER, BEFORE, Change, changes
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.records import dataset, refuse_same
from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.diagnosis import diagnose as _diagnose
from orchestration.discrepancy.laws.base import usable
from orchestration.discrepancy.note import Note, UnusableRecordError
from orchestration.discrepancy.pipeline import (
    Options,
    Result,
    absent_inputs,
    budget_of,
    parameters_given,
)
from orchestration.records import Record
from orchestration.records.joined import base_name


@dataclass(frozen=True)
class Compared:
    """What changed, and what is to be said of the later record by itself.

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
    options: Options | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> Compared:
    """Tell which parameters of a diagnosed model, those of its effects too, are others in a later record.

    Parameters
    ----------
    result : Result
        Of the record before.
    after : Record
    options : Options, optional
        That the diagnosis was made with.
    progress : callable

    Returns
    -------
    Compared

    Raises
    ------
    UserError
        If the later record cannot be used.
    """
    chosen, cls = options or Options(), result.diagnosis.selection.base.candidate.cls
    part = dataset(after, result.model, chosen.given, chosen.interpolate).only(
        result.diagnosis.estimation.measured
    )
    part = replace(part, linear=result.diagnosis.estimation.linear)
    if missing := [o for o in result.diagnosis.estimation.measured if o not in part.measured]:
        raise UserError(
            f"{after.source}: it lacks an output of the record before, {', '.join(missing)}"
        )
    refuse_same([*result.records, after], result.model.outputs, "--compare")
    progress(f"diagnosing {after.source.name}")
    given, budget = parameters_given(chosen, result.model), budget_of(chosen, part)
    try:
        later = _diagnose(
            cls, part, result.effects, given, progress, held=chosen.hold, budget=budget
        )
    except UnusableRecordError:
        raise
    except UserError as error:
        raise UserError(f"{after.source.name}: {error}") from error
    data = Dataset.joined({**_usable(result.diagnosis, BEFORE), **_usable(later, AFTER)})
    best, other = _explaining(result.diagnosis), _explaining(later)
    candidate, values, parameters = (
        best.candidate,
        dict[str, float](),
        [*map(base_name, best.problem.names)],
    )
    for effect in other.candidate.effects:
        if effect not in candidate.effects:
            candidate = candidate.with_effect(effect)
            values |= {n: other.fit.values[n] for n in own_parameters(effect)}
            parameters.append(effect.neutral)
    values |= best.problem.start | best.fit.values
    own = {*candidate.cls.layout.start_parameters, *chosen.each}
    common, single = (
        [n for n in dict.fromkeys(parameters) if (n in own) is which] for which in (False, True)
    )
    enough = budget_of(chosen, data)
    found = changes(candidate, data, common, single, values, progress, enough)
    if (
        enough.notes or later.inconclusive or result.diagnosis.inconclusive
    ):  # what could not be asked is not denied
        found = [replace(one, uncertain=not one.changed) for one in found]
    notes = [*absent_inputs(result.model, [after], chosen.given), *later.notes]
    there = Result([after], [], result.model, result.effects, later, None, None, None, notes)
    return Compared(found, there, enough.notes)


def _usable(diagnosis: Diagnosis, label: str) -> dict[str, Dataset]:
    """The records of a diagnosis, less what could not be trusted."""
    whole = usable(diagnosis)
    return whole.apart() if whole.several else {label: whole}


def _explaining(diagnosis: Diagnosis) -> FittedCandidate:
    """The model that explains a record: with the effects that were named if nothing else is wrong.

    Where something remains, what was named may stand in for it, and would bend the parameters.
    """
    return diagnosis.selection.best if diagnosis.explained else diagnosis.selection.base
