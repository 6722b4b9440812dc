"""Claims: lengths, moment arms and toe are those of points in the plane, and do virtual work; no
geometry that is allowed is singular.
"""

import math

import numpy as np
import pytest

from fmus.foot.model import Foot
from tests.contract.raw import ERROR, instance
from tests.support.foot import (
    ACTUATORS,
    JOINTS,
    RANGES,
    jacobian,
    lengths_at,
    one_by_one,
    outputs,
    toe_at,
)

TOE = ("toe_x", "toe_y")


def test_reference_configuration_is_table_5_1():
    found = outputs(Foot())
    assert [found[f"{a}_length"] for a in ACTUATORS] == pytest.approx(
        [97.5e-3, 93.2e-3, 113.3e-3, 139.2e-3], rel=1e-14
    )
    foot = Foot()
    arms = [foot.an_arm(), foot.po_arm(), foot.do_arm(), foot.pl_arm()]
    assert np.array(arms) * 1e3 == pytest.approx([-12.6, 29.4, -6.0, 16.3], abs=0.05), "errata 13"
    ankle, _, mtp = foot.joint_stiffnesses()
    assert [ankle, mtp] == pytest.approx([9.31, 2.75], abs=0.005), "errata 13"


def test_lengths_and_toe_are_those_of_points_in_the_plane():
    for values in one_by_one(200):
        found, toe = outputs(Foot(**values)), toe_at(*values.values())
        expected = lengths_at(values["ankle_angle"], values["mtp_angle"])
        assert [found[f"{a}_length"] for a in ACTUATORS] == pytest.approx(expected, rel=1e-13)
        assert [found["toe_x"], found["toe_y"]] == pytest.approx([toe.real, toe.imag], rel=1e-13)


def test_analytic_jacobians_are_those_of_casadi_and_virtual_work_holds():
    for values in one_by_one(50):
        of = jacobian(values)
        for joint in JOINTS:
            for actuator in ACTUATORS:
                slope = of(f"{actuator}_length", f"{joint}_angle")
                assert of(f"{actuator}_length_rate", f"{joint}_rate") == pytest.approx(
                    slope, rel=1e-11, abs=1e-15
                )
                assert of(f"{joint}_torque", f"{actuator}_tension") == pytest.approx(
                    -slope, rel=1e-11, abs=1e-15
                )
            for position, axis in zip(TOE, "xy", strict=True):
                slope = of(position, f"{joint}_angle")
                assert of(f"toe_velocity_{axis}", f"{joint}_rate") == pytest.approx(
                    slope, rel=1e-11, abs=1e-15
                )
                assert of(f"{joint}_torque", f"toe_force_{axis}") == pytest.approx(
                    slope, rel=1e-11, abs=1e-15
                )


def test_analytic_jacobians_are_finite_differences_of_the_points():
    h = 1e-5
    for values in one_by_one(50):
        of = jacobian(values)
        for joint in JOINTS:
            plus, minus = (
                {**values, f"{joint}_angle": values[f"{joint}_angle"] + s * h} for s in (1, -1)
            )
            toe = (toe_at(*plus.values()) - toe_at(*minus.values())) / (2 * h)
            assert of("toe_velocity_x", f"{joint}_rate") == pytest.approx(toe.real, abs=1e-9)
            assert of("toe_velocity_y", f"{joint}_rate") == pytest.approx(toe.imag, abs=1e-9)
            ends = [lengths_at(v["ankle_angle"], v["mtp_angle"]) for v in (plus, minus)]
            for actuator, high, low in zip(ACTUATORS, *ends, strict=True):
                found = of(f"{actuator}_length_rate", f"{joint}_rate")
                assert found == pytest.approx((high - low) / (2 * h), abs=1e-9)


def test_jacobian_is_eq_5_3_as_printed():
    """Not what the program has: sines and cosines of eq. 5.3; table 5-1's angles make link 3
    horizontal.
    """
    l1, l2, l3 = 50.8e-3, 62.5e-3, 23.6e-3
    for values in one_by_one(20):
        a, tm, mtp = values.values()
        first, second, third = math.radians(49.0) + a, math.radians(79.9) + a + tm, a + tm + mtp
        toe = np.array([-l3 * math.cos(third), -l3 * math.sin(third)])
        arch = toe + np.array([-l2 * math.sin(second), l2 * math.cos(second)])
        ankle = arch + np.array([-l1 * math.sin(first), l1 * math.cos(first)])
        assert np.array(Foot(**values).jacobian()) == pytest.approx(
            np.array([ankle, arch, toe]), rel=1e-12, abs=1e-15
        )


