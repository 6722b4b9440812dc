"""Claims: both builds of all feet give the reference results, and the same equations beyond the
joints' ranges.
"""

import csv
import math
from pathlib import Path

import numpy as np
import pytest

import fmus
from fmus.foot import model
from fmus.foot.model import Foot
from tests.contract.raw import instance
from tests.support import hosts
from tests.support.foot import ACTUATORS, JOINTS, lengths_at, toe_at
from tests.support.pace import slow_but

FEET = ["foot", "foot_design", "foot_displacement_driven", "foot_dynamic", "foot_free"]
OUTPUTS = [o.name for o in Foot.layout.outputs]
FOLDER = Path(model.__file__).parent


def table(path):
    with path.open(encoding="utf-8", newline="") as file:
        header, *body = csv.reader(file)
    return header, np.array(body, dtype=float)


@pytest.mark.parametrize("name", FEET)
def test_both_builds_reproduce_the_reference_result(fmu, name, runtime):
    wanted, expected = table(FOLDER / "reference" / f"{name}_ref.csv")
    fed, stimuli = table(FOLDER / "reference" / f"{name}_in.csv")
    after, jumps = (np.append(np.diff(t[:, 0]) > 0.0, True) for t in (expected, stimuli))
    times = expected[after, 0]
    held = np.searchsorted(stimuli[jumps, 0], times + 1e-9, side="right") - 1
    inputs = {signal: stimuli[jumps, i][held] for i, signal in enumerate(fed) if i}
    found = hosts.run_fmpy(fmu(name, runtime), times, inputs, wanted[1:])
    for i, signal in enumerate(wanted[1:], 1):
        scale = np.abs(expected[:, i]).max()
        assert np.abs(found[signal] - expected[after, i]).max() <= 1e-7 * scale, signal


@pytest.mark.parametrize("name", slow_but(FEET, *FEET[:3]))
def test_builds_agree(fmu, name):
    times = np.arange(0.0, 0.15, 0.005)
    random = np.random.default_rng(2)
    layout = fmus.component(name).layout
    inputs = {v.name: v.nominal * random.uniform(-0.1, 0.5, times.size) for v in layout.inputs}
    wanted = [v.name for v in layout.measurable]
    python, native = (
        hosts.run_fmpy(fmu(name, r), times, inputs, wanted) for r in ("python", "native")
    )
    for signal in wanted:
        assert (
            np.abs(python[signal] - native[signal]).max() <= 1e-9 * np.abs(native[signal]).max()
        ), signal


BEYOND = [
    {"ankle_angle": 0.72},
    {"ankle_angle": -2.5, "tm_angle": 1.0},
    {"mtp_angle": 3.0},
    {"mtp_angle": -2.0},
    {"ankle_angle": 1e300, "tm_angle": -1e300, "mtp_angle": 1e300},
]


@pytest.mark.parametrize("posture", BEYOND)
def test_beyond_the_joints_ranges_the_same_equations_hold(fmu, runtime, posture):
    with instance(fmu("foot", runtime)) as one:
        one.initialize()
        one.set(posture)
        one.step(0.01)
        found = dict(zip(OUTPUTS, one.get(*OUTPUTS), strict=True))
    assert all(math.isfinite(value) for value in found.values())
    if max(map(abs, posture.values())) < 10.0:
        ankle, tm, mtp = (posture.get(f"{joint}_angle", 0.0) for joint in JOINTS)
        toe = toe_at(ankle, tm, mtp)
        assert [found["toe_x"], found["toe_y"]] == pytest.approx(
            [toe.real, toe.imag], rel=1e-12, abs=1e-15
        )
        assert [found[f"{a}_length"] for a in ACTUATORS] == pytest.approx(
            lengths_at(ankle, mtp), rel=1e-12
        )
