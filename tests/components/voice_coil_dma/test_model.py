"""The bench against the thesis and against solutions of the whole loop by scipy, written out by
hand here.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from demonstrations.thesis import loop_analysis as analysis
from fmus.kit import Parameter, State
from fmus.kit.integrate import Integrator
from fmus.kit.record.compiled import CompiledModel
from fmus.kit.symbolic.tracing import trace
from fmus.voice_coil_dma.model import VoiceCoilDma
from tests.support.voice_coil import B2, CORNER, K1, K2, B, K, L, M, R, S, T, equation_2_1

LEVEL = 20.0 / 65536


class Clamped(VoiceCoilDma):
    """The bench with A1's actuator in it, so that nothing is exchanged and the loop is exact."""

    name = "clamped"
    k1 = Parameter(K1, "N/m", doc="stiffness at once")
    k2 = Parameter(K2, "N/m", doc="delayed stiffness")
    b2 = Parameter(B2, "N*s/m", doc="damping in series with k2")
    dashpot = State("m", rate="dashpot_rate", nominal=1e-3, doc="elongation of the dashpot")

    def spring(self):
        return self.k1 * self.position + self.k2 * (self.position - self.dashpot)

    def dashpot_rate(self):
        return self.k2 * (self.position - self.dashpot) / self.b2

    def velocity_rate(self):
        return super().velocity_rate() - self.spring() / self.m

    def force_filter_rate(self):
        return super().force_filter_rate() + CORNER * self.spring()


def scipy_loop(
    times,
    reference,
    tension=lambda t: 0.0,
    *,
    actuator=False,
    controller=True,
    anti_windup=True,
    hold=lambda t: False,
    limits=(0.0, 10.0),
    measured=lambda force: force,
    drive=lambda volts: volts,
    friction=lambda v: B * v,
    constant=lambda x: K,
):
    """Monolithic solution: a stiff solver between events, the controller at exact multiples of T.

    Inputs may jump at ``times`` only. Rows: current, position, velocity, filtered force, filtered
    position, voltage.
    """
    state, command, previous, rows = np.zeros(6), 0.0, 0.0, []
    samples = T * np.arange(int(times[-1] / T) + 2)
    instants = np.unique(np.round(np.concatenate([times, samples[samples < times[-1]]]), 12))
    volts = 0.0
    for at, until in zip(instants, np.append(instants[1:], np.nan), strict=True):
        if np.abs(times - at).min() < 1e-10:
            rows.append([*state[:5], volts])
        if np.isnan(until):
            break
        inside = 0.5 * (at + until)
        if np.abs(samples - at).min() < 1e-10:
            error = reference(inside) - measured(state[3])
            change = 0.66 * error - 0.06 * previous
            if hold(inside):
                change = 0.36 * (
                    error - previous
                )  # Tustin: proportional 0.36, integral 0.3 (E(t) + E(t-1))
            command = command + change if controller else reference(inside)
            if anti_windup:
                command = min(max(command, limits[0]), limits[1])
            previous = error
            volts = drive(min(max(command, limits[0]), limits[1]))

        def rates(t, y, volts=volts, inside=inside):
            i, x, v, force, position, dashpot = y
            pull = tension(inside) + (K1 * x + K2 * (x - dashpot) if actuator else 0.0)
            k = constant(x)
            return [
                (volts - R * i - k * v) / L,
                v,
                (k * i - friction(v) - pull) / M,
                CORNER * (pull - force),
                CORNER * (x - position),
                K2 * (x - dashpot) / B2 if actuator else 0.0,
            ]

        state = solve_ivp(rates, (at, until), state, method="LSODA", rtol=1e-10, atol=1e-13).y[
            :, -1
        ]
    return np.array(rows)


