"""Time on the emulated rig: states under held inputs, at every sample and, exactly too, anywhere between two.

The linear part of the physics, inputs included, advances by matrix exponentials; what is left over is small and smooth
and enters by a fourth-order exponential Runge-Kutta method (Cox and Matthews, J. Comput. Phys. 176, 2002). Stiff cells
of a diffusion cost no small steps that way, and linear physics is solved exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

if TYPE_CHECKING:
    from orchestration.rig.emulator.physics import Physics

Array = NDArray[np.float64]
Signals = dict[str, Array]
_LONGEST = 0.1  # s, step of physics that is not linear
_SMALL = 1e-6  # states and inputs about zero between which the linear part is taken
_SAME = 1e-10  # s, instants that are one


class Step:
    """Advance states (order,) or (order, m) under held inputs (2,) or (2, m) by one duration (s)."""

    def __init__(self, physics: Physics, duration: float):
        self.physics, n = physics, physics.order
        self.pieces = 1 if physics.is_linear else max(1, int(np.ceil(duration / _LONGEST - 1e-6)))
        h = duration / self.pieces
        rest = np.array(physics.rates(np.zeros(n), 0.0, 0.0))
        units = _SMALL * np.eye(n + 2)
        columns = [(np.array(physics.rates(unit[:n], unit[n], unit[n + 1])) - rest) / _SMALL for unit in units]
        self.system = np.array(columns).T
        square = np.pad(self.system, ((0, 2), (0, 0)))
        self.whole, self.half = expm(h * square)[:n], expm(h / 2 * square)[:n]
        if not physics.is_linear:
            one, two, three = _phi(h * self.system[:, :n])
            self.half_gain = h / 2 * _phi(h / 2 * self.system[:, :n])[0]
            self.gains = h * (one - 3 * two + 4 * three), 2 * h * (two - 2 * three), h * (4 * three - two)

    def __call__(self, state: Array, inputs: Array) -> Array:
        """Return the states a duration later."""
        if self.physics.is_linear:
            return self.whole @ np.concatenate([state, inputs])
        first, middle, last = self.gains
        for _ in range(self.pieces):
            both = np.concatenate([state, inputs])
            drift, left = self.half @ both, self._left_over(both)
            a = drift + self.half_gain @ left
            left_a = self._left_over(both_a := np.concatenate([a, inputs]))
            left_b = self._left_over(np.concatenate([drift + self.half_gain @ left_a, inputs]))
            c = self.half @ both_a + self.half_gain @ (2 * left_b - left)
            left_c = self._left_over(np.concatenate([c, inputs]))
            state = self.whole @ both + first @ left + middle @ (left_a + left_b) + last @ left_c
        return state

    def _left_over(self, both: Array) -> Array:
        """Return the part of the rates that is not linear."""
        n = self.physics.order
        return np.array(self.physics.rates(both[:n], both[n], both[n + 1])) - self.system @ both


def _phi(matrix: Array) -> tuple[Array, Array, Array]:
    """Return phi_k(z) = (phi_{k-1}(z) - 1/(k-1)!) / z of a matrix z for k = 1, 2, 3, with phi_0 = exp."""
    n = len(matrix)
    chain = np.kron(np.eye(4, k=1), np.eye(n))
    chain[:n, :n] = matrix
    blocks = expm(chain)[:n]
    return blocks[:, n : 2 * n], blocks[:, 2 * n : 3 * n], blocks[:, 3 * n :]


@dataclass(frozen=True)
class Run:
    """A run of the rig.

    Parameters
    ----------
    physics : Physics
    time : ndarray, shape (n,)
        Seconds, increasing.
    inputs : ndarray, shape (2, n)
        Current (A) and force (N), each held from its sample to the next.
    state : ndarray, shape (order, n)
    """

    physics: Physics
    time: Array
    inputs: Array
    state: Array

    def at(self, time: Array) -> tuple[Array, Array]:
        """Return states (order, m) and inputs (2, m) at instants (s) of the run; before it all was as at its start."""
        sample = np.maximum(np.searchsorted(self.time, time + _SAME, side="right") - 1, 0)
        state, inputs = self.state[:, sample], self.inputs[:, sample]
        since = np.round(np.maximum(time - self.time[sample], 0.0), 9)
        for duration in np.unique(since[since > 0]):
            late = since == duration
            state[:, late] = Step(self.physics, duration)(state[:, late], inputs[:, late])
        return state, inputs


def propagate(physics: Physics, time: Array, inputs: Array, start: Array) -> Run:
    """Run `physics` from its `start` (order,) under inputs (2, n) held from sample to sample (time (n,), s)."""
    durations, kind = np.unique(np.round(np.diff(time), 12), return_inverse=True)
    steps = [Step(physics, duration) for duration in durations]
    state = np.empty((time.size, start.size))
    state[0], held = start, inputs.T.copy()
    for k, which in enumerate(kind.tolist()):
        state[k + 1] = steps[which](state[k], held[k])
    if not np.all(np.isfinite(state)):
        raise RuntimeError(f"the emulated rig failed after {time[np.argmin(np.isfinite(state).all(axis=1))]} s")
    return Run(physics, time, inputs, state.T)
