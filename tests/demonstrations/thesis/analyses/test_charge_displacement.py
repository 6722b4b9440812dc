"""Figs. 3-10 and 3-11 recomputed, against closed forms of charge and lag and against numpy's least
squares.
"""

import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from demonstrations.thesis.analyses import charge_displacement
from tests.support.thesis_findings import claim, row

R1, R2, C, ALPHA = 0.43, 2.35, 2.7, 0.068  # ohm, ohm, F, mm/C
TAU = (R1 + R2) * C
FLOW = 1e3 * 0.2 * 9.80665 / 1.7e6  # mm/s, 200 g on b1 of fig. 3-9
TIME = 0.1 * np.arange(601)


def charge(frequency):
    """Charge of a square wave of 0.9 A, from one switch to the next in closed form."""
    half, full = 0.5 / frequency, R2 * C * 0.9
    start, q = 0.0, np.empty_like(TIME)
    for n in range(round(60 / half) + 1):
        inside = np.floor(TIME / half + 1e-9) == n
        to = full * (-1) ** n
        q[inside] = to + (start - to) * np.exp(-(TIME[inside] - n * half) / TAU)
        start = to + (start - to) * np.exp(-half / TAU)
    return q


@pytest.mark.parametrize("frequency", [0.2, 0.1])
def test_the_record_is_charge_flow_and_noise(frequency):
    time, found, displacement = charge_displacement.record(frequency)
    assert time == pytest.approx(TIME)
    assert found == pytest.approx(charge(frequency), rel=1e-6, abs=1e-9)
    noise = 1e3 * displacement - ALPHA * charge(frequency) - FLOW * TIME  # mm
    assert np.std(noise) == pytest.approx(3e-3, rel=0.1)
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 4 / np.sqrt(600)


@pytest.mark.slow
@pytest.mark.parametrize(("figure", "frequency"), [("fig. 3-10", 0.2), ("fig. 3-11", 0.1)])
def test_row_40_the_flow_pulls_the_slope(figure, frequency):
    """Lines of numpy through closed forms; 3 um of noise move a slope by less than 4e-4 mm/C."""
    q = charge(frequency)[:600]
    x = ALPHA * q + FLOW * TIME[:600]
    free, forced = np.polyfit(q, x, 1)[0], (q @ x) / (q @ q)
    for crossing, slope in (("free", free), ("forced", forced)):
        found = claim(charge_displacement, f"alpha, zero crossing {crossing}", figure)
        assert found.reproduced == pytest.approx(slope, abs=4e-4)
        assert not found.holds
        along = claim(
            charge_displacement,
            f"alpha, zero crossing {crossing}, steady flow fitted along",
            figure,
        )
        assert along.reproduced == pytest.approx(ALPHA, abs=4e-4)
        assert along.holds
    assert free < ALPHA < forced
    if frequency == 0.2:
        given = re.search(
            r"slope of (\S+) mm/C and the one through zero (\S+) mm/C",
            row(charge_displacement, 40).holds,
        ).groups()
        assert [float(g) for g in given] == pytest.approx([free, forced], abs=4e-4)
        assert (
            f"{FLOW * 1e3:.2f} µm/s for ever, {FLOW * 5e3:.1f} µm in a cycle"
            in row(charge_displacement, 40).holds
        )
        assert (
            f"whose stroke is {1e3 * ALPHA * np.ptp(q[-50:]):.0f} µm"
            in row(charge_displacement, 40).holds
        )


@pytest.mark.slow
def test_the_speed_of_what_is_called_steady():
    assert claim(
        charge_displacement, "speed of the mechanical displacement in its steady state"
    ).reproduced == pytest.approx(1e3 * FLOW)


@pytest.mark.parametrize(("frequency", "where"), [(0.2, "0.2"), (0.1, "0.1")])
def test_row_41_a_lag_encloses_what_its_equations_enclose(frequency, where):
    """Integrate charge, lag and saturation by scipy, and the last cycle's area by trapezia."""

    def rates(t, y):
        current = 0.9 * (1 if (t * frequency) % 1 < 0.5 else -1)
        into = (R2 * current - y[0] / C) / (R1 + R2)
        return [into, into - y[1] / charge_displacement.LAG]

    t = np.linspace(0, 60, 60001)
    q, pending = solve_ivp(rates, (0, 60), [0, 0], t_eval=t, max_step=0.02, rtol=1e-8).y
    acting = q - pending
    full = charge_displacement.SATURATION
    x = ALPHA * full * np.tanh(acting / full)
    areas = []
    for n in range(round(60 * frequency)):
        cycle = slice(round(n / frequency * 1000), round((n + 1) / frequency * 1000) + 1)
        chord = 0.5 * (q[cycle][-1] + q[cycle][0]) * (x[cycle][0] - x[cycle][-1])
        areas.append(np.trapezoid(q[cycle], x[cycle]) + chord)
    found = 1e3 * charge_displacement.read(frequency, lagging=True, drift=True).area.value
    assert found == pytest.approx(
        np.mean(areas), rel=0.05
    )  # the flow is estimated, and there is noise
    assert float(
        re.search(rf"(\d\.\d+) mm·C at {where} Hz", row(charge_displacement, 41).holds)[1]
    ) == pytest.approx(found, abs=6e-4)


def test_row_41_a_line_encloses_nothing():
    found = claim(charge_displacement, "whether loops of eq. 3.4 enclose an area")
    assert (found.published, found.reproduced) == ("yes", "no")
    low, high = charge_displacement.read(0.1, drift=True).area.interval
    # noise of every sample stands beside a step of the charge: a deviation for a cycle, and six of
    # them
    q = charge(0.1)[-101:]
    deviation = 3e-6 * np.sqrt(np.sum((0.5 * (q[2:] - q[:-2])) ** 2) / 6)
    assert low <= 0.0 <= high
    assert high - low < 4 * 2.57 * deviation
