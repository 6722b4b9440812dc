"""Claims: a fused system follows solutions of its whole equations, written out here without the
code of the models.

Oracles: scipy between exact events for the bench and the foot (geometry from points in the plane),
an event loop over the single components for what is sampled, central differences for sensitivities,
arithmetic on paper for the rules of connection.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from fmus import component
from fmus.kit import Component, Discrete, Input, Output, Parameter, State, UserError
from fmus.kit.integrate import Integrator
from fmus.kit.record.compiled import CompiledModel
from fmus.kit.symbolic.tracing import trace
from orchestration.experiment.waveforms import square_wave
from orchestration.master import run
from orchestration.master.reference.fused import fuse
from orchestration.system import library
from orchestration.system.model import Connection, Member, Port, System, connect
from studies.references import foot as points

R, L, K, M, B, CORNER, T = 3.0, 1e-3, 3.9, 0.03, 6.0, 2 * np.pi * 100.0, 1.0 / 30.0
R1, R2, C, ALPHA, K1, B1, K2, B2 = 0.43, 2.35, 2.70, 6.8e-5, 6300.0, 1.7e6, 1.0e4, 2.0e6


def bench(times, reference, current):
    """Rows at ``times``, after which inputs keep their values: position, voltage, tension, filtered
    force, charge.

    A stiff solver between events; the controller of eq. 2.2 acts at exact multiples of its period.
    """
    y, volts, previous, rows = np.zeros(8), 0.0, 0.0, []
    samples = T * np.arange(int(times[-1] / T) + 1)
    events = np.unique(np.round(np.append(times, samples), 12))

    def tension(y):
        return max(K1 * (y[1] - ALPHA * y[5] - y[6] - y[7]), 0.0)

    def slope(_, y, volts, amperes):
        i, x, v, force, position, charge, kelvin, _ = y
        pull = tension(y)
        return [
            (volts - R * i - K * v) / L,
            v,
            (K * i - B * v - pull) / M,
            CORNER * (pull - force),
            CORNER * (x - position),
            (R2 * amperes - charge / C) / (R1 + R2),
            (pull - K2 * kelvin) / B2,
            pull / B1,
        ]

    for at, until in zip(events, np.append(events[1:], np.nan), strict=True):
        row = np.searchsorted(times, at + 1e-9) - 1
        if np.abs(samples - at).min() < 1e-9:
            error = reference[row] - y[3]
            volts, previous = np.clip(volts + 0.66 * error - 0.06 * previous, 0.0, 10.0), error
        if np.abs(times - at).min() < 1e-9:
            charging = (R2 * current[row] - y[5] / C) / (R1 + R2)
            rows.append([y[1], R1 * charging + y[5] / C, tension(y), y[3], y[5]])
        if at < events[-1]:
            y = solve_ivp(
                slope,
                (at, until),
                y,
                "LSODA",
                args=(volts, current[row]),
                rtol=1e-10,
                atol=1e-13,
                max_step=5e-3,
            ).y[:, -1]
    return np.array(rows).T


SEEN = [
    "bench.position",
    "actuator.voltage",
    "actuator.tension",
    "bench.force_measured",
    "actuator.charge",
]


def close(found, exact, tolerance):
    """Relative to the largest value, signal by signal."""
    for name, values in exact.items():
        assert np.abs(found[name] - values).max() <= tolerance * np.abs(values).max(), name


def test_bench_is_the_monolithic_solution_slack_and_saturation_included():
    time = 0.01 * np.arange(101)
    inputs = {
        "force_reference": np.select([time < 0.2, time < 0.6], [0.0, 2.0], 20.0),
        "current": square_wave(time, 1.3, 2.0),
    }
    found = CompiledModel(fuse(library.system("dma_bench"))).run(time, inputs).signals
    exact = dict(zip(SEEN, bench(time, *inputs.values()), strict=True))
    close(found, exact, 1e-6)
    assert found["bench.coil_voltage"].max() == 10.0
    assert (exact["actuator.tension"] == 0.0).sum() > 3
    assert exact["actuator.tension"].max() > 5.0


@pytest.mark.slow
def test_foot_under_four_currents_is_the_motion_of_its_points():
    system, feet, currents = (
        library.system("foot_gait"),
        ("an", "po", "do", "pl"),
        np.array([1.0, -0.6, 0.5, -0.8]),
    )
    flowed = [system.member(a).parameters["maxwell_elongation_start"] for a in feet]

    def parts(y):
        angles, rates, charge, kelvin, maxwell = np.split(y, [3, 6, 10, 14])
        lengths, _ = points.actuators(angles[0], angles[2])
        left = lengths - points.REFERENCE - ALPHA * charge - kelvin - maxwell
        return angles, rates, charge, kelvin, np.maximum(K1 * left, 0.0)

    def slope(_, y):
        angles, rates, charge, kelvin, pull = parts(y)
        turned = points.acceleration(angles, rates, np.append(pull, [0.0, 0.0]))
        return [
            *rates,
            *turned,
            *(R2 * currents - charge / C) / (R1 + R2),
            *(pull - K2 * kelvin) / B2,
            *pull / B1,
        ]

    time = np.array([0.0, 0.05, 0.1, 0.2, 0.4])
    y = solve_ivp(
        slope, (0.0, 0.4), [*np.zeros(14), *flowed], "DOP853", t_eval=time, rtol=1e-10, atol=1e-13
    ).y
    exact = {f"foot.{joint}_angle": y[i] for i, joint in ((0, "ankle"), (2, "mtp"))}
    exact |= {f"{a}.tension": [parts(row)[4][i] for row in y.T] for i, a in enumerate(feet)}
    inputs = {f"{a}_current": np.full(time.size, i) for a, i in zip(feet, currents, strict=True)}
    close(CompiledModel(fuse(system)).run(time, inputs).signals, exact, 1e-6)
    assert np.abs(exact["foot.ankle_angle"]).max() > 5e-4


def protected():
    """The watch with a voltage limit that acts soon, and an estimate that is soon valid."""
    system = library.system("degradation_watch")
    watch, *others = system.members
    soon = {"initial_voltage_limit": 1.1, "settling_time": 40.0}
    return replace(system, members=(replace(watch, parameters=watch.parameters | soon), *others))


@pytest.mark.slow
def test_watch_takes_its_samples_in_the_order_of_its_members():
    """Between its sample instants nothing but the actuator moves, so that single components can be
    stepped exactly.
    """
    estimator, *others = protected().members
    system, step = replace(protected(), members=(*others, estimator)), 0.1
    time = step * np.arange(1501)
    command = square_wave(time + 2.5, 1.3, 0.1)
    galvanostat, actuator, estimator = (m.cls(**m.parameters) for m in system.members)
    integrators = [Integrator(model) for model in (galvanostat, actuator, estimator)]
    rows = []
    for t, wanted in zip(time.tolist(), command.tolist(), strict=True):
        galvanostat.current_command = wanted
        actuator.current = galvanostat.current()  # of the sample before
        galvanostat.voltage, galvanostat.voltage_limit = (
            actuator.voltage(),
            estimator.voltage_limit(),
        )
        rows.append(
            [
                actuator.current,
                galvanostat.voltage,
                estimator.R1,
                estimator.impedance(),
                actuator.throughput,
            ]
        )
        integrators[0].advance(t, step)
        actuator.current = estimator.current = galvanostat.current()
        estimator.voltage = actuator.voltage()
        for integrator in integrators[1:]:
            integrator.advance(t, step)
    names = [
        "galvanostat.current",
        "actuator.voltage",
        "estimator.R1",
        "estimator.impedance",
        "actuator.throughput",
    ]
    found = CompiledModel(fuse(system)).run(time, {"current_command": command}).signals
    close(found, dict(zip(names, np.array(rows).T, strict=True)), 1e-6)
    for happened in ("galvanostat.recovering", "estimator.estimate_valid"):
        assert set(found[happened]) == {0.0, 1.0}


def test_gauss_seidel_is_the_fused_watch_whose_members_are_in_the_order_of_its_steps():
    """And no other: who is protected at an instant has another current for those who sample after
    him.
    """
    system = protected()
    time = 0.1 * np.arange(601)
    inputs = {"current_command": square_wave(time + 2.5, 1.3, 0.1)}
    estimator, galvanostat, actuator = system.members
    coupled = run(system, time, inputs, method="gauss-seidel").signals
    errors = []
    for members in ((galvanostat, actuator, estimator), (estimator, galvanostat, actuator)):
        found = CompiledModel(fuse(replace(system, members=members))).run(time, inputs).signals
        errors.append(max(np.abs(found[name] - values).max() for name, values in coupled.items()))
    assert min(errors) < 1e-9
    assert max(errors) > 1e-3


def test_sensitivities_to_parameters_of_members_are_central_differences():
    graph = fuse(library.system("dma_bench"))
    time = 0.01 * np.arange(61)
    inputs = {"force_reference": 3.0 + 0.0 * time, "current": np.where(time < 0.3, 0.2, -0.4)}
    values = {
        "actuator.k1": 6300.0,
        "actuator.alpha": 6.8e-5,
        "bench.K": 3.9,
        "bench.error_gain": 0.66,
    }
    plain, found = CompiledModel(graph), CompiledModel(graph, list(values)).run(time, inputs)
    for i, (name, value) in enumerate(values.items()):
        ends = [plain.run(time, inputs, {name: value * (1 + s)}).signals for s in (1e-3, -1e-3)]
        for signal in ("actuator.tension", "bench.position", "bench.coil_voltage"):
            slope = (ends[0][signal] - ends[1][signal]) / (2e-3 * value)
            error = np.abs(found.sensitivities[signal][:, i] - slope).max()
            # what the integration errors of the two runs leave, which are nearly the same in both
            floor = 1e-2 * graph.tolerance * np.abs(ends[0][signal]).max() / (2e-3 * value)
            assert error <= 1e-5 * np.abs(slope).max() + floor, (name, signal)
            assert floor < 1e-3 * np.abs(slope).max(), (name, signal)


# --- rules of connection
# --------------------------------------------------------------------------------------------


class Leak(Component):
    """A leaking integrator that also passes its input on."""

    name = "leak"
    a = Parameter(2.0, "1/s")
    u = Input("1", start=0.5)
    bias = Input("1", start=0.25)
    x = State("1", rate="x_rate", output=True)

    def x_rate(self):
        return -self.a * self.x + self.u + self.bias

    @Output("1")
    def through(self):
        """Part of the input."""
        return self.x + 3.0 * self.u


class Count(Component):
    """Counts its samples and remembers what it saw of another."""

    name = "count"
    other = Input("1")
    count = Discrete("1", update="counted", period=0.5, output=True)
    seen = Discrete("1", update="look", period=0.5, output=True)

    def counted(self):
        return self.count + 1.0

    def look(self):
        return self.other


def system_of(classes, connections, parameters=None, inputs=None):
    members = (Member.of(n, c, (parameters or {}).get(n)) for n, c in classes.items())
    return System("small", tuple(members), connections, inputs or {})


def test_a_chain_is_the_linear_system_worked_out_on_paper():
    """q receives 2 (x_p + 3 u) - 1 and p half of x_q; u comes from outside, and the bias of q stays
    where it is put.
    """
    system = system_of(
        {"q": Leak, "p": Leak},
        (
            Connection(Port("p", "through"), Port("q", "u"), factor=2.0, offset=-1.0),
            Connection(Port("q", "x"), Port("p", "bias"), factor=0.5),
        ),
        {"q": {"a": 7.0, "x_start": 0.125, "bias": 0.75}},
        {"drive": (Port("p", "u"),)},
    )
    graph = fuse(system)
    assert [(v.name, v.start) for v in graph.layout.inputs] == [("drive", 0.5), ("q.bias", 0.75)]
    A, B = np.array([[-7, 2], [0.5, -2]]), np.array([[6, 1], [1, 0]])  # of q, p
    C, D = np.array([[1, 6], [0, 1]]), np.array([[18, 0], [3, 0]])
    for found, matrix in zip(graph.linearise(), (A, B, C, D), strict=True):
        np.testing.assert_array_equal(found, matrix)
    time = np.linspace(0.0, 2.0, 5)
    drive = np.array([0.5, -1.0, 2.0, 0.0, 1.0])
    found = CompiledModel(graph).run(time, {"drive": drive}).signals
    x = np.array([0.125, 0.0])
    for k, u in enumerate(drive):
        assert [found["q.x"][k], found["p.x"][k]] == pytest.approx(x, rel=1e-7)
        outputs = C @ x + D[:, 0] * u - [3.0, 0.0]
        assert [found["q.through"][k], found["p.through"][k]] == pytest.approx(outputs, rel=1e-7)
        affine = np.block([[A, (B @ [u, 0.75] - [1.0, 0.0])[:, None]], [np.zeros((1, 3))]])
        x = (expm(0.5 * affine) @ [*x, 1.0])[:2]


def test_an_input_of_the_system_reaches_all_its_ports():
    system = system_of(
        {"one": Leak, "two": Leak},
        (),
        {n: {"bias": 0.0} for n in ("one", "two")},
        {"drive": (Port("one", "u"), Port("two", "u"))},
    )
    graph = fuse(system)
    _, B, _, _ = graph.linearise()
    np.testing.assert_array_equal(
        B[:, [v.name for v in graph.layout.inputs].index("drive")], [1, 1]
    )


def test_samples_that_coincide_are_taken_in_the_order_of_the_members():
    time = 0.25 * np.arange(10)
    taken = np.ceil(time / 0.5)  # a sample at a communication point shows at the next one
    for first, second in (("a", "b"), ("b", "a")):
        system = system_of(
            {first: Count, second: Count}, connect("a.count -> b.other", "b.count -> a.other")
        )
        found = CompiledModel(fuse(system)).run(time, {}).signals
        np.testing.assert_array_equal(found["a.count"], taken)
        np.testing.assert_array_equal(found[f"{first}.seen"], np.maximum(taken - 1, 0))
        np.testing.assert_array_equal(found[f"{second}.seen"], taken)


def test_members_keep_their_own_sample_periods():
    system = library.system("degradation_watch")
    parameters = {"galvanostat.protection_period": 0.3, "estimator.sample_period": 0.2}
    time = 0.1 * np.arange(200)
    inputs = {"current_command": 1.3 * np.sin(3.0 * time)}
    found = CompiledModel(fuse(system)).run(time, inputs, parameters).signals
    changes = {
        n: np.flatnonzero(np.diff(found[n]))
        for n in ("galvanostat.sampled_voltage", "estimator.b0")
    }
    assert set(changes["galvanostat.sampled_voltage"] % 3) == {0}
    assert set(changes["estimator.b0"] % 2) == {0}
    assert min(map(len, changes.values())) > 20


def test_what_cannot_be_fused_is_told():
    system = system_of(
        {"q": Leak, "p": Leak},
        connect("q.through -> p.u", "p.through -> q.u"),
        {n: {"bias": 0.0} for n in ("q", "p")},
    )
    with pytest.raises(
        UserError, match=r"^system small: an algebraic loop cannot be fused: .*q\.u.*p\.u[^\n]*$"
    ):
        fuse(system)
    foreign = replace(system, members=(replace(system.members[0], cls=None), system.members[1]))
    with pytest.raises(UserError, match=r"^system small: q \(leak\.fmu\) cannot be fused, [^\n]*$"):
        fuse(foreign)


def test_a_fused_single_component_is_the_component():
    time = 0.1 * np.arange(50)
    inputs = {"current": square_wave(time, 0.9, 0.5), "force": 1.0 + np.sin(time)}
    cls = component("ppy_actuator")
    system = system_of({"m": cls}, (), {}, {n: (Port("m", n),) for n in inputs})
    alone, fused = (
        CompiledModel(trace(cls)).run(time, inputs),
        CompiledModel(fuse(system)).run(time, inputs),
    )
    for name, values in alone.signals.items():
        np.testing.assert_array_equal(fused.signals[f"m.{name}"], values)
    assert fuse(system).layout.start_of == {
        f"m.{k}": f"m.{v}" for k, v in cls.layout.start_of.items()
    }
