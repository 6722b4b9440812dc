"""Simulating plants: linear ones by matrix exponentials, exactly; else Runge and Kutta's method in small steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import lfilter

Array = NDArray[np.float64]
Values = Mapping[str, float]
Matrices = tuple[Array, Array, Array, Array]
WELL_CONDITIONED = 1e6  # eigenvectors up to this condition number may serve as coordinates
FINEST = 0.01  # s, longest step of what is not linear, where records are drawn


class Dynamics(Protocol):
    """What a plant says of itself."""

    @property
    def finest(self) -> float:
        """Longest step of what is not linear, s, where records are drawn."""

    def matrices(self, p: Values) -> Matrices | None:
        """A, B, C, D; None where it is not linear."""

    def drawn(self, p: Values) -> Matrices | None:
        """The same where records are drawn: with what it is clamped to."""

    def static(self, p: Values, u: Array) -> Array:
        """Inputs (m, n) as they act, where something without memory stands before the states."""

    def bias(self, p: Values) -> Array:
        """What is added to the outputs, shape (o,)."""

    def rates(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Of a plant that is not linear."""

    def shown(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Outputs of a plant that is not linear."""


Feedback = Callable[[int, Array, Array, Array], Array]


def transition(a: Array, b: Array, step: float) -> tuple[Array, Array, Array]:
    """Matrices of ``x1 = F x0 + G u0 + H (u1 - u0)``, exact for inputs that go linearly (held: u1 = u0)."""
    n, m = b.shape
    block = np.zeros((n + 2 * m, n + 2 * m))
    block[:n, :n], block[:n, n : n + m] = a * step, b * step
    block[n : n + m, n + m :] = np.eye(m)
    whole = expm(block)
    return whole[:n, :n], whole[:n, n : n + m], whole[:n, n + m :]


def recursion(f: Array, start: Array, drive: Array) -> Array:
    """States (n, k) of ``x[k+1] = F x[k] + drive[k]``, in the coordinates of the eigenvectors where they serve."""
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
    smooth: bool | NDArray[np.bool_] = False,
    finest: float = FINEST,
) -> tuple[Array, Array]:
    """Outputs (o, n) and states (s, n) under inputs (m, n) at even steps, held or going linearly between samples.

    `smooth` may tell input by input, shape (m,).
    """
    acting = plant.static(p, u)
    change = np.diff(acting, axis=1) * np.broadcast_to(smooth, len(u))[:, None]
    system = plant.matrices(p)
    if system is None:
        fed, ends = (
            acting.T.tolist(),
            [*(acting[:, :-1] + change).T.tolist(), acting[:, -1].tolist()],
        )
        x, shown, passed = list(start), [], []
        for now, then in zip(fed, ends, strict=True):
            shown.append(plant.shown(x, now, p))
            passed.append(x)
            x = _advanced(plant, p, x, now, then, step, finest)
        return np.array(shown).T, np.array(passed).T
    a, b, c, d = system
    f, g, h = transition(a, b, step)
    states = recursion(f, start, g @ acting[:, :-1] + h @ change)
    return c @ states + d @ acting + plant.bias(p)[:, None], states


def closed_loop(
    plant: Dynamics,
    p: Values,
    step: float,
    u: Array,
    start: Array,
    feedback: Feedback,
    noise: Array,
) -> tuple[Array, Array, Array]:
    """Inputs (m, n), outputs (o, n) and states (s, n) where each held input may hang on what was measured before."""
    system, n = plant.drawn(p), u.shape[1]
    f, g, _ = transition(*system[:2], step) if system else (None, None, None)
    x, fed = np.array(start, dtype=float), u.copy()
    y, states = np.empty_like(noise), np.empty((x.size, n))
    for k in range(n):
        measured = y[:, k - 1] + noise[:, k - 1] if k else np.full(len(noise), np.nan)
        fed[:, k] = feedback(k, fed[:, k], measured, x)
        states[:, k], now = x, plant.static(p, fed[:, k])
        if system:
            y[:, k] = system[2] @ x + system[3] @ now + plant.bias(p)
            x = f @ x + g @ now
        else:
            y[:, k] = plant.shown(x.tolist(), now.tolist(), p)
            x = np.array(
                _advanced(plant, p, x.tolist(), now.tolist(), now.tolist(), step, plant.finest)
            )
    return fed, y, states


def _advanced(
    plant: Dynamics,
    p: Values,
    x: list[float],
    u0: list[float],
    u1: list[float],
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
