"""Two members in a circle, each a first-order lag, and the exact solution of their steps."""

from __future__ import annotations

from math import exp

import numpy as np

H = 0.1
TIME = H * np.arange(31)


TAU = {"a": 0.7, "b": 0.4}
DECAY = {name: exp(-H / tau) for name, tau in TAU.items()}


CIRCLE = "a.x -> b.u; b.x -> -2 a.u + 1"  # a_u = 1 - 2 b_x
BOTH = {"a": {"tau": TAU["a"], "start": 0.3}, "b": {"tau": TAU["b"]}}


def lag(x, u, decay):
    """Exact step of tau dx/dt = u - x with a held input."""
    return u + (x - u) * decay


def recurrence(sequential, decay=DECAY, steps=TIME.size - 1):
    a, b = 0.3, 0.0
    rows = [(a, b)]
    for _ in range(steps):
        new = lag(a, 1 - 2 * b, decay["a"])
        b = lag(b, new if sequential else a, decay["b"])
        a = new
        rows.append((a, b))
    return np.array(rows).T


def ramp(x, u, slope, h, tau):
    """Exact step for the input u + slope t."""
    return u + slope * (h - tau) + (x - u + slope * tau) * exp(-h / tau)
