"""Several records of one cell, made without the kit: the exact solution of its equations under held
current.
"""

from __future__ import annotations

import numpy as np

from fmus.kit import Component, Input, Output, Parameter, State
from orchestration.discrepancy.data.dataset import Dataset

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


def measured(
    seed: int, start: float, ocv: float = 3.3, noise: float = 1e-3, samples: int = 400, **other
) -> Dataset:
    """One record, with white noise."""
    i = current(seed, samples)
    clean = voltage(i, start, ocv, **TRUE | other)
    drawn = noise * np.random.default_rng(seed).standard_normal(samples)
    return Dataset(STEP * np.arange(samples), {"current": i}, {"voltage": clean + drawn})


STARTS = {"a": -6.0, "b": 2.0, "c": 8.0, "d": -3.0, "e": 5.0, "f": 0.0}
OCVS = {"a": 3.20, "b": 3.25, "c": 3.31, "d": 3.38, "e": 3.42, "f": 3.29}


def several(labels: str = "abcdef", ocvs=None, **other) -> Dataset:
    """Records joined to one, each with its own start, and its own open circuit voltage if any are
    given.
    """
    records = {}
    for k, label in enumerate(labels):
        records[label] = measured(k, STARTS[label], (ocvs or {}).get(label, 3.3), **other)
    return Dataset.joined(records)


def with_gaps(*missing: tuple[int, int], samples: int = 900) -> Dataset:
    """Return a record of one cell, some of whose samples are missing."""
    kept = np.ones(samples, dtype=bool)
    for first, last in missing:
        kept[first:last] = False
    return measured(3, 4.0, samples=samples).where(kept)


def joined_pieces(data: Dataset) -> Dataset:
    """Return the pieces between gaps in time, joined to runs of one record."""
    pieces = data.pieces()
    return Dataset.joined(pieces, dict.fromkeys(pieces, "it"))
