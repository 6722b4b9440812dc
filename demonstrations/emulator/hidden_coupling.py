"""Hidden variations of the coupling of charge, load and elongation."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from demonstrations.emulator.physics import Array, Physics

_PLAYS = 8  # play operators of the hysteresis
_SHORTEST = 1e-8  # s, in place of a lag of zero


@dataclass
class LoadDependentVoltage(Physics):
    """The films' voltage rises with a tensile load, less than proportionally."""

    linear: ClassVar[bool] = False
    sensitivity: float = 0.02  # V/N, of a small load
    levelling_load: float = 8.0  # N, at which the voltage has half the height of a proportional one

    def capacitor_voltage(self, state: Array, force: Any) -> Any:
        """Add the voltage of the load to that of the charge."""
        return super().capacitor_voltage(state, force) + self.sensitivity * force / (
            1 + abs(force) / self.levelling_load
        )


@dataclass
class EvenStrain(Physics):
    """Unequal elongation in oxidation and reduction: an even hyperbolic cosine of charge."""

    evenness: float = 5e-6  # m/C^2, of a small charge
    cosine_charge: float = 3.0  # C

    def electrochemical_length(self, charge: Any) -> Any:
        """Add the even part of the elongation."""
        even = 2 * self.cosine_charge**2 * (np.cosh(charge / self.cosine_charge) - 1)
        return super().electrochemical_length(charge) + self.evenness * even


@dataclass
class SaturatingStrain(Physics):
    """The elongation of the films saturates with the charge."""

    saturation: float = 1 / 3.0  # 1/C, inverse of that charge

    def electrochemical_length(self, charge: Any) -> Any:
        """Divide by (1 + |Q/Qs|^3)^(1/3), deliberately none of the usual sigmoids."""
        return super().electrochemical_length(charge) / np.cbrt(
            1 + np.abs(self.saturation * charge) ** 3
        )


@dataclass
class LaggingStrain(Physics):
    """The charge passes two first-order lags before it elongates the films."""

    linear: ClassVar[bool] = True
    extra_states: ClassVar[int] = 2  # charge after each stage, C
    lag: float = 1.0  # s, of both stages together
    late_share: float = 0.2  # of the lag, in the second stage

    def active_charge(self, state: Array) -> Any:
        """Return the charge with that after the second stage in place of its own."""
        return super().active_charge(state) - state[0] + self.own(LaggingStrain, state)[1]

    def rates(self, state: Array, current: Any, force: Any) -> list[Any]:
        """Append the rates of both stages of the lag."""
        first, second = self.own(LaggingStrain, state)
        early, late = (
            max(self.lag * share, _SHORTEST) for share in (1 - self.late_share, self.late_share)
        )
        return [
            *super().rates(state, current, force),
            (state[0] - first) / early,
            (first - second) / late,
        ]


@dataclass
class PlayingStrain(Physics):
    """A share of the charge elongates the films through play operators of several widths."""

    playing_share: float = 0.2
    widest_play: float = 1.0  # C, half the width of the widest loop

    def electrochemical_length(self, charge: Any) -> Any:
        """Replace a share of the charge by the mean of Prandtl's play operators."""
        return super().electrochemical_length(
            charge + self.playing_share * (self.play(charge) - charge)
        )

    def play(self, charge: Array) -> Array:
        """Return the mean of the play operators over a record of charge (n,)."""
        radii = self.widest_play * np.arange(1, _PLAYS + 1) / _PLAYS
        mean = np.empty_like(charge)
        memory = np.zeros(_PLAYS)
        low, high = np.subtract.outer(charge, radii), np.add.outer(charge, radii)
        for k in range(charge.size):
            memory = np.maximum(low[k], np.minimum(high[k], memory))
            mean[k] = memory.sum() / _PLAYS
        return mean


@dataclass
class ChargedSoftness(Physics):
    """The compliance of both springs rises with charge, between two limits."""

    linear: ClassVar[bool] = False
    softness: float = 0.05  # 1/C, relative rise of both compliances per charge, about zero
    softness_charge: float = 3.0  # C

    def _compliance(self, state: Array) -> Any:
        return 1 + self.softness * self.softness_charge * np.tanh(state[0] / self.softness_charge)

    def spring_length(self, state: Array, force: Any) -> Any:
        """Return the length of the instantaneous spring with the compliance of this charge."""
        return super().spring_length(state, force) * self._compliance(state)

    def creep_force(self, state: Array) -> Any:
        """Return the force of the creep spring with the compliance of this charge."""
        return super().creep_force(state) / self._compliance(state)
