"""Records of benches, drawn at random."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orchestration.records import write_record
from studies.benches.simulation import NOMINAL, Bench

Array = NDArray[np.float64]
RATE = 100.0  # Hz, of the record
UNITS = {
    "force_reference": "N",
    "current": "A",
    "actuator.tension": "N",
    "actuator.voltage": "V",
    "bench.position": "m",
    "bench.force_measured": "N",
}
_NOISE = {"N": 5e-3, "V": 4e-3, "m": 3e-6}
_CHANGEABLE = ("K", "b_vc", "m", "R1", "C", "alpha", "k1")
_CREEP = (7e-4, 2e-3)  # m/s, within which dry friction changes its sign
_SPREAD = 0.25  # of the logarithm of a parameter that is not nominal


@dataclass(frozen=True)
class BenchRecord:
    """A record of a bench, and what is true of it.

    Attributes
    ----------
    bench : Bench
    time : ndarray, shape (n,)
    signals : dict of str to ndarray, shape (n,)
        With noise, named as in the system.
    changed : dict of str to float
        Parameters that are not nominal.
    """

    bench: Bench
    time: Array
    signals: dict[str, Array]
    changed: dict[str, float]

    def write(self, path: Path) -> Path:
        """Write it as a file."""
        write_record(path, self.time, self.signals, UNITS)
        return path


def draw(seed: int, dry_friction: tuple[float, float] = (0.0, 0.0)) -> BenchRecord:
    """Draw a record of 10 to 25 s at any phase of the controller.

    Every second bench has up to two parameters that are not nominal; for every second the noise of
    the load cell goes through the controller, and every fourth has a clock that jitters.

    Parameters
    ----------
    seed : int
    dry_friction : tuple of float
        Least and most, N.
    """
    random = np.random.default_rng(seed)
    time = np.arange(round(RATE * random.uniform(10.0, 25.0))) / RATE
    values = dict(NOMINAL)
    names = random.choice(_CHANGEABLE, random.choice([0, 0, 1, 2]), replace=False)
    changed = {str(n): values[n] * float(np.exp(_SPREAD * random.choice([-1, 1]))) for n in names}
    bench = Bench(
        values | changed,
        phase=random.uniform(0.0, 1.0 / 30.0),
        jitter=random.choice([0.0, 0.0, 0.0, 3e-4]),
        dry_friction=random.uniform(*dry_friction),
        creep=float(np.exp(random.uniform(*np.log(_CREEP)))),
    )
    reference = _levels(random, time, np.r_[0.5, random.uniform(0.5, 4.0, 5)], (0.5, 2.0))
    current = _levels(random, time, np.r_[0.0, random.uniform(-1.2, 1.2, 5)], (0.5, 3.0))
    heard = random.choice([0.0, _NOISE["N"]])
    clean = bench.run(time, reference, current, heard, seed)
    clean |= {"force_reference": reference, "current": current}
    signals = {}
    for name, unit in UNITS.items():
        values_of = clean[name.rpartition(".")[2]]
        is_input = name in ("force_reference", "current")
        deviation = 0.0 if is_input else _NOISE[unit]
        signals[name] = values_of + deviation * random.standard_normal(time.size)
    return BenchRecord(bench, time, signals, changed)


def _levels(
    random: np.random.Generator, time: Array, levels: Array, dwell: tuple[float, float]
) -> Array:
    """Return steps between levels, each held for some time; the first is the first level."""
    values = np.full(time.size, levels[0])
    now = random.uniform(*dwell)
    while now < time[-1]:
        values[time >= now] = random.choice(levels)
        now += random.uniform(*dwell)
    return values
