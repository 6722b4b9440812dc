"""Physics of the emulated actuator: an electrical circuit and a Burgers body, and their motion.

A hidden variation overrides laws through ``super()``. Laws take states of one instant or of a whole
record.

Inputs are constant between samples. The linear part of the physics advances by matrix exponentials,
exactly; the rest is small and smooth and is integrated by a fourth-order exponential Runge-Kutta
method (Cox and Matthews, J. Comput. Phys. 176, 2002), so that stiff cells of a diffusion need no
small steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass, make_dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

Array = NDArray[np.float64]
Signals = dict[str, Array]
_PROBES = np.array([-1e-6, 0.0, 1e-6])  # V, about the voltage, for the slope of the leakage
_LONGEST = 0.1  # s, step of physics that is not linear
_SMALL = 1e-6  # difference of states and inputs from zero, for the linear part
_SAME = 1e-10  # s, largest difference of equal instants


@dataclass(frozen=True)
class RigParameters:
    """Parameters of the emulated actuator in SI units.

    Defaults are the thesis' 12-layer actuator (ERRATA row 1).
    """

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
    def scattered(cls, seed: int, spread: float = 0.15) -> RigParameters:
        """Draw a specimen: each nominal value times a log-normal factor.

        The log standard deviation is `spread`.
        """
        factors = np.exp(spread * np.random.default_rng(seed).standard_normal(8))
        return cls(*(np.array(astuple(cls())) * factors).tolist())


@dataclass
class Physics:
    """Physics of the emulated rig, of which variations are subclasses.

    The state is ``[charge (C), creep elongation (m), plastic elongation (m), ...]`` along the first
    axis, followed by the states of the variations in the order in which their `rates` append them.
    """

    # whether rates are linear in state and inputs; False in a variation that is not linear
    linear: ClassVar[bool] = True
    extra_states: ClassVar[int] = 0  # number of states of a variation, zero at the start of a run
    parameters: RigParameters

    def __post_init__(self) -> None:
        kinds = [cls for cls in reversed(type(self).__mro__) if issubclass(cls, Physics)]
        lineage = [cls for cls in kinds if "extra_states" in vars(cls)]
        ends = np.cumsum([3, *(cls.extra_states for cls in lineage)]).tolist()
        self._place = {
            cls: slice(a, b) for cls, a, b in zip(lineage, ends[:-1], ends[1:], strict=True)
        }
        self.order: int = ends[-1]
        self.is_linear = all(vars(cls).get("linear", True) for cls in kinds)
        self._plain_leakage = type(self).leakage_current is Physics.leakage_current

    def own(self, variation: type[Physics], state: Array) -> Array:
        """Return the states of a variation."""
        return state[self._place[variation]]

    # --- electrical
    # ----------------------------------------------------------------------------------------------

    def series_resistance(self, state: Array) -> Any:
        """Return the resistance (ohm) between terminal and films."""
        return self.parameters.R1

    def capacitance(self, state: Array) -> Any:
        """Return the capacitance (F) of the films."""
        return self.parameters.C

    def film_voltage(self, state: Array) -> Any:
        """Return the voltage (V) of the charge on the films."""
        return state[0] / self.capacitance(state)

    def capacitor_voltage(self, state: Array, force: Any) -> Any:
        """Return the voltage (V) behind the series resistance."""
        return self.film_voltage(state)

    def leakage_current(self, voltage: Any) -> Any:
        """Return the leakage current (A) at a voltage (V), with which it rises."""
        return voltage / self.parameters.R2

    def terminal_voltage(self, state: Array, current: Any, force: Any) -> Any:
        """Return the voltage (V) at which films' current and leakage have the sum `current` (A)."""
        films = self.capacitor_voltage(state, force)
        resistance = self.series_resistance(state)
        share = self.parameters.R2 / (resistance + self.parameters.R2)
        voltage = share * (films + resistance * current)
        if self._plain_leakage:
            return voltage
        for _ in range(100):  # Newton's method
            low, leakage, high = self.leakage_current(np.add.outer(_PROBES, voltage))
            excess = (voltage - films) / resistance + leakage - current
            correction = excess / (1 / resistance + (high - low) / (_PROBES[2] - _PROBES[0]))
            voltage = voltage - correction
            if np.max(np.abs(correction) - 1e-13 * (1 + np.abs(voltage))) <= 0:
                return voltage
        raise RuntimeError(
            "no terminal voltage balances the currents: still moving"
            f" {np.max(np.abs(correction))} V"
        )

    # --- coupling
    # ----------------------------------------------------------------------------------------------

    def active_charge(self, state: Array) -> Any:
        """Return the charge (C) that elongates the films."""
        return state[0]

    def electrochemical_length(self, charge: Any) -> Any:
        """Return the elongation (m) by a record of charge (C)."""
        return self.parameters.alpha * charge

    # --- mechanical
    # ----------------------------------------------------------------------------------------------

    def spring_length(self, state: Array, force: Any) -> Any:
        """Return the elongation (m) of the instantaneous spring."""
        return force / self.parameters.k1

    def creep_force(self, state: Array) -> Any:
        """Return the force (N) of the creep spring."""
        return self.parameters.k2 * state[1]

    def creep_drive(self, state: Array, force: Any) -> Any:
        """Return the force (N) on the creep dashpot."""
        return force - self.creep_force(state)

    def flow_drive(self, force: Any) -> Any:
        """Return the force (N) on the viscoplastic dashpot."""
        return force

    def mechanical_length(self, state: Array, force: Any) -> Any:
        """Return the elongation (m) of a Burgers body: spring, creep element, dashpot."""
        return self.spring_length(state, force) + state[1] + state[2]

    # --- as a whole
    # ----------------------------------------------------------------------------------------------

    def rates(self, state: Array, current: Any, force: Any) -> list[Any]:
        """Return the time derivatives of the state."""
        charging = current - self.leakage_current(self.terminal_voltage(state, current, force))
        creeping = self.creep_drive(state, force) / self.parameters.b2
        return [charging, creeping, self.flow_drive(force) / self.parameters.b1]

    def sensed(self, run: Trajectory, time: Array) -> Signals:
        """Return noise-free readings at increasing instants (s): voltage (V), displacement (m)."""
        state, (current, force) = run.at(time)
        elongation = self.mechanical_length(state, force) + self.electrochemical_length(
            self.active_charge(state)
        )
        return {"voltage": self.terminal_voltage(state, current, force), "displacement": elongation}


