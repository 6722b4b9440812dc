"""Hidden variations that are in no catalogue: disturbances of the bench."""

from dataclasses import dataclass

import numpy as np

from demonstrations.emulator.physics import Array, Physics, Signals, Trajectory

_GRID = 0.5  # s, step of the random walk of temperature


@dataclass
class Hum(Physics):
    """Disturbance by a machine: a tone with a second harmonic."""

    hum_output: str = "displacement"
    hum_amplitude: float = 5e-6  # V or m
    hum_frequency: float = 1.0  # Hz
    hum_phase: float = 0.0  # rad

    def sensed(self, run: Trajectory, time: Array) -> Signals:
        """Add the tone, also above half the sampling frequency, where it is aliased."""
        signals = super().sensed(run, time)
        angle = 2 * np.pi * self.hum_frequency * time + self.hum_phase
        tone = self.hum_amplitude * (np.sin(angle) + 0.3 * np.sin(2 * angle + 1.0))
        return signals | {self.hum_output: signals[self.hum_output] + tone}


@dataclass
class SlippingClamp(Physics):
    """The clamp slips a few times, permanently and in one direction."""

    slip: float = 2e-5  # m, mean
    slip_seed: int = 0

    def sensed(self, run: Trajectory, time: Array) -> Signals:
        """Add the slips so far."""
        random = np.random.default_rng(self.slip_seed)
        signals = super().sensed(run, time)
        count = int(random.integers(3, 9))
        instants = random.uniform(0.05, 0.95, count) * run.time[-1]
        lengths = random.exponential(self.slip, count)
        slipped = (time[:, np.newaxis] >= instants) @ lengths
        return signals | {"displacement": signals["displacement"] + slipped}


@dataclass
class RestlessAir(Physics):
    """The room temperature is a random walk, which the frame follows with a lag and expands."""

    expansion: float = 1e-5  # m, standard deviation of a minute's walk
    frame_time: float = 20.0  # s
    air_seed: int = 0

    def sensed(self, run: Trajectory, time: Array) -> Signals:
        """Add the expansion of the frame."""
        random = np.random.default_rng(self.air_seed)
        signals = super().sensed(run, time)
        grid = np.arange(run.time[0], run.time[-1] + 2 * _GRID, _GRID)
        air = np.cumsum(random.normal(0.0, self.expansion * np.sqrt(_GRID / 60), grid.size))
        frame = np.zeros(grid.size)
        for k in range(1, grid.size):
            frame[k] = frame[k - 1] - np.expm1(-_GRID / self.frame_time) * (
                air[k - 1] - frame[k - 1]
            )
        return signals | {"displacement": signals["displacement"] + np.interp(time, grid, frame)}


@dataclass
class LooseContact(Physics):
    """A contact of the supply line whose resistance comes and goes, and only adds a voltage."""

    contact_resistance: float = 0.02  # ohm, while bad
    contact_dwell: float = 15.0  # s, mean
    contact_seed: int = 0

    def sensed(self, run: Trajectory, time: Array) -> Signals:
        """Add the voltage across the contact."""
        random = np.random.default_rng(self.contact_seed)
        signals = super().sensed(run, time)
        span = run.time[-1] - run.time[0]
        dwells = random.exponential(self.contact_dwell, 20 + 3 * int(span / self.contact_dwell))
        bad = np.searchsorted(run.time[0] + np.cumsum(dwells), time, side="right") % 2
        current = run.at(time)[1][0]
        return signals | {"voltage": signals["voltage"] + self.contact_resistance * bad * current}


@dataclass
class LooseFixture(Physics):
    """A fixture that comes loose at an instant, and is compliant afterwards."""

    fixture_compliance: float = 1e-5  # m/N
    loosening: float = 0.5  # instant, as a fraction of the run from time zero

    def sensed(self, run: Trajectory, time: Array) -> Signals:
        """Add the elongation of the loose fixture."""
        signals = super().sensed(run, time)
        force = run.at(time)[1][1]
        loose = time >= self.loosening * run.time[-1]
        return signals | {
            "displacement": signals["displacement"] + self.fixture_compliance * loose * force
        }
