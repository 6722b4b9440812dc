"""Chapter 4 recomputed: the programs of appendix A3 carried out as they are printed."""

import control
import numpy as np
import pytest

from demonstrations.thesis import circuit, degradation, forgetting
from orchestration.experiment.waveforms import square_wave
from tests.support.thesis_findings import claim, claims, row

pytestmark = pytest.mark.slow  # the first test computes the claims of a chapter

R1, R2, C = 0.43, 2.35, 2.7
PERIOD = 0.1


def by_control(current):
    """Voltage of the circuit for a held current."""
    circuit = control.ss(control.tf([R1 * R2 * C, R2], [(R1 + R2) * C, 1.0]))
    time = PERIOD * np.arange(len(current))
    return control.forced_response(
        control.sample_system(circuit, PERIOD, "zoh"), time, current
    ).outputs


def test_the_circuit_answers_as_control_has_it():
    current = square_wave(PERIOD * np.arange(500), 1.3, 0.1)
    assert circuit.response(current) == pytest.approx(by_control(current), rel=1e-9, abs=1e-12)


def test_row_27_the_fit_of_a_perfect_prediction():
    """The loop of appendix A3 on a record without noise, whose one-step predictions are exact."""
    current = square_wave(PERIOD * np.arange(2001), 1.3, 0.1)
    voltage = by_control(current)
    start = 1000
    phi = np.array(
        [[-voltage[start + j], current[start + j + 1], current[start + j]] for j in range(1000)]
    ).T
    wanted = voltage[start + 1 : start + 1001]
    theta = np.linalg.solve(phi @ phi.T, phi @ wanted)
    v_fit, v_act = phi.T @ theta, voltage[start : start + 1000]
    printed = 100 * (1 - np.linalg.norm(v_act - v_fit) / np.linalg.norm(v_fit - v_fit.mean()))
    right = 100 * (1 - np.linalg.norm(wanted - v_fit) / np.linalg.norm(wanted - wanted.mean()))
    assert right == pytest.approx(100.0, abs=1e-6)
    assert claims(degradation, 27)[0].reproduced == pytest.approx(printed, abs=1e-4)
    assert f"is given {printed:.0f} %" in row(degradation, 27).holds


def test_row_28_the_plot_is_a_second_early():
    """The loop of appendix A3, with 10 % and 10 Hz."""
    eps, fsampl = 10.0, 10.0
    tsampl = 1 / fsampl
    tmax = int((np.log10(eps) - 2) / np.log10(0.99) * tsampl)
    alphas = [10 ** ((np.log10(eps) - 2) * (tsampl / (j + 1))) for j in range(tmax + 1)]
    drawn = dict(zip(range(tmax + 1), alphas, strict=True))  # plot(0:tmax, alphas)
    right = {t: 0.1 ** (tsampl / t) for t in (1, 2)}
    assert drawn[1] == pytest.approx(right[2])
    assert (
        f"{drawn[1]:.4f}, which is the factor for 2 s; eq. 4.11 gives {right[1]:.4f}"
        in row(forgetting, 28).holds
    )
    assert (claims(forgetting, 28)[0].published, claims(forgetting, 28)[0].reproduced) == (
        "1",
        pytest.approx(2.0),
    )


def test_more_than_five_hours_were_recorded():
    recorded = claim(degradation, "continuous operation that was recorded")
    assert recorded.reproduced == pytest.approx(1.8485e5 * 0.1 / 3600, rel=1e-12)
    assert recorded.holds


def test_row_11_what_is_left_of_a_sample():
    left = 100.0
    for _ in range(100):
        left *= 0.91
    assert f"a weight of {left:.3f} % after 10 s" in row(forgetting, 11).holds
    assert 0.91 ** (claims(forgetting, 11)[0].reproduced / 0.1) == pytest.approx(np.exp(-1))
    assert forgetting.forgetting_factor(left, 0.1, 10.0) == pytest.approx(0.91, rel=1e-12)
    assert f"leaves {100 * 0.985**75:.0f} % after 5 s" in row(forgetting, 11).holds


