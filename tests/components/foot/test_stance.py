"""Claims: a stance goes from heel to ball by what the films do, the ground makes its reaction,
energy is never made, and results do not depend on the communication step.
"""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ppy_rig as ppy
from fmus.foot.systems import FOOT_STANCE
from fmus.kit.record import CompiledModel
from orchestration import master
from orchestration.experiment import read
from orchestration.experiment.execution import run
from orchestration.experiment.waveforms import square_wave
from orchestration.fmu import Fmu
from orchestration.master.reference import fuse
from orchestration.system import library
from studies.references import foot as points
from tests.support.foot import ACTUATORS, RANGES, lengths_at

LANDINGS = 2_000  # each of five times
# J, of four springs whose ends jump by the displacement of a step: k d^2 / 2 each
COUPLING = 4.0 * 0.5 * 6300.0 * (6.8e-5 * 1.4 * 5e-3) ** 2
WEIGHT = 0.031 * 9.80665  # N
R1, R2, C, ALPHA = 0.43, 2.35, 2.7, 6.8e-5  # table 3-1, fig. 3-10
K1, B1, K2, B2 = 6300.0, 1.7e6, 1e4, 2e6  # fig. 3-9
SIGNS = {"an": -1.0, "po": 1.0, "do": -1.0, "pl": 1.0}
START = FOOT_STANCE.members["foot"].values
REFERENCE = np.array(lengths_at(0.0, 0.0))
LOADED = ([0.0, 0.16, 0.96, 5.76, 7.36], [-0.2736, -0.2736, 0.0, 0.0, -0.31])
PUSHED = ([0.0, 0.4, 1.6, 4.0, 6.0, 7.2], [0.0, 0.0, 0.0456, 0.0, -0.0456, 0.0])


def inputs(time):
    """Loads and currents of the experiment, written again."""
    current = 1.3 * square_wave(time + 2.0, 1.0, 0.125)
    found = {f"{a}_current": sign * current for a, sign in SIGNS.items()}
    found["leg_force_x"] = np.interp(time, *LOADED)
    return found | {"leg_force_y": np.interp(time, *PUSHED)}


def test_at_the_start_moments_are_balanced_and_the_heel_is_lower():
    ankle, mtp = START["ankle_angle_start"], START["mtp_angle_start"]
    flowed = np.array([START[f"{a}_flow_start"] for a in ACTUATORS])
    pulls = K1 * (np.array(lengths_at(ankle, mtp)) - REFERENCE - flowed)
    h = 1e-6
    arms = (np.array(lengths_at(ankle + h, mtp + h)) - lengths_at(ankle - h, mtp - h)) / (2.0 * h)
    assert pulls[1::2] == pytest.approx([1.0, 0.4], rel=1e-3)
    assert arms[::2] * pulls[::2] == pytest.approx(-arms[1::2] * pulls[1::2], rel=2e-3)
    _, _, (heel, ball, toe, _) = points.rods(np.array([ankle, 0.0, mtp, 0.0]))
    assert START["leg_height_start"] - heel[0] == pytest.approx(0.2e-3, abs=1e-6)
    assert heel[0] - ball[0] == pytest.approx(0.28e-3, abs=5e-6)
    assert toe[0] < ball[0]


@pytest.fixture(scope="module")
def stance():
    return ppy.run("foot_stance")


@pytest.mark.slow
def test_the_weight_goes_from_heel_to_ball_and_the_heel_leaves_first(stance):
    time = stance["time"].to_numpy()
    heel, ball, up = (
        stance[f"foot.{name}"].to_numpy()
        for name in ("heel_pressure", "ball_pressure", "ground_force_x")
    )
    on_heel, on_ball = time[heel > 0.0], time[ball > 0.0]
    assert on_heel[0] < 0.1
    assert 2.0 < on_ball[0] < 4.0
    assert on_heel[-1] < 6.1
    assert 7.2 < on_ball[-1] < 7.4
    carried = (time > 1.1) & (time < 5.7)
    assert -up[carried] == pytest.approx(np.full(carried.sum(), WEIGHT), rel=1e-2)
    assert ball[np.searchsorted(time, 5.76)] > 0.85 * WEIGHT
    assert np.all(up[time > 7.4] == 0.0)


@pytest.mark.slow
def test_films_stay_within_what_they_bear(stance):
    for name in ACTUATORS:
        tension = stance[f"foot.{name}_force"].to_numpy()
        assert 0.15 < tension.min() < tension.max() < 2.5
        assert np.abs(stance[f"{name}.voltage"].to_numpy()).max() < 1.25


