"""Claims: compliance and damping of the toe are what minimised energy and dissipated power say."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize

from fmus.foot.model import Foot
from tests.contract.raw import instance
from tests.support.foot import ACTUATORS, lengths_at, one_by_one, outputs, postures, toe_at


def matrices(found, kind: str) -> np.ndarray:
    xx, xy, yy = (found[f"toe_{kind}_{e}"] for e in ("xx", "xy", "yy"))
    return np.moveaxis(np.array([[xx, xy], [xy, yy]]), -1, 0)


def drawn_parameters(count: int) -> dict[str, np.ndarray]:
    """Geometry anywhere in its ranges; stiffness and damping over four decades."""
    random, drawn = np.random.default_rng(3), {}
    for p in Foot.layout.parameters:
        if p.unit in ("m", "rad", "1"):
            drawn[p.name] = random.uniform(p.min, p.max, count)
        else:
            drawn[p.name] = p.start * 10.0 ** random.uniform(-2.0, 2.0, count)
    return drawn


@pytest.mark.parametrize("varied", [False, True], ids=["table 5-1", "any parameters"])
def test_compliance_and_damping_are_positive_semidefinite_at_10000_postures(varied):
    foot = Foot(**postures(10_000), **(drawn_parameters(10_000) if varied else {}))
    found = outputs(foot)
    for kind in ("compliance", "damping"):
        whole = matrices({k: np.asarray(v) for k, v in found.items()}, kind)
        assert whole.shape == (10_000, 2, 2)
        values = np.linalg.eigvalsh(whole)
        assert np.isfinite(values).all()
        assert (values[:, 0] >= -1e-12 * values[:, 1]).all()
        assert (values[:, 1] > 0.0).all()
    assert (np.asarray(foot.po_arm()) > 0.0).all(), (
        "what keeps the ankle from being without stiffness"
    )
    assert (np.asarray(foot.pl_arm()) > 0.0).all(), "and the toe"


def test_both_are_symmetric_in_the_law_itself():
    foot = Foot(ankle_angle=0.4, tm_angle=-0.1, mtp_angle=0.7)
    assert foot.compliance(0, 1) == foot.compliance(1, 0)
    assert foot.damping(0, 1) == foot.damping(1, 0)


def test_compliance_is_how_far_the_toe_moves_in_equilibrium():
    """Springs at rest in a posture; the potential energy under a small force is minimised
    numerically.
    """
    for values in one_by_one(5):
        posture = np.array(list(values.values()))
        rest, start = np.array(lengths_at(posture[0], posture[2])), toe_at(*posture)
        found = matrices(
            {k: np.array([v]) for k, v in outputs(Foot(**values)).items()}, "compliance"
        )[0]
        for force in (np.array([1e-3, 0.0]), np.array([0.0, 1e-3])):

            def energy(scaled, posture=posture, rest=rest, start=start, force=force):
                now = posture + 1e-4 * scaled
                stretched = np.array(lengths_at(now[0], now[2])) - rest
                moved = toe_at(*now) - start
                work = force @ [moved.real, moved.imag]
                return 1e9 * (
                    0.5 * 9100.0 * stretched @ stretched + 50.0 * (now[1] - posture[1]) ** 2 - work
                )

            settled = (
                posture
                + 1e-4 * minimize(energy, np.zeros(3), method="BFGS", options={"gtol": 1e-7}).x
            )
            moved = toe_at(*settled) - start
            assert [moved.real, moved.imag] == pytest.approx(
                found @ force, rel=2e-3, abs=1e-3 * np.abs(found @ force).max()
            )


def test_damping_dissipates_at_the_toe_what_the_actuators_do():
    random = np.random.default_rng(5)
    for values in one_by_one(50):
        rates = {"ankle_rate": random.normal(), "mtp_rate": random.normal()}
        found = outputs(Foot(**values, **rates))
        velocity = np.array([found["toe_velocity_x"], found["toe_velocity_y"]])
        whole = matrices({k: np.array([v]) for k, v in found.items()}, "damping")[0]
        dissipated = sum(1.7e6 * found[f"{a}_length_rate"] ** 2 for a in ACTUATORS)
        assert velocity @ whole @ velocity == pytest.approx(dissipated, rel=1e-9)


def test_antagonists_stiffen_each_other():
    """Adding compliances, as eq. 5.7 does, a stiffer actuator more would make the joint softer."""
    pair, without = Foot(), Foot(k_po=1e-3)
    assert pair.joint_stiffnesses()[0] > without.joint_stiffnesses()[0]
    assert without.joint_stiffnesses()[0] == pytest.approx(
        9100.0 * (18e-3 * math.sin(math.radians(44.6))) ** 2, rel=1e-6
    )


def test_readme_says_what_the_matrices_are():
    found = outputs(Foot())
    compliance = [found[f"toe_compliance_{e}"] * 1e3 for e in ("xx", "xy", "yy")]
    damping = [found[f"toe_damping_{e}"] * 1e-3 for e in ("xx", "xy", "yy")]
    assert compliance == pytest.approx([1.91, -0.60, 0.21], abs=0.005)
    assert damping == pytest.approx([921, 2569, 8049], abs=0.6)
    stiff = outputs(Foot(tm_stiffness=1e9))["toe_compliance_xx"]
    assert 1.0 - stiff / found["toe_compliance_xx"] == pytest.approx(0.04, abs=0.005)


def test_a_straight_foot_is_locked_and_its_damping_large_but_a_number(fmu, runtime):
    """All links in a line, far beyond the ranges: no joint can move the toe along the line."""
    with instance(fmu("foot", runtime)) as one:
        one.initialize()
        dampings = []
        for off in (1e-3, 1e-4, 0.0):
            one.set({"tm_angle": -math.radians(30.9), "mtp_angle": off - math.radians(10.1)})
            one.step(0.01)
            dampings.append(
                max(map(abs, one.get("toe_damping_xx", "toe_damping_xy", "toe_damping_yy")))
            )
    assert dampings[1] == pytest.approx(100.0 * dampings[0], rel=0.05), (
        "one over the square of the distance"
    )
    assert 1e3 * dampings[1] < dampings[2] < 1e30
