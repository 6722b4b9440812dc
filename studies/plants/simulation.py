"""Simulation of plants: exact by matrix exponentials, or Runge-Kutta where not linear."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np
from scipy.linalg import expm
from scipy.signal import lfilter

from fmus.kit.arrays import Array, Mask

Values = Mapping[str, float]
Matrices = tuple[Array, Array, Array, Array]
WELL_CONDITIONED = 1e6  # eigenvectors up to this condition number may serve as coordinates
FINEST = 0.01  # s, longest step of what is not linear, where records are drawn


class Dynamics(Protocol):
    """The equations of a plant, as the simulation needs them."""

    @property
    def finest(self) -> float:
        """Longest step of what is not linear, s, where records are drawn."""

    def matrices(self, p: Values) -> Matrices | None:
        """Return A, B, C, D; None where it is not linear."""

    def drawn(self, p: Values) -> Matrices | None:
        """Return A, B, C, D where records are drawn: with what it is clamped to."""

    def static(self, p: Values, u: Array) -> Array:
        """Return inputs (m, n) as they act, where something without memory precedes the states."""

    def bias(self, p: Values) -> Array:
        """Return what is added to the outputs, shape (o,)."""

    def rates(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Return derivatives of a plant that is not linear."""

    def shown(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Return outputs of a plant that is not linear."""


Feedback = Callable[[int, Array, Array, Array], Array]


def transition(a: Array, b: Array, step: float) -> tuple[Array, Array, Array]:
    """Return matrices of ``x1 = F x0 + G u0 + H (u1 - u0)``.

    Exact for inputs that go linearly (held: u1 = u0).
    """
    n, m = b.shape
    block = np.zeros((n + 2 * m, n + 2 * m))
    block[:n, :n] = a * step
    block[:n, n : n + m] = b * step
    block[n : n + m, n + m :] = np.eye(m)
    whole = expm(block)
    return whole[:n, :n], whole[:n, n : n + m], whole[:n, n + m :]


def recursion(f: Array, start: Array, drive: Array) -> Array:
    """Return states (n, k) of ``x[k+1] = F x[k] + drive[k]``.

    In the coordinates of the eigenvectors where they serve.
    """
    values, vectors = np.linalg.eig(f)
    shown = np.empty((f.shape[0], drive.shape[1] + 1))
    if np.linalg.cond(vectors) < WELL_CONDITIONED:
        modes = np.linalg.solve(vectors, np.column_stack([start, drive]).astype(complex))
        moved = [
            lfilter([1.0], [1.0, -value], mode) for value, mode in zip(values, modes, strict=True)
        ]
        return np.asarray((vectors @ np.array(moved)).real)
    x = shown[:, 0] = start
    for k in range(drive.shape[1]):
        x = shown[:, k + 1] = f @ x + drive[:, k]
    return shown


def simulate(
    plant: Dynamics,
    p: Values,
    step: float,
    u: Array,
    start: Array,
    smooth: bool | Mask = False,
    *,
    finest: float = FINEST,
) -> tuple[Array, Array]:
    """Simulate outputs (o, n) and states (s, n) under inputs (m, n) at even steps.

    Inputs are held or go linearly between samples.

    `smooth` may tell input by input, shape (m,).
    """
    acting = plant.static(p, u)
    change = np.diff(acting, axis=1) * np.broadcast_to(smooth, len(u))[:, None]
    system = plant.matrices(p)
    if system is None:
        ends = [*(acting[:, :-1] + change).T.tolist(), acting[:, -1].tolist()]
        return _stepped(plant, p, list(start), acting.T.tolist(), ends, step=step, finest=finest)
    a, b, c, d = system
    f, g, h = transition(a, b, step)
    states = recursion(f, start, g @ acting[:, :-1] + h @ change)
    return c @ states + d @ acting + plant.bias(p)[:, None], states


def _stepped(
    plant: Dynamics,
    p: Values,
    start: list[float],
    inputs: list[list[float]],
    ends: list[list[float]],
    *,
    step: float,
    finest: float,
) -> tuple[Array, Array]:
    """Simulate outputs (o, n) and states (s, n) by Runge-Kutta steps.

    Inputs go linearly from those of a sample to those at its end.
    """
    x = start
    outputs = []
    states = []
    for now, then in zip(inputs, ends, strict=True):
        outputs.append(plant.shown(x, now, p))
        states.append(x)
        x = _advanced(plant, p, x, now, then, step=step, finest=finest)
    return np.array(outputs).T, np.array(states).T


def closed_loop(
    plant: Dynamics,
    p: Values,
    step: float,
    u: Array,
    start: Array,
    *,
    feedback: Feedback,
    noise: Array,
) -> tuple[Array, Array, Array]:
    """Simulate inputs (m, n), outputs (o, n) and states (s, n) under feedback.

    Each held input may depend on what was measured before.
    """
    system = plant.drawn(p)
    n = u.shape[1]
    f, g, _ = transition(*system[:2], step) if system else (None, None, None)
    x = np.array(start, dtype=float)
    fed = u.copy()
    y = np.empty_like(noise)
    states = np.empty((x.size, n))
    for k in range(n):
        measured = y[:, k - 1] + noise[:, k - 1] if k else np.full(len(noise), np.nan)
        fed[:, k] = feedback(k, fed[:, k], measured, x)
        states[:, k] = x
        now = plant.static(p, fed[:, k])
        if system:
            y[:, k] = system[2] @ x + system[3] @ now + plant.bias(p)
            x = f @ x + g @ now
        else:
            y[:, k] = plant.shown(x.tolist(), now.tolist(), p)
            held = now.tolist()
            x = np.array(
                _advanced(plant, p, x.tolist(), held, held, step=step, finest=plant.finest)
            )
    return fed, y, states


def _advanced(
    plant: Dynamics,
    p: Values,
    x: list[float],
    u0: list[float],
    u1: list[float],
    *,
    step: float,
    finest: float,
) -> list[float]:
    """Fourth-order Runge-Kutta steps across one sample."""
    pieces = max(1, int(np.ceil(step / finest - 1e-9)))
    h = step / pieces

    def moved(by: float, rate: list[float]) -> list[float]:
        return [one + by * r for one, r in zip(x, rate, strict=True)]

    def fed(part: float) -> list[float]:
        return [a + (b - a) * part for a, b in zip(u0, u1, strict=True)]

    for i in range(pieces):
        first, middle, last = (fed((i + part) / pieces) for part in (0.0, 0.5, 1.0))
        k1 = plant.rates(x, first, p)
        k2 = plant.rates(moved(h / 2, k1), middle, p)
        k3 = plant.rates(moved(h / 2, k2), middle, p)
        k4 = plant.rates(moved(h, k3), last, p)
        x = moved(h / 6, [a + 2.0 * (b + c) + d for a, b, c, d in zip(k1, k2, k3, k4, strict=True)])
    return x
