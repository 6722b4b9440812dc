"""A voice-coil bench with an actuator clamped to it, integrated step by step.

It shares no code with the components. Coil, slide, films and filter are one set of differential
equations (Runge-Kutta of fourth order, fixed steps that end on every sample of controller and
record). Dry friction changes its sign within a velocity, as that of a greased slide, which creeps
where a dry one sticks. Steps are short for it. Taken after each step instead (Moreau's time
stepping), it lets the slide creep by a velocity of the step, and moves it by half a step's braking
farther than it is fast: a moving mass of 30 g is then fitted as 19 g.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
NOMINAL = {
    # coil, slide and load cell: thesis, appendix A1
    "R": 3.0,
    "L": 1e-3,
    "K": 3.9,
    "m": 0.03,
    "b_vc": 6.0,
    # films: thesis, table 3-1 and fig. 3-9
    "R1": 0.43,
    "R2": 2.35,
    "C": 2.70,
    "alpha": 6.8e-5,
    "k1": 6300.0,
    "b1": 1.7e6,
    "k2": 1.0e4,
    "b2": 2.0e6,
}
_CORNER = 2.0 * math.pi * 100.0  # rad/s, of the filter of the load cell
_B0 = 0.66  # V/N, thesis eq. 2.2
_B1 = -0.06  # V/N
_HIGHEST = 10.0  # V, of the amplifier; the lowest is zero
PERIOD = 1.0 / 30.0  # s, of the controller
# states, then what follows from them and the voltage of the controller
_SIGNALS = (
    "coil_current",
    "position",
    "velocity",
    "force_measured",
    "charge",
    "kelvin_elongation",
    "maxwell_elongation",
    "tension",
    "voltage",
    "coil_voltage",
)
_STEP = 2e-4  # s, at most; the coil's own time is 0.33 ms
_CREEPING_STEP = 5e-5  # s, the same with dry friction, which is as fast as 0.04 ms


@dataclass(frozen=True)
class Bench:
    """A specimen on a bench.

    Attributes
    ----------
    values : dict of str to float
        Parameters, SI.
    phase : float
        Time of the first sample of the controller, seconds.
    jitter : float
        Standard deviation of the times of the others, seconds.
    dry_friction : float
        Newtons.
    creep : float
        Velocity within which dry friction changes its sign, m/s.
    """

    values: dict[str, float] = field(default_factory=lambda: dict(NOMINAL))
    phase: float = 0.0
    jitter: float = 0.0
    dry_friction: float = 0.0
    creep: float = 1e-3

    period: ClassVar[float] = PERIOD  # of what samples

    @property
    def true(self) -> dict[str, float]:
        """Values by the names of the parameters that mean the same in the models."""
        return self.values | {"sample_shift": self.phase, "coulomb_force": self.dry_friction}

    def run(
        self, time: Array, reference: Array, current: Array, noise: float, seed: int
    ) -> dict[str, Array]:
        """Simulate the bench from rest; inputs are held from sample to sample.

        Parameters
        ----------
        time, reference, current : ndarray, shape (n,)
            Seconds, N, A.
        noise : float
            Of the load cell, as the controller reads it, N.
        seed : int

        Returns
        -------
        dict of str to ndarray, shape (n,)
            Without noise: tension and measured force in N, position in m, voltages in V, and
            the other states.
        """
        due, noises = self._controller_samples(time, noise, seed)
        state = [0.0] * 7
        command = 0.0
        previous = 0.0
        rows = []
        for k, now in enumerate(time.tolist()):
            outputs = [self._tension(state), self._voltage(state, current[k]), command]
            rows.append([*state, *outputs])
            end = float(time[k + 1]) if k + 1 < time.size else now
            while now < end:
                if due[0] <= now:
                    due.pop(0)
                    error = float(reference[k]) - state[3] - noises.pop(0)
                    command = min(max(command + _B0 * error + _B1 * previous, 0.0), _HIGHEST)
                    previous = error
                until = min(end, due[0])
                state = self._advance(state, until - now, command, float(current[k]))
                now = until
        return dict(zip(_SIGNALS, np.array(rows).T, strict=True))

    def _controller_samples(
        self, time: Array, noise: float, seed: int
    ) -> tuple[list[float], list[float]]:
        """Return when the controller samples, infinity last, and the noise that it reads then."""
        random = np.random.default_rng(seed)
        count = math.ceil((time[-1] - time[0]) / PERIOD) + 1
        instants = time[0] + self.phase + PERIOD * np.arange(count)
        instants[1:] += self.jitter * random.standard_normal(count - 1)
        noises = noise * random.standard_normal(count)
        return [*instants.tolist(), math.inf], noises.tolist()

    def _tension(self, state: list[float]) -> float:
        _, x, _, _, q, kelvin, maxwell = state
        return max(self.values["k1"] * (x - self.values["alpha"] * q - kelvin - maxwell), 0.0)

    def _voltage(self, state: list[float], current: float) -> float:
        p = self.values
        into = (p["R2"] * current - state[4] / p["C"]) / (p["R1"] + p["R2"])
        return p["R1"] * into + state[4] / p["C"]

    def _advance(
        self, state: list[float], duration: float, volts: float, current: float
    ) -> list[float]:
        step = _CREEPING_STEP if self.dry_friction else _STEP
        count = max(1, math.ceil(duration / step - 1e-9))
        h = duration / count
        for _ in range(count):
            k1 = self._rates(state, volts, current)
            k2 = self._rates(_moved(state, 0.5 * h, k1), volts, current)
            k3 = self._rates(_moved(state, 0.5 * h, k2), volts, current)
            k4 = self._rates(_moved(state, h, k3), volts, current)
            mean = [
                (a + 2.0 * b + 2.0 * c + d) / 6.0 for a, b, c, d in zip(k1, k2, k3, k4, strict=True)
            ]
            state = _moved(state, h, mean)
        return state

    def _rates(self, state: list[float], volts: float, current: float) -> list[float]:
        p = self.values
        i, _, v, filtered, q, kelvin, _ = state
        tension = self._tension(state)
        friction = p["b_vc"] * v + self.dry_friction * math.tanh(v / self.creep)
        return [
            (volts - p["R"] * i - p["K"] * v) / p["L"],
            v,
            (p["K"] * i - friction - tension) / p["m"],
            _CORNER * (tension - filtered),
            (p["R2"] * current - q / p["C"]) / (p["R1"] + p["R2"]),
            (tension - p["k2"] * kelvin) / p["b2"],
            tension / p["b1"],
        ]


def _moved(state: list[float], h: float, rates: list[float]) -> list[float]:
    return [x + h * r for x, r in zip(state, rates, strict=True)]
