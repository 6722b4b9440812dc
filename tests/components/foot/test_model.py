"""The foot against points in the plane, virtual work, power balance, equilibria found by
minimising, and scipy.
"""

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize

import fmus
from fmus.foot import model
from fmus.foot.model import Foot, FootDynamic
from fmus.kit.integrate import Integrator
from fmus.kit.symbolic.tracing import trace
from tests.contract.raw import ERROR, instance
from tests.support import hosts
from tests.support.foot import ACTUATORS, JOINTS, lengths_at, toe_at

RANGES = {"ankle": (-0.7, 0.7), "tm": (-0.26, 0.26), "mtp": (-0.15, 1.05)}
TOE = ("toe_x", "toe_y")
OUTPUTS = [o.name for o in Foot.layout.outputs]
GRAPH = trace(Foot)
FOLDER = Path(model.__file__).parent


def postures(count: int, seed: int = 0) -> dict[str, np.ndarray]:
    random = np.random.default_rng(seed)
    return {f"{joint}_angle": random.uniform(*RANGES[joint], count) for joint in JOINTS}


def one_by_one(count: int):
    drawn = postures(count, 7)
    return [{name: float(values[i]) for name, values in drawn.items()} for i in range(count)]


def outputs(component) -> dict[str, float]:
    return dict(zip([o.name for o in component.layout.outputs], component.outputs(), strict=True))


def jacobian(values: dict[str, float]):
    """Derivative of an output by an input, by CasADi: ``of(output, input)``."""
    d = GRAPH.linearise(**values)[3]
    rows, columns = (
        {v.name: i for i, v in enumerate(g)} for g in (GRAPH.layout.outputs, GRAPH.layout.inputs)
    )
    return lambda output, given: d[rows[output], columns[given]]


# --- kinematics
# --------------------------------------------------------------------------------------------------


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


# --- compliance and damping
# -------------------------------------------------------------------------------------------


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


def test_readme_says_where_moment_arms_vanish():
    for actuator, joint, degrees in (
        ("an", "ankle", -53.0),
        ("po", "ankle", 70.0),
        ("do", "mtp", -19.0),
    ):
        ends = [Foot(**{f"{joint}_angle": math.radians(degrees + s)}) for s in (-0.6, 0.6)]
        assert math.prod(getattr(foot, f"{actuator}_arm")() for foot in ends) < 0.0


def test_readme_says_what_the_matrices_are():
    found = outputs(Foot())
    compliance = [found[f"toe_compliance_{e}"] * 1e3 for e in ("xx", "xy", "yy")]
    damping = [found[f"toe_damping_{e}"] * 1e-3 for e in ("xx", "xy", "yy")]
    assert compliance == pytest.approx([1.91, -0.60, 0.21], abs=0.005)
    assert damping == pytest.approx([921, 2569, 8049], abs=0.6)
    stiff = outputs(Foot(tm_stiffness=1e9))["toe_compliance_xx"]
    assert 1.0 - stiff / found["toe_compliance_xx"] == pytest.approx(0.04, abs=0.005)


# --- dynamics
# --------------------------------------------------------------------------------------------------


def run(component, steps: int, size: float) -> None:
    integrator = Integrator(component)
    for k in range(steps):
        integrator.advance(k * size, size)


def test_arch_vibrates_as_a_damped_oscillator():
    """Without loads the joints are independent; closed form for the arch."""
    foot = FootDynamic(tm_angle_start=0.01)
    run(foot, 20, 1e-3)
    decay, frequency = 0.2 / (2 * 5e-4), math.sqrt(100.0 / 5e-4)
    damped = math.sqrt(frequency**2 - decay**2)
    t = 0.02
    expected = (
        0.01 * math.exp(-decay * t) * (math.cos(damped * t) + decay / damped * math.sin(damped * t))
    )
    assert foot.tm_angle == pytest.approx(expected, abs=1e-9)
    assert foot.ankle_angle == foot.mtp_angle == 0.0


def test_constant_tensions_do_not_hold_the_ankle():
    """Second derivative of the potential of two tensions in balance, from the points: a hilltop,
    not a valley.
    """
    po = 3.0 * 12.639 / 29.383  # by the moment arms of the reference configuration
    h = 1e-3
    potential = [
        3.0 * an + po * other for an, other, *_ in (lengths_at(s * h, 0.0) for s in (-1, 0, 1))
    ]
    curvature = (potential[0] - 2.0 * potential[1] + potential[2]) / h**2
    slope = jacobian({"an_tension": 3.0, "po_tension": po})("ankle_torque", "ankle_angle")
    assert slope == pytest.approx(-curvature, rel=1e-4)
    assert slope > 0.0


