"""Claims: the five-hour life is that of a circuit integrated here, and section 4.2 holds."""

import math

import numpy as np
import pytest

from demonstrations.thesis import ageing
from fmus.degradation_estimator.systems import CAPACITANCE
from fmus.kit.errors import UserError
from tests.support.pace import slow_but

pytestmark = pytest.mark.slow  # the first test computes the claims of a chapter

# Table 3-1 and section 4.3, typed in again; CAPACITANCE is checked against the printed
# voltage below.
R1, R2, C = 0.43, 2.35, 3.3479  # ohm, ohm, F
OMEGA = 0.628  # rad/s
LIMIT, VOLTAGE_STEP, IMPEDANCE_STEP = 1.2, 0.05, 0.05  # V, V, 1
MEMORY = 600.0 / math.log(10.0)  # s: 10 % of the weight is left after 600 s (eq. 4.11)
NOISE = 20e-3  # V rms, as in errata 9
LEAST_SQUARES = ageing.ESTIMATOR | {"instrumental_variable": 0.0}


def impedance(series):
    """R2 in parallel with a series resistance and C."""
    branch = series + 1 / (1j * OMEGA * C)
    return np.abs(R2 * branch / (R2 + branch))


def circuit(current, step=0.1):
    """Voltage and series resistance of the ageing circuit; R1 is frozen within a step, the charge
    in closed form.
    """
    growth, kappa, cooling, thermal = 6.7e-5, 0.02, 40.0, 2000.0  # 1/C, 1/K, K/W, s
    charge = moved = warm = 0.0
    voltage, series = np.empty_like(current), np.empty_like(current)
    for k, i in enumerate(current.tolist()):
        r = R1 * (1 + growth * moved) / (1 + kappa * warm)
        series[k] = r
        voltage[k] = R2 * (r * i + charge / C) / (r + R2)
        rest = R2 * C * i
        after = rest + (charge - rest) * math.exp(-step / ((r + R2) * C))
        rate = (after - charge) / step
        across = i * R2 - R2 * rate  # what does not charge the films leaks
        heat = r * rate**2 + across**2 / R2
        warm = cooling * heat + (warm - cooling * heat) * math.exp(-step / thermal)
        moved += abs(after - charge)
        charge = after
    return voltage, series


@pytest.fixture(scope="module")
def free():
    return ageing.run(protected=False)


@pytest.fixture(scope="module")
def protected():
    return ageing.run()


@pytest.fixture(scope="module")
def noisy():
    return ageing.run(protected=False, voltage_noise=NOISE, seed=1)


@pytest.fixture(scope="module", params=slow_but(["free", "protected", "noisy"], "protected"))
def life(request):
    """Each life, with what it should be."""
    signals = request.getfixturevalue(request.param)
    voltage, series = circuit(signals["current"])
    return signals | {
        "true_voltage": voltage,
        "true_series_resistance": series,
        "true_impedance": impedance(series),
    }


# --- the actuator
# --------------------------------------------------------------------------------------------------


def test_capacitance_gives_the_printed_first_voltage():
    """Charge of the periodic state by going through the cycle until it repeats; +-1.15 V (section
    4.3).
    """
    assert pytest.approx(C, rel=1e-4) == CAPACITANCE
    charge, decay = 0.0, math.exp(-5.0 / ((R1 + R2) * C))
    for k in range(40):
        rest = R2 * C * (1.3 if k % 2 == 0 else -1.3)
        charge = rest + (charge - rest) * decay
    assert R2 * (-1.3 * R1 + charge / C) / (R1 + R2) == pytest.approx(-1.15, abs=1e-4)


def test_the_actuator_is_the_circuit_integrated_here(life):
    assert life["series_resistance"] == pytest.approx(life["true_series_resistance"], rel=1e-3)
    assert life["voltage"] == pytest.approx(life["true_voltage"], abs=2e-3)


def test_impedance_has_its_minimum_where_fig_4_7_has_it(free):
    truth = impedance(free["series_resistance"])
    lowest = free["time"][np.argmin(truth)]
    assert lowest == pytest.approx(2100.0, abs=50.0)
    assert 0.15 < truth[-1] / truth.min() - 1 < 0.25
    late = truth[free["time"] > 10000.0][::1000]
    assert np.all(np.diff(late) > 0.0)


# --- the estimator
# --------------------------------------------------------------------------------------------------


def test_impedance_is_tracked_within_2_percent(life):
    """Measured: 0.6 % at worst, 0.7 % with 20 mV of noise."""
    truth = life["true_impedance"]
    first = int(np.argmax(life["estimate_valid"]))
    assert life["time"][first] == pytest.approx(120.0, abs=0.2)
    assert np.all(life["estimate_valid"][first:] == 1.0)
    assert np.abs(life["impedance"][first:] / truth[first:] - 1).max() < 0.02


