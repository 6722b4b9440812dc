"""Claims: the foot of the gait rests under balanced tensions, and yields as its compliance says."""

from dataclasses import replace

import numpy as np
import pytest

from fmus import component
from fmus.foot.systems import ACTUATORS, TENSIONS
from orchestration.master import run as run_master
from orchestration.system import library


def test_an_actuator_pulls_at_the_foot_that_sets_its_length():
    wires = {str(c.source): str(c.target) for c in library.system("foot_gait").connections}
    assert wires == {f"foot.{a}_length_change": f"{a}.length_change" for a in ACTUATORS} | {
        f"{a}.tension": f"foot.{a}_tension" for a in ACTUATORS
    }


def test_tensions_of_antagonists_have_equal_moments_in_the_reference_position():
    foot = component("foot_dynamic")()
    for one, other in (("po", "an"), ("pl", "do")):
        moments = [getattr(foot, f"{a}_arm")() * TENSIONS[a] for a in (one, other)]
        assert moments[0] == pytest.approx(-moments[1], rel=1e-12)


def test_the_compliance_of_the_foot_is_that_of_its_actuators():
    system = library.system("foot_gait")
    actuator = component("ppy_actuator_length_driven")()
    for name in ACTUATORS:
        parameters = system.member("foot").parameters
        assert parameters[f"k_{name}"] == actuator.k1
        assert parameters[f"b_{name}"] == actuator.b1
        flowed = system.member(name).parameters["maxwell_elongation_start"]
        assert -actuator.k1 * flowed == pytest.approx(TENSIONS[name], rel=1e-15)


@pytest.mark.slow
def test_the_foot_rests_under_tension_and_stays_taut(libcosim):
    """The largest current, driven for the two seconds of the experiment, slackens nobody; without
    it nothing moves.
    """
    tensions = [f"{a}.tension" for a in ("an", "po", "do", "pl")]
    still = libcosim("foot_gait", 0.5, {}, ["foot.ankle_angle", "foot.mtp_angle", *tensions], 0.5)
    assert np.abs(still["foot.ankle_angle"]).max() < 1e-9
    assert np.abs(still["foot.mtp_angle"]).max() < 1e-9
    driven = libcosim(
        "foot_gait",
        2.0,
        {"po.current": 1.3, "do.current": 1.3},
        ["foot.ankle_angle", *tensions],
        0.5,
    )
    assert driven["foot.ankle_angle"][-1] > 1e-3  # the longer one at the heel lets the foot rise
    for name in tensions:
        assert driven[name].min() > 3.0
        assert still[name][0] == pytest.approx(driven[name][0], rel=1e-3)


@pytest.mark.parametrize(
    ("creeps", "seconds", "tolerance"), [(False, 1.0, 1e-3), (True, 1.6, 0.02)]
)
def test_the_toe_of_the_gait_yields_as_its_compliance_says(creeps, seconds, tolerance):
    """A force of 0.1 N moves it by the mean of the compliances before and after; of the actuators
    that ship, 1 % is creep.
    """
    system, axes = library.system("foot_gait"), ("x", "y")
    quiet = {name: {"b1": 1e18, "b2": 1e18} for name in ("an", "po", "do", "pl")} | {
        "foot": {"ankle_damping": 0.1}
    }
    members = tuple(
        m if creeps else replace(m, parameters={**m.parameters, **quiet[m.name]})
        for m in system.members
    )
    time = 1e-4 * np.arange(round(seconds / 1e-4) + 1)
    free, pushed = (
        run_master(
            replace(system, members=members), time, {"toe_force_x": np.full(time.size, f)}
        ).signals
        for f in (0.0, -0.1)
    )
    said = [
        0.5 * (free[name][-1] + pushed[name][-1])
        for name in ("foot.toe_compliance_xx", "foot.toe_compliance_xy")
    ]
    moved = [(pushed[f"foot.toe_{a}"][-1] - free[f"foot.toe_{a}"][-1]) / -0.1 for a in axes]
    assert moved == pytest.approx(said, rel=tolerance)
    if creeps:
        assert moved[0] == pytest.approx(2.897e-3, rel=1e-3)
