"""Claims: an FMU without equations is linearised as closed forms have it, and says by which way.

Oracles: ``tau dx/dt = u - x`` of an FMU in C that hides its state; thesis eq. 3.9 for an actuator
that tells no origin.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import ppy_rig as ppy
from fmus import component
from fmus.kit import UserError
from fmus.kit.build import build_cached
from orchestration.fmu import find_model
from orchestration.linear.fmu_derivatives import _SIZES, FmuRequest, _blocks, _slope
from tests.support import fmi3_fmus
from tests.support.archive import anonymous, edited
from tests.support.hosts import build_one_state_fmu

DAHLQUIST = Path(__file__).parents[3] / "examples/ci/models/Dahlquist.fmu"
R1, R2, C, ALPHA, K1, B1, K2, B2 = 0.43, 2.35, 2.70, 6.8e-5, 6300.0, 1.7e6, 1.0e4, 2.0e6


def foreign(name, path, *changes):
    """An FMU as anybody's, for it tells no origin, with another description."""

    def edit(file, content):
        for old, new in changes if file == "modelDescription.xml" else ():
            assert old in content
            content = content.replace(old, new)
        return anonymous(file, content)

    edited(build_cached(component(name), "native"), path, edit)
    model = find_model(str(path))
    assert model.cls is None
    return model


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("foreign")


def linearised(model, inputs, outputs, time=0.0, step=None, **settings):
    return ppy.linearise(
        model, settings=settings, at=time, inputs=inputs, outputs=outputs, step=step
    )


