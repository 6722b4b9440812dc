"""Claims: the order of excitation is that of theory; models that need more are refused.

Oracles: sums of sinusoids, periodic binary signals and white noise (Ljung, section 13.3), the
covariance of AR(1).
"""

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import max_len_seq

from fmus.kit.errors import UserError
from orchestration.identify.black_box import (
    arx,
    autocovariance_matrix,
    box_jenkins,
    input_output_data,
    pexcit,
)
from tests.support.black_box import response

RANDOM = np.random.default_rng(7)
TIME = np.arange(1003)


@pytest.mark.parametrize("count", [1, 2, 5])
@pytest.mark.parametrize("offset", [0.0, 1e3])
def test_each_sinusoid_excites_two_orders(count, offset):
    signal = offset + sum(np.sin(0.37 * (k + 1) * TIME + k) for k in range(count))
    assert pexcit(signal, 1e-9) == 2 * count
    assert pexcit(3e-6 * signal, 1e-9) == 2 * count


def test_a_sinusoid_at_half_the_sample_rate_excites_one():
    assert pexcit(np.where(TIME % 2, 1.0, -1.0), 1e-9) == 1


@pytest.mark.parametrize("bits", [3, 4, 5])
def test_a_periodic_binary_signal_excites_one_less_than_its_period(bits):
    """About its mean; its period is 2^bits - 1."""
    sequence = np.tile(2.0 * max_len_seq(bits)[0] - 1.0, 20)
    assert pexcit(sequence, 1e-9) == 2**bits - 2


def test_white_noise_excites_as_much_as_is_looked_for():
    assert pexcit(RANDOM.standard_normal(5000)) == 50
    assert pexcit(RANDOM.standard_normal(5000), highest=80) == 80


def test_a_constant_excites_nothing():
    assert pexcit(np.full(100, 3.0)) == 0


def test_a_slow_square_wave_excites_few_orders_by_the_cutoff_of_the_thesis():
    """But many where only rounding is cut off."""
    square = np.sign(np.sin(2 * np.pi * np.arange(5000) / 100 + 0.1))
    assert 5 < pexcit(square) < 40
    assert pexcit(square, 1e-9) == 50


def test_the_matrix_is_that_of_equation_3_16():
    """Of a long AR(1) process, whose covariance is phi^k / (1 - phi^2), and Toeplitz."""
    u = 5.0 + response([1.0], [1.0, -0.7], RANDOM.standard_normal(100_000))
    matrix = autocovariance_matrix(u, 4)
    assert matrix == pytest.approx(toeplitz(0.7 ** np.arange(4) / (1.0 - 0.49)), abs=0.05)
    assert matrix == pytest.approx(matrix.T)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: pexcit([1.0, 2.0, 3.0], 1.5), r"^cutoff = 1\.5: must be between 0 and 1$"),
        (
            lambda: pexcit([1.0, 2.0, 3.0], highest=2),
            r"^order = 2: must be from 1 to half of the 3 samples$",
        ),
        (lambda: pexcit([]), r"^order = 1: must be from 1 to half of the 0 samples$"),
    ],
)
def test_mistakes_are_told_in_one_line(call, said):
    with pytest.raises(UserError, match=said):
        call()


def data(first):
    second = RANDOM.standard_normal(len(first))
    y = response([0.0, 0.4], [1.0, -0.7], first) + response([0.0, 1.0], [1.0, -0.2], second)
    return input_output_data(
        np.column_stack([first, second]), y + 0.1 * RANDOM.standard_normal(len(y)), 1.0
    )


def test_what_does_not_excite_a_model_is_refused():
    sine = data(np.sin(0.3 * TIME))
    said = (
        r"^input u1 is persistently exciting of order 2 only, and the orders ask for 4: lower them"
    )
    for find in (
        lambda: box_jenkins(sine, 2, 2, 1, 1),
        lambda: arx(sine, 2, 2),
        lambda: box_jenkins(sine, 3, 1, 0, 0),
    ):
        with pytest.raises(UserError, match=said):
            find()
    assert box_jenkins(sine, 1, 1, 0, 0).parameter("f1_1").value == pytest.approx(-0.7, abs=0.05)


@pytest.mark.slow
def test_what_excites_weakly_is_told():
    slow = data(np.sign(np.sin(2 * np.pi * TIME / 500.0 + 0.1)))
    weak = [m for m in box_jenkins(slow, 4, 4, 0, 0).messages if "excites weakly" in m]
    assert len(weak) == 1
    assert weak[0].startswith("input u1 excites weakly: to order ")
    assert not any(
        "weakly" in m for m in box_jenkins(data(RANDOM.standard_normal(1003)), 4, 4, 0, 0).messages
    )
