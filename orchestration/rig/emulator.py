"""A rig to practise on: an actuator with measurement noise and, if wanted, an effect nobody told the models of.

It shares no code with the models, so that agreement between the two means something: voltage comes from a balance of
currents at the terminal, time advances by matrix exponentials (linear physics) or an eighth-order Runge-Kutta method.
"""

from collections.abc import Callable
from dataclasses import asdict, astuple, dataclass
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.signal import lfilter

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RigParameters:
    """What the emulated actuator is made of, in SI units; defaults are the thesis' 12-layer actuator (ERRATA row 1)."""

    R1: float = 0.43  # ohm, diffusion, contacts and electrolyte
    R2: float = 2.35  # ohm, leakage
    C: float = 2.70  # F, bulk of the films
    alpha: float = 6.8e-5  # m/C, displacement per charge
    k1: float = 6300.0  # N/m, instantaneous spring
    b1: float = 1.7e6  # N.s/m, viscoplastic dashpot
    k2: float = 1.0e4  # N/m, creep spring
    b2: float = 2.0e6  # N.s/m, creep dashpot

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not 0 < value < np.inf:
                raise ValueError(f"rig parameter {name} = {value!r}: must be finite and above 0")

    @classmethod
    def scattered(cls, seed: int, spread: float = 0.15) -> "RigParameters":
        """Draw another specimen: each nominal value times a log-normal factor of log standard deviation `spread`."""
        factors = np.exp(spread * np.random.default_rng(seed).standard_normal(8))
        return cls(*(np.array(astuple(cls())) * factors).tolist())


@dataclass
class Physics:
    """What the rig really does; a hidden variation overrides one law, written to serve an instant or a whole record.

    The state is ``[charge (C), creep elongation (m), plastic elongation (m), ...]`` along the first axis.
    """

    linear: ClassVar[bool] = True  # the rates are linear in state and inputs; a variation that breaks this says False
    extra_states: ClassVar[int] = 0  # appended by a variation, zero at the start of a run
    parameters: RigParameters

    def series_resistance(self, state: Array) -> Any:
        """Return the resistance (ohm) between terminal and films."""
        return self.parameters.R1

    def capacitor_voltage(self, state: Array, force: Any) -> Any:
        """Return the voltage (V) of the films behind the series resistance."""
        return state[0] / self.parameters.C

    def leakage_current(self, voltage: Any) -> Any:
        """Return the current (A) that passes by the films at a terminal voltage (V); may be any rising function."""
        return voltage / self.parameters.R2

    def electrochemical_length(self, charge: Any) -> Any:
        """Return the elongation (m) caused by a charge (C)."""
        return self.parameters.alpha * charge

    def terminal_voltage(self, state: Array, current: Any, force: Any) -> Any:
        """Return the voltage (V) at which the current into films plus leakage equals the supplied `current` (A)."""
        films, resistance = self.capacitor_voltage(state, force), self.series_resistance(state)
        voltage, probe = films + resistance * current, 1e-6
        for _ in range(100):  # Newton's method, exact in one step for a linear leakage
            excess = (voltage - films) / resistance + self.leakage_current(voltage) - current
            leak_slope = (self.leakage_current(voltage + probe) - self.leakage_current(voltage - probe)) / (2 * probe)
            correction = excess / (1 / resistance + leak_slope)
            voltage = voltage - correction
            if np.all(np.abs(correction) <= 1e-13 * (1 + np.abs(voltage))):
                return voltage
        raise RuntimeError(f"no terminal voltage balances the currents: still moving {np.max(np.abs(correction))} V")

    def mechanical_length(self, state: Array, force: Any) -> Any:
        """Return the elongation (m) of a Burgers body: spring, creep element and dashpot in series."""
        return force / self.parameters.k1 + state[1] + state[2]

    def rates(self, state: Array, current: Any, force: Any) -> list[Any]:
        """Return the time derivatives of the state."""
        p = self.parameters
        charging = current - self.leakage_current(self.terminal_voltage(state, current, force))
        return [charging, (force - p.k2 * state[1]) / p.b2, force / p.b1]


