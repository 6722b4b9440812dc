"""Claims: scores and predicted improvements are the figures that the decision quotes.

What an own parameter makes too is no share of an effect.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from fmus.kit.sensors import sensor_drift
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.candidates.linearised_model import LinearisedModel
from orchestration.discrepancy.data.holdout import HELD_OUT
from orchestration.discrepancy.diagnosis import searched_parameters
from orchestration.discrepancy.selection.scoring import score
from orchestration.discrepancy.selection.search import Search
from studies.emulator.records import draw
from tests.support.diagnosis import as_measured
from tests.support.regression_model import Amplifier, offset_record

DECISION = Path(__file__).parents[4] / "docs" / "decisions" / "0012-naming-causes.md"


def test_the_colour_of_the_base_swallows_a_drift_as_the_decision_says():
    ((scored, predicted),) = re.findall(
        r"scored ([\d.]+), and ([\d.]+) with", DECISION.read_text(encoding="utf-8")
    )
    drawn = draw("sensor_drift", 1)
    first = as_measured(drawn).part(0, round(drawn.time.size * (1.0 - HELD_OUT)))
    search = Search(first, PpyActuator, searched_parameters(PpyActuator))
    looked_at = score(search, search.nominal(), [sensor_drift(PpyActuator, "voltage")])
    model = LinearisedModel(looked_at.model.problem, looked_at.model.fit)
    ((_, (direction,)),) = looked_at.directions.values()
    change = direction.gradient, direction.least, direction.most
    falls = [model.score_statistics(*change)[0], model.predicted_improvement(*change).fall]
    assert falls == pytest.approx([float(scored), float(predicted)], rel=0.02)


def test_what_the_gain_makes_too_is_not_identifiable():
    """An offset of 1 beside some of the input, which has no mean, so that shares are exact."""
    data = offset_record(30.0, 1)
    base = Search(data, Amplifier, ["gain"]).nominal()
    model = LinearisedModel(base.problem, base.fit)
    u = data.inputs["signal"]
    offset, mixed = {"shown": np.ones(u.size)}, {"shown": 1.0 + u}
    assert model.identifiable_share({"shown": u}) == pytest.approx(0.0, abs=1e-6)
    assert model.identifiable_share(offset) == pytest.approx(1.0, abs=1e-6)
    assert model.identifiable_share(mixed) == pytest.approx(1.0 / (1.0 + np.mean(u**2)), rel=1e-6)
    assert model.confounded_share(offset)(mixed) == pytest.approx(1.0, abs=1e-6)