def together(variations: Sequence[type[Physics]]) -> type[Physics]:
    """Return a physics with all of the variations."""
    return make_dataclass("Together", [], bases=(*variations, Physics)) if variations else Physics


# --- time
# --------------------------------------------------------------------------------------------------


class Motion(Protocol):
    """Rates of change of states under two inputs; zero at zero if they are linear."""

    order: int
    is_linear: bool

    def rates(self, state: Array, first: Any, second: Any, /) -> list[Any]:
        """Return the time derivatives of the state."""
        ...


class Transition:
    """Transition of states (order,) or (order, m) over one duration (s) with constant inputs.

    Inputs have the shape (2,) or (2, m).
    """

    def __init__(self, physics: Motion, duration: float):
        self.physics = physics
        n = physics.order
        self.pieces = 1 if physics.is_linear else max(1, int(np.ceil(duration / _LONGEST - 1e-6)))
        h = duration / self.pieces
        at_zero = np.array(physics.rates(np.zeros(n), 0.0, 0.0))
        units = _SMALL * np.eye(n + 2)
        columns = [
            (np.array(physics.rates(unit[:n], unit[n], unit[n + 1])) - at_zero) / _SMALL
            for unit in units
        ]
        self.system = np.array(columns).T
        square = np.pad(self.system, ((0, 2), (0, 0)))
        self.whole = expm(h * square)[:n]
        self.half = expm(h / 2 * square)[:n]
        if not physics.is_linear:
            one, two, three = _phi(h * self.system[:, :n])
            self.half_gain = h / 2 * _phi(h / 2 * self.system[:, :n])[0]
            self.gains = (
                h * (one - 3 * two + 4 * three),
                2 * h * (two - 2 * three),
                h * (4 * three - two),
            )

    def __call__(self, state: Array, inputs: Array) -> Array:
        """Return the states after the duration."""
        if self.physics.is_linear:
            return self.whole @ np.concatenate([state, inputs])
        first, middle, last = self.gains
        for _ in range(self.pieces):
            both = np.concatenate([state, inputs])
            drift = self.half @ both
            nonlinear = self._nonlinear(both)
            a = drift + self.half_gain @ nonlinear
            both_a = np.concatenate([a, inputs])
            nonlinear_a = self._nonlinear(both_a)
            b = drift + self.half_gain @ nonlinear_a
            nonlinear_b = self._nonlinear(np.concatenate([b, inputs]))
            c = self.half @ both_a + self.half_gain @ (2 * nonlinear_b - nonlinear)
            nonlinear_c = self._nonlinear(np.concatenate([c, inputs]))
            state = (
                self.whole @ both
                + first @ nonlinear
                + middle @ (nonlinear_a + nonlinear_b)
                + last @ nonlinear_c
            )
        return state

    def _nonlinear(self, both: Array) -> Array:
        """Return the nonlinear part of the rates for states and inputs in one vector."""
        n = self.physics.order
        return np.array(self.physics.rates(both[:n], both[n], both[n + 1])) - self.system @ both


