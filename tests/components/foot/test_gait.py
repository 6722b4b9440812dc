"""Claims: lengths of the stance phase are eqs. 5.13 to 5.15 and the program's plantar one; an angle
from a length is where the foot has it.
"""

import math

import numpy as np
import pytest

from fmus.foot import gait
from fmus.foot.model import Foot
from fmus.kit.errors import UserError


def test_lengths_are_eqs_5_13_to_5_15():
    time = np.linspace(0.0, 1.0, 41)
    found = gait.lengths(time, Foot())
    wave = np.sin(2 * np.pi * time)
    for actuator, expected in (
        ("an", 97.5 - wave),
        ("po", 93.2 + wave),
        ("do", 113.3 - wave - 1.0),
    ):
        assert found[actuator] * 1e3 == pytest.approx(expected, rel=1e-12), actuator
    assert gait.length_changes(0.25)["po"] == pytest.approx(1e-3)


def test_errata_14_plantar_length_is_that_of_the_program_and_not_eq_5_16():
    time = np.linspace(0.0, 1.0, 41)
    found = gait.lengths(time, Foot())
    printed_5_16 = 113.3 - np.sin(2 * np.pi * time) - 1.0  # eq. 5.15 once more
    assert found["do"] * 1e3 == pytest.approx(printed_5_16)
    assert found["pl"] * 1e3 == pytest.approx(139.2 + np.sin(2 * np.pi * time) + 1.0)


def test_lengths_go_with_the_scale():
    large = gait.lengths(0.0, Foot(scale=2.5))
    assert large["an"] == pytest.approx(2.5 * 97.5e-3)
    assert large["pl"] == pytest.approx(2.5 * 139.2e-3 + 1e-3), (
        "the changes are those of the actuators"
    )


@pytest.mark.parametrize("scale", [1.0, 2.5])
@pytest.mark.parametrize(
    ("actuator", "joint", "angles"),
    [
        ("an", "ankle", (-0.7, 0.7)),
        ("po", "ankle", (-0.7, 0.7)),
        ("do", "mtp", (-0.15, 1.05)),
        ("pl", "mtp", (-0.15, 1.05)),
    ],
)
def test_angle_from_a_length_is_where_the_foot_has_it(scale, actuator, joint, angles):
    """Round trip; lengths themselves are held against points in the plane in ``test_foot.py``."""
    foot = Foot(scale=scale)
    for angle in np.linspace(*angles, 21):
        setattr(foot, f"{joint}_angle", float(angle))
        length = getattr(foot, f"{actuator}_length")()
        assert gait.joint_angle(foot, actuator, length) == pytest.approx(angle, abs=1e-9)


def test_antagonists_of_the_gait_ask_for_different_angles():
    """Eqs. 5.13 and 5.14 at t = 0.25 s, both by 1 mm: moment arms of 12.6 and 29.4 mm cannot
    follow.
    """
    lengths = gait.lengths(0.25, Foot())
    an, po = (
        math.degrees(gait.joint_angle(Foot(), actuator, lengths[actuator]))
        for actuator in ("an", "po")
    )
    assert [an, po] == pytest.approx([4.4, 2.0], abs=0.05)
    do, pl = (
        math.degrees(gait.joint_angle(Foot(), actuator, lengths[actuator]))
        for actuator in ("do", "pl")
    )
    assert do > 1.5 * pl


@pytest.mark.parametrize(
    ("length", "what"),
    [(0.05, "cannot be reached"), (0.2, "cannot be reached"), (math.nan, "finite")],
)
def test_unreachable_lengths_are_refused(length, what):
    with pytest.raises(UserError, match=what) as refusal:
        gait.joint_angle(Foot(), "an", length)
    assert "actuator 'an'" in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_an_actuator_that_is_not_there_is_refused():
    with pytest.raises(UserError, match="no actuator named 'ant'; there are an, po, do, pl"):
        gait.joint_angle(Foot(), "ant", 0.1)
