"""Claims: a magnitude is what 95 % of a signal stay below, rounded down to 1, 2 or 5; the sampling
is that of the record.
"""

from __future__ import annotations

import numpy as np

from fmus.kit import Component, Input, Output, Parameter, State
from orchestration.discrepancy.candidates.scales import sampling_of, signal_scales


class Drive(Component):
    """First order."""

    name = "drive"
    gain = Parameter(3.0, "rad/s/V", min=1e-6)
    lag = Parameter(0.3, "s", min=1e-3)
    voltage = Input("V")
    omega = State("rad/s", rate="omega_rate")

    def drag(self):
        """Speed that is lost."""
        return self.omega

    def omega_rate(self):
        """First order."""
        return (self.gain * self.voltage - self.drag()) / self.lag

    @Output("rad/s")
    def speed(self):
        """As measured."""
        return self.omega


def test_magnitudes_are_those_of_the_record_to_one_figure():
    time = 0.01 * np.arange(4000)
    found = signal_scales(Drive, time, {"voltage": np.full(4000, 2.4)}, {"gain": 30.0})
    # it comes to 72 rad/s; its rate is 240 rad/s^2 exp(-t / 0.3 s), which after 5 % of the 40 s is
    # 0.3
    assert found == {"voltage": 2.0, "omega": 50.0, "drag": 50.0, "speed": 50.0, "omega_rate": 0.2}


def test_what_is_next_to_nothing_has_no_magnitude():
    """Its third power would be zero, and what is divided by that no number."""
    time = 0.01 * np.arange(400)
    assert signal_scales(Drive, time, {"voltage": np.full(400, 1e-150)}, {}) == {}


def test_the_sampling_is_the_median_step_and_the_length_to_two_figures():
    time = np.delete(60.03 * np.arange(1001), [7, 8, 500])
    found = sampling_of(time)
    assert (found.step, found.duration) == (60.0, 60000.0)


class Growing(Component):
    """It grows without bounds."""

    name = "growing"
    rate = Parameter(1.0, "1/s")
    level = State("m", rate="growth", start=1.0)

    def growth(self):
        """In proportion."""
        return self.rate * self.level

    @Output("m")
    def shown(self):
        """As measured."""
        return self.level


def test_what_runs_away_has_no_magnitude():
    assert set(signal_scales(Growing, np.linspace(0.0, 10.0, 50), {}, {})) >= {"level", "growth"}
    assert "level" not in signal_scales(Growing, np.linspace(0.0, 300.0, 50), {}, {})