def test_scale_multiplies_lengths_and_arms():
    values = {
        "ankle_angle": 0.3,
        "tm_angle": 0.1,
        "mtp_angle": 0.5,
        "an_tension": 2.0,
        "toe_force_x": -1.0,
    }
    small, large = outputs(Foot(**values)), outputs(Foot(scale=2.5, tm_stiffness=625.0, **values))
    for name in small:
        power = (
            0
            if "compliance" in name or "damping" in name or "rate" in name or "velocity" in name
            else 1
        )
        assert large[name] == pytest.approx(2.5**power * small[name], rel=1e-13), name


def test_readme_says_where_moment_arms_vanish():
    for actuator, joint, degrees in (
        ("an", "ankle", -53.0),
        ("po", "ankle", 70.0),
        ("do", "mtp", -19.0),
    ):
        ends = [Foot(**{f"{joint}_angle": math.radians(degrees + s)}) for s in (-0.6, 0.6)]
        assert math.prod(getattr(foot, f"{actuator}_arm")() for foot in ends) < 0.0


GEOMETRY = {p.name: p for p in Foot.layout.parameters if p.source == "thesis table 5-1"}


def test_no_geometry_that_is_allowed_is_singular_within_the_joints_ranges():
    """The sign of an arm is that of a sum linear in length and radius: their ends suffice. Angles
    in steps of 1 deg.
    """
    span = {name: np.array([p.min, p.max]) for name, p in GEOMETRY.items()}
    beta, gamma = np.linspace(*span["beta_po"], 24), np.linspace(*span["gamma_po"], 18)
    grid = np.meshgrid(span["l_po"], span["r_po"], beta, gamma, np.linspace(*RANGES["ankle"], 81))
    foot = Foot(
        **dict(zip(("l_po", "r_po", "beta_po", "gamma_po", "ankle_angle"), grid, strict=True))
    )
    assert np.min(foot.po_arm()) > math.radians(1.0) * span["r_po"][1], (
        "more than an arm changes in a step"
    )
    assert span["r_pl"][0] > 0.0
    # the toe's two columns of J are l1 l3 sin(a3 - a1) + l2 l3 sin(a3 - a2) apart, both angles
    # between 0 and pi
    last = span["beta_p"] + RANGES["mtp"]
    both = last + span["beta_df"] + RANGES["tm"]
    assert last[0] >= 0.0
    assert both[0] > 0.0
    assert max(last[1], both[1]) < math.pi
    assert span["l1"][0] * span["l3"][0] * min(np.sin(both)) > 1e-4, (
        "far above what counts as locked"
    )
    # an actuator has a length in any posture, because its origin is farther from the joint than its
    # attachment is
    smallest = {a: max(span[f"beta_{a}"][0] - span[f"gamma_{a}"][1], 0.0) for a in ("an", "po")}
    for a, angle in (smallest | {"do": span["gamma_do"][0]}).items():
        assert span[f"l_{a}"][0] > 2.0 * span[f"r_{a}"][1] * math.cos(angle)


@pytest.mark.parametrize("name", ["foot", "foot_displacement_driven", "foot_dynamic", "foot_free"])
def test_geometry_that_could_be_singular_is_refused(fmu, name, runtime):
    """Each parameter of the geometry, just beyond either end of its range, by name and with the
    range.
    """
    with instance(fmu(name, runtime)) as one:
        for p in GEOMETRY.values():
            for bound, sign in ((p.min, -1), (p.max, 1)):
                one.messages.clear()
                one.do("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
                one.set({p.name: bound + sign * 1e-4})
                one.do("fmi2EnterInitializationMode")
                assert one.call("fmi2ExitInitializationMode") == ERROR
                assert f"parameter '{p.name}' = {bound + sign * 1e-4:g}" in one.messages[0]
                assert f"is outside its range [{p.min:g}, {p.max:g}]" in one.messages[0]
                one.do("fmi2Reset")