def _phi(matrix: Array) -> tuple[Array, Array, Array]:
    """Return phi_k(z) of a matrix z for k = 1, 2, 3.

    phi_k(z) = (phi_{k-1}(z) - 1/(k-1)!) / z, with phi_0 = exp.
    """
    n = len(matrix)
    chain = np.kron(np.eye(4, k=1), np.eye(n))
    chain[:n, :n] = matrix
    blocks = expm(chain)[:n]
    return blocks[:, n : 2 * n], blocks[:, 2 * n : 3 * n], blocks[:, 3 * n :]


@dataclass(frozen=True)
class Trajectory:
    """States of the rig over a run.

    Parameters
    ----------
    physics : Physics
    time : ndarray, shape (n,)
        Seconds, increasing.
    inputs : ndarray, shape (2, n)
        Current (A) and force (N), constant from sample to sample.
    state : ndarray, shape (order, n)
    """

    physics: Physics
    time: Array
    inputs: Array
    state: Array

    def at(self, time: Array) -> tuple[Array, Array]:
        """Return states (order, m) and inputs (2, m) at instants (s) of the run.

        Before the run both are those of its start.
        """
        sample = np.maximum(np.searchsorted(self.time, time + _SAME, side="right") - 1, 0)
        state = self.state[:, sample]
        inputs = self.inputs[:, sample]
        elapsed = np.round(np.maximum(time - self.time[sample], 0.0), 9)
        for duration in np.unique(elapsed[elapsed > 0]):
            late = elapsed == duration
            state[:, late] = Transition(self.physics, duration)(state[:, late], inputs[:, late])
        return state, inputs


def propagate(physics: Physics, time: Array, inputs: Array, start: Array) -> Trajectory:
    """Return the trajectory from `start` (order,) at times (n,) in s.

    Inputs (2, n) are constant from sample to sample.
    """
    durations, kind = np.unique(np.round(np.diff(time), 12), return_inverse=True)
    transitions = [Transition(physics, duration) for duration in durations]
    state = np.empty((time.size, start.size))
    state[0] = start
    rows = inputs.T.copy()
    for k, duration_index in enumerate(kind.tolist()):
        state[k + 1] = transitions[duration_index](state[k], rows[k])
    if not np.all(np.isfinite(state)):
        raise RuntimeError(
            f"the emulated rig failed after {time[np.argmin(np.isfinite(state).all(axis=1))]} s"
        )
    return Trajectory(physics, time, inputs, state.T)
