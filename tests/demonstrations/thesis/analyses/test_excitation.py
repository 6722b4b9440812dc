"""Orders of excitation, against the powers of the harmonics in closed form."""

import numpy as np
import pytest

from demonstrations.thesis.analyses import excitation
from orchestration.experiment.reading import read
from tests.support.thesis_findings import claim, row


def order_by_harmonics(period):
    """Odd harmonics of a sampled square wave above 1 % of the first; two orders each, one at half
    the sample rate.
    """
    number = np.arange(1, period // 2 + 1, 2)
    power = (np.sin(np.pi / period) / np.sin(np.pi * number / period)) ** 2
    power[2 * number == period] *= 2  # its line is one, of twice the power
    return sum(1 if 2 * k == period else 2 for k, p in zip(number, power, strict=True) if p > 0.01)


def test_row_44_no_square_wave_has_order_20():
    assert max(order_by_harmonics(n) for n in range(2, 2000, 2)) == 15
    assert [order_by_harmonics(n) for n in (20, 28, 100, 1000)] == [10, 14, 10, 10]
    largest, period = excitation.best_square()
    assert largest == order_by_harmonics(period) == 14
    found = claim(excitation, "largest order of any square wave")
    assert found.reproduced == largest
    assert not found.holds
    assert "makes 10 orders" in row(excitation, 44).holds
    assert "to 14 at most, with 28 samples" in row(excitation, 44).holds
    assert "(15 by a matrix of 500, with 30)" in row(excitation, 44).holds
    assert "40 samples has order 20" in row(excitation, 44).holds  # half the samples of a period


def test_the_orders_of_the_stimuli():
    current = claim(excitation, "order of the current, square wave")
    assert current.reproduced == order_by_harmonics(100)
    assert not current.holds
    # power of steps that are held for 30 s on average falls as 1/f^2 from some 5 mHz on: of the
    # frequencies that 5 s of samples tell apart, 0.2 Hz each, few are above a hundredth
    force = claim(excitation, "order of the force, steps")
    assert force.reproduced <= 5
    assert not force.holds
    assert claim(
        excitation, "order of the square waves of table 3-1, for the 3 parameters of eq. 3.10"
    ).holds


def test_loads_that_are_held_for_less_excite_more():
    assert 3 * excitation.typical(excitation.DWELL) < excitation.typical(excitation.BRISK)


def test_the_stimuli_are_those_of_the_experiment():
    inputs = read("fig_3_12").inputs
    assert tuple(level.value for level in inputs["force"].levels) == excitation.LEVELS
    assert tuple(inputs["force"].dwell) == excitation.DWELL
    assert (inputs["current"].amplitude.value, inputs["current"].frequency) == (0.9, 0.1)
    assert (read("fig_3_12").duration, read("fig_3_12").step) == (
        excitation.DURATION,
        excitation.PERIOD,
    )
    assert np.abs(excitation.square(0.1)).max() == pytest.approx(0.9)
