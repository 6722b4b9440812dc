"""Conversions of sensors against the tables of standards, closed forms, NumPy and SciPy."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from orchestration.plugins.calibration.conversions import (
    beta,
    divider,
    emf,
    inverse,
    polynomial,
    rtd,
    steinhart_hart,
    table,
    thermocouple,
)

# mV by degC, from the tables of NIST Monograph 175, which are those of IEC 60584-1
EMF = {
    "B": {100: 0.033, 200: 0.178, 400: 0.787, 800: 3.154, 1000: 4.834, 1500: 10.099, 1800: 13.591},
    "E": {-250: -9.718, -100: -5.237, -50: -2.787, 100: 6.319, 500: 37.005, 800: 61.017},
    "J": {-200: -7.89, -50: -2.431, 100: 5.269, 500: 27.393, 800: 45.494, 1000: 57.953},
    "K": {-250: -6.404, -200: -5.891, -100: -3.554, 100: 4.096, 500: 20.644, 1000: 41.276},
    "N": {-250: -4.313, -200: -3.99, -50: -1.269, 100: 2.774, 500: 16.748, 1200: 43.846},
    "R": {100: 0.647, 500: 4.471, 1000: 10.506, 1200: 13.228, 1500: 17.451, 1700: 20.222},
    "S": {100: 0.646, 500: 4.233, 1000: 9.587, 1200: 11.951, 1500: 15.582, 1700: 17.947},
    "T": {-250: -6.18, -200: -5.603, -100: -3.379, 50: 2.036, 100: 4.279, 200: 9.288},
}
# the largest and smallest temperatures of the standard, degC
ENDS = {
    "B": (43, 1820),
    "E": (-270, 1000),
    "J": (-210, 1200),
    "K": (-270, 1372),
    "N": (-270, 1300),
    "R": (-50, 1768.1),
    "S": (-50, 1768.1),
    "T": (-270, 400),
}
ROUNDING = 0.5001e-3  # of the tables, mV


@pytest.mark.parametrize("kind", EMF)
def test_thermocouples_are_those_of_the_standard(kind: str) -> None:
    couple = partial(thermocouple, type=kind, cold_junction=0.0)
    for temperature, voltage in EMF[kind].items():
        assert emf(kind, temperature) == pytest.approx(voltage, abs=ROUNDING)
        low, high = (couple(1e-3 * (voltage + sign * ROUNDING)) for sign in (-1, 1))
        assert low <= temperature <= high


@pytest.mark.parametrize("kind", EMF)
def test_a_thermocouple_beyond_its_range_has_no_value(kind: str) -> None:
    couple = partial(thermocouple, type=kind, cold_junction=0.0)
    low, high = ENDS[kind]
    inside = 0.01
    assert couple(1e-3 * emf(kind, low + inside)) == pytest.approx(low + inside)
    assert couple(1e-3 * emf(kind, high - inside)) == pytest.approx(high - inside)
    for voltage in (emf(kind, low) - 1e-3, emf(kind, high) + 1e-3, math.nan, math.inf):
        assert math.isnan(couple(1e-3 * voltage))


@pytest.mark.parametrize("power", [1, 3, 9, 25])
def test_a_root_of_a_flat_or_steep_function_is_found(power: int) -> None:
    for value in (0.0, 1e-12, 0.3, 1.0):
        root = inverse(lambda x: x**power, value, 0.0, 1.0)
        assert abs(root - value ** (1 / power)) < 1e-10 or abs(root**power - value) < 1e-15
        assert inverse(lambda x: x**power, value, -1.0, 2.0) ** power == pytest.approx(value)
    assert math.isnan(inverse(lambda x: x**power, 1.1, 0.0, 1.0))


def test_a_cold_junction_adds_its_emf() -> None:
    # type K: 4.096 mV at 100 degC, 1.000 mV at 25 degC
    couple = partial(thermocouple, type="K", cold_junction=25.0)
    assert couple(3.096e-3) == pytest.approx(100.0, abs=0.03)
    assert couple(0.0) == pytest.approx(25.0, abs=1e-6)


@pytest.mark.parametrize(
    ("temperature", "resistance"),
    [(-200, 18.52), (-100, 60.26), (-50, 80.31), (0, 100), (100, 138.51), (850, 390.48)],
)
def test_a_pt100_is_that_of_the_standard(temperature: float, resistance: float) -> None:
    # IEC 60751, table 1
    inside = min(max(resistance, 18.53), 390.47)
    assert rtd(inside) == pytest.approx(temperature, abs=0.05)
    assert rtd(10 * inside, r0=1000.0) == pytest.approx(rtd(inside))
    low, high = (rtd(resistance + sign * 0.005) for sign in (-1, 1))
    assert not (low > temperature)
    assert not (high < temperature)


def test_a_pt100_that_is_open_or_short_has_no_value() -> None:
    for resistance in (0.0, 18.5, 390.5, 1e6, math.inf, math.nan):
        assert math.isnan(rtd(resistance))
    # the quadratic's root above 0 degC
    a, b = 3.9083e-3, -5.775e-7
    root = (-a + math.sqrt(a * a - 4 * b * (1 - 1.2))) / (2 * b)
    assert rtd(120.0) == pytest.approx(root, abs=1e-8)


def test_a_thermistor_has_the_temperature_of_its_equation() -> None:
    ntc = partial(beta, beta=3950.0, resistance=10e3, span=(-40.0, 125.0))
    for temperature in (-40.0, 0.0, 25.0, 100.0):
        kelvin = temperature + 273.15
        resistance = 10e3 * math.exp(3950.0 * (1 / kelvin - 1 / 298.15))
        assert ntc(resistance * (1.0 - 1e-12)) == pytest.approx(temperature, abs=1e-8)
    for resistance in (0.0, -1.0, 10.0, 1e7, math.nan, math.inf):
        assert math.isnan(ntc(resistance))
    # the inverse of Steinhart and Hart's equation is the root of a cubic
    a, b, c = 1.1292e-3, 2.3411e-4, 8.7755e-8
    hart = partial(steinhart_hart, a=a, b=b, c=c, span=(-40.0, 125.0))
    for temperature in (-30.0, 25.0, 110.0):
        roots = np.roots([c, 0.0, b, a - 1.0 / (temperature + 273.15)])
        logarithm = float(roots[np.abs(roots.imag) < 1e-9].real[0])
        assert hart(math.exp(logarithm)) == pytest.approx(temperature, abs=1e-8)


def test_a_divider_has_the_resistance_of_kirchhoffs_laws() -> None:
    for resistance in (100.0, 10e3, 1e6):
        current = 5.0 / (resistance + 22e3)
        low = partial(divider, supply=5.0, resistor=22e3)
        high = partial(divider, supply=5.0, resistor=22e3, sensor="high")
        assert low(resistance * current) == pytest.approx(resistance)
        assert high(5.0 - resistance * current) == pytest.approx(resistance)
    for volts in (0.0, 5.0, -0.1, 5.1, math.nan):
        assert math.isnan(low(volts))


def test_polynomials_and_tables_are_those_of_numpy_and_scipy() -> None:
    coefficients = (1.5, -2.0, 0.25, 0.125)
    points = ((-1.0, 8.0), (0.0, 3.0), (0.5, 2.5), (4.0, -7.0))
    signals, values = zip(*points, strict=True)
    spline = make_interp_spline(signals, values, k=1)
    for signal in np.linspace(-1.0, 4.0, 101):
        assert polynomial(signal, coefficients=coefficients) == pytest.approx(
            np.polyval(coefficients[::-1], signal)
        )
        assert table(signal, points=points) == pytest.approx(spline(signal))
    for signal in (-1.001, 4.001, math.nan):
        assert math.isnan(table(signal, points=points))
