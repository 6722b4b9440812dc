"""Claims: the oracle integrates what a diagnosis wrote, and the FMUs of drawn records hold."""

from __future__ import annotations

import numpy as np
import pytest

from studies.judging import extended
from studies.outside import PLANTS

SPRING = next(plant.model for plant in PLANTS if plant.name == "spring")
VALUES = {"mass": 1.0, "stiffness": 20.0, "damping": 1.5, "position_start": 0.1}
TIME = 0.02 * np.arange(200)


def part(law, signal, shape, memory="", factor="", places=(), **values):
    parameters = {name: {"value": value} for name, value in values.items()}
    return {
        "law": law,
        "signal": signal,
        "shape": shape,
        "memory": memory,
        "factor": factor,
        "middle": 0.0,
        "scale": 1.0,
        "places": list(places),
        "parameters": parameters,
    }


def place_with(force, *parts):
    columns = {"time": TIME, "force": np.full(len(TIME), force), "place": TIME}
    return extended._integrated(SPRING, parts, VALUES, columns)["place"]


def decaying(force, damping):
    """x of ``x'' + c x' + 20 x = F`` from 0.1 m at rest, in closed form."""
    rest = force / 20.0
    fast = np.sqrt(20.0 - damping**2 / 4.0)
    phase = np.cos(fast * TIME) + damping / (2.0 * fast) * np.sin(fast * TIME)
    return rest + (0.1 - rest) * np.exp(-damping * TIME / 2.0) * phase


def test_a_written_term_is_added_to_its_law():
    added = part("friction", "velocity", "a x", friction_of_velocity=0.5)
    assert place_with(3.0, added) == pytest.approx(decaying(3.0, 2.0), abs=1e-6)
    twice = part("push", "", "a force", factor="force", push_offset=1.0)
    assert place_with(3.0, twice) == pytest.approx(decaying(6.0, 1.5), abs=1e-6)
    flat = part("push", "position", "a curve", places=(-9.0, 0.5, 9.0), a=2.0, b=2.0, c=2.0)
    assert place_with(3.0, flat) == pytest.approx(decaying(5.0, 1.5), abs=1e-6)


@pytest.mark.parametrize("memory", ["lag", "play"])
def test_a_memory_begins_in_equilibrium(memory):
    end = {"lag": "push_of_force_time", "play": "push_of_force_way"}[memory]
    kept = part("push", "force", "a x", memory, **{"push_of_force": 1.0, end: 0.7})
    assert place_with(3.0, kept) == pytest.approx(decaying(6.0, 1.5), abs=1e-6)


def test_every_third_case_is_of_the_actuator_and_every_second_asks_for_families():
    drawn = extended.cases(30, 7)
    assert len({str(case) for case in drawn}) == 30
    assert sum(case.model == "ppy_actuator" for case in drawn) == 10
    assert {case.effects for case in drawn} == {"", "families"}
    assert drawn == extended.cases(30, 7)


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("case", extended.cases(3, 3), ids=str)
def test_the_fmu_of_a_drawn_record_holds(case):
    assert extended.judge(case)["failures"] == []
