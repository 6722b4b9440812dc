"""Claims: what is reported of a model with an effect is no farther from the record than the model without it."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit.sensors import measurement_effects
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.selection.search import Search
from orchestration.identify.prediction_error import fit
from tests.support.several import Cell, measured


@pytest.mark.parametrize("spent", [True, False], ids=["no time left", "time enough"])
def test_an_extended_model_is_no_farther_from_the_record_than_the_one_below(spent):
    """A search whose time is spent where it begins leaves a drift of 10 mV/s that is not there."""
    search = Search(measured(5, 1.0), Cell, ["R0", "R1", "tau1", "relaxed_start"])
    base = search.nominal()
    (drift,) = [effect for effect in measurement_effects(Cell) if effect.id == "sensor_drift"]
    candidate = base.candidate.with_effect(drift)
    problem = search.problem(candidate, [*search.parameters, *candidate.parameters], {})
    problem.out_of_time = lambda: True
    begun = problem.position(problem.start | base.fit.values | {"voltage_drift": 1e-2})
    lost = FittedCandidate(candidate, problem, fit(problem, begun))
    assert lost.fit.values["voltage_drift"] == pytest.approx(1e-2)
    problem.out_of_time = lambda: spent
    found = search.trusted(lost, base)
    errors = [float(np.linalg.norm(model.fit.residual["voltage"])) for model in (found, base)]
    assert errors[0] <= 1.02 * errors[1]
