"""Records of a battery cell with two RC pairs and hysteresis, as a cycler writes them.

Shares no code with the project. The current is held between samples, so that charge, pairs and
hysteresis have closed forms from sample to sample. Hysteresis is that of Plett (Journal of Power
Sources 134, 2004, part 2): one state that goes to the sign of the current with the charge passed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SAMPLES = 3600  # at 1 Hz
CAPACITY = 2.5  # A h
DATED, IN_SECONDS = "Datum und Uhrzeit", "Zeit [s]"  # heads of the first column


@dataclass(frozen=True)
class Cell:
    """A cell with two RC pairs, each of a resistance in ohm and a time constant in s.

    Attributes
    ----------
    capacity : float
        A h.
    series : float
        Series resistance, ohm.
    pairs : tuple of tuple of float
    hysteresis : float
        Half the width of the loop, V.
    decay : float
        Capacities that bring the loop to its other side, the inverse of a share of the capacity.
    charge : float
        State of charge at the start.
    """

    capacity: float = 2.45
    series: float = 0.027
    pairs: tuple[tuple[float, float], ...] = ((0.013, 18.0), (0.016, 240.0))
    hysteresis: float = 0.006
    decay: float = 60.0
    charge: float = 0.92

    def voltage(self, current: Array) -> Array:
        """Return the voltage under a current in discharge that is held for a second, V."""
        charge = self.charge - np.concatenate([[0.0], np.cumsum(current[:-1])]) / (
            3600.0 * self.capacity
        )
        drop = self.series * current
        for resistance, constant in self.pairs:
            drop += resistance * lagged(current, constant)
        passed = np.abs(current) / (3600.0 * self.capacity)
        loop = _kept(np.sign(current), np.exp(-self.decay * passed))
        return open_circuit_voltage(charge) - drop - self.hysteresis * loop


def lagged(current: Array, constant: float) -> Array:
    """Return a current that is held for a second behind a first-order lag, at rest at the start."""
    return _kept(current, np.full(current.size, np.exp(-1.0 / constant)))


def _kept(signal: Array, kept: Array) -> Array:
    """Return a state that keeps a share of itself from sample to sample, the rest being signal."""
    state = np.zeros(signal.size)
    for k in range(signal.size - 1):
        state[k + 1] = kept[k] * state[k] + (1.0 - kept[k]) * signal[k]
    return state


def open_circuit_voltage(charge: Array) -> Array:
    """Return the voltage at rest at a state of charge, of NMC against graphite, V."""
    return (
        3.38
        + 0.55 * charge
        + 0.16 * charge**4
        - 0.38 * np.exp(-16.0 * charge)
        + 0.045 * np.tanh((charge - 0.58) / 0.12)
    )


def pulses(rng: np.random.Generator, samples: int = SAMPLES) -> Array:
    """Return pulses in discharge and charge, with rests, as a test of resistance has them, A."""
    current = np.zeros(samples)
    at = int(rng.integers(20, 60))
    while at < samples:
        length = int(rng.choice([10, 30, 60, 180]))
        current[at : at + length] = rng.choice([0.5, 1.0, 1.5, 2.0, -0.5]) * CAPACITY
        at += length + int(rng.choice([40, 120, 300]))
    return current


def drive(rng: np.random.Generator, samples: int = SAMPLES) -> Array:
    """Return a drive cycle: phases of a second to a minute, braking among them, and stops, A."""
    current = np.zeros(samples)
    at = 0
    while at < samples:
        length = int(np.ceil(rng.exponential(12.0)))
        if rng.random() > 0.2:
            current[at : at + length] = CAPACITY * rng.normal(0.5, 0.8)
        at += length
    return np.asarray(np.clip(current, -2.0 * CAPACITY, 3.0 * CAPACITY))


def steps(rng: np.random.Generator, samples: int = SAMPLES) -> Array:
    """Return constant currents with rests of some minutes between, A."""
    current = np.zeros(samples)
    at = int(rng.integers(60, 200))
    while at < samples:
        length = int(rng.integers(200, 600))
        current[at : at + length] = rng.choice([0.3, 0.5, 0.8, 1.0]) * CAPACITY
        at += length + int(rng.integers(200, 500))
    return current


PROFILES: dict[str, Callable[[np.random.Generator], Array]] = {
    "pulses": pulses,
    "drive": drive,
    "steps": steps,
}


def drawn(seed: int) -> tuple[Cell, str, float]:
    """Draw a cell, the name of a profile and the noise of the voltage, V."""
    rng = np.random.default_rng(seed)
    fast = rng.uniform(6.0, 30.0)
    slow = fast * rng.uniform(6.0, 20.0)
    cell = Cell(
        capacity=CAPACITY * rng.uniform(0.93, 1.04),
        series=rng.uniform(0.018, 0.04),
        pairs=(
            (rng.uniform(0.008, 0.022), fast),
            (rng.uniform(0.008, 0.022), slow),
        ),
        hysteresis=rng.uniform(0.002, 0.010),
        decay=rng.uniform(30.0, 120.0),
        charge=rng.uniform(0.85, 0.98),
    )
    profile = list(PROFILES)[seed % len(PROFILES)]
    return cell, profile, float(10.0 ** rng.uniform(-4.0, -2.7))


def record(seed: int) -> tuple[Array, Array, Cell]:
    """Return a drawn current, the voltage measured with noise, and the cell."""
    cell, profile, noise = drawn(seed)
    rng = np.random.default_rng([seed, 1])
    current = PROFILES[profile](rng)
    return current, cell.voltage(current) + noise * rng.standard_normal(current.size), cell


def write_german(path: Path, current: Array, voltage: Array, clock: str = DATED) -> Path:
    """Write a record as a German cycler does: semicolons, decimal commas, in Latin-1."""
    begun = datetime(2025, 3, 14, 8, 30, 0)
    preamble = ["Prüfling;Zelle 7"] if clock == DATED else []
    lines = [*preamble, f"{clock};Strom [A];Spannung [V]"]
    for k, row in enumerate(zip(current, voltage, strict=True)):
        stamp = f"{begun + timedelta(seconds=k):%d.%m.%Y %H:%M:%S}" if clock == DATED else str(k)
        lines.append(";".join([stamp, *(f"{value:.5f}".replace(".", ",") for value in row)]))
    path.write_text("\n".join(lines) + "\n", encoding="latin-1")
    return path
