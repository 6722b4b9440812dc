"""What chapter 5 prints, and what does not hold of it: eqs. 5.11 to 5.16, table 5-1."""

import math

import numpy as np
import pytest

from fmus.foot import gait
from fmus.foot.model import Foot
from fmus.kit.errors import UserError
from studies.thesis.printed_foot import MILLIMETRES_PER_INCH, printed


def test_program_gives_eqs_5_11_and_5_12_to_the_printed_digits():
    found = printed()
    for matrix, published in (
        (found.compliance, (("1081", "9.6"), ("9.6", "7.3"))),
        (found.damping, (("1.7e+07", "1.5e+05"), ("1.5e+05", "1.1e+05"))),
    ):
        for value, text in zip(matrix.flat, sum(published, ()), strict=True):
            shown = f"{value:.1e}" if "e" in text else f"{value:.{len(text.partition('.')[2])}f}"
            assert shown == text


def test_errata_12_digits_behind_the_printed_ones():
    found = printed()
    assert found.compliance == pytest.approx(np.array([[1080.78, 9.554], [9.554, 7.315]]), rel=1e-4)
    assert [f"{v:.3e}" for v in found.damping.flat] == [
        "1.672e+07",
        "1.478e+05",
        "1.478e+05",
        "1.132e+05",
    ]


def test_errata_12_the_x_compliance_is_the_offset_and_not_the_foot():
    inches, millimetres = printed(), printed(MILLIMETRES_PER_INCH)
    assert millimetres.compliance[0, 0] == pytest.approx(1.1e10, rel=0.05)
    assert printed(offset=1e-5).compliance[0, 0] == pytest.approx(
        10 * inches.compliance[0, 0], rel=0.02
    )
    consistent = Foot().compliance(0, 0) * 1e3  # mm/N
    assert inches.compliance[0, 0] > 500 * consistent
    with pytest.raises(ValueError, match="singular"):
        printed(offset=0.0)


def test_printed_damping_is_larger_along_x_and_the_text_expects_it_along_y():
    damping, foot = printed().damping, Foot()
    assert damping[0, 0] > 100 * damping[1, 1]
    assert foot.damping(1, 1) > 5 * foot.damping(0, 0)


def test_printed_compliance_and_damping_are_one_matrix():
    """Damping mapped like compliance: their ratio is k b whatever the foot is."""
    found = printed()
    assert found.damping / found.compliance == pytest.approx(
        np.full((2, 2), 9.1 * 1700.0), rel=1e-12
    )


# --- gait
# --------------------------------------------------------------------------------------------------


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