@pytest.mark.slow
@pytest.mark.parametrize(
    ("settings", "tension", "is_beyond", "told"),
    [
        # 161 g, which the body carries and lifts as it does the 31 g
        (
            ["foot.leg_mass=0.15", f"inputs.leg_force_x.levels={[5.19 * f for f in LOADED[1]]}"],
            "po",
            lambda pull: pull <= 0.0,
            r"foot\.po_compression reaches .*, first at (\S+) s: compression above which the films"
            " of po are slack",
        ),
        # dashpots that have flowed to 1.5 N more in po, and to what balances it in an
        (
            ["foot.po_flow_start=0.00413", "foot.an_flow_start=-0.00308"],
            "an",
            lambda pull: pull > 3.0,
            r"an\.force reaches .*, beyond an\.force_limit = 3 N, first at (\S+) s: load above",
        ),
    ],
)
def test_a_run_says_when_a_film_is_slack_or_overloaded(settings, tension, is_beyond, told):
    notes = []
    made = run(read("foot_stance", settings), note=notes.append)
    time = made["time"].to_numpy()
    first = time[is_beyond(made[f"foot.{tension}_force"].to_numpy())][0]
    remarks = [line for line in notes if "_limit" in line]
    assert len(remarks) == 1
    assert float(re.match(told, remarks[0])[1]) == pytest.approx(first, abs=5.1e-3)


@pytest.mark.slow
def test_without_currents_the_weight_stays_on_the_heel():
    still = ppy.run(
        "foot_stance", settings={f"inputs.{a}_current.amplitude": 0.0 for a in ACTUATORS}
    )
    at = np.searchsorted(still["time"].to_numpy(), 5.7)
    assert still["foot.ball_pressure"][at] < 0.15 * WEIGHT


@pytest.mark.slow
def test_the_stance_is_the_motion_of_points_under_whole_films(stance, monkeypatch):
    """Oracle: rods by Newton, Euler and Kane on Hunt and Crossley's ground, and films with their
    Kelvin element, which the system has as a dashpot.
    """
    monkeypatch.setattr(points, "MASSES", points.MASSES / 10.0)
    monkeypatch.setattr(points, "LEG", points.LEG / 10.0)
    monkeypatch.setattr(points, "FREE_INERTIA", points.FREE_INERTIA / 10.0)

    def tensions(x):
        lengths, _ = points.actuators(x[0], x[2])
        charge, kelvin, maxwell = np.split(x[16:], 3)
        return np.maximum(K1 * (lengths - REFERENCE - ALPHA * charge - kelvin - maxwell), 0.0)

    def slope(time, x):
        pulls = tensions(x)
        given = inputs(time)
        charge, kelvin, _ = np.split(x[16:], 3)
        currents = np.array([given[f"{a}_current"] for a in ACTUATORS])
        loads = np.array([*pulls, 0.0, 0.0, given["leg_force_x"], given["leg_force_y"]])
        return [
            *points.free_slope(x[:16], loads),
            *(R2 * currents - charge / C) / (R1 + R2),
            *(pulls - K2 * kelvin) / B2,
            *pulls / B1,
        ]

    state = np.zeros(28)
    state[[0, 2, 8]] = [
        START[f"{name}_start"] for name in ("ankle_angle", "mtp_angle", "leg_height")
    ]
    state[24:] = [START[f"{a}_flow_start"] for a in ACTUATORS]
    seen = []
    for begin, end in ((0.0, 2.0), (2.0, 4.0)):  # at 2 s currents change their sign
        time = np.arange(begin + 0.01, end - 5e-3, 0.01)
        found = solve_ivp(slope, (begin, end - 1e-9), state, "DOP853", time, rtol=1e-7, atol=1e-10)
        state = found.y[:, -1]
        seen.append((time, found.y))
    time, exact = (np.concatenate(parts, axis=-1) for parts in zip(*seen, strict=True))
    at = np.searchsorted(stance["time"].to_numpy(), time - 1e-9)
    pulls = np.array([tensions(x) for x in exact.T]).T
    for name, values in zip(ACTUATORS, pulls, strict=True):
        assert stance[f"foot.{name}_force"].to_numpy()[at] == pytest.approx(values, abs=5e-3)
    assert stance["foot.ankle_angle"].to_numpy()[at] == pytest.approx(exact[0], abs=4e-5)
    assert stance["foot.leg_height"].to_numpy()[at] == pytest.approx(exact[8], abs=2e-6)
    assert stance["foot.ground_work"].to_numpy()[at] == pytest.approx(
        exact[13], rel=1e-2, abs=2e-7
    )  # a push is held over a step while the foot creeps