@pytest.mark.parametrize(
    ("load", "joint", "limit"), [("an", "ankle", 0.7), ("po", "ankle", -0.7), ("pl", "mtp", -0.15)]
)
def test_soft_stop_holds_at_the_limit(load, joint, limit):
    """Rest is where the stop's torque, inertia times frequency squared per angle, is that of the
    tension.
    """
    foot = FootDynamic(**{f"{load}_tension": 5.0}, ankle_damping=0.2, mtp_damping=4e-3)
    run(foot, 100, 0.1)
    angle = getattr(foot, f"{joint}_angle")
    beyond = angle - limit
    h = 1e-6
    i = ACTUATORS.index(load)
    ends = [lengths_at(angle + s * h, angle + s * h)[i] for s in (1, -1)]
    torque = -5.0 * (ends[0] - ends[1]) / (2 * h)
    assert beyond * limit > 0.0
    inertia = {"ankle": 1e-3, "mtp": 2e-5}[joint]
    assert inertia * 200.0**2 * beyond == pytest.approx(torque, rel=1e-5)


def test_energy_is_kept_without_friction():
    """Kinetic energy against the work of constant tensions and toe force, from the points alone."""
    loads = {"an_tension": 1.0, "do_tension": 0.2, "toe_force_x": -0.05, "toe_force_y": 0.1}
    friction = {f"{joint}_damping": 0.0 for joint in JOINTS}
    foot = FootDynamic(**loads, **friction)
    run(foot, 20, 0.002)

    def potential(ankle, tm, mtp):
        an, _, do, _ = lengths_at(ankle, mtp)
        toe = toe_at(ankle, tm, mtp)
        return 1.0 * an + 0.2 * do + 0.05 * toe.real - 0.1 * toe.imag + 50.0 * tm**2

    kinetic = 0.5 * (1e-3 * foot.ankle_rate**2 + 5e-4 * foot.tm_rate**2 + 2e-5 * foot.mtp_rate**2)
    assert kinetic > 1e-6
    assert 0.0 < foot.ankle_angle < 0.7
    assert 0.0 < foot.mtp_angle < 1.05
    released = potential(0.0, 0.0, 0.0) - potential(foot.ankle_angle, foot.tm_angle, foot.mtp_angle)
    assert kinetic == pytest.approx(released, rel=1e-6)


def test_motion_is_that_of_scipy_on_the_points():
    """Moment arms by finite differences of the points, equations written down once more."""
    h, loads, force = 1e-6, np.array([1.2, 0.3, 0.1, 0.05]), np.array([-0.2, 0.05])
    inertia, friction = np.array([1e-3, 5e-4, 2e-5]), np.array([0.02, 0.2, 1e-3])

    def work(q):
        toe = toe_at(*q)
        return force @ [toe.real, toe.imag] - loads @ lengths_at(q[0], q[2]) - 50.0 * q[1] ** 2

    def slope(_, s):
        q, v = s[:3], s[3:]
        torque = [(work(q + h * e) - work(q - h * e)) / (2 * h) for e in np.eye(3)]
        return np.concatenate([v, (torque - friction * v) / inertia])

    expected = solve_ivp(slope, (0.0, 0.06), np.zeros(6), rtol=1e-9, atol=1e-11).y[:, -1]
    assert np.all(expected[:3] < [0.7, 0.26, 1.05]), "before the stops"
    assert np.all(expected[:3] > [-0.7, -0.26, -0.15])
    signals = {f"{a}_tension": float(t) for a, t in zip(ACTUATORS, loads, strict=True)}
    foot = FootDynamic(**signals, toe_force_x=-0.2, toe_force_y=0.05)
    run(foot, 6, 0.01)
    found = [getattr(foot, s.name) for s in FootDynamic.layout.states]
    assert found == pytest.approx(expected, rel=1e-5, abs=1e-6)


# --- as FMUs
# --------------------------------------------------------------------------------------------------


def table(path):
    with path.open(encoding="utf-8", newline="") as file:
        header, *body = csv.reader(file)
    return header, np.array(body, dtype=float)


@pytest.mark.parametrize("name", ["foot", "foot_dynamic"])
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


@pytest.mark.parametrize("name", ["foot", "foot_dynamic"])
def test_builds_agree(fmu, name):
    times = np.arange(0.0, 0.15, 0.005)
    random = np.random.default_rng(2)
    layout = fmus.component(name).layout
    inputs = {v.name: random.uniform(-0.1, 0.5, times.size) for v in layout.inputs}
    wanted = [v.name for v in layout.measurable]
    python, native = (
        hosts.run_fmpy(fmu(name, r), times, inputs, wanted) for r in ("python", "native")
    )
    for signal in wanted:
        assert (
            np.abs(python[signal] - native[signal]).max() <= 1e-9 * np.abs(native[signal]).max()
        ), signal


# --- ranges
# --------------------------------------------------------------------------------------------------

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


@pytest.mark.parametrize("name", ["foot", "foot_dynamic"])
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
