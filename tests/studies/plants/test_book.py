"""Claims: plants by the book do what textbooks say in closed form, and their models say the same.

Every closed form is of a step from rest or of a release, and in the units of the plant.
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
import pytest

from orchestration.fmu import find_model
from studies.plants import BY_THE_BOOK, PLANTS, simulate

_HOUR = 3600.0


def _answer(name, levels, start=None, samples=4000, share=1.0):
    """Return time and outputs under constant inputs; `share` is of the usual time between samples.

    The parameters are a specimen's.
    """
    plant = PLANTS[name]
    p = plant.specimen(np.random.default_rng(3))
    step = share / plant.rate
    u = np.tile(np.array(levels, dtype=float).reshape(-1, 1), samples)
    first = plant.rest() if start is None else np.array(start)
    y, _ = simulate(plant, p, step, u, first, finest=plant.coarsest)
    return p, np.arange(samples) * step, dict(zip(plant.outputs, y, strict=True))


def test_an_accelerometer_rings_about_its_static_deflection():
    p, t, y = _answer("Accelerometer", [20.0])
    static = 20e6 / p["omega0"] ** 2
    decay = p["omega0"] / (2.0 * p["quality"])
    omega = sqrt(p["omega0"] ** 2 - decay**2)
    swing = np.exp(-decay * t) * (np.cos(omega * t) + decay / omega * np.sin(omega * t))
    assert y["deflection"] == pytest.approx(static * (1.0 - swing), abs=1e-9 * static)


def test_a_loudspeaker_rests_where_its_suspension_holds_the_force():
    p, _, y = _answer("Loudspeaker", [3.0])
    assert y["current"][0] == pytest.approx(3.0 / p["Re"])
    assert y["current"][-1] == pytest.approx(3.0 / p["Re"])
    assert y["excursion"][-1] == pytest.approx(p["Bl"] * 3.0 / p["Re"] / p["Kms"])
    # mm: the first acceleration is that of the force on the mass
    force = p["Bl"] * 3.0 / p["Re"]
    _, t, early = _answer("Loudspeaker", [3.0], samples=3, share=1e-3)
    assert early["excursion"][1] == pytest.approx(500.0 * force / p["Mms"] * t[1] ** 2, rel=1e-3)


def test_a_vessel_fills_exponentially():
    p, t, y = _answer("Vessel", [0.7])
    level = p["feed"] * 0.7 / p["leak"]
    assert y["gauge"] == pytest.approx(level * (1.0 - np.exp(-p["leak"] / p["volume"] * t)))
    assert y["meter"] == pytest.approx(np.full(t.size, 0.7 * p["feed"]))


def test_a_crane_swings_as_a_pendulum():
    p, t, y = _answer("Crane", [], start=[1e-4, 0.0])
    decay = p["loss"] / 2.0
    omega = sqrt(9.81 / p["rope"] - decay**2)
    swing = np.exp(-decay * t) * (np.cos(omega * t) + decay / omega * np.sin(omega * t))
    assert y["inclination"] == pytest.approx(1e-4 * swing, abs=1e-7)
    # far out it is slower: by the arithmetic-geometric mean of 1 and cos(theta0 / 2), after Gauss
    plant = PLANTS["Crane"]
    free = dict(p, loss=0.0)
    angle, _ = simulate(plant, free, 0.01, np.empty((0, 4000)), np.array([2.0, 0.0]))
    crossing = np.flatnonzero(np.diff(np.sign(angle[0])))[:2]
    between = [k + angle[0, k] / (angle[0, k] - angle[0, k + 1]) for k in crossing]
    a, b = 1.0, np.cos(1.0)
    for _ in range(6):
        a, b = (a + b) / 2.0, np.sqrt(a * b)
    period = 2.0 * pi * sqrt(p["rope"] / 9.81) / a
    assert 2.0 * 0.01 * (between[1] - between[0]) == pytest.approx(period, rel=1e-5)


def test_a_ship_turns_at_last_as_the_rudder_asks():
    p, t, y = _answer("Ship", [5.0])
    rise = 1.0 - np.exp(-t / p["T"])
    assert y["turn"] == pytest.approx(5.0 * p["K"] * rise)
    assert y["compass"] == pytest.approx(5.0 * p["K"] * (t - p["T"] * rise), abs=1e-6)


def test_tanks_pass_on_what_is_pumped():
    p, _, y = _answer("Tanks", [0.012])
    lower = 0.012 / p["drain"]
    assert y["lower_level"][-1] == pytest.approx(lower)
    assert y["upper_level"][-1] == pytest.approx(lower + 0.012 / p["pipe"])


def test_a_house_cools_in_the_hours_of_capacity_over_loss():
    p, t, y = _answer("House", [1.0, 275.0])
    last = 275.0 + 1.0 / p["UA"]
    decay = np.exp(-t * p["UA"] / (p["C"] * _HOUR))
    assert y["indoor"] == pytest.approx(last + (291.0 - last) * decay)


def test_a_lithium_cell_counts_ampere_hours():
    p, t, y = _answer("LithiumCell", [1.5])
    drawn = 1.5 * t / _HOUR
    assert y["terminal"] == pytest.approx(p["U0"] - p["slope"] * drawn - 1.5 * p["R"])


def test_a_gear_motor_runs_up_to_where_the_torques_balance():
    p, t, y = _answer("GearMotor", [6.0])
    constant = 20.0 * p["k"]
    stiff = constant**2 / p["R"] + p["b"]
    speed = constant * 6.0 / p["R"] / stiff * (1.0 - np.exp(-stiff / p["J"] * t))
    assert y["tachometer"] == pytest.approx(speed)
    assert y["ammeter"] == pytest.approx((6.0 - constant * speed) / p["R"])


def test_a_train_loses_speed_as_its_resistance_falls():
    p, t, y = _answer("Train", [], start=[110.0, 0.0], samples=1000)
    limit = p["rolling"] / p["growth"]
    decay = np.exp(-p["growth"] * t)
    assert y["speedometer"] == pytest.approx((110.0 + limit) * decay - limit)
    way = (110.0 + limit) * (1.0 - decay) / p["growth"] - limit * t
    assert y["position"] == pytest.approx(way / _HOUR, abs=1e-9)


@pytest.mark.parametrize("name", BY_THE_BOOK)
def test_a_model_without_anything_missing_has_the_rates_of_its_plant(name):
    """The models are written by hand with the kit, so each holds the other to its units."""
    rng = np.random.default_rng(5)
    plant = PLANTS[name]
    p = plant.specimen(rng)
    x = (plant.rest() + rng.normal(size=plant.order)).tolist()
    u = [r.centre + r.amplitude * rng.normal() for r in plant.inputs.values()]
    cls = find_model(plant.model).cls
    one = cls()
    for named, values in ((p, p.values()), (plant.states, x), (plant.inputs, u)):
        for variable, value in zip(named, values, strict=True):
            setattr(one, variable, value)
    declared = {state.name: state.rate for state in cls.layout.states}
    assert set(declared) == set(plant.states)
    rates = [getattr(one, declared[state])() for state in plant.states]
    assert rates == pytest.approx(plant.rates(x, u, p), rel=1e-12)
    units = {output.name: output.unit for output in cls.layout.outputs}
    assert units == dict(plant.outputs)
    shown = [getattr(one, output)() for output in plant.outputs]
    assert shown == pytest.approx(plant.shown(x, u, p), rel=1e-12)
