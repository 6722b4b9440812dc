"""Claims: a load that was there before the first sample decides no value, alone or by comparison.

The records are of an own simulation, a matrix exponential of SciPy over each step of held inputs.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from fmus.ppy_actuator import PpyActuator
from orchestration.diagnosis import Options
from orchestration.diagnosis.changes import find_changes
from orchestration.diagnosis.engine import Diagnosis, diagnose
from orchestration.fmu.model import declared_model_of
from orchestration.identify.changes import Change, describe_changes
from orchestration.records import Record

TRUE = {
    "R1": 0.71,
    "R2": 3.4,
    "C": 1.9,
    "alpha": 0.092e-3,
    "k1": 5200.0,
    "b1": 1.1e6,
    "k2": 8200.0,
    "b2": 1.3e6,
}
STEP = 0.05
MODEL = declared_model_of(PpyActuator)
PARAMETERS_ALONE = Options(effects=[], laws=False)


def month(number: int, **changed: float) -> Record:
    """Return 100 s of switched current under 1 N that was there long before.

    The damper `b1` has crept by 0.1 mm a month.
    """
    p = TRUE | changed
    random = np.random.default_rng(number)
    time = STEP * np.arange(2000)
    current = 0.6 * np.repeat(random.choice([-1.0, 1.0], 200), 10)
    rate = -1.0 / ((p["R1"] + p["R2"]) * p["C"])
    matrix = np.zeros((5, 5))  # charge, two elongations, current, force
    matrix[0, [0, 3]] = rate, p["R2"] / (p["R1"] + p["R2"])
    matrix[1, [1, 4]] = -p["k2"] / p["b2"], 1.0 / p["b2"]
    matrix[2, 4] = 1.0 / p["b1"]
    step = expm(matrix * STEP)
    states = np.zeros((len(time), 5))
    states[0, :3] = 0.2 * random.normal(), 1.0 / p["k2"], 1e-4 * number
    states[:, 3], states[:, 4] = current, 1.0
    for k in range(len(time) - 1):
        states[k + 1, :3] = (step @ states[k])[:3]
    charge = states[:, 0]
    flow = (p["R2"] * current - charge / p["C"]) / (p["R1"] + p["R2"])
    voltage = p["R1"] * flow + charge / p["C"]
    displacement = p["alpha"] * charge + 1.0 / p["k1"] + states[:, 1] + states[:, 2]
    return Record(
        time,
        {
            "current": current,
            "force": states[:, 4],
            "voltage": voltage + 3e-3 * random.standard_normal(len(time)),
            "displacement": displacement + 2e-6 * random.standard_normal(len(time)),
        },
        {"current": "A", "force": "N", "voltage": "V", "displacement": "m"},
        Path(f"month_{number}.csv"),
    )


@pytest.fixture(scope="module")
def first() -> Diagnosis:
    return diagnose([month(0)], MODEL, options=PARAMETERS_ALONE)


def compared(first: Diagnosis, record: Record) -> dict[str, Change]:
    changed = find_changes(first, record, PARAMETERS_ALONE)
    return {one.name: one for one in changed.changes}


@pytest.fixture(scope="module")
def aged(first: Diagnosis) -> dict[str, Change]:
    """R1 is 10 % higher, C 5 % lower."""
    return compared(first, month(5, R1=1.1 * TRUE["R1"], C=0.95 * TRUE["C"]))


def test_a_stiffness_that_shows_in_the_offset_alone_is_not_determined(first):
    assert first.parameters["k1"].interval[1] == math.inf
    assert "k1" not in first.changed
    for name in ("R1", "R2", "C", "alpha"):
        low, high = first.parameters[name].interval
        assert low < TRUE[name] < high
        assert high - low < 0.01 * TRUE[name]


@pytest.mark.slow
def test_an_offset_of_the_later_record_is_no_change_of_a_stiffness(aged):
    assert not aged["k1"].changed
    assert not aged["k1"].uncertain
    assert {name for name, one in aged.items() if one.changed} == {"R1", "C"}


@pytest.mark.slow
def test_values_before_are_those_of_the_first_record_alone(first, aged):
    """What both records share may move them, by less than their own uncertainty."""
    for name in ("R1", "R2", "C", "alpha"):
        low, high = first.parameters[name].interval
        value = first.parameters[name].value
        assert abs(aged[name].before - value) < 0.2 * (high - low), name
    assert aged["C"].after / aged["C"].before == pytest.approx(0.95, abs=2e-3)
    assert aged["R1"].after / aged["R1"].before == pytest.approx(1.1, abs=2e-3)


@pytest.mark.slow
def test_changes_of_a_percent_are_told_with_their_sizes(first):
    """Of 2 % and -1 %, many standard errors; nothing else moved."""
    found = compared(first, month(1, R1=1.02 * TRUE["R1"], C=0.99 * TRUE["C"]))
    assert {name for name, one in found.items() if one.changed} == {"R1", "C"}
    assert found["R1"].after / found["R1"].before == pytest.approx(1.02, abs=2e-3)
    assert found["C"].after / found["C"].before == pytest.approx(0.99, abs=2e-3)
    said = describe_changes([*found.values()])
    assert said.startswith("What changed: R1, times 1.0")
    assert not any(found[name].unchanged for name in ("R1", "C"))


@pytest.mark.slow
def test_where_only_the_start_differs_nothing_changed(first):
    found = compared(first, month(2))
    assert not [name for name, one in found.items() if one.changed or one.uncertain]
    assert {name for name, one in found.items() if one.unchanged} == {"R1", "R2", "C", "alpha"}
