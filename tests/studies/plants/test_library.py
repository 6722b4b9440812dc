"""Claims: the laws of the linear plants are the state matrices that textbooks have for them."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from studies.plants import PLANTS

SPRING, DAMPER = 300.0, 1.0  # of what the coil pulls on


def actuator(p):
    both = p["R1"] + p["R2"]
    share = p["R2"] / both
    a = np.diag([-1.0 / (both * p["C"]), -p["k2"] / p["b2"], 0.0])
    b = [[share, 0.0], [0.0, 1.0 / p["b2"]], [0.0, 1.0 / p["b1"]]]
    c = [[share / p["C"], 0.0, 0.0], [p["alpha"], 1.0, 1.0]]
    return a, b, c, [[share * p["R1"], 0.0], [0.0, 1.0 / p["k1"]]]


def actuator_by_length(p):
    both = p["R1"] + p["R2"]
    share = p["R2"] / both
    pull = -p["k1"] * np.array([p["alpha"], 1.0, 1.0])
    creep = (pull - np.array([0.0, p["k2"], 0.0])) / p["b2"]
    a = [[-1.0 / (both * p["C"]), 0.0, 0.0], creep, pull / p["b1"]]
    b = [[share, 0.0], [0.0, p["k1"] / p["b2"]], [0.0, p["k1"] / p["b1"]]]
    return a, b, [[share / p["C"], 0.0, 0.0], pull], np.diag([share * p["R1"], p["k1"]])


def galvanostat(p):
    lag = 1.0 / p["response_time"]
    return [[-lag]], [[lag, 0.0]], [[1.0]], [[0.0, 0.0]]


def voice_coil(p):
    cut = 2.0 * pi * p["position_cutoff"]
    a = [
        [-p["R"] / p["L"], 0.0, -p["K"] / p["L"], 0.0],
        [0.0, 0.0, 1.0, 0.0],
        [p["K"] / p["m"], 0.0, -p["b_vc"] / p["m"], 0.0],
        [0.0, cut, 0.0, -cut],
    ]
    b = [[1.0 / p["L"], 0.0], [0.0, 0.0], [0.0, -1.0 / p["m"]], [0.0, 0.0]]
    return a, b, [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]], np.zeros((2, 2))


def motor(p):
    k, r, j = p["constant"], p["resistance"], p["inertia"]
    a = [[-(k * k / r + p["damping"]) / j]]
    return a, [[k / (r * j), -1.0 / j]], [[-k / r], [1.0]], [[1.0 / r, 0.0], [0.0, 0.0]]


def thermal_nodes(p):
    c1, c2, between, out = p["C1"], p["C2"], 1.0 / p["R12"], 1.0 / p["R2"]
    a = [[-between / c1, between / c1], [between / c2, -(between + out) / c2]]
    return a, [[1.0 / c1, 0.0], [0.0, out / c2]], np.eye(2), np.zeros((2, 2))


def cell(p):
    return [[-1.0 / p["tau1"]]], [[1.0 / p["tau1"]]], [[-p["R1"]]], [[-p["R0"]]]


TEXTBOOK = {
    "Actuator": actuator,
    "ActuatorByLength": actuator_by_length,
    "Galvanostat": galvanostat,
    "VoiceCoil": voice_coil,
    "Motor": motor,
    "ThermalNodes": thermal_nodes,
    "Cell": cell,
}


@pytest.mark.parametrize("name", TEXTBOOK)
def test_laws_are_the_state_matrices_of_textbooks(name):
    p = PLANTS[name].specimen(np.random.default_rng(3))
    for found, expected in zip(PLANTS[name].matrices(p), TEXTBOOK[name](p), strict=True):
        expected = np.array(expected)
        size = max(1e-300, np.abs(expected).max())
        assert found / size == pytest.approx(expected / size, rel=1e-11, abs=1e-14)


def test_every_plant_but_four_is_linear():
    others = {name for name, plant in PLANTS.items() if plant.matrices(plant.nominal) is None}
    assert others == {"Pendulum", "Foot", "Crane", "Train"}


def test_the_coil_pulls_on_a_spring_where_its_tension_is_no_input():
    p = PLANTS["VoiceCoil"].nominal
    free, clamped = PLANTS["VoiceCoil"].matrices(p), PLANTS["VoiceCoil"].drawn(p)
    pulled = np.outer(free[1][:, 1], [0.0, SPRING, DAMPER, 0.0])
    assert clamped[0] == pytest.approx(free[0] + pulled)
    assert clamped[1][:, 1] == pytest.approx(0.0)


def test_open_circuit_is_all_that_a_cell_has_at_rest():
    assert PLANTS["Cell"].bias({"ocv": 3.3, "R0": 1.0, "R1": 1.0, "tau1": 1.0}) == [3.3]
    assert not np.any(PLANTS["Motor"].bias(PLANTS["Motor"].nominal))
