"""Information criteria by hand."""

from __future__ import annotations

from dataclasses import fields
from math import log
from types import SimpleNamespace

import pytest

from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.identify.fitting.prediction_error import FitResult


def fitted(effects, bic):
    return FittedCandidate(SimpleNamespace(effects=effects), None, SimpleNamespace(bic=bic))


@pytest.mark.parametrize(("tried", "price"), [(0, 0.0), (1, 0.0), (20, 2.0 * log(20))])
def test_an_effect_pays_for_those_that_were_looked_at_beside_it(tried, price):
    base, one, two = fitted((), 200.0), fitted(("a",), 150.0), fitted(("a", "b"), 120.0)
    assert one.delta_bic(base, tried) == pytest.approx(50.0 - price)
    assert two.delta_bic(base, tried) == pytest.approx(80.0 - 2.0 * price)
    assert two.delta_bic(one, tried) == pytest.approx(30.0 - price)


def test_a_parameter_costs_the_logarithm_of_the_samples():
    """Schwarz, Ann. Stat. 6, 1978."""
    known = {"deviance": 30.0, "parameters": 3, "samples": 500}
    result = FitResult(**({field.name: None for field in fields(FitResult)} | known))
    assert result.bic == pytest.approx(30.0 + 3.0 * log(500.0))


def test_its_parameters_are_as_fitted_and_the_others_where_they_start():
    problem = SimpleNamespace(start={"R1": 1.0, "C": 2.0})
    model = FittedCandidate(None, problem, SimpleNamespace(values={"C": 3.0}))
    model.parameters["R1"] = 5.0  # a copy
    assert model.parameters == {"R1": 1.0, "C": 3.0}
