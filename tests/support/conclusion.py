"""A conclusion that is drawn once more, from the data and the selection of a diagnosis."""

from __future__ import annotations

from dataclasses import replace

from orchestration.discrepancy.conclude import conclude
from orchestration.discrepancy.final_model import DiagnosisData
from orchestration.discrepancy.selection import Search
from orchestration.discrepancy.validation import (
    confirm,
    errors_in_variables,
)
from orchestration.records.runs import base_name


def search_of(diagnosis):
    """Return a search over the estimation data of a diagnosis, for the parameters of its base."""
    base = diagnosis.selection.base
    problem = base.problem
    names = list(dict.fromkeys(map(base_name, problem.names)))
    known = {p.name for p in base.candidate.cls.layout.parameters}
    fixed = {n: v for n, v in problem.start.items() if n in known and n not in names}
    start = {n: v for n, v in problem.start.items() if n in names}
    return Search(diagnosis.estimation, base.candidate.cls, names, fixed | start, lambda text: None)


def as_it_is(fitted, below):
    """Report a model as it is."""
    return fitted


def conclude_again(diagnosis, **other):
    """Draw the conclusion of a diagnosis once more, from its own selection."""
    judged = confirm(diagnosis.selection, diagnosis.validation, as_it_is)
    return conclude_judged(diagnosis, judged, **other)


def conclude_judged(diagnosis, judged, **other):
    """Draw the conclusion from the data of a diagnosis and a selection that was judged."""
    data = DiagnosisData(
        estimation=diagnosis.estimation,
        validation=diagnosis.validation,
        usable=diagnosis.usable,
        more_than_estimation=True,
        parameters=list(diagnosis.selection.base.problem.names),
        intersample=diagnosis.intersample,
        input_noise=errors_in_variables.no_input_noise(diagnosis.selection.base),
    )
    return conclude(search_of(diagnosis), judged, replace(data, **other))
