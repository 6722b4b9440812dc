"""Claims: the plants with outside truth are integrated exactly, their models say the same, and
every record has its labels."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from orchestration.diagnosis import LawModel, Record
from orchestration.diagnosis.runs import Setting
from orchestration.fmu import find_model
from studies.outside import (
    KINDS,
    PLANTS,
    Hidden,
    Laws,
    case_of,
    draw_outside,
    noise_of,
    simulate,
)
from studies.outside.elements import bristle, lag, plain, play, rate_limit
from studies.outside.truths import drawer


def _levels(plant, share):
    return [low + share * (high - low) for low, high in plant.ranges]


@pytest.mark.parametrize("plant", PLANTS, ids=lambda plant: plant.name)
def test_a_plant_is_integrated_as_by_solve_ivp(plant):
    n = 120
    t = plant.step * np.arange(n)
    u = np.array([_levels(plant, 0.5 + 0.3 * math.sin(0.07 * k)) for k in range(n)])
    usual = simulate(plant, plant.parameters, (), u, False)[1]
    fine = replace(plant, substeps=10 * plant.substeps)
    outputs = simulate(fine, plant.parameters, (), u, False)[1]
    laws = Laws(plant, plant.parameters, ())
    between = lambda at: [np.interp(at, t, column) for column in u.T]  # noqa: E731
    x = np.array(plant.start)
    expected = [laws.outputs(x, u[0])]
    for k in range(n - 1):  # corners of the inputs are where a step ends
        solved = solve_ivp(
            lambda at, w: laws.rates(w, between(at)),
            (t[k], t[k + 1]),
            x,
            method="DOP853",
            rtol=1e-12,
            atol=1e-14,
        )
        x = solved.y[:, -1]
        expected.append(laws.outputs(x, u[k + 1]))
    spread = np.std(expected, axis=0)
    assert np.abs((outputs - expected) / spread).max() < 1e-8
    assert np.abs((usual - expected) / spread).max() < 1e-4  # noise is 3e-3 at least


@pytest.mark.parametrize("plant", PLANTS, ids=lambda plant: plant.name)
def test_the_model_of_a_plant_says_what_its_functions_say(plant):
    u = np.array([_levels(plant, 0.2 + 0.6 * ((k // 25) % 2)) for k in range(100)])
    _, expected = simulate(plant, plant.parameters, (), u, True)
    model = LawModel(find_model(plant.model).cls)
    assert [v.name for v in model.inputs] == list(plant.inputs)
    assert [v.name for v in model.states] == list(plant.states)
    laws = {law for balance in plant.balances for law in balance}
    assert laws <= set(model.laws)
    time = plant.step * np.arange(100)
    record = Record(time, u, expected, (False,) * len(plant.inputs))
    values = np.array([plant.parameters.get(p.name, p.start) for p in model.parameters])
    course = model.run(record, Setting(values, np.zeros(0, dtype=int), substeps=4), plant.start)
    spread = expected.std(axis=0)
    assert np.abs((course.outputs - expected) / spread).max() < 1e-5


@pytest.mark.parametrize("plant", PLANTS, ids=lambda plant: plant.name)
def test_additions_to_laws_of_one_balance_do_the_same_to_the_outputs(plant):
    """Responses to a constant in each of the laws that a plant itself adds to are in proportion."""
    u = np.array([_levels(plant, 0.3 + 0.4 * ((k // 20) % 2)) for k in range(60)])
    places = {kind.place for kind in KINDS[plant.name]}
    base = simulate(plant, plant.parameters, (), u, True)[1]
    for balance in plant.balances:
        directions = []
        for place in balance & places:
            kind = next(k for k in KINDS[plant.name] if k.place == place)
            constant = Hidden(kind, plain(lambda v: 1.0, lambda s: 0.0), 1e-5)
            moved = simulate(plant, plant.parameters, (constant,), u, True)[1] - base
            directions.append(moved.ravel() / np.linalg.norm(moved))
        for direction in directions[1:]:
            assert abs(direction @ directions[0]) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("number", range(2, 27, 5))
def test_every_group_has_its_labels_and_is_visible(number):
    drawn = draw_outside(case_of(3, number))
    assert len(drawn.right) == {"clean": 0, "two": 2}.get(drawn.group, 1)
    laws = {law for balance in drawn.plant.balances for law in balance}
    for pairs in drawn.right:
        assert pairs
        assert {law for law, _ in pairs} <= laws
        assert {s for _, s in pairs} <= {"power", "fan", "warm", "shown", "time", ""}
    widths = drawn.noise / drawn.fitted.exact.std(axis=0)
    assert np.all((widths > 0.0029) & (widths < 0.0301))
    if drawn.hidden:
        assert drawn.strength >= 3.0 * widths.max()


def test_half_of_the_kinds_are_inside():
    for kinds in KINDS.values():
        inside = sum(kind.inside for kind in kinds)
        assert abs(2 * inside - len(kinds)) <= 1


@pytest.mark.parametrize("plant", PLANTS, ids=lambda plant: plant.name)
def test_all_kinds_of_a_plant_run_and_change_the_outputs(plant):
    u = np.array([_levels(plant, 0.2 + 0.6 * ((k // 30) % 2)) for k in range(150)])
    base = simulate(plant, plant.parameters, (), u, True)[1]
    names = set(plant.inputs) | set(plant.states) | {"time", ""}
    for kind in KINDS[plant.name]:
        element = kind.make(drawer(np.random.default_rng(1)))
        hidden = Hidden(kind, element, min(1e-3, element.most))
        changed = simulate(plant, plant.parameters, (hidden,), u, True)[1]
        assert np.isfinite(changed).all(), kind.name
        if kind.name not in ("knee of the voltage", "overflow"):  # beyond what this record reaches
            assert np.abs(changed - base).max() > 0.0, kind.name
        assert set(kind.signals) <= names, kind.name


def test_noise_has_its_width_and_correlation():
    noise = noise_of(200_000, np.array([2.0]), 0.8, np.random.default_rng(1))[:, 0]
    assert noise.std() == pytest.approx(2.0, rel=0.02)
    assert np.corrcoef(noise[1:], noise[:-1])[0, 1] == pytest.approx(0.8, abs=0.01)


def test_a_case_is_drawn_the_same_again():
    one, other = (draw_outside(case_of(1, 2)) for _ in range(2))
    assert np.array_equal(one.fitted.measured, other.fitted.measured)
    assert one.right == other.right


def _course(element, signal, n, step):
    """Integrate the memory of an element with small Euler steps, and return its values."""
    values, z = [], list(element.start({"v": signal(0.0)}))
    for k in range(n):
        s = {"v": signal(k * step)}
        values.append(element.value(s, z))
        z = [a + step * b for a, b in zip(z, element.rates(s, z), strict=True)]
    return np.array(values)


_V = lambda s: s["v"]  # noqa: E731


def test_a_lag_of_a_ramp_is_behind_by_its_time():
    behind = _course(lag(_V, 0.5), lambda t: 3.0 * t, 60_000, 1e-4)
    assert behind[-1] == pytest.approx(-1.5, rel=1e-3)


def test_play_is_behind_by_its_width_where_its_signal_goes_on():
    behind = _course(play(_V, 0.2, 1e-3), lambda t: t, 20_000, 1e-4)
    assert behind[-1] == pytest.approx(-0.2, abs=2e-3)


def test_a_rate_limit_falls_behind_a_quicker_ramp():
    behind = _course(rate_limit(_V, 1.0, 1e-3), lambda t: 3.0 * t, 10_000, 1e-4)
    assert behind[-1] == pytest.approx(-2.0, abs=1e-2)


def test_bristles_end_at_their_level_and_give_before():
    sliding = _course(bristle(_V, 0.1, 0.5, 1.0), lambda t: 2.0, 10_000, 1e-4)
    assert sliding[-1] == pytest.approx(1.0 + 0.5 * math.exp(-4.0), rel=1e-3)
    assert sliding[10] == pytest.approx(2.0 * 1e-3 / 0.1, rel=0.05)
