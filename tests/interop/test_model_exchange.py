"""Claims: solvers of other tools integrate our FMUs to what they compute by themselves, and to
closed forms.

fmpy brings CVode and Euler, CasADi an importer of its own and SUNDIALS. Inputs jump where fmpy is
told of an event: between events it holds them, whatever a table says.
"""

from __future__ import annotations

import zipfile

import casadi as ca
import fmpy
import numpy as np
import pytest
from fmpy import simulate_fmu
from scipy.linalg import expm

import fmus
from fmus import component
from fmus.kit import Component, Output, Parameter, State, maximum
from fmus.kit.build.building import build
from fmus.kit.build.toolchain import host_platform
from tests.support.exchange import both_ways, distance
from tests.support.pace import FREE_FEET
from tests.support.stimuli import STIMULI


class Ramp(Component):
    """A ramp, and the integral of what of it is beyond an edge."""

    name = "ramp"

    edge = Parameter(1.0, "1", min=0, max=9, doc="where the integral begins")
    size = State("1", rate="unity", output=True, doc="rises by one a second")
    beyond = State("1", rate="excess", output=True, doc="integral of what is beyond the edge")

    def unity(self):
        return 1.0 + 0.0 * self.size

    def excess(self):
        return maximum(1e3 * (self.size - self.edge), 0.0)

    @Output("1")
    def twice(self):
        """Twice the ramp"""
        return 2.0 * self.size


def test_every_component_is_tried():
    assert set(STIMULI) == set(fmus.COMPONENTS)


@pytest.mark.parametrize("name", STIMULI)
def test_no_communication_point_meets_a_sample(name):
    """There tools differ in what is read, and where inputs jump in what is sampled: PyFMI takes the
    value before.
    """
    stop, step, _ = STIMULI[name]
    time = np.arange(step, stop, step)
    layout = component(name).layout
    values = {p.name: p.start for p in layout.parameters}
    for clock, _ in layout.sampled:
        first = sum(values[shift] for shift in clock.shift)
        samples = (time - first) / values.get(clock.period, clock.period)
        assert np.abs(samples - np.round(samples)).min() > 1e-4


# of what is fed: shares of mean and amplitude; twenty amplitudes away inputs are beyond every limit
COURSES = {"moving": (1.0, 1.0, 0.0), "nothing": (0.0, 0.0, 0.0), "saturated": (1.0, 0.0, 20.0)}
# the error in tolerances that is allowed; where a leg hits the ground it is of the instant, too
ALLOWED = dict.fromkeys(STIMULI, 1e3) | dict.fromkeys(FREE_FEET, 1e4)


@pytest.fixture
def indicated(monkeypatch):
    """Collects the event indicators that solvers of fmpy see."""
    seen = []
    original = fmpy.fmi2.FMU2Model.getEventIndicators

    def watched(self, z, nz):
        original(self, z, nz)
        seen.append(np.ctypeslib.as_array(z, (nz,)).copy() if nz else np.array([]))

    monkeypatch.setattr(fmpy.fmi2.FMU2Model, "getEventIndicators", watched)
    return seen


@pytest.mark.filterwarnings("ignore:.*missing input")
@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-9])
@pytest.mark.parametrize("course", COURSES)
@pytest.mark.parametrize("name", STIMULI)
def test_cvode_computes_what_co_simulation_does(fmu, indicated, name, course, tolerance):
    """Indicators are never zero, and where inputs move of order one."""
    stop, step, stimuli = STIMULI[name]
    means, amplitudes, away = COURSES[course]
    fed = {
        signal: (means * mean + away * size, amplitudes * size, speed)
        for signal, (mean, size, speed) in stimuli.items()
    }
    moved = 0
    for output, (found, expected) in both_ways(
        *(fmu(name, "native"), fmu(name, "native")),
        *(stop, step, fed),
        solver="CVode",
        relative_tolerance=tolerance,
    ).items():
        assert distance(found, expected) <= ALLOWED[name] * tolerance, output
        moved += np.ptp(expected) > 0.0
    assert moved or course != "moving", "nothing moved"
    sizes = np.abs(indicated)
    if sizes.size:
        assert sizes.min() > 0.0
        assert course != "moving" or 0.1 < sizes.max(axis=0).min() <= sizes.max() < 10.0


