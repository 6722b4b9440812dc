"""Bench with a voice coil that pulls on the actuator under force control at 30 Hz (section 2.2).

Values are those of appendix A1 and eq. 2.2 where the source contradicts itself (errata 2, 3 and 5).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from demonstrations.emulator.physics import Array, Physics
from demonstrations.emulator.stepping.plants import Spring
from demonstrations.emulator.stepping.transitions import Switching

_LONGEST = 1e-3  # s; mass and spring swing in 14 ms
_LONGEST_NOT_LINEAR = 5e-4  # s
_SAME = 1e-9  # s, largest difference of equal instants


@dataclass(frozen=True)
class Coil:
    """Coil, slide, sensors and controller, in SI units."""

    resistance: float = 3.0  # ohm
    inductance: float = 1e-3  # H
    force_constant: float = 3.9  # N/A, and V.s/m
    mass: float = 0.03  # kg
    damping: float = 6.0  # N.s/m
    filter_rate: float = 2 * np.pi * 100.0  # 1/s, of load cell and potentiometer
    sampling: float = 1 / 30  # s
    gains: tuple[float, float] = (0.66, -0.06)  # V/N, of the present and of the previous error
    supply: tuple[float, float] = (0.0, 10.0)  # V


class BenchPlant:
    """Bench with a closed force loop.

    Its states are those of the actuator, and current, position, velocity and two filters.

    Parameters
    ----------
    physics : Physics
    coil : Coil
    """

    inputs: ClassVar[tuple[str, ...]] = ("force_reference", "current")

    def __init__(self, physics: Physics, coil: Coil | None = None):
        self.physics = physics
        self.coil = coil or Coil()
        self.spring = Spring(physics)
        self.order = physics.order + 5
        self.voltage = 0.0  # V, output of the controller
        self.released = True
        self._error = 0.0
        self._samples = 0
        self._piece = _LONGEST if self.spring.is_linear else _LONGEST_NOT_LINEAR
        regimes = [_Regime(self, taut=False), _Regime(self, taut=True)]
        self._switching = Switching(regimes, lambda state, _: self._gap(state), self._piece)

    def release(self) -> None:
        """Set the voltage of the coil to zero until the next command."""
        self.voltage = 0.0
        self._error = 0.0
        self.released = True

    def hold(self, state: Array, commands: Array, time: float) -> Array:
        """Run the controller if a sample is due; return current (A) and coil voltage (V)."""
        reference, current = commands
        if time >= self._samples * self.coil.sampling - _SAME:
            self._samples += 1
            if not self.released:
                self._control(reference - state[self.physics.order + 3])
        return np.array([current, self.voltage])

    def _control(self, error: float) -> None:
        """Apply eq. 2.2 with a limited voltage, which is also that of the next step."""
        now, before = self.coil.gains
        low, high = self.coil.supply
        step = now * error + before * self._error
        self.voltage = min(max(self.voltage + step, low), high)
        self._error = error

    def longest(self, time: float) -> float:
        """Return the time (s) until the next sample of the controller, or at most a piece."""
        return float(min(self._piece, max(self._samples * self.coil.sampling - time, _SAME)))

    def advance(self, state: Array, held: Array, duration: float) -> Array:
        """Advance the state, with changes between slack and taut."""
        return self._switching(state, held, duration)

    def _gap(self, state: Array) -> float:
        n = self.physics.order
        return self.spring.gap(state[:n], state[n + 1])

    def terminal(self, state: Array, held: Array) -> Array:
        """Return current (A) and tension (N), which is zero for a slack film."""
        gap = self._gap(state)
        return np.array(
            [held[0], self.spring.tension(state[: self.physics.order], gap) if gap > 0 else 0.0]
        )

    def shown(self, state: Array, held: Array) -> dict[str, float]:
        """Return the signals of the coil, of the filtered sensors, and the tension."""
        n = self.physics.order
        current, position, velocity, force, filtered = state[n:].tolist()
        return {
            "position": position,
            "velocity": velocity,
            "coil_current": current,
            "coil_voltage": float(held[1]),
            "force_measured": force,
            "position_measured": filtered,
            "tension": float(self.terminal(state, held)[1]),
        }

    def rates(self, state: Array, current: Any, voltage: Any, taut: bool) -> list[Any]:
        """Return the time derivatives of all states, for a taut or slack film."""
        n = self.physics.order
        c = self.coil
        amperes, position, velocity, force, filtered = state[n:]
        tension = self.spring.tension(state[:n], self._gap(state)) if taut else 0.0
        return [
            *self.physics.rates(state[:n], current, tension),
            (voltage - c.resistance * amperes - c.force_constant * velocity) / c.inductance,
            velocity,
            (c.force_constant * amperes - c.damping * velocity - tension) / c.mass,
            c.filter_rate * (tension - force),
            c.filter_rate * (position - filtered),
        ]


class _Regime:
    """Motion of a bench whose film is taut, or slack."""

    def __init__(self, bench: BenchPlant, taut: bool):
        self._bench = bench
        self._taut = taut
        self.order = bench.order
        self.is_linear = bench.spring.is_linear if taut else bench.physics.is_linear

    def rates(self, state: Array, current: Any, voltage: Any) -> list[Any]:
        """Return the rates of the bench in this regime."""
        return self._bench.rates(state, current, voltage, self._taut)