@dataclass
class SaturatingStrain(Physics):
    """Hidden variation: the films stop growing around a charge."""

    saturation_charge: float = 3.0  # C

    def electrochemical_length(self, charge: Any) -> Any:
        """Level off as 1/(1 + |Q/Qs|^3)^(1/3), deliberately none of the usual sigmoids."""
        return super().electrochemical_length(charge) / np.cbrt(1 + np.abs(charge / self.saturation_charge) ** 3)


@dataclass
class GrowingResistance(Physics):
    """Hidden variation: the series resistance rises with the charge moved into and out of the films, and levels off."""

    linear: ClassVar[bool] = False
    extra_states: ClassVar[int] = 1  # throughput, C
    growth: float = 0.5  # of the resistance, in the end
    endurance: float = 500.0  # C, throughput that brings about half of it

    def series_resistance(self, state: Array) -> Any:
        """Grow by a fraction that saturates with the throughput, as sites for damage are used up."""
        return super().series_resistance(state) * (1 + self.growth * state[3] / (self.endurance + state[3]))

    def rates(self, state: Array, current: Any, force: Any) -> list[Any]:
        """Append the rate of the throughput."""
        rates = super().rates(state, current, force)
        return [*rates, abs(rates[0])]


@dataclass
class LoadDependentVoltage(Physics):
    """Hidden variation: a tensile load raises the films' voltage, which then drives charge too."""

    sensitivity: float = 0.02  # V/N

    def capacitor_voltage(self, state: Array, force: Any) -> Any:
        """Add the load's share to the charge's."""
        return super().capacitor_voltage(state, force) + self.sensitivity * force


@dataclass
class EmulatedRig:
    """An actuator on a bench with noisy, optionally quantised, sensors.

    Every run starts afresh but draws new noise; rigs made alike repeat the same sequence of runs.

    Parameters
    ----------
    parameters : RigParameters
    seed : int
        Of the noise.
    voltage_noise, displacement_noise : float
        Standard deviations (V, m).
    noise_colour : float
        Lag-one correlation of the noise, which is AR(1).
    initial_charge : float
        C.
    voltage_resolution, displacement_resolution : float
        One converter count (V, m); zero means no quantisation.
    hidden : callable, optional
        Makes the physics from the parameters: a subclass of `Physics`, or a `functools.partial` of one.

    Attributes
    ----------
    truth : dict of str to ndarray, shape (n,)
        Of the last run, without noise: voltage, displacement and its two parts, charge.
    """

    parameters: RigParameters = RigParameters()
    seed: int = 0
    voltage_noise: float = 4e-3
    displacement_noise: float = 3e-6
    noise_colour: float = 0.0
    initial_charge: float = 0.0
    voltage_resolution: float = 0.0
    displacement_resolution: float = 0.0
    hidden: Callable[[RigParameters], Physics] | None = None

    def __post_init__(self) -> None:
        if not -1 < self.noise_colour < 1:
            raise ValueError(f"noise_colour = {self.noise_colour!r}: must lie between -1 and 1")
        for name in ("voltage_noise", "displacement_noise", "voltage_resolution", "displacement_resolution"):
            if not 0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} = {getattr(self, name)!r}: must be finite and at least 0")
        self.physics = (self.hidden or Physics)(self.parameters)
        self.truth: dict[str, Array] = {}
        self._random = np.random.default_rng(self.seed)

    def run(self, time: ArrayLike, current: ArrayLike, force: ArrayLike) -> dict[str, Array]:
        """Apply inputs, each held from its sample to the next, and measure.

        Parameters
        ----------
        time : array_like, shape (n,)
            Seconds, strictly increasing.
        current, force : array_like, shape (n,) or scalar
            A and N, tension positive.

        Returns
        -------
        dict of str to ndarray, shape (n,)
            ``voltage`` (V) and ``displacement`` (m), as the sensors report them.

        Raises
        ------
        ValueError
            If a signal is not finite, has the wrong length, or time does not increase.
        """
        t = np.asarray(time, dtype=float)
        if t.ndim != 1 or t.size == 0 or not np.all(np.isfinite(t)) or np.any(np.diff(t) <= 0):
            raise ValueError("time must be a finite, strictly increasing, non-empty vector (s)")
        signals = [np.asarray(signal, dtype=float) for signal in (current, force)]
        if any(signal.shape not in ((), t.shape) or not np.all(np.isfinite(signal)) for signal in signals):
            raise ValueError(f"current (A) and force (N) must be finite, each a scalar or as long as time ({t.size})")
        inputs = np.array([np.broadcast_to(signal, t.shape) for signal in signals])
        physics, start = self.physics, np.zeros(3 + self.physics.extra_states)
        start[0] = self.initial_charge
        state = (propagate_exactly if physics.linear else propagate_adaptively)(physics, t, inputs, start)
        stretch, strain = physics.mechanical_length(state, inputs[1]), physics.electrochemical_length(state[0])
        voltage = physics.terminal_voltage(state, *inputs)
        self.truth = {"voltage": voltage, "displacement": stretch + strain, "charge": state[0]}
        self.truth |= {"electrochemical_displacement": strain, "mechanical_displacement": stretch}
        return {
            "voltage": self._measure(voltage, self.voltage_noise, self.voltage_resolution),
            "displacement": self._measure(stretch + strain, self.displacement_noise, self.displacement_resolution),
        }

    def _measure(self, signal: Array, deviation: float, resolution: float) -> Array:
        """Add stationary AR(1) noise, then round to whole converter counts."""
        white = self._random.standard_normal(signal.size)
        white[1:] *= np.sqrt(1 - self.noise_colour**2)  # the first draw already has the stationary spread
        noisy = signal + deviation * lfilter([1.0], [1.0, -self.noise_colour], white)
        return np.round(noisy / resolution) * resolution if resolution > 0 else noisy