def simulate(model, times, reference=lambda t: 0.0, tension=lambda t: 0.0, hold=lambda t: False):
    """The same rows from the component, inputs held over the steps between ``times``."""
    integrator, rows = Integrator(model), []
    for at, until in zip(times, np.append(times[1:], np.nan), strict=True):
        rows.append(
            [
                model.coil_current,
                model.position,
                model.velocity,
                model.force_measured(),
                model.position_measured(),
                model.coil_voltage(),
            ]
        )
        if np.isnan(until):
            return np.array(rows)
        inside = 0.5 * (at + until)
        model.force_reference, model.tension, model.hold = (
            float(reference(inside)),
            float(tension(inside)),
            hold(inside),
        )
        integrator.advance(float(at), float(until - at))
    return np.array(rows)


def same(found, exact, rel=1e-6):
    """Every column, relative to its largest value; a velocity, to 10 mm/s at least."""
    scale = np.abs(exact).max(axis=0)
    scale[2] = max(scale[2], 0.01)
    error = np.abs(found - exact).max(axis=0) / scale
    assert (error < rel).all(), error


def steps(t):
    """Wanted force in N, beyond what 10 V can give in the middle."""
    return (1.0, 2.5, 20.0, 0.5)[min(int(t / 0.5), 3)]


GRID = 0.01 * np.arange(201)


def test_closed_loop_with_the_actuator_is_the_monolithic_solution():
    found = simulate(Clamped(), GRID, steps)
    exact = scipy_loop(GRID, steps, actuator=True)
    same(found, exact)
    assert exact[:, 5].max() == 10.0  # saturates
    assert exact[45, 3] == pytest.approx(1.0, rel=5e-3)


@pytest.mark.parametrize("size", [1e-3, 0.007, T, 0.1, 0.5])
def test_any_communication_step_gives_the_same_loop(size):
    times = np.round(size * np.arange(round(1.0 / size) + 1), 12)
    found = simulate(Clamped(), times, lambda t: 2.0)
    same(found, scipy_loop(times, lambda t: 2.0, actuator=True))


@settings(max_examples=4, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1))
def test_prescribed_tension_is_the_monolithic_solution(seed):
    rng = np.random.default_rng(seed)
    times = np.append(0.0, np.cumsum(rng.uniform(0.001, 0.2, 12)))
    forces, pulls = rng.uniform(0, 5, 12), rng.uniform(0, 5, 12)

    def held(values):
        return lambda t: values[min(np.searchsorted(times, t) - 1, 11)]

    found = simulate(VoiceCoilDma(), times, held(forces), held(pulls))
    same(found, scipy_loop(times, held(forces), held(pulls)))


def test_open_loop_is_the_coil_and_its_output_limits():
    def command(t):
        return (3.0, 12.0, -4.0, 6.0)[min(int(t / 0.5), 3)]

    found = simulate(Clamped(controller_on=False), GRID, command)
    same(found, scipy_loop(GRID, command, actuator=True, controller=False))
    settled = found[49]
    assert settled[5] == 3.0
    assert settled[0] == pytest.approx(3.0 / R, rel=1e-3)
    assert set(np.unique(found[:, 5])) == {
        0.0,
        3.0,
        10.0,
        6.0,
    }  # 12 V and -4 V are beyond the limits


def test_windup_and_anti_windup():
    def reference(t):
        return 20.0 if t < 1.0 else 1.0

    times = 0.01 * np.arange(301)
    with_it = simulate(Clamped(), times, reference)
    without = simulate(Clamped(anti_windup=False), times, reference)
    same(with_it, scipy_loop(times, reference, actuator=True))
    same(without, scipy_loop(times, reference, actuator=True, anti_windup=False))
    back = [times[(run[:, 5] < 9.9) & (times > 1.0)][0] for run in (with_it, without)]
    assert back[0] <= 1.0 + 2 * T + 0.01  # answers at the next sample
    assert back[1] > 1.2  # has to unwind first


