"""Claims: the free foot moves as Lagrange's equations of points say, keeps its energy, is the foot
under a fixed leg where that is asked for, and lands at any communication step.
"""

from functools import cache

import casadi
import numpy as np
import pytest

from fmus.foot.free import solve
from fmus.foot.model import FootDynamic, FootFree
from fmus.kit.record.compiled import CompiledModel
from orchestration.fmu.instance import Fmu
from orchestration.fmu.simulation import simulate_instance
from tests.support.foot import RANGES
from tests.support.pace import slow_but

JOINTS = ("ankle", "tm", "mtp", "mtp2")
LOADS = [v.name for v in FootFree.layout.inputs]
RIGID = {f"{joint}_damping": 0.0 for joint in JOINTS} | {
    "restitution_loss": 0.0,
    "ground_friction": 0.0,
}
FIXED = {"gravity": 0.0, "ground_stiffness": 0.0, "m1": 0.0, "m2": 0.0, "m3": 0.0, "m4": 0.0}
LINKS, BENDS = (50.8e-3, 62.5e-3, 23.6e-3, 23.6e-3), np.radians([49.0, 30.9, 10.1])
compiled = cache(CompiledModel)


def drawn(seed):
    """A posture anywhere in its ranges, rates, a leg above the ground, masses and loads."""
    random = np.random.default_rng(seed)
    ranges = RANGES | {"mtp2": RANGES["mtp"]}
    values = {f"{j}_angle_start": random.uniform(*ranges[j]) for j in JOINTS}
    values |= {f"{j}_rate_start": 3.0 * random.normal() for j in JOINTS}
    values |= {f"leg_velocity_{axis}_start": random.normal() for axis in "xy"}
    values |= {name: random.uniform(0.01, 0.3) for name in ("leg_mass", "m1", "m2", "m3", "m4")}
    values |= {f"{j}_inertia": 10.0 ** random.uniform(-4.5, -3.0) for j in JOINTS}
    values |= {name: random.uniform(-2.0, 2.0) for name in LOADS}
    return {name: float(value) for name, value in values.items()}


@cache
def lagrangian():
    """Accelerations by Lagrange's equations: energies of points, derivatives by CasADi."""
    q, v, p = casadi.SX.sym("q", 6), casadi.SX.sym("v", 6), casadi.SX.sym("p", 11)
    leg, masses, inertias, mtp2_spring, gravity = p[0], p[1:5], p[5:9], p[9], p[10]
    a1 = BENDS[0] + q[2]
    a2 = a1 + BENDS[1] + q[3]
    turns = [a1, a2, a2 + BENDS[2] + q[4], a2 + BENDS[2] + q[5]]

    def at(link, share):
        """Point on a link, from where the leg began."""
        point = q[:2]
        for before in (*range(min(link, 2)), link):
            length = LINKS[before] * (share if before == link else 1.0)
            point = point + length * casadi.vertcat(
                casadi.cos(turns[before]), casadi.sin(turns[before])
            )
        return point

    energy = leg * casadi.sumsqr(v[:2]) / 2
    height = -leg * q[0]
    for link in range(4):
        # a uniform rod is two thirds of its mass in the middle and a sixth at each end
        for share, part in ((0.0, 1 / 6), (0.5, 2 / 3), (1.0, 1 / 6)):
            point = at(link, share)
            velocity = casadi.jtimes(point, q, v)
            energy = energy + masses[link] * part * casadi.sumsqr(velocity) / 2
            height = height - masses[link] * part * point[0]
    energy = energy + casadi.dot(inertias, v[2:] ** 2) / 2
    potential = gravity * height + 50.0 * q[3] ** 2 + mtp2_spring * q[5] ** 2 / 2
    momentum = casadi.gradient(energy, v)
    mass = casadi.jacobian(momentum, v)
    force = casadi.gradient(energy - potential, q) - casadi.jtimes(momentum, q, v)
    toe = casadi.jacobian(at(2, 1.0), q)
    return casadi.Function("lagrange", [q, v, p], [mass, force, toe])