@pytest.mark.filterwarnings("ignore:.*missing input")
@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-9])
@pytest.mark.parametrize(
    ("start", "fed"),
    [
        ({}, {"current_command": 1.3}),
        ({}, {"current_command": -1.3}),
        ({"potentiostat": True}, {"voltage_command": 5.0}),
    ],
    ids=["upper limit", "lower limit", "saturated potentiostat"],
)
def test_an_instrument_rests_at_its_limit(fmu, indicated, start, fed, tolerance):
    """No indicator stands at zero there, and the limit is no end of events: 50 samples have each
    its own, and a stimulus jumps 30 times.
    """
    constant = {name: (value, 0.0, 1.0) for name, value in fed.items()}
    found, expected = both_ways(
        fmu("galvanostat", "native"),
        fmu("galvanostat", "native"),
        0.5,
        0.0017,
        constant,
        solver="CVode",
        relative_tolerance=tolerance,
        start_values=start,
    )["current"]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
    assert abs(found[-1]) == 1.3
    assert np.abs(indicated).min() >= 1e-10
    assert len(indicated) < 1000


def test_euler_comes_near_and_nearer_with_half_the_step(fmu):
    stop, step, stimuli = STIMULI["ppy_actuator"]
    errors = [
        distance(
            *both_ways(
                fmu("ppy_actuator", "native"),
                fmu("ppy_actuator", "native"),
                stop,
                step,
                stimuli,
                n,
                solver="Euler",
                step_size=step / n,
            )["charge"]
        )
        for n in (16, 32)
    ]
    assert errors[0] < 0.02
    assert 1.8 < errors[0] / errors[1] < 2.2  # of first order


def test_an_edge_is_met_where_it_is(tmp_path):
    """The integral of a ramp beyond an edge is a parabola; a solver that is told of the edge stops
    at it.
    """
    path = tmp_path / "ramp.fmu"
    path.write_bytes(build(Ramp, "native", [host_platform()]))
    found = simulate_fmu(
        str(path),
        stop_time=3.0,
        output_interval=0.4,
        start_values={"edge": 1.1},
        relative_tolerance=1e-6,
        fmi_type="ModelExchange",
        solver="CVode",
        output=["size", "beyond"],
        record_events=True,
    )
    assert np.abs(found["time"] - 1.1).min() < 1e-6
    beyond = 500.0 * np.maximum(found["time"] - 1.1, 0.0) ** 2
    np.testing.assert_allclose(found["beyond"], beyond, rtol=0, atol=1e-5 * beyond.max())


@pytest.fixture
def opened(fmu, tmp_path):
    """Opens one of our FMUs in CasADi, and returns it with its parameters."""

    def builder(name):
        with zipfile.ZipFile(fmu(name, "native")) as archive:
            archive.extractall(tmp_path / name)
        parameters = {p.name: p.start for p in component(name).layout.parameters}
        return ca.DaeBuilder(name, str(tmp_path / name)), parameters

    return builder


def test_casadi_integrates_it_to_the_closed_form(opened):
    """Eq. 3.9: the charge under a constant current rises to R2 C i with the time constant (R1 + R2)
    C.
    """
    dae, parameters = opened("ppy_actuator")
    assert dae.x() == ["charge", "kelvin_elongation", "maxwell_elongation"]
    ode = dae.create("ode", ["x", "u"], ["ode"])
    x, u = ca.MX.sym("x", 3), ca.MX.sym("u", 2)
    times = [1.0, 7.0, 30.0]
    options = {"reltol": 1e-10, "abstol": 1e-14}
    run = ca.integrator("run", "cvodes", {"x": x, "u": u, "ode": ode(x, u)}, 0.0, times, options)
    found = run(x0=[0.0, 0.0, 0.0], u=[0.25, 0.4])["xf"].full()
    R1, R2, C, k2, b1, b2 = (parameters[name] for name in ("R1", "R2", "C", "k2", "b1", "b2"))
    t = np.array(times)
    expected = [
        R2 * C * 0.25 * -np.expm1(-t / ((R1 + R2) * C)),
        0.4 / k2 * -np.expm1(-t * k2 / b2),
        0.4 / b1 * t,
    ]
    np.testing.assert_allclose(found, expected, rtol=1e-7)


