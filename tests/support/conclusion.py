"""A conclusion that is drawn once more, from the data and the selection of a diagnosis."""

from __future__ import annotations

from dataclasses import replace

from orchestration.discrepancy.conclude import conclude
from orchestration.discrepancy.final_model import DiagnosisData
from orchestration.discrepancy.laws import search_of
from orchestration.discrepancy.validation import (
    confirm,
    errors_in_variables,
)


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