def test_accelerations_are_those_of_lagrange_for_points():
    """Rods as three points each; what tensions do to joints is held against points elsewhere."""
    for seed in range(200):
        values = drawn(seed)
        foot = FootFree(ground_stiffness=0.0, **values)
        q = [0.0, 0.0, *(values[f"{j}_angle_start"] for j in JOINTS)]
        v = [*foot.leg_velocity(), *(values[f"{j}_rate_start"] for j in JOINTS)]
        own = [values[f"{j}_inertia"] for j in JOINTS]
        masses = [values[name] for name in ("leg_mass", "m1", "m2", "m3", "m4")]
        mass, force, toe = map(np.array, lagrangian()(q, v, [*masses, *own, 0.5, 9.80665]))
        pulls = FootDynamic(
            **{f"{j}_angle_start": values[f"{j}_angle_start"] for j in JOINTS[:3]},
            **{name: values[name] for name in LOADS if name.endswith("tension")},
        ).joint_torques()
        push = [values["toe_force_x"], values["toe_force_y"]]
        damping = np.array([0.02, 0.2, 1e-3, 1e-3]) * v[2:]
        force = force.ravel() + toe.T @ push
        force += [values["leg_force_x"], values["leg_force_y"], *pulls, 0.0]
        force[2:] -= damping
        expected = np.linalg.solve(mass, force)
        found = [
            foot.leg_acceleration_x(),
            foot.leg_acceleration_y(),
            *(getattr(foot, f"{j}_acceleration")() for j in JOINTS),
        ]
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


def test_solve_agrees_with_numpy():
    random = np.random.default_rng(4)
    for size in (1, 2, 4, 6):
        root = random.normal(size=(size, size))
        matrix, right = root @ root.T + np.eye(size), random.normal(size=size)
        assert solve(matrix.tolist(), right.tolist()) == pytest.approx(
            np.linalg.solve(matrix, right), rel=1e-9
        )


def run(values, stop=1.0, step=5e-3, **given):
    time = step * np.arange(round(stop / step) + 1)
    held = {name: np.full(time.size, given.get(name, 0.0)) for name in LOADS}
    return compiled(FootFree).run(time, held, values).signals


def balance(found):
    """Return the energy in the foot, less the energy that came in."""
    inside = found["kinetic_energy"] + found["potential_energy"] + found["joint_loss"]
    return inside - found["actuator_work"] - found["ground_work"] - found["load_work"]


def test_energy_is_kept_without_friction_and_touch():
    """Thrown up under constant tensions, whose potential is their lengths: nothing is lost in half
    a second.
    """
    values = RIGID | {
        "leg_velocity_x_start": -2.0,
        "leg_height_start": 0.2,
        "ankle_rate_start": 2.0,
    }
    pulls = {"an_tension": 1.0, "do_tension": 0.2}
    found = run(values, 0.4, **pulls)
    assert found["ground_force_x"].min() == 0.0
    stored = 1.0 * found["an_length_change"] + 0.2 * found["do_length_change"]
    total = found["kinetic_energy"] + found["potential_energy"] + stored
    assert np.ptp(found["kinetic_energy"]) > 0.1
    assert np.ptp(total) < 1e-7 * np.ptp(found["kinetic_energy"])


def test_energy_is_kept_on_a_ground_that_is_a_spring():
    """Hertz's springs under four points store 2/5 k d^(5/2) / d0^(1/2) each."""
    found = run(RIGID, 0.3, 1e-3)
    depths = depth_of_points(found) - found["leg_height"]
    springs = (0.4 * 2e4 * np.maximum(depths, 0.0) ** 2.5 / 1e-3**0.5).sum(axis=0)
    total = found["kinetic_energy"] + found["potential_energy"] + springs
    assert springs.max() > 1e-3
    assert np.ptp(total) < 1e-6 * np.ptp(found["potential_energy"])
    assert found["ground_work"] == pytest.approx(-springs, abs=1e-7)


def depth_of_points(found):
    """Heel, ball and both toes below the ankle, from the angles."""
    a1 = BENDS[0] + found["ankle_angle"]
    a2 = a1 + BENDS[1] + found["tm_angle"]
    ball = LINKS[0] * np.cos(a1) + LINKS[1] * np.cos(a2)
    heel = 41.7e-3 * np.cos(found["ankle_angle"] - np.radians(57.7))
    toes = [
        ball + LINKS[2] * np.cos(a2 + BENDS[2] + found[f"{joint}_angle"]) for joint in JOINTS[2:]
    ]
    return np.array([heel, ball, *toes])


def test_work_and_loss_add_up_in_any_step():
    for seed in range(5):
        values = drawn(seed)
        loads = {name: values.pop(name) for name in LOADS}
        found = run(values, 0.5, **loads)
        assert found["ground_force_x"].min() < -1.0, "it lands"
        assert np.ptp(balance(found)) < 1e-6 * np.ptp(found["joint_loss"])


