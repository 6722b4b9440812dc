"""Claims: the yardstick of laws hides nothing unless told to, its right answers exist, and it
counts fairly.

`python -m studies.judging.laws` draws records and asks; `studies/hidden_laws` shares no code with
what it judges.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit.curves import SHAPES
from fmus.kit.symbolic import list_laws
from orchestration.fmu.model import find_model
from studies.clean.records import Case, draw
from studies.hidden_laws.kinds import KINDS, NAMES
from studies.hidden_laws.naive import least_bic
from studies.hidden_laws.place import Answer, answers, counted, is_right, over
from studies.hidden_laws.records import (
    LawCase,
    base_of,
    cases,
    curve_of,
    draw_lack,
    lack_of,
    series,
)
from studies.judging import laws as judge
from studies.plants.change import NOTHING
from studies.plants.library import PLANTS, altered


@pytest.mark.parametrize("name", NAMES)
def test_a_plant_that_lacks_nothing_is_the_clean_one(name):
    case = Case(name, "PRBS", "Gaussian", 5)
    bare, clean = draw(case, plant=altered(name, NOTHING)), draw(case)
    for output, y in clean.clean.items():
        assert np.max(np.abs(bare.clean[output] - y)) < 1e-4 * np.ptp(y)


@pytest.mark.parametrize("name", KINDS)
def test_strength_zero_hides_nothing(name):
    kind = KINDS[name]
    none, some = (kind.drawn(np.random.default_rng(1), strength, 60.0) for strength in (1e-9, 1.0))
    memory = [3.0] * len(some.change.rest)
    centre, width = {"angle": (0.0, 0.5), "inner": (303.0, 15.0)}.get(
        kind.place.signal, (0.0, 20.0)
    )
    visited = np.linspace(centre - width, centre + width, 69)
    most, least = (max(abs(one.change.more(x, memory)) for x in visited) for one in (some, none))
    assert most > 0.0
    assert least <= 1e-6 * most


def test_there_are_many_kinds_in_three_shapes_each():
    several = {(k.plant, k.kind) for k in KINDS.values()}
    assert len(several) >= 14
    assert all(sum((k.plant, k.kind) == one for k in KINDS.values()) == 3 for one in several)


@pytest.mark.parametrize("name", KINDS)
def test_right_answers_exist(name):
    kind = KINDS[name]
    cls = find_model(PLANTS[kind.plant].model).cls
    laws = {law.name for law in list_laws(cls)}
    signals = (
        laws
        | {v.name for v in (*cls.layout.inputs, *cls.layout.states, *cls.layout.outputs)}
        | {"time"}
    )
    place = kind.place
    assert Answer(place.law, place.kind, place.signal, kind.memory) in kind.right
    assert {a.law for a in kind.right} <= laws
    assert {a.signal for a in kind.right} <= signals
    assert kind.closed <= {*SHAPES}
    if place.kind == "multiply" and kind.memory != "heat":
        assert kind.coefficient[0] in PLANTS[kind.plant].nominal


@pytest.mark.parametrize("name", NAMES)
def test_laws_that_do_the_same_do(name):
    """A little more in any of them, in its own unit and sign, makes the same rates and outputs."""
    plant = PLANTS[name]
    p, x = dict(plant.nominal), [0.3 + 0.1 * k for k in range(len(plant.states))]
    u = [r.centre + 0.5 * r.amplitude for r in plant.inputs.values()]
    known = plant.evaluate(x, u, p)
    for group in plant.equivalents(p):
        effects = []
        for law, amount in group.items():
            if law not in known or law in ("voltage", "displacement", "drive_voltage"):
                continue  # an output, or a law that only the model under test has
            signal = next(iter(plant.inputs))
            more = altered(name, over(f"{law} + {signal}", lambda x, a=amount: 1e-3 * a).change)
            effects.append([*more.rates(x, u, p), *more.shown(x, u, p)])
        for one in effects[1:]:
            assert one == pytest.approx(effects[0], rel=1e-6)


def test_cases_repeat_and_reach_every_kind():
    drawn = cases(240, 3)
    assert drawn == cases(240, 3)
    assert {(c.plant, c.kind.kind) for c in drawn} == {(k.plant, k.kind) for k in KINDS.values()}
    assert {c.strength for c in drawn} == {1.0, 0.3}
    first, again = draw_lack(drawn[0]), draw_lack(drawn[0])
    assert all(np.array_equal(first.outputs[o], again.outputs[o]) for o in first.outputs)


def test_a_wrong_answer_is_counted_wrong():
    right = KINDS["Pendulum, friction by angle, square"].right
    assert is_right(Answer("friction", "multiply", "angle"), right, {}, 0.05)
    assert not is_right(Answer("friction", "add", "angle"), right, {}, 0.05)  # that is a spring
    assert not is_right(Answer("friction", "multiply", "velocity"), right, {}, 0.05)
    assert not is_right(Answer("gravity", "multiply", "angle"), right, {}, 0.05)
    assert not is_right(Answer("friction", "multiply", "angle", "lagged"), right, {}, 0.05)


def test_signals_that_run_in_proportion_are_one():
    step, right = 1.0, answers("loss + loss; drop x current [throughput]")
    outer = np.sin(np.arange(500.0) / 20.0)
    still = {"outer": outer, "loss": 3.0 * outer, "current": np.where(outer > 0.0, 2.0, -2.0)}
    assert is_right(Answer("loss", "add", "outer"), right, still, step)
    assert is_right(Answer("drop", "multiply", "time"), right, still, step)
    moving = still | {"loss": outer - np.cos(np.arange(500.0) / 90.0), "current": outer - 0.9}
    assert not is_right(Answer("loss", "add", "outer"), right, moving, step)
    assert not is_right(Answer("drop", "multiply", "time"), right, moving, step)
    assert counted(Answer("", "add", "current", "lagged"), still, step) is None


def test_the_naive_method_finds_a_static_error_of_an_output():
    rng = np.random.default_rng(1)
    a, b = np.sin(np.arange(2000) / 30.0), np.cos(np.arange(2000) / 47.0)
    e = {
        "y": 0.3 * a * np.abs(a) + 0.05 * rng.standard_normal(2000),
        "z": 0.05 * rng.standard_normal(2000),
    }
    assert least_bic(e, {"b": b, "a": a, "still": np.ones(2000)}) == ["a", "b"]
    assert judge.naive_is_right("a", answers("law + a"), {"a": a, "b": b})
    assert not judge.naive_is_right("b", answers("law + a"), {"a": a, "b": b})
    assert not judge.naive_is_right("a", answers("law + a [lagged]"), {"a": a, "b": b})
    assert judge.naive_is_right("twice", answers("law + a"), {"a": a, "twice": 2.0 * a})


def test_a_refit_leaves_what_is_hidden_and_truth_can_be_followed():
    hidden = "Cell, resistance grows with use, levelling"
    case = LawCase("Cell", "multisine", "Gaussian", 5, at_rest=False, hidden=hidden)
    drawn = draw_lack(case)
    assert base_of(drawn).left > 3.0 > 1.0 > base_of(draw_lack(case, 1e-9)).left
    known = series(drawn)
    assert known["voltage"] == pytest.approx(drawn.clean["voltage"], abs=1e-9)
    before = drawn.truth[f"{lack_of(case).change.place}_memory_0_start"]
    assert before > 0.0
    assert curve_of(drawn, lack_of(case))(1.0) == lack_of(case).curve(before + 1.0)


def test_a_cause_is_right_by_its_law_and_signal_whatever_its_memory():
    right = KINDS["Pendulum, relaxing arm, one"].right
    assert judge.is_named({("friction", "velocity")}, right, {}, 0.05)
    assert judge.is_named({("acceleration", "time"), ("gravity", "angle")}, right, {}, 0.05)
    assert not judge.is_named({("acceleration", "time")}, right, {}, 0.05)


@pytest.mark.parametrize(
    ("verdict", "right", "kind"),
    [
        ("cause", [True], "first"),
        ("ambiguous", [False, True], "in the group"),
        ("cause", [False], "another"),
        ("unexplained", [True, False], "best guess"),
        ("unexplained", [False, True], "none"),
        ("consistent", [], "none"),
        ("refused", [], "refused"),
    ],
)
def test_rules_of_naming(verdict, right, kind):
    assert judge.named({"verdict": verdict, "right": right}) == kind


def test_a_share_of_a_law_that_stands_still_may_be_named_as_an_addition():
    """Under a constant force a stiffness over the charge is an elongation over the charge."""
    kind = KINDS["Actuator, stiffness by charge, hinge"]
    elongation = Answer("charge_elongation", "add", "charge")
    still, moving = np.ones(9), np.arange(9.0)
    assert elongation in judge.right_answers(kind, {"spring_elongation": still})
    assert judge.right_answers(kind, {"spring_elongation": moving}) == kind.right
    assert judge.right_answers(kind, {}) == kind.right


def test_what_leaves_too_little_or_stands_still_is_not_counted():
    assert judge.excluded({"widths": 3.9})
    assert judge.excluded({"widths": 9.0, "still": judge.stands_still(np.ones(9))})
    assert not judge.excluded({"widths": 9.0, "still": judge.stands_still(None)})
