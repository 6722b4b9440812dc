"""Which effects are worth a fit: figures that the decision quotes, and effects of which a record
says nothing.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fmus.kit.errors import UserError
from fmus.kit.generic import coulomb_friction
from fmus.kit.sensors import sensor_drift
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.candidates.linearised_model import LinearisedModel
from orchestration.discrepancy.data.holdout import HELD_OUT
from orchestration.discrepancy.diagnosis import searched_parameters
from orchestration.discrepancy.selection.scoring import score
from orchestration.discrepancy.selection.search import Search
from orchestration.identify.fitting.problem import Problem
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


@pytest.mark.parametrize("fails", [1, 2, 3, 4, 5, None])
def test_an_effect_is_scored_at_the_values_at_which_it_can_be_simulated(monkeypatch, fails):
    """The slowest values of a second parameter fail; with all, there is a reason, not an effect
    without a trace.
    """
    friction = coulomb_friction(Amplifier, "amplified", "signal", unit="V")
    evaluate = Problem.evaluate
    tried = []

    def some(self, q):
        second = round(float(q[self.names.index("amplified_coulomb_velocity")]), 9)
        tried.extend([second] if second not in tried else [])
        if fails is None or tried.index(second) + 1 == fails:
            raise UserError("not finite")
        return evaluate(self, q)

    search = Search(offset_record(30.0, 1), Amplifier, ["gain"])
    base = search.nominal()
    monkeypatch.setattr(Problem, "evaluate", some)
    scored = score(search, base, [friction])
    if fails is None:
        assert friction not in scored.directions
        assert search.not_assessed["coulomb_friction"].facts["reason"] == "not finite"
    else:
        seconds = {d.values["amplified_coulomb_velocity"] for d in scored.directions[friction][1]}
        assert len(seconds) == len(tried) - 1 == 4
