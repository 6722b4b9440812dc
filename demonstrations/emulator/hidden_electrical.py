"""Hidden variations of the electrical circuit."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from demonstrations.emulator.physics import Array, Physics

_CELLS = 30  # of the diffusion layer
_AMBIENT = 296.0  # K
_BREEZE = 10.0  # K, rise at which convection doubles the cooling


@dataclass
class DoubleLayer(Physics):
    """A double layer at the interface, with a charge transfer like Butler-Volmer's."""

    linear: ClassVar[bool] = False
    extra_states: ClassVar[int] = 1  # voltage across the layer, V
    transfer_resistance: float = 0.1  # ohm, of a small current
    layer_time: float = 0.2  # s, of a small current
    bending_voltage: float = 0.6  # V

    def capacitor_voltage(self, state: Array, force: Any) -> Any:
        """Add the layer's voltage to the films'."""
        return super().capacitor_voltage(state, force) + self.own(DoubleLayer, state)[0]

    def rates(self, state: Array, current: Any, force: Any) -> list[Any]:
        """Append the rate of the layer's voltage."""
        rates = super().rates(state, current, force)
        crossing = self.bending_voltage * np.sinh(
            self.own(DoubleLayer, state)[0] / self.bending_voltage
        )
        return [*rates, (self.transfer_resistance * rates[0] - crossing) / self.layer_time]


@dataclass
class DiffusionLayer(Physics):
    """Part of the series resistance is the diffusion of ions through a layer, in finite volumes.

    The concentration of each cell is expressed as the current of its steady state; it is zero at
    the end of the layer at the films.
    """

    extra_states: ClassVar[int] = _CELLS
    diffusing_share: float = 0.3  # of the series resistance
    diffusion_time: float = 10.0  # s, thickness squared over diffusivity

    def series_resistance(self, state: Array) -> Any:
        """Return the resistance without diffusion, plus half a cell."""
        return super().series_resistance(state) * (1 - self.diffusing_share * (1 - 0.5 / _CELLS))

    def capacitor_voltage(self, state: Array, force: Any) -> Any:
        """Add the voltage of the first cell."""
        across = (
            self.diffusing_share
            * super().series_resistance(state)
            * self.own(DiffusionLayer, state)[0]
        )
        return super().capacitor_voltage(state, force) + across

    def rates(self, state: Array, current: Any, force: Any) -> list[Any]:
        """Append the mass balance of every cell."""
        rates = super().rates(state, current, force)
        cells = self.own(DiffusionLayer, state)
        between = -_CELLS * np.diff(cells, axis=0)
        flux = np.concatenate([np.array(rates[:1]), between, 2 * _CELLS * cells[-1:]])
        gained = (flux[:-1] - flux[1:]) * (_CELLS / self.diffusion_time)
        return [*rates, *gained]


@dataclass
class OnsettingLeakage(Physics):
    """A second leakage that starts smoothly at a voltage, with the power 3/2 of the excess."""

    linear: ClassVar[bool] = False
    leakage_rise: float = 0.1  # A/V^1.5
    onset_voltage: float = 0.7  # V
    onset_width: float = 0.08  # V

    def leakage_current(self, voltage: Any) -> Any:
        """Add the second leakage, an odd function of the voltage."""
        exceeding = np.logaddexp(0, (np.abs(voltage) - self.onset_voltage) / self.onset_width)
        at_zero = np.logaddexp(0, -self.onset_voltage / self.onset_width)
        second = (self.onset_width * exceeding) ** 1.5 - (self.onset_width * at_zero) ** 1.5
        return super().leakage_current(voltage) + self.leakage_rise * np.sign(voltage) * second


@dataclass
class ChargeDependentCapacitance(Physics):
    """The inverse capacitance rises with the charge, between two levels."""

    linear: ClassVar[bool] = False
    # 1/C, relative rise of the inverse capacitance, per charge and about zero
    stiffening: float = 0.1
    levelling_charge: float = 3.0  # C

    def film_voltage(self, state: Array) -> Any:
        """Integrate 1/C (1 + a Q / sqrt(1 + (Q/Q0)^2)) over the charge."""
        levelling = self.levelling_charge
        charge = state[0]
        gained = self.stiffening * levelling**2 * (np.sqrt(1 + (charge / levelling) ** 2) - 1)
        return super().film_voltage(state) + gained / self.capacitance(state)


@dataclass
class GrowingResistance(Physics):
    """Series resistance that rises with the charge throughput, and saturates."""

    linear: ClassVar[bool] = False
    extra_states: ClassVar[int] = 1  # throughput, C
    growth: float = 0.5  # of the resistance, in the end
    endurance: float = 500.0  # C, throughput at half of the growth

    def series_resistance(self, state: Array) -> Any:
        """Return the resistance with a growth that saturates, as sites of damage are exhausted."""
        throughput = self.own(GrowingResistance, state)[0]
        return super().series_resistance(state) * (
            1 + self.growth * throughput / (self.endurance + throughput)
        )

    def rates(self, state: Array, current: Any, force: Any) -> list[Any]:
        """Append the rate of the throughput."""
        rates = super().rates(state, current, force)
        return [*rates, abs(rates[0])]


@dataclass
class FadingCapacitance(Physics):
    """Capacitance that falls exponentially with the charge throughput, to a final value."""

    linear: ClassVar[bool] = False
    extra_states: ClassVar[int] = 1  # throughput, C
    fade: float = 0.2  # of the capacitance, in the end
    fading_charge: float = 500.0  # C

    def capacitance(self, state: Array) -> Any:
        """Return the capacitance of the remaining active sites."""
        lost = -self.fade * np.expm1(-self.own(FadingCapacitance, state)[0] / self.fading_charge)
        return super().capacitance(state) * (1 - lost)

    def rates(self, state: Array, current: Any, force: Any) -> list[Any]:
        """Append the rate of the throughput."""
        rates = super().rates(state, current, force)
        return [*rates, abs(rates[0])]


@dataclass
class SelfHeating(Physics):
    """Dissipation warms the actuator, and its resistance falls by Arrhenius' law.

    The cooling by convection improves with the temperature.
    """

    linear: ClassVar[bool] = False
    extra_states: ClassVar[int] = 1  # temperature above the ambient one, K
    activation_temperature: float = 1800.0  # K, activation energy over the gas constant
    heat_resistance: float = 20.0  # K/W, of a small rise
    heat_time: float = 400.0  # s, of a small rise

    def series_resistance(self, state: Array) -> Any:
        """Return the resistance at the present temperature."""
        rise = self.own(SelfHeating, state)[0]
        return super().series_resistance(state) * np.exp(
            -self.activation_temperature * rise / _AMBIENT / (_AMBIENT + rise)
        )

    def rates(self, state: Array, current: Any, force: Any) -> list[Any]:
        """Append the heat balance: dissipated power minus the loss by convection."""
        rates = super().rates(state, current, force)
        rise = self.own(SelfHeating, state)[0]
        heat = (
            self.terminal_voltage(state, current, force) * current
            - self.film_voltage(state) * rates[0]
        )
        cooling = rise * (1 + (abs(rise) / _BREEZE) ** 1.25)
        return [*rates, (self.heat_resistance * heat - cooling) / self.heat_time]
