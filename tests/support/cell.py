"""A record of a cell, made without the kit: the exact solution under a held current."""

from __future__ import annotations

import numpy as np

from fmus.kit import Component, Input, Output, Parameter, State
from tests.support.measured import Measured

STEP = 0.1  # s
TRUE = {"R0": 0.03, "R1": 0.02, "tau1": 4.0}


class Cell(Component):
    """Terminal voltage of a cell with one pair of resistance and capacitance."""

    name = "cell"
    experiment = (60.0, STEP)
    ocv = Parameter(3.3, "V", min=0, max=5, doc="open circuit voltage")
    R0 = Parameter(0.025, "ohm", min=1e-6, max=100, doc="ohmic resistance")
    R1 = Parameter(0.025, "ohm", min=1e-6, max=100, doc="polarisation resistance")
    tau1 = Parameter(5.0, "s", min=1e-3, max=1e6, doc="polarisation time constant")
    current = Input("A", nominal=1.0, doc="current, positive in discharge")
    relaxed = State("A", rate="relaxed_rate", nominal=1.0, doc="current through R1")

    def relaxed_rate(self):
        """Relaxation of the pair."""
        return (self.current - self.relaxed) / self.tau1

    @Output("V", nominal=0.1)
    def voltage(self):
        """At the terminals."""
        return self.ocv - self.R0 * self.current - self.R1 * self.relaxed


def current(seed: int, samples: int = 400) -> np.ndarray:
    """Steps of random height, each held for 1.5 s."""
    levels = np.random.default_rng(1000 + seed).uniform(-2.0, 2.0, samples // 15 + 1)
    return np.repeat(levels, 15)[:samples]


def voltage(current, start, ocv, R0, R1, tau1):
    """Voltage (n,) under a current that is held from sample to sample."""
    decay, relaxed = np.exp(-STEP / tau1), np.empty(len(current))
    relaxed[0] = start
    for k, i in enumerate(current[:-1]):
        relaxed[k + 1] = decay * relaxed[k] + (1.0 - decay) * i
    return ocv - R0 * current - R1 * relaxed


def measured(seed: int, start: float, noise: float = 1e-3, samples: int = 400) -> Measured:
    """One record, with white noise."""
    i = current(seed, samples)
    clean = voltage(i, start, 3.3, **TRUE)
    drawn = noise * np.random.default_rng(seed).standard_normal(samples)
    return Measured(STEP * np.arange(samples), {"current": i}, {"voltage": clean + drawn})
