"""Which effects are worth a fit: figures that the decision quotes, and effects of which a record says nothing."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fmus.kit.sensors import sensor_drift
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.candidates.outlook import LinearisedModel
from orchestration.discrepancy.data.holdout import HELD_OUT
from orchestration.discrepancy.diagnosis import searched
from orchestration.discrepancy.selection.scoring import score
from orchestration.discrepancy.selection.search import Search
from orchestration.rig.emulator.records import draw
from tests.support.diagnosis import as_measured

DECISION = Path(__file__).parents[4] / "docs" / "decisions" / "0012-naming-causes.md"


def test_the_colour_of_the_base_swallows_a_drift_as_the_decision_says():
    ((scored, predicted),) = re.findall(r"scored ([\d.]+), and ([\d.]+) with", DECISION.read_text(encoding="utf-8"))
    drawn = draw("sensor_drift", 1)
    first = as_measured(drawn).part(0, round(drawn.time.size * (1.0 - HELD_OUT)))
    search = Search(first, PpyActuator, searched(PpyActuator))
    looked_at = score(search, search.nominal(), [sensor_drift(PpyActuator, "voltage")])
    model = LinearisedModel(looked_at.model.problem, looked_at.model.fit)
    ((_, (direction,)),) = looked_at.directions.values()
    change = direction.gradient, direction.least, direction.most
    falls = [model.score_statistics(*change)[0], model.predicted_improvement(*change).fall]
    assert falls == pytest.approx([float(scored), float(predicted)], rel=0.02)
