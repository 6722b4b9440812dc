"""Claims: an FMU without equations is linearised as closed forms have it, and says by which way.

Oracles: ``tau dx/dt = u - x`` of an FMU in C that hides its state; thesis eq. 3.9 for an actuator
that tells no origin.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus import component
from fmus.kit import UserError
from fmus.kit.build import build_cached
from orchestration.fmu import find_model
from orchestration.linear.fmu_derivatives import FmuRequest, linearise_fmu
from tests.support import fmi3_fmus
from tests.support.archive import anonymous, edited
from tests.support.hosts import build_one_state_fmu

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


def request(model, inputs, outputs, step=0.1, time=0.0, **settings):
    return FmuRequest(model, time, settings, inputs, outputs, step)


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
    found = linearise_fmu(
        request(model, ["current", "force"], ["voltage", "displacement"], time=time, current=0.5)
    )
    assert found.method == way
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
    found = linearise_fmu(request(model, ["u"], ["x"], tau=0.5))
    decay = np.exp(-0.2)
    assert (len(found.states), found.period) == (1, 0.1)
    assert found.method == "central differences of responses to pulses"
    assert found.poles().tolist() == pytest.approx([decay], rel=1e-6)
    f = np.array([0.1, 1.0, 3.0])
    z = np.exp(2j * np.pi * f * 0.1)
    np.testing.assert_allclose(found.response(f), (1.0 - decay) / (z - decay), rtol=1e-6)


def test_one_in_which_something_is_sampled_is_realised_at_its_period(folder):
    model = foreign("voice_coil_dma", folder / "dma.fmu")
    found = linearise_fmu(
        request(
            model,
            ["force_reference", "tension"],
            ["coil_voltage", "force_measured"],
            step=1.0 / 30.0,
            time=1.0,
            force_reference=0.5,
            tension=0.5,
            voltage_command_start=2.0,
        )
    )
    assert found.method == "central differences of responses to pulses"
    z = np.exp(2j * np.pi * np.array([0.5, 3.0]) / 30.0)
    law = (0.66 - 0.06 / z) / (z - 1.0)  # eq. 2.2, seen at the next communication point
    seen = 1.0 - np.exp(-2.0 * np.pi * 100.0 / 30.0)
    lag = seen / (z - 1.0 + seen)
    frequencies = np.array([0.5, 3.0])
    np.testing.assert_allclose(found.response(frequencies), law, rtol=1e-5)
    np.testing.assert_allclose(
        found.response(frequencies, "tension", "coil_voltage"), -law * lag, rtol=1e-5
    )
    between = request(model, ["force_reference"], ["coil_voltage"], 0.01, voltage_command_start=2.0)
    with pytest.raises(UserError, match="take a multiple of its sample period"):
        linearise_fmu(between)


def test_one_that_nothing_drives_has_no_linear_model():
    model = find_model(str(fmi3_fmus.foreign("sawtooth")))
    with pytest.raises(UserError, match=r"sawtooth\.fmu: has no real input; a linear model goes"):
        linearise_fmu(request(model, [], ["x"]))


def test_signals_that_it_has_not_are_refused(folder):
    model = find_model(str(build_one_state_fmu(folder)))
    with pytest.raises(UserError, match=r"no real input of this name; there are u"):
        linearise_fmu(request(model, ["v"], ["x"]))
    with pytest.raises(UserError, match=r"no real output of this name; there are x"):
        linearise_fmu(request(model, ["u"], ["y"]))


@pytest.mark.parametrize(("time", "moves"), [(0.0, True), (3.0, True), (400.0, False)])
def test_an_fmu_that_moves_at_its_operating_point_is_said_to(folder, time, moves):
    """The charge of an actuator at constant current: a lag of (R1 + R2) C = 7.5 s."""
    model = foreign("ppy_actuator", folder / f"moving_{time:g}.fmu")
    found = linearise_fmu(request(model, ["current"], ["voltage"], time=time, current=0.5))
    lag = (R1 + R2) * C
    rate = 0.5 * R2 / (R1 + R2) * np.exp(-time / lag)
    told = " ".join(found.notes)
    assert ("charge changes by" in told) == moves
    if moves:
        assert f"charge changes by {rate:.3g} A*s per second" in told.replace(" C per", " A*s per")
    charge = 0.5 * R2 * C * (1.0 - np.exp(-time / lag))
    voltage = R1 * (0.5 * R2 - charge / C) / (R1 + R2) + charge / C
    assert found.point.outputs["voltage"] == pytest.approx(voltage, rel=1e-5)


def test_operating_points_stand_beside_each_other_with_all_values(folder):
    model = foreign("ppy_actuator", folder / "two.fmu")
    near, far = (
        linearise_fmu(request(model, ["current"], ["voltage"], time=time, current=0.5))
        for time in (1.0, 2.0)
    )
    text = str(replace(near, further=(far,)))
    (row,) = (line for line in text.splitlines() if line.startswith("voltage "))
    values = [f"{one.point.outputs['voltage']:.6g}" for one in (near, far)]
    assert row.split() == ["voltage", "output", *values, "V"]
