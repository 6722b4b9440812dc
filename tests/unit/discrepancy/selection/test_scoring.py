"""Which effects are worth a fit, and of which a record says nothing."""

from __future__ import annotations

import pytest

from fmus.kit.errors import UserError
from fmus.kit.generic import coulomb_friction
from orchestration.discrepancy.selection.scoring import score
from orchestration.discrepancy.selection.search import Search
from orchestration.identify.fitting.problem import Problem
from tests.support.regression_model import Amplifier, offset_record


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
