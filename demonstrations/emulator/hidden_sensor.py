"""Hidden variations of the sensors of voltage and displacement; the actuator is unchanged."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from demonstrations.emulator.physics import Array, Physics, Signals, Trajectory

_BEFORE = 1e-6  # of a step: the value before a jump of inputs is taken so shortly before its end


def two_stage_transition(sensor_time: float, duration: float) -> Array:
    """Return the transition (2, 4) of two equal stages over a duration (s).

    It applies to both stages, and value and slope of the signal at the start.
    """
    rate = 2 / sensor_time
    system = np.array([[-rate, 0, rate, 0], [rate, -rate, 0, 0], [0, 0, 0, 1], [0, 0, 0, 0]])
    return np.asarray(expm(system * duration)[:2])


@dataclass
class SluggishSensor(Physics):
    """A sensor with two equal, critically damped stages, in equilibrium at the start."""

    lag_output: str = "displacement"
    sensor_time: float = 0.2  # s, of both stages together

    def sensed(self, run: Trajectory, time: Array) -> Signals:
        """Return the response to a signal that is linear between knots and jumps with inputs."""
        signals = super().sensed(run, time)
        if self.sensor_time == 0:
            return signals
        knots = np.union1d(run.time, time)
        steps = np.diff(knots)
        value = super().sensed(run, knots)[self.lag_output]
        slope = (
            super().sensed(run, knots[1:] - _BEFORE * steps)[self.lag_output] - value[:-1]
        ) / steps
        durations, kind = np.unique(np.round(steps, 9), return_inverse=True)
        transitions = [two_stage_transition(self.sensor_time, t) for t in durations]
        stages = np.full((knots.size, 2), value[0])
        for k, duration_index in enumerate(kind.tolist()):
            stages[k + 1] = transitions[duration_index] @ np.array([*stages[k], value[k], slope[k]])
        return signals | {self.lag_output: stages[np.searchsorted(knots, time), 1]}


@dataclass
class LateSensor(Physics):
    """A sensor with a pure delay; before the run its signal is that of the start."""

    late_output: str = "displacement"
    delay: float = 0.1  # s

    def sensed(self, run: Trajectory, time: Array) -> Signals:
        """Return the signals with one delayed."""
        late = super().sensed(run, time - self.delay)[self.late_output]
        return super().sensed(run, time) | {self.late_output: late}


@dataclass
class MisscaledSensor(Physics):
    """A sensor with a gain error."""

    gain_output: str = "displacement"
    gain_error: float = 0.05  # relative

    def sensed(self, run: Trajectory, time: Array) -> Signals:
        """Return the signals with one scaled."""
        signals = super().sensed(run, time)
        return signals | {self.gain_output: (1 + self.gain_error) * signals[self.gain_output]}


@dataclass
class BiasedSensor(Physics):
    """A sensor with an offset."""

    bias_output: str = "voltage"
    bias: float = 0.01  # V or m

    def sensed(self, run: Trajectory, time: Array) -> Signals:
        """Return the signals with an offset of one."""
        signals = super().sensed(run, time)
        return signals | {self.bias_output: signals[self.bias_output] + self.bias}


@dataclass
class DriftingSensor(Physics):
    """A sensor that warms up from time zero, and drifts exponentially to a limit."""

    drift_output: str = "displacement"
    drift: float = 2e-8  # V/s or m/s, at first
    warming_time: float = 2000.0  # s

    def sensed(self, run: Trajectory, time: Array) -> Signals:
        """Return the signals with a drift of one."""
        signals = super().sensed(run, time)
        drifted = (
            -self.drift * self.warming_time * np.expm1(-np.maximum(time, 0.0) / self.warming_time)
        )
        return signals | {self.drift_output: signals[self.drift_output] + drifted}