@pytest.mark.slow
@pytest.mark.parametrize("step", [5e-3, 3.7e-3, 1e-3])
def test_at_any_communication_step_it_converges_to_the_fused_system(step):
    """The landing and the roll; the fused system has no communication step."""
    system = library.system("foot_stance")
    coarse = step * np.arange(round(4.0 / step) + 1)
    given = inputs(coarse)
    exact = CompiledModel(fuse(system)).run(coarse, given).signals
    errors = []
    for parts in (1, 2):
        time = np.linspace(0.0, coarse[-1], parts * (coarse.size - 1) + 1)
        held = {name: np.repeat(values, parts)[: time.size] for name, values in given.items()}
        found = master.run(system, time, held).signals
        errors.append(
            [
                np.abs(found[name][::parts] - exact[name]).max() / np.ptp(exact[name])
                for name in ("foot.ankle_angle", "foot.leg_height", "foot.po_force")
            ]
        )
    whole, half = np.array(errors)
    assert np.all(whole < 0.4 * step)  # 0.2 % at 5 ms
    assert half == pytest.approx(0.5 * whole, rel=0.15)


def landing(random):
    """A posture, tensions of 0 to 3 N, charges, and a fall of up to 0.5 mm at 0.1 to 0.5 m/s."""
    posture = {joint: random.uniform(*span) for joint, span in RANGES.items()}
    charges, pulls = random.uniform(-2.0, 2.0, 4), random.uniform(0.0, 3.0, 4)
    lengths = np.array(lengths_at(posture["ankle"], posture["mtp"]))
    flows = lengths - REFERENCE - ALPHA * charges - pulls / K1
    angles = np.array([*posture.values(), 0.0])
    lowest = max(point[0] for point in points.rods(angles)[2])
    values = {f"foot.{joint}_angle_start": angle for joint, angle in posture.items()}
    values |= {f"foot.{joint}_rate_start": random.normal() for joint in RANGES}
    values |= {f"foot.{a}_flow_start": x for a, x in zip(ACTUATORS, flows, strict=True)}
    values |= {f"{a}.charge_start": x for a, x in zip(ACTUATORS, charges, strict=True)}
    values |= {
        "foot.leg_height_start": lowest + random.uniform(0.0, 5e-4),
        "foot.leg_velocity_x_start": random.uniform(0.1, 0.5),
        "foot.leg_velocity_y_start": random.uniform(-0.2, 0.2),
    }
    return {name: float(value) for name, value in values.items()}


SEEN = (
    "foot.kinetic_energy",
    "foot.potential_energy",
    "foot.load_work",
    "foot.ground_work",
    *(f"foot.{a}_force" for a in ACTUATORS),
    *(f"{a}.electrochemical_displacement" for a in ACTUATORS),
)


@pytest.fixture(scope="module")
def packed(tmp_path_factory):
    path = tmp_path_factory.mktemp("packed") / "foot_stance.fmu"
    system = replace(library.system("foot_stance"), outputs={})
    path.write_bytes(master.pack(system))
    return path


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_random_landings_of_the_whole_system_make_no_energy(packed, seed):
    """At steps of 5 ms, from any posture, under currents of 1.3 A at most, of which 1.4 A charge
    films of 2 C: energy of foot and springs is at most what it was, with the work of loads and of
    films that shorten under tension. The ground takes, and a step of the coupling makes 3 nJ.
    """
    random, step, row = np.random.default_rng(seed), 5e-3, np.zeros(len(SEEN))
    touched = 0
    names = [*(f"{a}_current" for a in ACTUATORS), "leg_force_x", "leg_force_y"]
    with Fmu(packed) as one:
        write, read = one.writer(names), one.reader(SEEN)
        for _ in range(LANDINGS):
            one.parameters = landing(random)
            one.start(0.0, 0.03)
            write(np.array([*random.uniform(-1.3, 1.3, 4), *random.uniform(-0.3, 0.3, 2)]))
            rows = []
            for k in range(7):
                if k:
                    one.step((k - 1) * step, step)
                read(row)
                rows.append(row.copy())
            assert one.reset()
            kinetic, potential, load, ground = np.array(rows).T[:4]
            pulls, elongated = np.split(np.array(rows)[:, 4:], 2, axis=1)
            energy = kinetic + potential + (pulls**2).sum(axis=1) / (2.0 * K1)
            moved = np.diff(elongated, axis=0)  # under a force that the films have had for a step
            films = np.append(0.0, np.cumsum(-(pulls[:-1] * moved).sum(axis=1)))
            gained = np.diff(energy - load - films - ground).max()
            assert gained <= COUPLING + 1e-6 * kinetic.max()
            assert ground.max() <= 1e-7 * kinetic.max()
            touched += ground[-1] < 0.0
    assert touched > 0.9 * LANDINGS
