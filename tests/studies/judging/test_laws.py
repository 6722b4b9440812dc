"""Claims: the yardstick of laws hides nothing unless told to, its right answers exist, and it
counts fairly.

`python -m studies.judging.laws` draws records and asks; `studies/hidden_laws` shares no code with
corrections.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus.kit.corrections import SignalTerm, correction
from fmus.kit.curves import SHAPES
from fmus.kit.symbolic.families import list_laws
from orchestration.fmu.model import catalogue, families, find_model
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
from studies.judging import laws_answers as judge
from studies.judging import laws_catalogue, laws_clean
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
    assert judge.other_way(Answer("friction", "add", "angle"), right, {}, 0.05)
    assert not judge.other_way(Answer("friction", "multiply", "angle"), right, {}, 0.05)
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


def _row(said=(), alike=(), **more):
    told = [
        {"label": "", "gain": 9.0, "confirmed": k == 0, "right": right}
        for k, right in enumerate(said)
    ]
    return {
        "widths": 9.0,
        "said": told,
        "alike": [{"label": "", "right": right} for right in alike],
    } | more


def test_rules_of_naming():
    assert judge.named(_row([True])) == "first"
    assert judge.named(_row([False], [False, True])) == "in the group"
    assert judge.named(_row([False], [False, False, True])) == "large group"
    assert judge.named(_row([False, True])) == "further down"
    assert judge.named(_row([False])) == "another"
    assert judge.named(_row()) == "none"
    assert judge.named({"refused": "no"}) == "refused"
    assert judge.wrongly_confirmed(_row([False]))
    assert not judge.wrongly_confirmed(_row([False], [True]))
    assert judge.as_good(_row([False], ratio=1.01))
    assert not judge.as_good(_row([False], ratio=1.1))
    assert not judge.as_good(_row([True], ratio=1.0))
    assert judge.excluded(_row(widths=3.9))
    assert not judge.excluded(_row())
    known = answers("friction + omega")
    said = [Answer("friction", "add", "load"), Answer("friction", "add", "omega")]
    assert judge.rank(said, known, {}, 1.0) == 2
    assert judge.rank(said[:1], known, {}, 1.0) is None


def test_a_band_is_held_against_the_truth_up_to_a_line():
    visited = np.linspace(-1.0, 1.0, 500)

    def band(x):
        return x**3 - 0.4 * x, x**3 - 0.4 * x - 0.02, x**3 - 0.4 * x + 0.02

    assert judge.covered(band, lambda z: z**3 + 5.0 * z - 1.0, visited) == 1.0
    assert judge.covered(band, lambda z: 2.0 * z**3, visited) < 0.5
    assert judge.covered(band, lambda z: z**3, np.tile([-1.0, 1.0], 50)) is None


def test_a_true_curve_is_told_in_the_unit_of_the_law_that_is_named():
    kind = KINDS["Motor, drag of another power, cube"]
    plant, truth = PLANTS["Motor"], dict(PLANTS["Motor"].nominal)
    omega = np.sin(np.arange(100.0))
    for law, factor in (("friction", 1.0), ("acceleration", -1.0 / truth["inertia"])):
        said = Answer(law, "add", "omega")
        curve, where = judge.true_curve(
            said,
            kind,
            lambda w: w**3,
            {"omega": omega},
            0.1,
            plant=plant,
            truth=truth,
            fitted=truth,
        )
        assert curve(2.0) == pytest.approx(8.0 * factor)
        assert where is omega
    twice = {"omega": omega, "speed": 2.0 * omega + 1.0}
    curve, _ = judge.true_curve(
        Answer("friction", "add", "speed"),
        kind,
        lambda w: w**3,
        twice,
        0.1,
        plant=plant,
        truth=truth,
        fitted=truth,
    )
    assert curve(5.0) == pytest.approx(8.0)
    factor = KINDS["Pendulum, friction by angle, square"]
    said, here = Answer("friction", "multiply", "angle"), {"angle": omega}
    pendulum = PLANTS["Pendulum"]
    curve, _ = judge.true_curve(
        said,
        factor,
        lambda a: a * a,
        here,
        0.1,
        plant=pendulum,
        truth={"damping": 0.4},
        fitted={"damping": 0.8},
    )
    assert curve(1.0) == pytest.approx(0.0)  # half of twice as much


def test_a_closed_form_counts_where_there_is_one():
    kind = KINDS["Motor, drag of another power, cube"]
    said = Answer("friction", "add", "omega")
    assert judge.closed_form(["stops", "cubic", "sign"], kind, said, True) is True
    assert judge.closed_form(["stops", "sign", "cubic"], kind, said, True) is False
    assert (
        judge.closed_form(["cubic"], KINDS["Motor, drag of another power, power 2.5"], said, True)
        is None
    )
    assert judge.closed_form(["cubic"], kind, replace(said, kind="multiply"), True) is None


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


def test_right_answers_of_the_rig_are_in_the_laws_of_its_effects():
    cls = find_model("ppy_actuator").cls
    known = catalogue(cls)
    laws = {law.name for law in list_laws(cls)}
    ids = {effect.id for effect in known.values()}
    assert set(laws_clean.RIG) <= ids
    for name in ids:
        right = laws_clean.right_of(name)
        assert known[name].term.law in {a.law for a in right}
        assert {a.law for a in right} <= laws


def test_effects_of_catalogues_are_right_where_they_change_the_law_by_the_signal():
    """Dry friction over the speed, and the heat of the current, however they are made."""
    speed = np.sin(np.arange(50.0))
    known = {"omega": speed, "voltage": np.cos(np.arange(50.0)) ** 3}
    friction = answers("friction * omega")
    motor = find_model(PLANTS["Motor"].model).cls
    effects = families(motor)
    for name, expected in (
        ("quadratic_drag(friction)", True),
        ("sliding_friction(friction)", False),
        ("quadratic_drag(winding_current, omega)", False),
        ("dead_zone(voltage)", False),
    ):
        said = laws_catalogue.is_right_effect(effects[name], friction, known, 0.1)
        assert said is expected, name
    term = SignalTerm("omega", unit="rad/s", scale=100.0)
    made = correction(motor, "friction", term, "cubic", "N*m", 0.01)
    assert laws_catalogue.is_right_effect(made, friction, known, 0.1)
    remembered = replace(term, memory="lagged", constant=0.1)
    lagged = correction(motor, "friction", remembered, "cubic", "N*m", 0.01)
    assert not laws_catalogue.is_right_effect(lagged, friction, known, 0.1)


@pytest.mark.parametrize(
    ("right", "false"),
    [([True], []), ([False, True], ["a"]), ([True, False], ["b"]), ([False, False], [])],
)
def test_a_companion_is_false_beside_what_is_right(right, false):
    row = {"causes": ["a", "b"][: len(right)], "right": right}
    assert laws_catalogue.false_companions(row) == false
