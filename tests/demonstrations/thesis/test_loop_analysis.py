"""Claims: margins, Bode data and coefficients of the loop are those of eq. 2.1; errata 3 and 4."""

import control
import numpy as np
import pytest

from demonstrations.thesis import loop_analysis as analysis
from fmus.voice_coil_dma.model import VoiceCoilDma
from tests.support.voice_coil import CORNER, S, T, equation_2_1


def test_plant_is_eq_2_1():
    assert analysis.plant()(S) == pytest.approx(equation_2_1(S), rel=1e-9)


def test_errata_3_eq_2_2_is_tustin_of_another_controller_than_the_printed_one():
    for gain, zero, published in ((18.0, 0.02, (0.66, -0.06)), (15.0, 0.002, (0.28, 0.22))):
        discrete = control.sample_system(analysis.controller(gain, zero), T, method="tustin")
        assert discrete.num[0][0] == pytest.approx(published, abs=1e-9)
        assert discrete.den[0][0] == pytest.approx([1.0, -1.0])
        assert analysis.discrete_coefficients(gain, zero) == pytest.approx(published, abs=1e-12)
        assert analysis.continuous_coefficients(*published) == pytest.approx((gain, zero), rel=1e-9)
    declared = {p.name: p.start for p in VoiceCoilDma.layout.parameters}
    assert (declared["error_gain"], declared["previous_error_gain"]) == (0.66, -0.06)


@pytest.mark.parametrize(
    ("about", "phase", "crossover"),
    [
        ({"period": None, "cutoff": None, "back_emf": False}, 117.4, 4.21),
        ({"period": None, "cutoff": None}, 115.5, 4.20),
        ({"gain": 15.0, "zero_time": 0.002, "back_emf": False}, 72.8, 2.96),
        (
            {"gain": 24.55, "period": None, "cutoff": 100.0 / (2 * np.pi), "back_emf": False},
            105.6,
            5.94,
        ),
    ],
)
def test_errata_4_margins(about, phase, crossover):
    found = analysis.margins(analysis.loop(**about))
    assert found.phase == pytest.approx(phase, abs=0.05)
    assert found.crossover == pytest.approx(crossover, abs=0.005)
    assert abs(found.phase - 107.0) > 1.0  # what is printed
    assert abs(found.crossover - 6.2) > 0.2


def test_bode_data():
    frequencies = np.logspace(-1, 2, 50)
    s = 2j * np.pi * frequencies
    exact = 18 * (0.02 * s + 1) / s * equation_2_1(s) * 60 / (s + 60) / (s / CORNER + 1)
    magnitude, phase = analysis.bode(analysis.loop(), frequencies)
    assert 10 ** (magnitude / 20) == pytest.approx(np.abs(exact), rel=1e-8)
    assert np.exp(1j * np.radians(phase)) == pytest.approx(exact / np.abs(exact), rel=1e-8)
    assert (np.abs(np.diff(phase)) < 90).all()


def test_step_of_the_loop_by_linear_analysis():
    """Fig. 2-6: the time constant is below a tenth of a second."""
    time = np.linspace(0, 1, 1001)
    response = analysis.closed_loop_step(time)
    assert 0.01 < analysis.rise_time(time, response) < 0.1
    assert response[-1] == pytest.approx(1.0, abs=1e-3)
    assert np.isnan(analysis.rise_time(time, 0.1 * response))
    assert analysis.rise_time(time, 1 - np.exp(-time / 0.3)) == pytest.approx(0.3, abs=1e-3)
