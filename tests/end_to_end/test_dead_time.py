"""Claims: a command that acts late is the cause; the extended model follows the record as it is.

Oracle: two tanks in a row whose pump starts late, solved by matrix exponentials. The naive way
beside it is the cross-correlation of the level's rate with the command.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.linalg import expm

import orchestration.api as ppy
from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.record.compiled import CompiledModel

AREA, OUTLET, GAIN = 0.8, 0.02, 3e-3  # m^2, m^2/s, m^3/s of a pump at full speed
FINE = 20  # parts of a sample, to which dead times are rounded


class Tanks(Component):
    """Two tanks in a row, the first filled by a pump, the second also from elsewhere."""

    name = "tanks"
    experiment = (2000.0, 2.0)

    area = Parameter(1.0, "m^2", min=0.01, max=100.0)
    outlet = Parameter(0.015, "m^2/s", min=1e-4, max=1.0)
    gain = Parameter(2.5e-3, "m^3/s", min=1e-5, max=1.0)
    pump = Input("1", display="%", doc="command")
    inflow = Input("m^3/s", nominal=1e-3, doc="from elsewhere")
    first = State("m", start=0.1, rate="first_rate", nominal=0.1)
    second = State("m", start=0.1, rate="second_rate", nominal=0.1)

    def pumped(self):
        """Flow of the pump."""
        return self.gain * self.pump

    def first_rate(self):
        """Balance of the first tank."""
        return (self.pumped() - self.outlet * self.first) / self.area

    def second_rate(self):
        """Balance of the second tank."""
        return (self.inflow + self.outlet * (self.first - self.second)) / self.area

    @Output("m", nominal=0.1)
    def level(self):
        """Level of the second tank."""
        return self.second


def drawn(seed: int, dead_time: float, step: float = 2.0, samples: int = 900):
    """Return time, command, inflow and level with noise of 1 % of its spread."""
    rng = np.random.default_rng(seed)
    time = step * np.arange(samples)
    pump = 0.5 + 0.4 * np.sign(np.sin(2.0 * np.pi * (time / 140.0 + 2e-6 * time**2)))
    inflow = 1e-3 * (1.0 + 0.5 * np.sin(2.0 * np.pi * time / 310.0 + rng.uniform(0.0, 6.0)))
    rates = np.array([[-OUTLET, 0.0], [OUTLET, -OUTLET]]) / AREA
    whole = np.zeros((4, 4))
    whole[:2, :2], whole[:2, 2:] = rates, np.diag([GAIN, 1.0]) / AREA
    part = expm(whole * step / FINE)
    x, levels = np.array([0.1, 0.1]), []
    for k in range(samples * FINE):
        if k % FINE == 0:
            levels.append(x[1])
        then = max(k - round(dead_time * FINE / step), 0) // FINE
        x = part[:2] @ [*x, pump[then], inflow[k // FINE]]
    noise = 0.01 * np.std(levels) * rng.standard_normal(samples)
    return time, pump, inflow, np.array(levels) + noise


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "dead_time"), [(12, 25.0), (13, 40.6), (24, 55.3)])
def test_a_pump_that_starts_late(seed, dead_time):
    time, pump, inflow, level = drawn(seed, dead_time)
    found = ppy.diagnose({"time": time, "pump": pump, "inflow": inflow, "level": level}, Tanks)
    assert found.causes[0] == "reading_late(pump)"
    assert "pump acts" in str(found)
    defaults = {p.name: p.start for p in found.model.layout.parameters}
    assert defaults["pump_delay"] == pytest.approx(dead_time, abs=0.1)
    for name, true in (("area", AREA), ("outlet", OUTLET), ("gain", GAIN)):
        assert defaults[name] == pytest.approx(true, rel=0.01)
    run = CompiledModel(found.model).run(time, {"pump": pump, "inflow": inflow}, {})
    error = np.std(run.signals["level"] - level) / np.std(level)
    naive = by_correlation(time, pump, level)
    print(f"delay {defaults['pump_delay']:.2f} s of {dead_time}, by correlation {naive:.0f} s")
    assert error < 0.015


def by_correlation(time, command, level):
    """Return the delay at which the rate of the level follows the command best, the naive way."""
    rate = np.gradient(level, time) - np.mean(np.gradient(level, time))
    centred = command - command.mean()
    products = [rate[k:] @ centred[: len(rate) - k] for k in range(60)]
    return float(np.argmax(products) * (time[1] - time[0]))


class Jacketed(Component):
    """A tank in a jacket that a valve heats, with a stream through it."""

    name = "jacketed"
    experiment = (5000.0, 2.0)

    heat_capacity = Parameter(8e4, "J/K", min=1e3, max=1e7)
    jacket_capacity = Parameter(2e4, "J/K", min=1e2, max=1e6)
    transfer = Parameter(700.0, "W/K", min=1.0, max=1e5)
    full_power = Parameter(2e4, "W", min=100.0, max=1e6)
    stream = Parameter(250.0, "W/K", min=1.0, max=1e4, fitted=False)
    valve = Input("1", start=0.4)
    inlet = Input("K", start=288.0, nominal=10.0)
    jacket = State("K", start=320.0, rate="jacket_rate", nominal=10.0)
    tank = State("K", start=312.0, rate="tank_rate", nominal=10.0)

    def exchanged(self):
        """Heat from jacket to tank."""
        return self.transfer * (self.jacket - self.tank)

    def jacket_rate(self):
        """Balance of the jacket."""
        return (self.full_power * self.valve - self.exchanged()) / self.jacket_capacity

    def tank_rate(self):
        """Balance of the tank."""
        return (self.exchanged() + self.stream * (self.inlet - self.tank)) / self.heat_capacity

    @Output("K", nominal=10.0)
    def temperature(self):
        """Temperature of the tank."""
        return self.tank


def heated(seed: int, dead_time: float, lag: float, step: float = 2.0, samples: int = 2500):
    """Return time, valve, inlet and temperature by a sensor that lags, with noise."""
    rng = np.random.default_rng(seed)
    valve = np.repeat(rng.choice([0.25, 0.4, 0.55, 0.7], samples // 100 + 1), 100)[:samples]
    inlet = 288.0 + np.repeat(rng.uniform(-3.0, 3.0, samples // 170 + 1), 170)[:samples]
    heat_capacity, jacket_capacity, transfer, full_power, stream = 83.6e3, 2e4, 900.0, 25e3, 250.0
    rates = np.array(
        [
            [-transfer / jacket_capacity, transfer / jacket_capacity, 0.0],
            [transfer / heat_capacity, -(transfer + stream) / heat_capacity, 0.0],
            [0.0, 1.0 / lag, -1.0 / lag],
        ]
    )
    by_inputs = np.zeros((3, 2))
    by_inputs[0, 0], by_inputs[1, 1] = full_power / jacket_capacity, stream / heat_capacity
    whole = np.zeros((5, 5))
    whole[:3] = np.hstack([rates, by_inputs])
    part = expm(whole * step / FINE)
    x = -np.linalg.solve(rates, by_inputs @ [valve[0], inlet[0]])
    temperatures = []
    for k in range(samples * FINE):
        if k % FINE == 0:
            temperatures.append(x[2])
        then = max(k - round(dead_time * FINE / step), 0) // FINE
        x = part[:3] @ [*x, valve[then], inlet[k // FINE]]
    noise = 0.08 * rng.standard_normal(samples)
    return step * np.arange(samples), valve, inlet, np.array(temperatures) + noise


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "dead_time"), [(41, 24.0), (44, 27.0)])
def test_a_valve_that_acts_late_is_the_first_guess_where_a_sensor_lags_too(seed, dead_time):
    """Neither is in the model, whose parameters make up for the dead time in part."""
    time, valve, inlet, temperature = heated(seed, dead_time, 6.0)
    record = {"time": time, "valve": valve, "inlet": inlet, "temperature": temperature}
    headline = str(ppy.diagnose(record, Jacketed)).splitlines()[0]
    first = re.search(r"\d % (.*?);", headline)[1]
    said = re.fullmatch(r"valve acts ([\d.]+) s later than it is recorded in .*", first)
    assert said, headline
    assert dead_time < float(said[1]) < dead_time + 2.0 * 6.0
