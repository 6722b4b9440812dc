"""The foot's FMUs against derivatives of points in the plane, and the closed form of the arch in
any step.
"""

import math
import sys

import numpy as np
import pytest

from tests.contract.raw import instance
from tests.support.foot import ACTUATORS, JOINTS, lengths_at, toe_at

pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="a loaded library cannot be removed"
)
DECAY = 0.2 / (2 * 5e-4)
DAMPED = math.sqrt(100.0 / 5e-4 - DECAY**2)


def test_directional_derivatives_are_those_of_the_points(fmu):
    posture = {"ankle_angle": 0.25, "tm_angle": -0.1, "mtp_angle": 0.4}
    h = 1e-6
    with instance(fmu("foot", "native")) as one:
        one.initialize(posture)
        one.step(0.01)
        for joint in JOINTS:
            ends = [
                posture | {f"{joint}_angle": posture[f"{joint}_angle"] + s * h} for s in (1, -1)
            ]
            toe = [toe_at(*end.values()) for end in ends]
            lengths = [np.array(lengths_at(end["ankle_angle"], end["mtp_angle"])) for end in ends]
            slope = (toe[0] - toe[1]) / (2 * h)
            expected = [slope.real, slope.imag, *((lengths[0] - lengths[1]) / (2 * h))]
            unknowns = ["toe_x", "toe_y", *(f"{a}_length" for a in ACTUATORS)]
            assert one.tangent(unknowns, [f"{joint}_angle"], [1.0]) == pytest.approx(
                expected, abs=1e-9
            )


def arch(time: float) -> float:
    """Angle of the arch let go from 0.01 rad, in closed form."""
    return (
        0.01
        * math.exp(-DECAY * time)
        * (math.cos(DAMPED * time) + DECAY / DAMPED * math.sin(DAMPED * time))
    )


@pytest.mark.parametrize(
    "sizes", [[1e-4] * 50, [0.03], [0.007, 1e-5, 0.0123, 0.001], [2.0]], ids=len
)
def test_any_step_gives_the_closed_form(fmu, runtime, sizes):
    with instance(fmu("foot_dynamic", runtime)) as one:
        one.initialize({"tm_angle_start": 0.01})
        for size in sizes:
            one.step(size)
            assert one.get("tm_angle")[0] == pytest.approx(arch(one.time), abs=1e-9)
        assert one.get("ankle_angle", "mtp_angle") == [0.0, 0.0]