def test_hold_freezes_the_integral_part_only():
    def held(t):
        return 0.5 <= t < 1.5

    def reference(t):
        return 1.0 if t < 0.75 else 2.0

    found = simulate(Clamped(), GRID, reference, hold=held)
    same(found, scipy_loop(GRID, reference, actuator=True, hold=held))
    # what is left is a gain: the voltage settles where V - V0 = 0.36 (E - E0)
    before, during = found[49], found[149]
    assert during[5] - before[5] == pytest.approx(
        0.36 * ((2.0 - during[3]) - (1.0 - before[3])), rel=1e-3
    )
    assert 2.0 - during[3] > 0.5
    assert found[-1, 3] == pytest.approx(2.0, rel=0.01)


def test_converters_have_their_levels_and_their_range():
    model = VoiceCoilDma(converters_on=True)
    force_level, position_level = LEVEL / (4.5e-4 * 1000.0), LEVEL / 196.85
    assert force_level < 0.001  # "smaller than 0.001 N and 0.003 mm"
    assert position_level < 3e-6
    for force in np.linspace(-25, 25, 501):
        model.force_filtered = model.position_filtered = float(force)
        model.position_filtered = force * 1e-3
        top = 22.222222222 - force_level
        expected = force_level * np.round(np.clip(force, -22.222222222, top) / force_level)
        assert model.force_measured() == pytest.approx(
            expected, abs=1.001 * force_level if abs(force) > 22 else 1e-6
        )
        assert abs(model.position_measured() - force * 1e-3) <= 0.5001 * position_level
    model.force_filtered = 1e3
    assert model.force_measured() == pytest.approx((10.0 - LEVEL) / 0.45, rel=1e-12)
    model.force_filtered = -1e3
    assert model.force_measured() == pytest.approx(-10.0 / 0.45, rel=1e-12)


def test_loop_with_converters_is_the_monolithic_solution():
    def rounded(volts):
        return LEVEL * np.floor(volts / LEVEL + 0.5)

    found = simulate(Clamped(converters_on=True), GRID, lambda t: 1.5)
    exact = scipy_loop(
        GRID,
        lambda t: 1.5,
        actuator=True,
        measured=lambda f: rounded(f * 0.45) / 0.45,
        drive=rounded,
    )
    same(found[:, [0, 1, 2, 5]], exact[:, [0, 1, 2, 5]])
    assert np.abs(found[:, 3] - exact[:, 3]).max() < 0.51 * LEVEL / 0.45
    assert np.abs(found[:, 4] - exact[:, 4]).max() < 0.51 * LEVEL / 196.85


def test_exchange_at_communication_points_converges_to_the_monolithic_solution():
    """The actuator outside, its tension held over the step: an error of first order, that
    extrapolation removes.
    """

    def exchanged(size):
        model, rows, dashpot = VoiceCoilDma(), [], 0.0
        integrator = Integrator(model)
        for k in range(round(0.3 / size)):
            model.force_reference = 1.0
            model.tension = K1 * model.position + K2 * (model.position - dashpot)
            x = model.position
            integrator.advance(k * size, size)
            dashpot += size * K2 * (0.5 * (x + model.position) - dashpot) / B2
            rows.append([model.position, model.force_measured()])
        return np.array(rows)[round(0.01 / size) - 1 :: round(0.01 / size)]

    exact = scipy_loop(GRID[:31], lambda t: 1.0, actuator=True)[1:, [1, 3]]
    coarse, fine = exchanged(4e-4), exchanged(2e-4)
    errors = [np.abs(run - exact).max(axis=0) / exact.max(axis=0) for run in (coarse, fine)]
    assert errors[1] == pytest.approx(errors[0] / 2, rel=0.2)
    assert (errors[1] < 0.02).all()
    assert (np.abs(2 * fine - coarse - exact).max(axis=0) / exact.max(axis=0) < 3e-3).all()