def _circuit_voltage(r1, current):
    """Return the voltage of the circuit under a held current, its series resistance changing."""
    charge = 0.0
    voltage = np.empty_like(current)
    for k, (r, i) in enumerate(zip(r1, current, strict=True)):
        voltage[k] = r * (R2 * i - charge / C) / (r + R2) + charge / C
        tau = (r + R2) * C
        charge += (R2 * C * i - charge) * (1 - np.exp(-PERIOD / tau))
    return voltage


def test_row_7_the_last_window_knows_all_that_came_before():
    """Normal equations of all windows, and of the last alone, solved here."""
    time = PERIOD * np.arange(10_001)
    current = square_wave(time, 1.3, 0.1)
    r1 = R1 * (1 + 0.5 * time / 1000.0)
    voltage = _circuit_voltage(r1, current)
    rise = []
    for start in (0, 9000):
        phi = np.column_stack([current[start + 1 :], current[start:-1], -voltage[start:-1]])
        b0, b1, a = np.linalg.lstsq(phi, voltage[start + 1 :])[0]
        discrete = control.tf([b0, b1], [1.0, a], PERIOD)
        # the circuit behind held samples: its gain at rest, its jump and its pole
        r2, jump, tau = float(discrete.dcgain()), b0, -PERIOD / np.log(-a)
        z = abs(complex(control.tf([jump * tau, r2], [tau, 1.0])(0.2j * np.pi)))
        whole = abs(complex(control.tf([R1 * R2 * C, R2], [(R1 + R2) * C, 1.0])(0.2j * np.pi)))
        rise.append(100 * (z / whole - 1))
    assert (
        f"it shows {rise[0]:.1f} %, a window of its own {rise[1]:.1f} %"
        in row(degradation, 7).holds
    )


def test_the_largest_voltage_is_not_that_of_actuator_135():
    found = claim(degradation, "largest voltage at 1.3 A and 0.1 Hz")
    settled = by_control(square_wave(PERIOD * np.arange(1000), 1.3, 0.1))[-100:]
    assert found.reproduced == pytest.approx(
        np.abs(settled).max(), rel=0.02
    )  # sampled before the extreme
    assert not found.holds


def test_a_life_is_derated_and_protected():
    """As in figs. 4-3 and 4-4, in the run that is drawn."""
    life = degradation.life()
    limit = life["voltage_limit"]
    assert (np.diff(limit) <= 0).all()
    assert limit[-1] < limit[0]
    beyond = np.abs(life["voltage"]) > limit
    assert beyond[-6000:].any()
    late = slice(-6000, None)
    assert not life["recovering"][: np.argmax(beyond)].any()
    assert (life["current"][late][life["recovering"][late] > 0.5] == 0.0).all()
    impedance = np.where(life["estimate_valid"] > 0.5, life["impedance"], np.inf)
    memory = 600.0 / np.log(10.0)  # s; the estimate is late by about one, see test_ageing
    assert 2100.0 < life["time"][np.argmin(impedance)] < 2100.0 + 2.0 * memory


def test_the_controller_rests_in_recoveries_and_would_not_by_itself():
    """The rest of eq. 2.2 is proportional; a controller that goes on would be visible."""
    signals = degradation.recoveries()
    # V; forces between points of a millisecond are interpolated
    assert degradation.windup(signals) < 1e-5
    going_on = signals | {"galvanostat.recovering": np.ones_like(signals["time"])}
    assert degradation.windup(going_on) > 1e-4


def test_the_forecast_is_within_a_percent_of_the_life():
    found = claim(degradation, "life to 10 % more impedance, forecast after 4 h")
    assert degradation.forecast().life == pytest.approx(float(found.published) * 3600, rel=0.01)


@pytest.mark.xfail(strict=True, reason="this life, which still bends, ends 10 s too early")
def test_the_forecast_holds_the_life():
    found = claim(degradation, "life to 10 % more impedance, forecast after 4 h")
    low, high = degradation.forecast().interval
    assert low < float(found.published) * 3600 < high