def propagate_exactly(physics: Physics, time: Array, inputs: Array, start: Array) -> Array:
    """Return the states (states, n) of linear `physics` at every sample, inputs (2, n) held in between."""
    order = start.size
    # The rates are linear, so their values at unit vectors are the columns of the system matrices.
    columns = [physics.rates(unit[:order], unit[order], unit[order + 1]) for unit in np.eye(order + 2)]
    system = np.pad(np.array(columns).T, ((0, 2), (0, 0)))
    steps, kind = np.unique(np.round(np.diff(time), 12), return_inverse=True)
    transitions = [expm(system * step)[:order] for step in steps]
    both = np.vstack([np.empty((order, time.size)), inputs])
    both[:order, 0] = start
    for k in range(time.size - 1):
        both[:order, k + 1] = transitions[kind[k]] @ both[:, k]
    return both[:order]


def propagate_adaptively(physics: Physics, time: Array, inputs: Array, start: Array) -> Array:
    """Return the states (states, n) of any `physics`, integrated anew over every stretch of constant inputs (2, n)."""

    def slope(_: float, state: Array, current: float, force: float) -> list[Any]:
        return physics.rates(state, current, force)

    state = np.column_stack([start, np.empty((start.size, time.size - 1))])
    switches = np.flatnonzero(np.any(np.diff(inputs, axis=1) != 0, axis=0)) + 1
    for a, b in pairwise(np.unique([0, *switches, time.size - 1])):
        span, samples, held = (time[a], time[b]), time[a + 1 : b + 1], (inputs[0, a], inputs[1, a])
        solution = solve_ivp(slope, span, state[:, a], "DOP853", samples, args=held, rtol=1e-10, atol=1e-14)
        if not solution.success:
            raise RuntimeError(f"the emulated rig failed after {time[a]} s: {solution.message}")
        state[:, a + 1 : b + 1] = solution.y
    return state
