"""The vertical stand with an actuator under weights, integrated by SciPy.

It shares no code with the components. Where the core rubs, the velocity that friction turns against
is the true one, which depends on the rate of the tension: at each instant their equation is solved.
A weight that swings is a pendulum of any amplitude.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

Array = NDArray[np.float64]
PERIOD = 0.1  # s, of LabVIEW
_GRAVITY = 9.80665  # m/s^2
_PLACING = 0.05  # s


@dataclass(frozen=True)
class Stand:
    """A specimen on the stand.

    Attributes
    ----------
    values : dict of str to float
        Parameters of the actuator, SI.
    friction, creep : float
        Of the core, N, and the velocity within which it changes its sign, m/s.
    angle, length, decay : float
        Amplitude of weights that swing from the start, rad, their pendulum, m, and its time, s.
    lean : float
        Angle between LVDT and actuator, rad.
    compliance : float
        Of the frame, m/N.
    lag : float
        By which elongation follows charge, s.
    sensitivity : float
        Voltage of the films per load, V/N.
    """

    values: dict[str, float]
    friction: float = 0.0
    creep: float = 1e-5
    angle: float = 0.0
    length: float = 0.1
    decay: float = 10.0
    lean: float = 0.0
    compliance: float = 0.0
    lag: float = 0.0
    sensitivity: float = 0.0

    period: ClassVar[float] = PERIOD  # of what samples

    @property
    def true(self) -> dict[str, float]:
        """Values by the names of the parameters that mean the same in the models."""
        return self.values | {
            "placing_time": _PLACING,
            "core_mass": 0.0,
            "sample_shift": 0.0,
            "core_friction": self.friction,
            "swing_square": self.angle**2,
            "misalignment_loss": 1.0 - math.cos(self.lean),
            "frame_compliance": self.compliance,
            "lag_time": self.lag,
            "voltage_per_force": self.sensitivity,
        }

    def run(self, time: Array, mass: Array, current: Array) -> dict[str, Array]:
        """Simulate from rest; inputs are held from sample to sample.

        Parameters
        ----------
        time, mass, current : ndarray, shape (n,)
            Seconds, kg, A.

        Returns
        -------
        dict of str to ndarray, shape (n,)
            Voltage, V, and displacement as LabVIEW reads it at its samples, m.
        """
        state = np.array([0.0, 0.0, 0.0, 0.0, 0.0, self.angle, 0.0])
        voltage, position = [], []
        for k, now in enumerate(time):
            voltage.append(self._voltage(state, current[k]))
            position.append(self._core(state))
            if k + 1 < time.size:
                inputs = float(mass[k]), float(current[k])
                solved = solve_ivp(
                    self._rates,
                    (now, time[k + 1]),
                    state,
                    "LSODA",
                    args=inputs,
                    rtol=1e-7,
                    atol=1e-9,
                )
                state = solved.y[:, -1]
        return {
            "actuator.voltage": np.array(voltage),
            "displacement_measured": np.array(position),
        }

    def _rates(self, _: float, state: Array, mass: float, current: float) -> list[float]:
        p = self.values
        charge, active, kelvin, _, tension, angle, turning = state
        charging = (p["R2"] * current - self._film_voltage(state)) / (p["R1"] + p["R2"])
        following = (charge - active) / self.lag if self.lag else charging
        creeping = (tension - p["k2"] * kelvin) / p["b2"]
        flowing = tension / p["b1"]
        drifting = p["alpha"] * following + creeping + flowing
        pull = mass * (_GRAVITY * math.cos(angle) + self.length * turning**2)
        return [
            charging,
            following,
            creeping,
            flowing,
            self._tension_rate(pull - tension, drifting),
            turning,
            -_GRAVITY / self.length * math.sin(angle) - 2.0 * turning / self.decay,
        ]

    def _tension_rate(self, excess: float, drifting: float) -> float:
        """Return the rate of the tension, which moves the core, whose friction changes the rate."""
        plain = excess / _PLACING
        if not self.friction:
            return plain
        most = self.friction / _PLACING

        def left(rate: float) -> float:
            velocity = drifting + rate / self.values["k1"]
            return rate - plain + most * math.tanh(velocity / self.creep)

        return float(brentq(left, plain - 1.01 * most, plain + 1.01 * most, xtol=1e-12))

    def _film_voltage(self, state: Array) -> float:
        return float(state[0] / self.values["C"] + self.sensitivity * state[4])

    def _voltage(self, state: Array, current: float) -> float:
        p = self.values
        film = self._film_voltage(state)
        return film + p["R1"] * (p["R2"] * current - film) / (p["R1"] + p["R2"])

    def _core(self, state: Array) -> float:
        p = self.values
        charge, active, kelvin, maxwell, tension, *_ = state
        moved = p["alpha"] * (active if self.lag else charge)
        lowered = moved + kelvin + maxwell + tension / p["k1"] + self.compliance * tension
        return float(lowered * math.cos(self.lean))