def test_casadi_reads_its_directional_derivatives(opened):
    dae, parameters = opened("ppy_actuator")
    jacobian = dae.create("f", ["x", "u"], ["ode", "y"]).jacobian()
    by_x, by_u, *_ = jacobian([1.0, 2e-5, 1e-5], [0.1, 0.3], np.zeros(3), np.zeros(len(dae.y())))
    R1, R2, C, k2, b1, b2 = (parameters[name] for name in ("R1", "R2", "C", "k2", "b1", "b2"))
    rows = [[-1.0 / C / (R1 + R2), 0, 0], [0, -k2 / b2, 0], [0, 0, 0]]
    np.testing.assert_allclose(by_x.full(), rows, rtol=1e-12, atol=1e-300)
    np.testing.assert_allclose(
        by_u.full(), [[R2 / (R1 + R2), 0], [0, 1 / b2], [0, 1 / b1]], rtol=1e-12
    )


def test_a_host_solves_it_with_stiff_equations_of_its_own(opened):
    """A mass on the film, oscillations of 800 rad/s beside creep of minutes: linear, against the
    matrix exponential.
    """
    mass, damping, weight, start, times = 0.01, 2.0, 0.4, 5e-5, [0.01, 0.5, 40.0]
    dae, parameters = opened("ppy_actuator_length_driven")
    assert dae.u() == ["current", "length_change"]
    film = dae.create("film", ["x", "u"], ["ode", "y"])
    x, place, speed = ca.MX.sym("x", 3), ca.MX.sym("place"), ca.MX.sym("speed")
    rates, outputs = film(x, ca.vertcat(0.0, place))
    tension = outputs[dae.y().index("tension")]
    system = {
        "x": ca.vertcat(x, place, speed),
        "ode": ca.vertcat(rates, speed, (weight - damping * speed - tension) / mass),
    }
    run = ca.integrator(
        "run",
        "cvodes",
        system,
        0.0,
        times,
        {"reltol": 1e-9, "abstol": 1e-13, "max_num_steps": 100000},
    )
    found = run(x0=[0.0, 0.0, 0.0, start, 0.0])["xf"].full()
    k1, k2, b1, b2 = (parameters[name] for name in ("k1", "k2", "b1", "b2"))
    pull = np.array([-k1, -k1, k1, 0.0])  # of x_b2, x_b1, place and speed: eqs. 3.5 and 3.7
    matrix = np.array(
        [(pull - [k2, 0, 0, 0]) / b2, pull / b1, [0, 0, 0, 1], (-pull - [0, 0, 0, damping]) / mass]
    )
    augmented = np.zeros((5, 5))
    augmented[:4, :4], augmented[:4, 4] = matrix, [0.0, 0.0, 0.0, weight / mass]
    expected = np.array([expm(augmented * t) @ [0.0, 0.0, start, 0.0, 1.0] for t in times]).T[:4]
    np.testing.assert_allclose(found[1:4], expected[:3], rtol=1e-6)
    np.testing.assert_allclose(found[4], expected[3], rtol=1e-5, atol=1e-10)


def test_the_description_is_valid(fmu):
    path = fmu("foot_dynamic", "native")
    description = fmpy.read_model_description(str(path), validate=True)
    assert description.modelExchange is not None
    assert description.coSimulation is not None
    assert description.modelExchange.modelIdentifier == description.coSimulation.modelIdentifier
    assert description.numberOfEventIndicators == 7
