"""Fig. 4-8 recomputed, against scipy's integration of the circuit and the loop of appendix A3
carried out here.
"""

import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from demonstrations.thesis.analyses import potentiostat
from tests.support.thesis_findings import claim, claims, row

R1, R2, C = 0.43, 2.35, 2.7  # table 3-1
TS = 1 / 15
OMEGA = 2 * np.pi * 0.1


def square(t):
    return 0.6 if (t + 1e-9) % 10 < 5 else -0.6


def limited(seconds, limit):
    """Return current and voltage at 15 Hz: the current is what the voltage asks for, clipped."""

    def current(t, q):
        return np.clip((square(t) - q / C) / R1 + square(t) / R2, -limit, limit)

    def rate(t, q):
        return (R2 * current(t, q[0]) - q[0] / C) / (R1 + R2)

    times, charge, q = TS * np.arange(round(seconds * 15)), [], [0.0]
    for start in np.arange(0, seconds, 5.0):
        inside = times[(times > start - 1e-9) & (times < start + 5 - 1e-9)]
        span = (start, start + 5 - 1e-9)
        run = solve_ivp(
            rate, span, q, t_eval=np.maximum([*inside, span[1]], start), max_step=2e-3, rtol=1e-8
        )
        charge += list(run.y[0][:-1])
        q = run.y[:, -1]
    charge = np.array(charge)
    i = np.array([current(t, x) for t, x in zip(times, charge, strict=True)])
    return i, (i + charge / (R1 * C)) / (1 / R1 + 1 / R2)


@pytest.mark.parametrize("limit", [1.3, 100.0])
def test_the_record_is_that_of_the_limited_circuit(limit):
    target = np.array([square(t) for t in TS * np.arange(300)])
    found = potentiostat.controlled(target, limit)
    for ours, scipys in zip(found, limited(20.0, limit), strict=True):
        assert ours == pytest.approx(scipys, abs=2e-4)


def limited_time(seconds, limit):
    """Return the time at the limit, in closed form from one turn of the voltage to the next.

    The charge goes to R2 C i with (R1 + R2) C until v = 0.6 V takes less than the limit, and then
    to 0.6 C with R1 C.
    """
    charge, total = 0.0, 0.0
    for turn in range(round(seconds / 5)):
        sign = (-1) ** turn
        released = R1 * C * sign * (0.6 * (1 / R1 + 1 / R2) - limit)
        final = sign * R2 * C * limit
        until = -(R1 + R2) * C * np.log((final - released) / (final - charge))
        total += until
        held = sign * 0.6 * C
        charge = held + (released - held) * np.exp(-(5 - until) / (R1 * C))
    return total


@pytest.mark.slow
def test_row_42_the_square_wave_takes_more_than_there_is():
    """The first turn of 1.2 V meets a capacitance that has come from 0 to 0.6 V but for exp(-5 s /
    R1 C).
    """
    inner = 0.6 * (1 - np.exp(-5 / (R1 * C)))
    most = (0.6 + inner) / R1 + 0.6 / R2
    (found,) = claims(potentiostat, 42)
    assert found.reproduced == pytest.approx(most, rel=1e-4)
    assert not found.holds
    assert f"takes {most:.1f} A when the voltage turns" in row(potentiostat, 42).holds
    share = float(
        re.search(r"at its limit for (\d+\.\d) % of the time", row(potentiostat, 42).holds)[1]
    )
    assert share == pytest.approx(100 * limited_time(160.0, 1.3) / 160.0, abs=0.06)
    _, voltage = limited(160.0, 1.3)
    assert np.mean(np.abs(voltage) < 0.59) > 0.3  # no square wave any more


def tustin(theta):
    """Convert as the M-file does."""
    a, bo, b1 = theta
    return (
        -(bo + b1) * (bo - b1) / (2 * (a * bo - b1)),
        (bo + b1) / (1 + a),
        -(a * bo - b1) * TS / (bo + b1) ** 2,
    )


def impedance(circuit):
    r1, r2, c = circuit
    return abs((r2 + r1 * r2 * c * 1j * OMEGA) / (1 + (r1 + r2) * c * 1j * OMEGA))


@pytest.mark.slow
def test_recursive_estimates_are_those_of_the_printed_loop():
    _, current, voltage = potentiostat.record()
    theta, p, rows = np.zeros(3), np.eye(3), {}
    for t in range(2, voltage.size + 1):  # counted from 1, as there
        phi = np.array([-voltage[t - 2], current[t - 1], current[t - 2]])
        theta = theta + (p @ phi / (0.985 + phi @ p @ phi)) * (voltage[t - 1] - phi @ theta)
        p = (p - np.outer(p @ phi, phi @ p) / (0.985 + phi @ p @ phi)) / 0.985
        rows[t] = tustin(theta)
        if t % 75 == 0:
            p = np.eye(3)
    expected = np.array([rows[t] for t in rows if (t - 1) * TS >= 20 - 1e-9])
    found = potentiostat.online()
    assert found.circuit == pytest.approx(expected, rel=1e-6)
    assert found.impedance == pytest.approx([impedance(c) for c in expected], rel=1e-6)
    for name, column in zip(("R1", "R2", "C"), expected.T, strict=True):
        assert claim(potentiostat, f"{name} by RLS at 15 Hz, median").reproduced == pytest.approx(
            np.median(column), rel=1e-6
        )


def test_batch_estimates_are_those_of_numpy():
    _, current, voltage = potentiostat.record()
    expected = []
    for start in range(300, 2400, 150):
        s = slice(start, start + 150)
        phi = np.column_stack([-voltage[s], current[start + 1 : start + 151], current[s]])
        expected.append(tustin(np.linalg.lstsq(phi, voltage[start + 1 : start + 151])[0]))
    found = potentiostat.batch()
    assert found.circuit == pytest.approx(np.array(expected), rel=1e-6)
    assert found.time == pytest.approx(np.arange(30, 161, 10))
    median = np.median([impedance(c) for c in expected])
    assert claim(
        potentiostat, "impedance at 0.1 Hz by LS at 15 Hz, median"
    ).reproduced == pytest.approx(median, rel=1e-6)
    assert median == pytest.approx(impedance((R1, R2, C)), rel=0.01)


def test_a_held_voltage_makes_other_coefficients_than_tustin():
    """Without noise the admittance is exact: i(t) from the charge that a held voltage leaves."""
    left = np.exp(-TS / (R1 * C))
    g = 1 / R1 + 1 / R2
    # q(t) = left q + (1 - left) C v; i = g v - q / (R1 C): v(t) by i(t), i(t-1), v(t-1)
    theta = (-(left + (1 - left) / (R1 * g)), 1 / g, -left / g)
    for name, value in zip(("R1", "R2", "C"), tustin(theta), strict=True):
        assert claim(
            potentiostat, f"{name} of table 3-1 from held voltage at 15 Hz"
        ).reproduced == pytest.approx(value, rel=1e-6)


def test_row_43_the_axes_are_those_of_another_actuator():
    axes = ((1, 4.5), (0.5, 2), (0, 1))
    counts = [
        sum(a <= x <= b for x, (a, b) in zip(circuit, axes, strict=True))
        for circuit in ((R1, R2, C), (1.32, 2.72, 0.46))
    ]
    assert counts == [0, 2]
    (found,) = claims(potentiostat, 43)
    assert (found.published, found.reproduced) == ("3", 0.0)
    assert "0 of 3 parameters of table 3-1" in row(potentiostat, 43).holds
    assert row(potentiostat, 43).holds.endswith("2 of 3")