def test_derating_follows_the_impedance_by_the_memory_of_the_estimate(life):
    """Late by two memories at most, 521 s (one for the estimate, one for its reference, as the
    impedance falls then).

    Measured: 410 to 421 s without noise; with 20 mV from 214 to 527 s, over four records.
    """
    truth = life["true_impedance"]
    change = truth / truth[np.argmax(life["estimate_valid"])] - 1
    scatter = (
        0.002 if np.any(life["measured_voltage"] != life["voltage"]) else 0.0
    )  # README of the estimator
    for n in (1, 2):
        due = life["time"][np.argmax(change > n * IMPEDANCE_STEP)]
        around = np.abs(life["time"] - due) < MEMORY
        uncertain = scatter / np.polyfit(life["time"][around], change[around], 1)[0]
        taken = life["time"][np.argmax(life["voltage_limit"] < LIMIT - (n - 0.5) * VOLTAGE_STEP)]
        assert due - uncertain < taken < due + 2 * MEMORY + uncertain
    assert life["voltage_limit"][-1] == pytest.approx(LIMIT - 2 * VOLTAGE_STEP)


def test_noise_biases_least_squares_and_not_the_instrumental_variable():
    """Errata 9, in the loop."""
    lives = [
        ageing.run(1800.0, voltage_noise=NOISE, seed=3, estimator=e)
        for e in (ageing.ESTIMATOR, LEAST_SQUARES)
    ]
    instrument, plain = (life["R2"][life["time"] > 600.0].mean() for life in lives)
    assert instrument == pytest.approx(R2, rel=0.03)
    assert plain < 0.9 * R2


# --- the protection
# --------------------------------------------------------------------------------------------------


def runs_beyond(life):
    """Lengths, in samples, of the times at which the measured voltage was beyond its limit."""
    limit = np.concatenate([[LIMIT], life["voltage_limit"][:-1]])
    beyond = np.abs(life["measured_voltage"]) > limit
    edges = np.flatnonzero(np.diff(np.concatenate([[0], beyond, [0]])))
    return np.diff(edges)[::2]


def test_the_voltage_exceeds_its_limit_without_protection_only(free, protected):
    assert runs_beyond(free).max() > 3
    assert len(runs_beyond(free)) > 100
    assert runs_beyond(protected).max() == 1, "the sample that is acted upon"


def test_the_current_rests_for_the_recovery_time(protected):
    resting = protected["recovering"] == 1.0
    assert np.array_equal(
        protected["current"], np.where(resting, 0.0, protected["current_command"])
    )
    edges = np.flatnonzero(np.diff(np.concatenate([[0], resting, [0]])))
    assert set(np.diff(edges)[::2]) == {5}, (
        "0.5 s at 10 Hz, and the voltage is below its limit then"
    )
    assert not protected["recovering"][: np.argmax(protected["voltage_limit"] < LIMIT)].any()


def test_protection_cools_the_actuator_and_so_the_next_step_comes_sooner(free, protected):
    assert protected["temperature_rise"][-1] < free["temperature_rise"][-1] - 1.0
    assert protected["throughput"][-1] < free["throughput"][-1]
    second = [
        life["time"][np.argmax(life["voltage_limit"] < LIMIT - 1.5 * VOLTAGE_STEP)]
        for life in (protected, free)
    ]
    assert second[0] < second[1] - 100.0


# --- the run itself
# --------------------------------------------------------------------------------------------------


def test_a_seed_makes_one_record_and_another_seed_another():
    one, same, other = (
        ageing.run(30.0, voltage_noise=NOISE, seed=seed)["R1"] for seed in (1, 1, 2)
    )
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)


def test_the_frequency_can_be_tracked():
    estimator = ageing.ESTIMATOR | {
        "track_frequency": 1.0,
        "angular_frequency": 5.0,
        "settling_time": 40.0,
    }
    found = ageing.run(120.0, estimator=estimator)
    fixed = ageing.run(
        120.0, estimator=estimator | {"track_frequency": 0.0, "angular_frequency": 0.2 * math.pi}
    )
    assert found["impedance"][-1] == pytest.approx(fixed["impedance"][-1], rel=1e-9)


def test_progress_is_told_and_what_an_fmu_refuses_is_said():
    told = []
    ageing.run(150.0, progress=told.append)
    assert told == [*range(7, 1500, 7), 1500]
    with pytest.raises(
        UserError, match="estimator: forgetting_time: -1 s is out of range; allowed is"
    ):
        ageing.run(10.0, estimator={"forgetting_time": -1.0})
