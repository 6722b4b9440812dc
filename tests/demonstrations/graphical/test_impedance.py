"""Batch impedance estimates against control theory, the printed M-file and known truth."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from demonstrations.emulator.emulator import EmulatedRig
from demonstrations.emulator.physics import RigParameters
from demonstrations.graphical.impedance import (
    least_squares_windows,
    magnitude,
    tustin,
    zero_order_hold,
)
from fmus.kit.errors import UserError
from orchestration.experiment.waveforms import square_wave

TRUE = (0.43, 2.35, 2.70)  # ohm, ohm, F
PERIOD = 0.1  # s
positive = st.floats(-1.0, 1.0).map(lambda power: 10.0**power)


def record(seconds, resistance=TRUE[0], noise=0.0, seed=0):
    time = PERIOD * np.arange(round(seconds / PERIOD))
    current = square_wave(time, 0.9, 0.2)
    rig = EmulatedRig(RigParameters(R1=resistance), seed=seed, voltage_noise=noise)
    return current, rig.run(time, current, np.zeros_like(time))["voltage"]


def joined(*resistances):
    """Join records of 100 s, each with another series resistance."""
    parts = [record(100.0, r) for r in resistances]
    return np.concatenate([i for i, _ in parts]), np.concatenate([v for _, v in parts])


@pytest.mark.parametrize(
    ("theta", "expected"),
    [
        ((0.3970, -0.3632, -0.9869), (0.449, 2.580, 2.503)),
        ((0.3648, -0.3321, -0.9839), (0.425, 2.031, 2.509)),
        ((0.3706, -0.3430, -0.9887), (0.421, 2.442, 3.073)),
    ],
)
def test_table_3_1_follows_from_its_coefficients(theta, expected):
    assert tustin(theta, PERIOD) == pytest.approx(expected, abs=2e-3)  # errata 10
    assert tustin([theta, theta], PERIOD)[1] == pytest.approx(expected, abs=2e-3)


@given(r1=positive, r2=positive, c=positive, period=st.floats(0.01, 0.2))
def test_conversions_invert_the_discretisations_of_control(r1, r2, c, period):
    circuit = control.tf([r1 * r2 * c, r2], [(r1 + r2) * c, 1.0])
    for method, convert in (("zoh", zero_order_hold), ("tustin", tustin)):
        discrete = control.sample_system(circuit, period, method)
        (b0, b1), (one, a) = discrete.num[0][0], discrete.den[0][0]
        assert convert([b0 / one, b1 / one, a / one], period) == pytest.approx(
            (r1, r2, c), rel=1e-6
        )
    assert magnitude((r1, r2, c), 0.7) == pytest.approx(abs(circuit(0.7j)), rel=1e-9)


def test_no_circuit_is_not_finite():
    assert not np.isfinite(zero_order_hold([0.0, 0.0, 0.0], PERIOD)).all()
    assert not np.isfinite(tustin([0.3, 0.3, -1.0], PERIOD)).all()


def test_windows_of_a_clean_record_give_the_circuit():
    found = least_squares_windows(*record(1000.1), PERIOD, conversion=zero_order_hold)
    assert found.end == pytest.approx(100.0 * np.arange(1, 11))
    assert found.circuit == pytest.approx(np.tile(TRUE, (10, 1)), rel=1e-6)
    printed = least_squares_windows(*record(1000.1), PERIOD)
    assert printed.circuit == pytest.approx(
        np.tile((0.412, 2.350, 2.718), (10, 1)), abs=6e-4
    )  # errata 8


def test_cumulative_windows_are_the_m_file():
    current, voltage = record(500.1, noise=3e-3, seed=4)
    # the loop of appendix A3, whose normal matrices are set to zero only once
    normal, right, expected = np.zeros((3, 3)), np.zeros(3), []
    for start in range(0, 5000, 1000):
        for j in range(1000):
            phi = np.array([-voltage[start + j], current[start + j + 1], current[start + j]])
            normal += np.outer(phi, phi)
            right += voltage[start + j + 1] * phi
        a, b0, b1 = np.linalg.inv(normal) @ right
        r1 = -(b0 + b1) * (b0 - b1) / (2 * (a * b0 - b1))
        expected.append((r1, (b0 + b1) / (1 + a), -(a * b0 - b1) * PERIOD / (b0 + b1) ** 2))
    found = least_squares_windows(current, voltage, PERIOD, cumulative=True)
    assert found.circuit == pytest.approx(np.array(expected), rel=1e-6)
    r1, r2, c = np.array(expected).T
    z = np.sqrt((r1 * r2 * c * 0.628) ** 2 + r2**2) / np.sqrt(((r1 + r2) * c * 0.628) ** 2 + 1)
    assert found.impedance == pytest.approx(z, rel=1e-6)


def test_cumulative_windows_lag_behind_a_change_that_single_windows_show():
    """Reproduce row 7 of the errata.

    After nine windows at 0.43 ohm, one at 0.86 ohm is a tenth of what the printed loop knows.
    """
    current, voltage = joined(*[0.43] * 9, 0.86, 0.86)
    alone = least_squares_windows(current, voltage, PERIOD, conversion=zero_order_hold)
    printed = least_squares_windows(
        current, voltage, PERIOD, cumulative=True, conversion=zero_order_hold
    )
    # the tenth window starts with the one sample at the joint, which belongs to neither circuit
    assert alone.circuit[9, 0] == pytest.approx(0.86, rel=0.02)
    assert printed.circuit[8] == pytest.approx(TRUE, rel=0.02)
    assert printed.circuit[9, 0] < 0.43 + 0.3 * 0.43


def test_noise_biases_either():
    current, voltage = record(600.1, noise=20e-3, seed=8)
    for cumulative in (False, True):
        found = least_squares_windows(current, voltage, PERIOD, 6000, cumulative=cumulative)
        assert found.circuit[-1, 1] == pytest.approx(1.31, abs=0.1)  # errata 9


@pytest.mark.parametrize(
    ("current", "voltage", "options", "message"),
    [
        (np.ones(5), np.ones(4), {}, "shape (5,) and voltage (4,)"),
        (np.ones(50), np.ones(50), {}, "record of 50 samples: a window of 1000 needs 1001"),
        (np.ones(50), np.ones(50), {"samples": 2}, "samples = 2"),
        (
            np.ones(50),
            np.full(50, np.nan),
            {"samples": 20},
            "sample 0: current and voltage must be finite",
        ),
        (
            np.ones(50),
            np.ones(50),
            {"samples": 20},
            "window from 0 s to 2 s: the current does not vary enough",
        ),
        (np.ones(50), np.ones(50), {"samples": 20, "period": 0.0}, "period = 0 s"),
    ],
)
def test_what_cannot_be_estimated_is_refused(current, voltage, options, message):
    with pytest.raises(UserError) as caught:
        least_squares_windows(current, voltage, **({"period": PERIOD} | options))
    assert message in str(caught.value)