@pytest.mark.parametrize("landings", slow_but([40, 2_000], 40))
def test_random_landings_get_no_energy_from_the_ground(landings):
    """The whole foot, from any posture at any velocity, under any tensions."""
    random = np.random.default_rng(5)
    touched = 0
    for seed in random.integers(0, 10**9, landings):
        values = drawn(seed)
        loads = {name: values.pop(name) for name in LOADS}
        posture = {f"{joint}_angle": values[f"{joint}_angle_start"] for joint in JOINTS}
        above = depth_of_points(posture).max() + random.uniform(0.0, 0.01)
        values |= {"leg_height_start": above, "leg_velocity_x_start": random.uniform(1.0, 2.0)}
        found = run(values, 0.05, 2e-3, **loads)
        most = np.ptp(found["kinetic_energy"])
        assert found["ground_work"].max() <= 1e-7 * most
        touched += found["ground_force_x"].min() < 0.0
    assert touched > 0.9 * landings


@pytest.mark.parametrize("leg", [{"leg_held": 1.0}, {"leg_mass": 1e6}], ids=["held", "heavy"])
def test_the_foot_under_a_fixed_leg_is_a_special_case(leg):
    """Held, or with a leg that is too heavy to move: the trajectories of ``foot_dynamic``."""
    random, time = np.random.default_rng(6), 0.01 * np.arange(101)
    levels = {
        v.name: np.repeat(random.uniform(0.0, 2.0, 11), 10)[:101] for v in FootDynamic.layout.inputs
    }
    levels |= {f"toe_force_{axis}": 0.2 * levels[f"toe_force_{axis}"] for axis in "xy"}
    still = {f"leg_force_{axis}": np.zeros(101) for axis in "xy"}
    expected = compiled(FootDynamic).run(time, levels, {}).signals
    found = compiled(FootFree).run(time, levels | still, FIXED | leg).signals
    for name, values in expected.items():
        # force over mass moves a heavy leg by a micrometre
        tolerance = 1e-6 * max(np.abs(values).max(), 1e-12)
        assert np.abs(found[name] - values).max() <= tolerance, name
    assert np.ptp(expected["ankle_angle"]) > 0.5


def test_standing_the_ground_carries_the_weight_and_friction_holds_a_push():
    """At rest pressures are the weight; a push below mu times it creeps, one above slides on."""
    weight = (0.2 + 0.06 + 0.03 + 0.01 + 0.01) * 9.80665
    found = run({}, 3.0)
    assert found["ground_force_x"][-1] == pytest.approx(-weight, rel=1e-4)
    pressures = [found[f"{part}_pressure"][-1] for part in ("heel", "ball", "toe", "toes")]
    assert sum(pressures) == pytest.approx(weight, rel=1e-4)
    held = run({}, 3.0, leg_force_y=0.3 * weight)
    creep = 0.02 * np.arctanh(0.3 / 0.6)
    assert held["leg_velocity_y"][-1] == pytest.approx(creep, rel=1e-3)
    pushed = run({}, 3.0, leg_force_y=0.8 * weight)
    gained = np.diff(pushed["leg_velocity_y"][-3:]) / 5e-3
    assert gained == pytest.approx(np.full(2, 0.2 * 9.80665), rel=1e-3)


@pytest.mark.parametrize("step", [5e-3, 2e-3, 1e-3])
def test_touchdown_and_lift_off_do_not_depend_on_the_communication_step(fmu, step):
    """A foot that hops: what it does is the same at any step of the host, seen every 10 ms."""
    path = fmu("foot_free", "native")
    hop = {"restitution_loss": 0.1, "leg_velocity_y_start": 0.3, "mtp_damping": 0.01}
    results = []
    for size in (step, 2.5e-4):
        time = size * np.arange(round(0.5 / size) + 1)
        with Fmu(path, hop) as one:
            one.start(0.0, 0.5)
            found = simulate_instance(one, time, {})
        every = round(0.01 / size)
        results.append({name: values[::every] for name, values in found.items()})
    coarse, fine = results
    flying = fine["ground_force_x"] == 0.0
    assert np.count_nonzero(np.diff(flying.astype(int))) >= 3, (
        "it touches and leaves more than once"
    )
    for name in ("leg_height", "leg_advance", "ankle_angle", "mtp_angle", "ground_work"):
        assert np.abs(coarse[name] - fine[name]).max() <= 1e-6 * np.ptp(fine[name]), name
