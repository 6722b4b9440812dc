"""Claims: impedance and dynamic stiffness are those of textbooks within their intervals; where a
record is too short, lines are left out and the result says so; what cannot be told is refused.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.identify.spectral import estimate_responses
from orchestration.identify.spectral.measured import unit_of_ratio
from tests.support import frequency as made

UNITS = {"current": "A", "force": "N", "voltage": "V", "displacement": "m", "charge": "C"}
RANDOM = np.random.default_rng(1)


def refusal(*arguments, **options):
    with pytest.raises(UserError) as caught:
        estimate_responses(*arguments, **options)
    return str(caught.value)


def test_the_impedance_off_six_periods_of_a_square_wave():
    """At its harmonics, from rest, with noise; below a tenth of the rate the hold does not show."""
    current = made.square(600)
    voltage = made.noisy(np.random.default_rng(2), made.voltage(current), 0.01)
    record = made.recorded(UNITS, current=current, voltage=voltage)
    result = estimate_responses(record, ["current"])
    found = result["voltage/current"]
    assert found.frequency[:4] == pytest.approx([0.1, 0.3, 0.5, 0.7])
    assert found.unit == "ohm"
    truth = made.held_impedance(found.frequency)
    assert np.mean(np.abs(found.values - truth) < found.radius) > 0.85
    assert abs(found.values[0]) == pytest.approx(abs(made.impedance(0.1)), rel=0.02)
    assert "current repeats every 10 s, 6 times" in str(result)


def test_storage_and_loss_of_burgers_model_off_a_multisine():
    """Inputs without hold: a spectrum times the complex compliance, so that Findley's closed forms
    hold at every frequency.
    """
    size = 6000
    random = np.random.default_rng(3)
    force = made.multisine(random, size // 4, 4)
    lines = np.fft.rfft(force)
    frequency = np.fft.rfftfreq(size, made.STEP)
    storage, loss = made.stiffness(frequency[1:])
    lines[1:] /= storage + 1j * loss
    moved = made.noisy(random, np.fft.irfft(lines, size), 1e-3)
    record = made.recorded(UNITS, force=force, displacement=moved)
    found = estimate_responses(record, ["force"], ["force/displacement"])["force/displacement"]
    storage, loss = made.stiffness(found.frequency)
    for interval, truth in (
        (found.storage, storage),
        (found.loss, loss),
        (found.loss_tangent, loss / storage),
    ):
        assert np.mean((interval.low < truth) & (truth < interval.high)) > 0.9
    assert (found.unit, found.is_stiffness) == ("N/m", True)
    low = found.frequency < 0.05
    assert found.loss_tangent.value[low] == pytest.approx((loss / storage)[low], rel=0.2)


def test_two_outputs_of_one_input_share_their_noise():
    """Charge is what voltage was a sample ago, noise and all: their ratio has hardly any, only
    a phase, by which the noises of both are turned against each other, too.
    """
    random = np.random.default_rng(7)
    current = made.multisine(random, 150, 5)
    voltage = made.noisy(random, made.voltage(current), 0.1)
    charge = 2.7 * voltage[149:-1] + 1e-4 * random.normal(size=600)
    record = made.recorded(UNITS, current=current[150:], voltage=voltage[150:], charge=charge)
    found = estimate_responses(record, ["current"], ["charge/voltage"])["charge/voltage"]
    truth = 2.7 * np.exp(-2j * np.pi * found.frequency * made.STEP)
    alone = estimate_responses(record, ["current"], ["voltage/current"])["voltage/current"]
    assert found.unit == "F"
    assert np.mean(np.abs(found.values - truth) < found.radius) > 0.85
    assert np.median(found.radius) / 2.7 < 0.1 * np.median(alone.radius / np.abs(alone.values))


def test_an_inverse_is_the_inverse_with_the_same_relative_error():
    current = RANDOM.normal(size=600)
    voltage = made.noisy(RANDOM, made.voltage(current), 0.01)
    record = made.recorded(UNITS, current=current, voltage=voltage)
    both = estimate_responses(record, ["current"], ["voltage/current", "current/voltage"])
    there, back = both["voltage/current"], both["current/voltage"]
    assert there.values * back.values == pytest.approx(1.0)
    assert there.variance / np.abs(there.values) ** 2 == pytest.approx(
        back.variance / np.abs(back.values) ** 2
    )


@pytest.mark.parametrize("noise", [1e-4, 1e-3])
def test_where_the_record_is_too_short_for_a_slow_pole_lines_are_left_out(noise):
    """600 s over a time constant of 7.5 s: twelve lines to its corner, which windows pass over."""
    held, dropped = [], 0
    for seed in range(20):
        random = np.random.default_rng(seed)
        current = random.normal(size=12000)
        voltage = made.noisy(random, made.voltage(current), noise)
        record = made.recorded(UNITS, current=current[6000:], voltage=voltage[6000:])
        result = estimate_responses(record, ["current"], band=(0.0, 0.05))
        found = result["voltage/current"]
        held += [*(np.abs(found.values - made.held_impedance(found.frequency)) < found.radius)]
        reason = "the record is too short for a response that changes so fast"
        dropped += found.left_out[reason].size
        assert found.left_out[reason].min() < 0.004
        assert reason in str(result)
    assert dropped > 20
    assert np.mean(held) > 0.9


def test_one_step_in_the_middle_of_a_record_is_enough():
    """Its spectrum turns from line to line, unlike that of a transient."""
    current = np.where(np.arange(600) < 300, 0.0, 0.9)
    voltage = made.noisy(np.random.default_rng(6), made.voltage(current), 1e-3)
    record = made.recorded(UNITS, current=current, voltage=voltage)
    found = estimate_responses(record, ["current"])["voltage/current"]
    error = np.abs(found.values - made.held_impedance(found.frequency))
    assert np.mean(error < found.radius) > 0.85
    assert np.median(error / np.abs(found.values)) < 0.02


def test_an_input_is_left_out_where_it_is_not_excited():
    """Sines from line 60 to 149 of the record."""
    current = made.multisine(RANDOM, 600, 1, first=60)
    record = made.recorded(UNITS, current=current, voltage=made.voltage(current))
    found = estimate_responses(record, ["current"])["voltage/current"]
    assert found.frequency.min() * 60.0 == pytest.approx(50, abs=10)
    assert found.left_out["current is not excited"].min() == pytest.approx(1 / 60.0)


def test_inputs_are_told_apart_by_lines_of_their_own():
    """Odd lines for one, even ones for the other, four periods of both."""
    current = made.multisine(RANDOM, 300, 4, first=1, by=2)
    force = made.multisine(RANDOM, 300, 4, first=2, by=2)
    moved = made.displacement(force) + 1e-4 * made.voltage(current)
    moved = made.noisy(RANDOM, moved, 1e-3)
    record = made.recorded(UNITS, current=current, force=force, displacement=moved)
    result = estimate_responses(record, ["current", "force"])
    for name, truth in (
        ("displacement/force", made.held_compliance),
        ("displacement/current", lambda f: 1e-4 * made.held_impedance(f)),
    ):
        found = result[name]
        inside = np.abs(found.values - truth(found.frequency)) < found.radius
        assert np.mean(inside) > 0.85
    odd = np.round(result["displacement/current"].frequency * 30.0) % 2
    assert odd.tolist() == [1.0] * odd.size


def test_periodic_inputs_at_the_same_lines_are_told_apart_by_smoothness():
    random = np.random.default_rng(5)
    current = made.multisine(random, 600, 2)
    force = made.multisine(random, 600, 2)
    moved = made.noisy(random, made.displacement(force) + 1e-4 * made.voltage(current), 1e-3)
    record = made.recorded(UNITS, current=current, force=force, displacement=moved)
    found = estimate_responses(record, ["current", "force"])["displacement/force"]
    truth = made.held_compliance(found.frequency)
    assert np.mean(np.abs(found.values - truth) < found.radius) > 0.85


def test_the_model_passes_the_same_estimate():
    """The truth as the model: it agrees, and so does its leakage; another does not."""
    current = made.square(650)
    truth = made.voltage(current)
    voltage = made.noisy(np.random.default_rng(4), truth, 1e-3)
    record = made.recorded(UNITS, current=current, voltage=voltage)
    options = {"of": ["voltage/current"], "model": "the circuit"}
    right = estimate_responses(record, ["current"], modelled={"voltage": truth}, **options)
    wrong = estimate_responses(record, ["current"], modelled={"voltage": 1.2 * truth}, **options)
    assert right["voltage/current"].model == pytest.approx(
        made.held_impedance(right["voltage/current"].frequency), rel=1e-4
    )
    assert np.mean(right["voltage/current"].agrees) > 0.85
    assert not wrong["voltage/current"].agrees[:5].any()
    assert "the first 5 s are left out, so that whole periods remain" in right.notes


def test_a_band_and_a_period_are_those_that_are_named():
    current = made.square(600)
    record = made.recorded(UNITS, current=current, voltage=made.voltage(current))
    found = estimate_responses(record, ["current"], period=20.0, band=(0.25, 0.75))
    assert found["voltage/current"].frequency == pytest.approx([0.3, 0.5, 0.7])
    assert "current repeats every 20 s, 3 times" in str(found)
    said = refusal(record, ["current"], band=(7.0, 9.0))
    assert "the record has lines from 0.0166667 Hz to 4.98333 Hz, 0.0166667 Hz apart" in said


CURRENT = RANDOM.normal(size=600)
SIGNALS = {
    "current": CURRENT,
    "force": np.ones(600),
    "voltage": made.voltage(CURRENT),
    "displacement": RANDOM.normal(size=600),
}


@pytest.mark.parametrize(
    ("of", "said"),
    [
        ("voltage", "write a ratio of two signals, such as voltage/current"),
        ("voltage/voltage", "write a ratio of two signals, such as voltage/current"),
        ("voltage/curent", "has no curent"),
        ("voltage/force", "force is constant in made.csv"),
    ],
)
def test_a_ratio_that_makes_no_sense_is_refused(of, said):
    assert said in refusal(made.recorded(UNITS, **SIGNALS), ["current", "force"], [of])


def test_ratios_that_several_inputs_mix_are_refused():
    record = made.recorded(UNITS, **(SIGNALS | {"force": RANDOM.normal(size=600)}))
    inputs = ["current", "force"]
    assert "both are inputs" in refusal(record, inputs, ["current/force"])
    said = refusal(record, inputs, ["voltage/displacement"])
    assert "both are outputs, and current and force move them" in said


def test_what_cannot_be_told_is_refused_in_a_line():
    alike = SIGNALS | {"force": 2.0 * CURRENT}
    said = refusal(made.recorded(UNITS, **alike), ["current", "force"])
    assert "the responses to current and force cannot be told apart" in said
    step = np.where(np.arange(600) < 10, 0.0, 1.0)
    record = made.recorded(UNITS, current=step, voltage=made.voltage(step))
    assert "cannot be told from the transient" in refusal(record, ["current"])
    still = made.recorded(UNITS, current=np.ones(600), voltage=CURRENT)
    assert "no input varies (current)" in refusal(still, ["current"])
    short = made.recorded(UNITS, current=CURRENT[:20], voltage=CURRENT[:20])
    assert "20 samples have 9 spectral lines to use, and 16 are needed" in refusal(
        short, ["current"]
    )


def test_gaps_and_unequal_steps_are_refused_with_what_to_do():
    broken = SIGNALS["voltage"].copy()
    broken[[17, 30]] = np.nan
    record = made.recorded(UNITS, **(SIGNALS | {"voltage": broken}))
    said = refusal(record, ["current"])
    assert "voltage has no value at 1.7 s and 1 more" in said
    assert "cut out a stretch without gaps" in said
    assert (
        "displacement/current"
        in estimate_responses(record, ["current"], ["displacement/current"]).responses
    ), "a signal that is not used may have gaps"
    record = made.recorded(UNITS, **SIGNALS)
    record.time[300:] += 5.0
    assert "a spectrum needs equal steps; cut out an even stretch" in refusal(record, ["current"])


@pytest.mark.parametrize(
    ("above", "below", "unit"),
    [
        ("V", "A", "ohm"),
        ("mV", "mA", "ohm"),
        ("N", "m", "N/m"),
        ("N", "mm", "N/mm"),
        ("m", "N*s", "m/(N*s)"),
        ("C", "V", "F"),
        ("m", "1", "m"),
        ("V", "V", "1"),
    ],
)
def test_a_ratio_has_its_unit(above, below, unit):
    assert unit_of_ratio(above, below) == unit