WAYS = {
    "directional derivatives of the FMU": (),
    "central differences of the FMU's laws": (
        (b'providesDirectionalDerivative="true"', b'providesDirectionalDerivative="false"'),
    ),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("time", [0.0, 3.0])
def test_an_actuator_from_outside_is_equation_3_9(folder, way, time):
    model = foreign("ppy_actuator", folder / f"{len(way)}_{time:g}.fmu", *WAYS[way])
    found = linearised(
        model, ["current", "force"], ["voltage", "displacement"], time=time, current=0.5
    )
    assert found.method.startswith(way)
    assert ("±" in found.method) == ("central" in way)
    s = 2j * np.pi * np.logspace(-3, 2, 11)
    frequencies = s.imag / (2.0 * np.pi)
    charge = R2 * C / (1.0 + (R1 + R2) * C * s)
    impedance = R1 * (R2 - charge / C) / (R1 + R2) + charge / C
    creep = 1.0 / K1 + 1.0 / (B1 * s) + 1.0 / (K2 + B2 * s)
    for into, out, exact in (
        ("current", "voltage", impedance),
        ("current", "displacement", ALPHA * charge),
        ("force", "displacement", creep),
    ):
        np.testing.assert_allclose(found.response(frequencies, into, out), exact, rtol=1e-6)
    reached = 0.5 * R2 * C * (1.0 - np.exp(-time / ((R1 + R2) * C)))
    assert found.point.states["charge"] == pytest.approx(reached, rel=1e-6, abs=1e-12)
    assert found.units["displacement"] == "m"


def test_an_fmu_that_hides_its_state_is_realised_from_pulses(folder):
    model = find_model(str(build_one_state_fmu(folder)))
    found = linearised(model, ["u"], ["x"], step=0.1, tau=0.5)
    decay = np.exp(-0.2)
    assert (len(found.states), found.period) == (1, 0.1)
    assert found.method.startswith("central differences of responses to pulses (")
    assert found.poles().tolist() == pytest.approx([decay], rel=1e-6)
    f = np.array([0.1, 1.0, 3.0])
    z = np.exp(2j * np.pi * f * 0.1)
    np.testing.assert_allclose(found.response(f), (1.0 - decay) / (z - decay), rtol=1e-6)


def test_one_in_which_something_is_sampled_is_realised_at_its_period(folder):
    model = foreign("voice_coil_dma", folder / "dma.fmu")
    found = linearised(
        model,
        ["force_reference", "tension"],
        ["coil_voltage", "force_measured"],
        step=1.0 / 30.0,
        time=1.0,
        force_reference=0.5,
        tension=0.5,
        voltage_command_start=2.0,
    )
    assert found.method.startswith("central differences of responses to pulses (")
    z = np.exp(2j * np.pi * np.array([0.5, 3.0]) / 30.0)
    law = (0.66 - 0.06 / z) / (z - 1.0)  # eq. 2.2, seen at the next communication point
    seen = 1.0 - np.exp(-2.0 * np.pi * 100.0 / 30.0)
    lag = seen / (z - 1.0 + seen)
    frequencies = np.array([0.5, 3.0])
    np.testing.assert_allclose(found.response(frequencies), law, rtol=1e-5)
    np.testing.assert_allclose(
        found.response(frequencies, "tension", "coil_voltage"), -law * lag, rtol=1e-5
    )
    signals = (["force_reference"], ["coil_voltage"])
    with pytest.raises(UserError, match="take a multiple of its sample period"):
        linearised(model, *signals, step=0.01, voltage_command_start=2.0)


def test_one_that_nothing_drives_has_no_linear_model():
    for path, said in (
        (fmi3_fmus.foreign("sawtooth"), r"sawtooth\.fmu: has no real input whose pulses show"),
        (DAHLQUIST, r"Dahlquist\.fmu: has no real input; a linear model goes from inputs to"),
    ):
        with pytest.raises(UserError, match=said):
            linearised(find_model(str(path)), [], ["x"])


def test_signals_that_it_has_not_are_refused(folder):
    model = find_model(str(build_one_state_fmu(folder)))
    with pytest.raises(UserError, match=r"no input or state of this name .there are: u"):
        linearised(model, ["v"], ["x"])
    with pytest.raises(UserError, match=r"no signal of this name .there are: "):
        linearised(model, ["u"], ["y"])


@pytest.mark.parametrize(("time", "moves"), [(0.0, True), (3.0, True), (400.0, False)])
def test_an_fmu_that_moves_at_its_operating_point_is_said_to(folder, time, moves):
    """The charge of an actuator at constant current: a lag of (R1 + R2) C = 7.5 s."""
    model = foreign("ppy_actuator", folder / f"moving_{time:g}.fmu")
    found = linearised(model, ["current"], ["voltage"], time=time, current=0.5)
    lag = (R1 + R2) * C
    rate = 0.5 * R2 / (R1 + R2) * np.exp(-time / lag)
    told = " ".join(found.notes)
    assert ("charge changes by" in told) == moves
    if moves:
        assert f"charge changes by {rate:.3g} C per second" in told.replace("A*s", "C")
    charge = 0.5 * R2 * C * (1.0 - np.exp(-time / lag))
    voltage = R1 * (0.5 * R2 - charge / C) / (R1 + R2) + charge / C
    assert found.point.outputs["voltage"] == pytest.approx(voltage, rel=1e-5)


def test_operating_points_stand_beside_each_other_with_all_values(folder):
    model = foreign("ppy_actuator", folder / "two.fmu")
    near, far = (
        linearised(model, ["current"], ["voltage"], time=time, current=0.5) for time in (1.0, 2.0)
    )
    text = str(replace(near, further=(far,)))
    (row,) = (line for line in text.splitlines() if line.startswith("voltage "))
    values = [f"{one.point.outputs['voltage']:.6g}" for one in (near, far)]
    assert row.split() == ["voltage", "output", *values, "V"]


# law, its slope at zero, and the largest share of the slope by which it may be wrong
LAWS = {
    "straight": (lambda x: 3.0 * x, 3.0, 1e-12),
    "curved": (lambda x: np.sin(1.0 + x), np.cos(1.0), 1e-9),
    "steep": (lambda x: np.tanh(x / 1e-4), 1e4, 1e-6),
    "in single precision": (lambda x: np.float32(np.exp(np.float32(x))), 1.0, 1e-3),
    "saturated": (lambda x: np.clip(x, -1e-4, 1e-4), 1.0, 1e-9),
    "dead": (lambda x: x - np.clip(x, -1e-4, 1e-4), 0.0, 1e-12),
}


@pytest.mark.parametrize("law", LAWS)
def test_the_size_of_a_difference_is_found_and_its_error_told(law):
    f, exact, within = LAWS[law]
    found = _slope(lambda x: np.array([[float(f(x))]]), _SIZES)
    scale = abs(exact) or 1.0
    error = abs(float(found.slope[0, 0]) - exact) / scale
    assert error <= within
    assert found.error <= 100.0 * within, "nor is the error told far too large"


def test_a_size_at_which_the_fmu_refuses_is_not_taken():
    def root(x):
        if x < -1e-5:
            raise UserError("no root of a negative number")
        return np.array([[np.sqrt(1e-5 + x)]])

    found = _slope(root, _SIZES)
    assert found.slope[0, 0] == pytest.approx(0.5 / np.sqrt(1e-5), rel=1e-6)


def test_a_hidden_lag_says_that_it_is_not_at_rest_and_shows_its_outputs(folder):
    model = find_model(str(build_one_state_fmu(folder)))
    moving = linearised(model, ["u"], ["x"], time=1.0, step=0.1, u=2.0, tau=0.5)
    level = 2.0 * (1.0 - np.exp(-2.0))
    assert moving.point.outputs["x"] == pytest.approx(level, rel=1e-9)
    rate = (2.0 - level) * (1.0 - np.exp(-0.2)) / 0.1  # over the first step
    assert moving.notes == (f"not at rest here: x changes by {rate:.3g} per second",)
    assert linearised(model, ["u"], ["x"], step=0.1).notes == ()


def test_a_state_that_is_an_output_is_itself_whatever_derivative_the_fmu_knows():
    """Dahlquist's x' = -k x; the Reference FMUs know no derivative of an output by itself."""
    model = find_model(str(DAHLQUIST))
    found = ppy.linearise(model, settings={"k": 2.0}, inputs="x", outputs="der(x)")
    assert found.matrices.D.tolist() == [[pytest.approx(-2.0, rel=1e-9)]]
    assert "x ±0.01" in found.method
    request = FmuRequest(model, {}, np.zeros(1), {}, [], ["x"], 0.1)
    blocks = _blocks(request, ["x"], np.array([[-2.0], [0.0]]))
    assert blocks.signals["x"].tolist() == [1.0]
