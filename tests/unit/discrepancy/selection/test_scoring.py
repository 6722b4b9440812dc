"""Claims: which effects are worth a fit, of which a record says nothing, and where fits start."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fmus.kit.errors import UserError
from fmus.kit.generic import coulomb_friction
from fmus.kit.sensors import sensor_gain
from orchestration.discrepancy.budget import Budget
from orchestration.discrepancy.candidates import ScoredModel
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.note import NoteCode
from orchestration.discrepancy.selection import scoring
from orchestration.discrepancy.selection.scoring import (
    confounding,
    score,
    screen,
    unidentifiable,
)
from orchestration.discrepancy.selection.search import Search
from orchestration.identify.fitting.problem import Problem
from tests.support.regression_model import ASYMMETRY, COUNT, OFFSET, OTHERS, Amplifier
from tests.support.regression_model import offset_record as drawn
from tests.support.scored import at, directions

FRICTION = coulomb_friction(Amplifier, "amplified", "signal", unit="V")


def simulated(monkeypatch: Any) -> None:
    """Have all effects simulated, as those that act through samples are."""

    def none(model, effects, linear):
        return [(effect, None) for effect in effects]

    monkeypatch.setattr(scoring, "score_directions", none)


@pytest.mark.parametrize("fails", [1, 2, 3, 4, 5, None])
def test_an_effect_is_scored_at_the_values_at_which_it_can_be_simulated(monkeypatch, fails):
    """One value of a second parameter fails; with all, there is a reason, not an effect without a
    trace.
    """
    evaluate = Problem.evaluate
    tried = []

    def some(self, q):
        second = round(float(q[self.names.index("amplified_coulomb_velocity")]), 9)
        tried.extend([second] if second not in tried else [])
        if fails is None or tried.index(second) + 1 == fails:
            raise UserError("not finite")
        return evaluate(self, q)

    search = Search(drawn(30.0, 1), Amplifier, ["gain"])
    base = search.nominal()
    simulated(monkeypatch)
    monkeypatch.setattr(Problem, "evaluate", some)
    scored = score(search, base, [FRICTION])
    if fails is None:
        assert FRICTION not in scored.directions
        note = search.not_assessed["coulomb_friction"]
        assert note.code is NoteCode.NOT_SIMULATED
        assert note.facts["reason"] == "not finite"
    else:
        settings = scored.directions[FRICTION].settings
        seconds = {one.values["amplified_coulomb_velocity"] for one in settings}
        assert len(seconds) == len(tried) - 1 == 4


def test_first_order_and_simulation_score_alike(monkeypatch):
    """A regression is of first order in any effect, so both are the same to the last digits."""
    data = drawn(30.0, 1)
    search = Search(data, Amplifier, ["gain"])
    base = at(Amplifier, data, ["gain"], {"gain": 2.3})
    effects = [OFFSET, *OTHERS, sensor_gain(Amplifier, "shown")]
    first_order = score(search, base, effects)
    simulated(monkeypatch)
    in_full = score(search, base, effects)
    for effect in effects:
        one = first_order.directions[effect]
        other = in_full.directions[effect]
        assert [s.values for s in one.settings] == [s.values for s in other.settings]
        assert one.gradient["shown"] == pytest.approx(other.gradient["shown"], rel=1e-4, abs=1e-6)
    assert search.not_assessed == {}


def test_without_time_left_nothing_is_simulated(monkeypatch):
    search = Search(drawn(30.0, 1), Amplifier, ["gain"], budget=Budget(0.0))
    base = at(Amplifier, search.data, ["gain"])
    assert list(score(search, base, [OFFSET]).directions) == [OFFSET]
    simulated(monkeypatch)
    assert score(search, base, [OFFSET]).directions == {}


@pytest.mark.parametrize("linear", [None, True, False, frozenset({"signal"})])
def test_what_is_known_of_inputs_is_handed_on(monkeypatch, linear):
    handed = []

    def found(model, effects, smooth):
        handed.append(set(smooth))
        return []

    monkeypatch.setattr(scoring, "score_directions", found)
    data = drawn(30.0, 1)
    data = Dataset(data.time, data.inputs, data.measured, linear)
    score(Search(data, Amplifier, ["gain"]), at(Amplifier, data, ["gain"]), [])
    assert handed == [{"signal"} if linear else set()]


def test_nothing_is_said_of_what_leaves_no_trace_or_is_the_models_own():
    """A gain of the sensor is the gain of the model; a friction has no setting."""
    gain = sensor_gain(Amplifier, "shown")
    data = drawn(30.0, 1)
    base = at(Amplifier, data, ["gain"])
    scored = score(Search(data, Amplifier, ["gain"]), base, [gain, OFFSET])
    silent = directions({"shown": np.empty((COUNT, 0))}, effect=FRICTION)
    scored = ScoredModel(base, scored.directions | {FRICTION: type(silent)(FRICTION, [], {})})
    notes = unidentifiable(scored)
    assert {name: note.code for name, note in notes.items()} == {
        "sensor_gain(shown)": NoteCode.UNIDENTIFIABLE,
        "coulomb_friction": NoteCode.NO_TRACE,
    }


def test_confounding_is_the_share_of_a_little_of_every_other_effect():
    """By projections: of an offset and of |u|, beside the gain, and only of derivatives."""
    data = drawn(30.0, 1)
    base = at(Amplifier, data, ["gain"])
    scored = score(Search(data, Amplifier, ["gain"]), base, [OFFSET, *OTHERS])
    u = data.inputs["signal"]
    one, other = (c - (c @ u) / (u @ u) * u for c in (np.ones(COUNT), np.abs(u)))
    share = (one @ other) ** 2 / (one @ one) / (other @ other)
    found = confounding(scored, OFFSET, [ASYMMETRY, FRICTION])
    assert found == {"asymmetric_friction": pytest.approx(share, rel=1e-4)}
    large = directions({"shown": np.ones((COUNT, 1))}, 1.0 / 3.0, 3.0)
    only_large = ScoredModel(base, scored.directions | {ASYMMETRY: large})
    assert confounding(only_large, OFFSET, [ASYMMETRY]) == {"asymmetric_friction": 0.0}


def test_a_fit_starts_from_the_amount_that_least_squares_finds():
    """The offset of the record, and the improvement in likelihood that it was made to have."""
    data = drawn(30.0, 1)
    base = at(Amplifier, data, ["gain"])
    base.problem.colour = {"shown": np.empty(0)}
    scored = score(Search(data, Amplifier, ["gain"]), base, [OFFSET, ASYMMETRY])
    first, *others = screen(scored, [OFFSET, ASYMMETRY, FRICTION])
    u = data.inputs["signal"]
    table = np.column_stack([u, np.ones(COUNT)])
    _, offset = np.linalg.lstsq(table, data.measured["shown"])[0]
    assert first.effect is OFFSET
    assert first.below is base
    assert first.start == {OFFSET.neutral: pytest.approx(offset, rel=1e-4)}
    assert first.predicted.fall == pytest.approx(30.0, rel=1e-3)
    assert {one.effect for one in others} == {ASYMMETRY}


def test_what_cannot_be_foretold_is_no_start_and_others_are(monkeypatch):
    data = drawn(30.0, 1)
    both = [OFFSET, ASYMMETRY]
    whole = score(Search(data, Amplifier, ["gain"]), at(Amplifier, data, ["gain"]), both)
    foretold = type(whole.linearised).predicted_improvement

    def runs_away(self, one, k):
        if one.effect is OFFSET:
            raise np.linalg.LinAlgError("not finite")
        return foretold(self, one, k)

    assert {start.effect for start in scoring.screen(whole, both)} == set(both)
    monkeypatch.setattr(type(whole.linearised), "predicted_improvement", runs_away)
    assert {start.effect for start in scoring.screen(whole, both)} == {ASYMMETRY}
