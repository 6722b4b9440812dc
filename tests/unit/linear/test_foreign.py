"""Claims: a loop with a foreign FMU in it has the margins of its closed form and of a sine sweep.

Oracles: a lag and a PI law on paper, python-control, thesis eq. 3.9, sweeps of the co-simulation.
"""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
import pytest

import ppy_rig as ppy
from fmus import component
from fmus.kit import Component, Input, Output, Parameter, UserError
from fmus.kit.build import build_cached
from orchestration.system import Connection, Member, Port, System, connect
from tests.support.archive import anonymous, edited
from tests.support.hosts import build_one_state_fmu
from tests.support.sine_sweep import SineSweep, sine_sweep

R1, R2, C, ALPHA = 0.43, 2.35, 2.70, 6.8e-5
PERIOD, GAIN, INTEGRAL, TAU = 0.1, 2.0, 0.4, 0.5
PI = {
    "sample_period": PERIOD,
    "proportional_gain": GAIN,
    "integral_time": INTEGRAL,
    "derivative_time": 0.0,
    "command_min": -1e3,
    "command_max": 1e3,
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("foreign")


@pytest.fixture(scope="module")
def lag(folder):
    return build_one_state_fmu(folder)


def around(plant, command, measured, **gains):
    """The loop of a PI controller around a member ``plant``."""
    controller = Member.of("pi", component("pid"), {**PI, **gains})
    return System(
        "loop",
        (controller, plant),
        connect(f"pi.command -> plant.{command}", f"plant.{measured} -> pi.measured"),
        {"reference": (Port("pi", "reference"),)},
        {"level": Port("plant", measured)},
        step=PERIOD,
    )


def pi_law(z, gain=GAIN):
    """Backward differences: K ((1 + h / T_i) - 1 / z) / (1 - 1 / z)."""
    return gain * ((1.0 + PERIOD / INTEGRAL) - 1.0 / z) / (1.0 - 1.0 / z)


@pytest.mark.parametrize("cut", ["plant.u", "pi.measured", "plant.x"])
@pytest.mark.parametrize("at", [0.0, 2.0])
def test_margins_of_a_loop_around_an_fmu_that_hides_its_state(lag, cut, at):
    system = around(Member("plant", lag, {"tau": TAU}), "u", "x")
    found = ppy.linearise(system, {"reference": 1.0}, at=at, cut=cut)
    z = control.TransferFunction([1, 0], [1], PERIOD)
    decay = np.exp(-PERIOD / TAU)
    exact = pi_law(z) / z * (1.0 - decay) / (z - decay)  # a sample is seen a step later
    gain, phase, _, crossover = control.margin(exact)
    margins = found.margins()
    assert (margins.gain, margins.phase) == pytest.approx((gain, phase), rel=1e-6)
    assert margins.crossover == pytest.approx(crossover / (2.0 * np.pi), rel=1e-6)
    assert found.method.startswith("Jacobians of the laws, central differences of responses to")


def test_the_operating_point_is_the_one_that_the_system_reaches(lag):
    """With the values of every member, and of the input behind the cut."""
    system = around(Member("plant", lag, {"tau": TAU}), "u", "x")
    at = 5 * PERIOD
    found = ppy.linearise(system, {"reference": 1.0}, at=at, cut="plant.u")
    level, command, error = 0.0, 0.0, 0.0
    for _ in range(5):  # the PI law, a step later the lag
        measured = level
        level = command + (level - command) * np.exp(-PERIOD / TAU)
        command += GAIN * ((1.0 + PERIOD / INTEGRAL) * (1.0 - measured) - error)
        error = 1.0 - measured
    values = found.point.values
    assert values["plant.x"] == pytest.approx(level, rel=1e-9)
    assert values["pi.command"] == pytest.approx(command, rel=1e-9)
    assert values["cut(plant.u)"] == pytest.approx(command, rel=1e-9)
    assert "not at rest here: plant.x changes by" in " ".join(found.notes)


@pytest.mark.parametrize("step", [PERIOD, PERIOD / 4.0])
def test_a_sine_sweep_of_the_loop_agrees(lag, step):
    """Within 0.2 dB and 2 degrees, in co-simulation."""
    system = around(Member("plant", lag, {"tau": TAU}), "u", "x")
    loop = ppy.linearise(system, cut="plant.u", step=step)
    opened = system.disconnected("plant.u", 0.0)
    frequencies = np.array([0.3, 1.0])
    sweep = SineSweep(frequencies, 0.01, PERIOD, step)
    swept = sine_sweep(opened, "plant.u", ["pi.command"], sweep, {"plant.u": 0.0}, method="jacobi")
    closed = ppy.linearise(system, inputs="reference", outputs="level", step=step)
    measured = sine_sweep(system, "reference", ["plant.x"], sweep, method="jacobi")
    for found, model in (
        (-swept["pi.command"], loop.response(frequencies)),
        (measured["plant.x"], closed.response(frequencies)),
    ):
        ratio = found / model
        assert np.abs(20.0 * np.log10(np.abs(ratio))).max() < 0.2
        assert np.abs(np.degrees(np.angle(ratio))).max() < 2.0


class Proportional(Component):
    """A current that is proportional to what a displacement lacks."""

    name = "proportional"
    gain = Parameter(500.0, "A/m", min=0.0, max=1e6, doc="gain")
    reference = Input("m", doc="wanted")
    measured = Input("m", doc="measured")

    @Output("A")
    def command(self):
        """Current."""
        return self.gain * (self.reference - self.measured)


def film(folder, directional):
    """The actuator as anybody's FMU, which tells no origin."""
    told = b'providesDirectionalDerivative="true"'

    def edit(file, content):
        if file == "modelDescription.xml" and not directional:
            content = content.replace(told, told.replace(b"true", b"false"))
        return anonymous(file, content)

    path = folder / f"film_{directional}.fmu"
    edited(build_cached(component("ppy_actuator"), "native"), path, edit)
    return path


@pytest.mark.parametrize("directional", [True, False])
def test_a_loop_around_an_fmu_that_shows_its_states_is_continuous(folder, directional):
    """Equation 3.9 behind a gain; factor and offset of a connection count."""
    system = System(
        "loop",
        (Member.of("law", Proportional), Member("plant", film(folder, directional))),
        (
            *connect("law.command -> plant.current"),
            Connection(Port("plant", "displacement"), Port("law", "measured"), 2.0, 1e-4),
        ),
        {"reference": (Port("law", "reference"),)},
        step=0.01,
    )
    found = ppy.linearise(system, cut="law.measured")
    s = 2j * np.pi * np.array([0.01, 0.1, 1.0])
    slope = ALPHA * R2 * C / (1.0 + (R1 + R2) * C * s)
    np.testing.assert_allclose(found.response(s.imag / (2.0 * np.pi)), 1e3 * slope, rtol=1e-6)
    assert found.period == 0.0
    assert ("directional derivatives" in found.method) == directional
    assert found.units["plant.charge"] in ("C", "A*s")
    assert found.point.values["law.command"] == pytest.approx(-500.0 * 1e-4, rel=1e-9)
    assert found.point.values["cut(law.measured)"] == pytest.approx(1e-4, rel=1e-9)
    closed = ppy.linearise(system, inputs="reference", outputs="plant.displacement")
    exact = 500.0 * slope / (1.0 + 1e3 * slope)
    np.testing.assert_allclose(closed.response(s.imag / (2.0 * np.pi)), exact, rtol=1e-6)


def test_a_step_that_is_no_part_of_the_sample_period_is_said_to_cut_another_loop(lag):
    system = around(Member("plant", lag), "u", "x")
    found = ppy.linearise(system, cut="plant.u", step=0.075)
    assert found.period == pytest.approx(0.3)
    note, *_ = found.notes
    assert note.startswith("plant.u also acts between samples, but behind the cut it is constant")


def test_parameters_of_a_loop_make_a_family(lag):
    """The lag's time constant, with another gain of the controller; each has its margins."""
    system = around(Member("plant", lag), "u", "x")
    gain = {"pi.proportional_gain": 1.5}
    found = ppy.linearise(system, cut="plant.u", settings=gain, over={"plant.tau": [0.5, 2.0]})
    f = np.array([0.5])
    z = np.exp(2j * np.pi * f * PERIOD)
    for tau, one in zip((0.5, 2.0), found.variations, strict=True):
        decay = np.exp(-PERIOD / tau)
        exact = pi_law(z, 1.5) / z * (1.0 - decay) / (z - decay)
        np.testing.assert_allclose(one.response(f), exact, rtol=1e-6)
        assert one.case == {"plant.tau": tau}
        assert f"also plant.tau = {tau:g} s: phase margin {one.margins().phase:.1f}" in str(found)


def test_a_loop_that_cannot_be_linearised_is_refused_in_a_line(lag):
    system = around(Member("plant", lag), "u", "x")
    with pytest.raises(UserError, match=r"cut='plant\.y': no state and no connection of this name"):
        ppy.linearise(system, cut="plant.y")
    with pytest.raises(UserError, match="of plant are not known; trim=True needs the"):
        ppy.linearise(system, trim=True)
    with pytest.raises(UserError, match="at='-1': a time from 0 s on"):
        ppy.linearise(system, at=-1.0)


def test_inputs_that_vary_lead_an_fmu_to_its_operating_point(lag):
    """A lag after a pulse, in closed form."""
    time = np.arange(0.0, 2.0, 0.5)
    level = np.array([1.0, 1.0, 0.0, 0.0])
    found = ppy.linearise(str(lag), {"u": level}, time=time, at=1.5, step=0.1)
    exact = (1.0 - np.exp(-1.0)) * np.exp(-0.5)
    assert found.point.outputs["x"] == pytest.approx(exact, rel=1e-9)


def test_different_inputs_are_a_family_of_operating_points(lag):
    family = ppy.linearise(str(lag), at=1.0, step=0.1, over={"u": [1.0, 3.0]})
    reached = [one.point.outputs["x"] for one in family.variations]
    assert reached == pytest.approx([u * (1.0 - np.exp(-1.0)) for u in (1.0, 3.0)], rel=1e-9)


@pytest.fixture(scope="module")
def unknown_loop(folder):
    """A designed controller around the actuator, and their loop as FMUs that tell no origin."""
    found = ppy.design(
        "ppy_actuator", command="current", measured="displacement", sample_period="20ms"
    )
    unknown = []
    for member in found.system.members:
        path = folder / f"{member.name}.fmu"
        edited(member.fmu, path, anonymous)
        unknown.append(Member(member.name, path, member.parameters))
    return found, replace(found.system, members=tuple(unknown))


@pytest.mark.slow
def test_a_sampled_controller_whose_laws_are_not_known_acts_at_its_samples(unknown_loop):
    """The margins are those of the design, which knows both laws."""
    found, system = unknown_loop
    cut = ppy.linearise(system, cut="controller.measured")
    assert "Jacobians" not in cut.method
    np.testing.assert_allclose(cut.margins(), found.margins(), rtol=1e-5)


@pytest.mark.slow
def test_a_sine_sweep_of_a_sampled_loop_agrees_with_the_usual_master(unknown_loop):
    """Within 0.2 dB and 2 degrees; members step one after another, the controller first."""
    _, system = unknown_loop
    loop = ppy.linearise(system, cut="controller.measured")
    crossover = loop.margins().crossover
    frequencies = crossover * np.array([0.5, 1.0, 2.0])
    sweep = SineSweep(frequencies, 1e-7, loop.period, system.step)
    opened = system.disconnected("controller.measured", 0.0)
    wire = "controller.measured"
    swept = sine_sweep(opened, wire, ["plant.displacement"], sweep, {wire: 0.0})
    ratio = -swept["plant.displacement"] / loop.response(frequencies)
    assert np.abs(20.0 * np.log10(np.abs(ratio))).max() < 0.2
    assert np.abs(np.degrees(np.angle(ratio))).max() < 2.0