@pytest.mark.parametrize(("stiffness", "longest"), [(4000.0, 0.010), (9000.0, 0.003)])
def test_exchange_with_a_spring_is_unstable_beyond_the_steps_that_the_readme_names(
    stiffness, longest
):
    """Largest eigenvalue of the exchange, by matrix exponential; half a step more or less is seen
    in the bench.
    """
    equations = np.array(
        [[-R / L, 0, -K / L, 0], [0, 0, 1, 0], [K / M, 0, -B / M, -1 / M], [0, 0, 0, 0]]
    )

    def growth(size):
        step = expm(equations * size)[:3]
        return (
            np.abs(np.linalg.eigvals(step[:, :3] + np.outer(step[:, 3], [0, stiffness, 0]))).max()
            - 1.0
        )

    limit = brentq(growth, 1e-4, 0.015)
    assert limit == pytest.approx(longest, rel=0.05)
    for size, stable in ((limit / 1.5, True), (limit * 1.5, False)):
        model = VoiceCoilDma(controller_on=False, force_reference=1.0)
        integrator = Integrator(model)
        for k in range(200):
            model.tension = stiffness * model.position
            integrator.advance(k * size, size)
        settled = K / R / stiffness  # 1 V into the coil at rest
        assert (abs(model.position / settled - 1.0) < 0.01) == stable


def test_compiled_and_interpreted_laws_agree():
    time = 0.01 * np.arange(201)
    force = np.array([steps(t + 1e-6) for t in time])
    pull = 0.2 + 0.9 * np.minimum(force, 5.0)
    run = CompiledModel(VoiceCoilDma).run(time, {"force_reference": force, "tension": pull}).signals
    # over a record the linear part is solved exactly, which steps of the model come close to at a
    # finer tolerance
    model = type("Finer", (VoiceCoilDma,), {"tolerance": 1e-12})()
    found = simulate(model, time, lambda t: force[int(t / 0.01)], lambda t: pull[int(t / 0.01)])
    for column, name in enumerate(
        ("coil_current", "position", "velocity", "force_measured", "position_measured")
    ):
        assert run[name] == pytest.approx(
            found[:, column], rel=1e-9, abs=1e-9 * np.abs(found[:, column]).max()
        ), name


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_what_is_not_a_number_does_not_pass_for_a_voltage(bad):
    model = VoiceCoilDma(controller_on=False)
    model.force_reference = bad
    limited = model.next_command()
    assert limited == 10.0 or limited != limited


def test_model_is_eq_2_1():
    a, _, _, _ = trace(Clamped).linearise()
    names = [state.name for state in Clamped.layout.states]
    volts = np.zeros(len(names))
    volts[names.index("coil_current")] = 1.0 / L
    for s, expected in zip(S, equation_2_1(S), strict=True):
        current = np.linalg.solve(s * np.eye(len(names)) - a, volts)[names.index("coil_current")]
        assert K * current == pytest.approx(expected, rel=1e-8)


def test_closed_loop_time_constant_is_below_a_tenth_of_a_second():
    """Fig. 2-6, by the sampled loop with the actuator clamped in."""
    time = np.linspace(0, 1, 1001)
    found = simulate(Clamped(), time, lambda t: 1.0)
    # the first sample applies 0.66 V at once, which is 0.66 K/R = 0.86 N
    assert 0.003 < analysis.rise_time(time, found[:, 3]) < 0.1
    assert found[-1, 3] == pytest.approx(1.0, rel=1e-3)


def test_signals_have_their_fixed_names():
    layout = VoiceCoilDma.layout
    assert {v.name: v.unit for v in layout.inputs} == {
        "force_reference": "N",
        "tension": "N",
        "hold": "1",
    }
    assert {v.name: v.unit for v in layout.measurable} == {
        "position": "m",
        "velocity": "m/s",
        "coil_current": "A",
        "coil_voltage": "V",
        "force_measured": "N",
        "position_measured": "m",
    }
    declared = {p.name: p.start for p in layout.parameters}
    assert [declared[n] for n in ("R", "L", "K", "m", "b_vc")] == [R, L, K, M, B]
    assert declared["sample_period"] == T
    for name in (
        "R",
        "L",
        "m",
        "sample_period",
        "load_cell_sensitivity",
        "potentiometer_sensitivity",
    ):
        assert {p.name: p.min for p in layout.parameters}[name] > 0, f"{name} divides"
