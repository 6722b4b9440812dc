"""Records of benches and stands, drawn at random."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orchestration.records import write_record
from studies.benches.simulation import NOMINAL, Bench
from studies.benches.stand import PERIOD, Stand

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
KNOWN = ("alpha", "k1")  # of an actuator on the stand, by another instrument
_FILMS = ("R1", "R2", "C", "alpha", "k1", "b1", "k2", "b2")
_STAND_UNITS = {
    "mass": "kg",
    "actuator.current": "A",
    "actuator.voltage": "V",
    "displacement_measured": "m",
}
_STAND_NOISE = {"actuator.voltage": 3e-3, "displacement_measured": 2e-6}
# of what is hidden in a stand: ranges of which it is drawn, evenly in the logarithm
_HIDDEN: dict[str, dict[str, tuple[float, float]]] = {
    "": {},
    "core_friction": {"friction": (0.08, 0.3), "creep": (5e-6, 3e-5)},
    "swinging_weight": {"angle": (0.15, 0.4), "length": (0.1, 0.3), "decay": (8.0, 40.0)},
    "misalignment": {"lean": (0.2, 0.45)},
    "frame_compliance": {"compliance": (1e-5, 5e-5)},
    "strain_lag": {"lag": (1.0, 6.0)},
    "force_to_voltage": {"sensitivity": (0.01, 0.05)},
}
STAND_EFFECTS = tuple(filter(None, _HIDDEN))
_CREEP = (7e-4, 2e-3)  # m/s, within which dry friction changes its sign
_SPREAD = 0.25  # of the logarithm of a parameter that is not nominal


@dataclass(frozen=True)
class SystemRecord:
    """A record of a system, and what is true of it.

    Attributes
    ----------
    plant : Bench or Stand
    time : ndarray, shape (n,)
    signals : dict of str to ndarray, shape (n,)
        With noise, named as in the system.
    units : Mapping of str to str
        Of the signals.
    changed : dict of str to float
        Parameters that are not nominal.
    """

    plant: Bench | Stand
    time: Array
    signals: dict[str, Array]
    units: Mapping[str, str]
    changed: dict[str, float]

    def write(self, path: Path) -> Path:
        """Write it as a file."""
        write_record(path, self.time, self.signals, self.units)
        return path


def draw_bench(seed: int, dry_friction: tuple[float, float] = (0.0, 0.0)) -> SystemRecord:
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
    return SystemRecord(bench, time, signals, UNITS, changed)


def draw_stand(seed: int, effect: str = "") -> SystemRecord:
    """Draw a record of 80 to 160 s of a stand, set to zero as the first weight is put on.

    Every second actuator has up to two parameters that are not nominal, of those that are unknown.

    Parameters
    ----------
    seed : int
    effect : str
        That is hidden; empty for none.
    """
    random = np.random.default_rng([seed, 83])
    time = PERIOD * np.arange(round(random.uniform(80.0, 160.0) / PERIOD))
    names = random.choice(
        [n for n in _FILMS if n not in KNOWN], random.choice([0, 0, 1, 2]), replace=False
    )
    factors = {str(name): float(np.exp(_SPREAD * random.choice([-1, 1]))) for name in names}
    changed = {name: NOMINAL[name] * factor for name, factor in factors.items()}
    films = {name: NOMINAL[name] for name in _FILMS} | changed
    hidden = {n: float(np.exp(random.uniform(*np.log(r)))) for n, r in _HIDDEN[effect].items()}
    stand = Stand(films, **hidden)
    mass = _levels(random, time, [0.1, 0.15, 0.2, 0.3], (6.0, 20.0))
    current = _levels(random, time, [0.0, -1.2, -0.9, -0.5, 0.5, 0.9, 1.2], (3.0, 10.0))
    signals = {"mass": mass, "actuator.current": current} | stand.run(time, mass, current)
    for name, deviation in _STAND_NOISE.items():
        signals[name] = signals[name] + deviation * random.standard_normal(time.size)
    return SystemRecord(stand, time, signals, _STAND_UNITS, changed)


def _levels(
    random: np.random.Generator, time: Array, levels: Sequence[float], dwell: tuple[float, float]
) -> Array:
    """Return steps between levels, each held for some time; the first is the first level."""
    values = np.full(time.size, levels[0])
    now = random.uniform(*dwell)
    while now < time[-1]:
        values[time >= now] = random.choice(levels)
        now += random.uniform(*dwell)
    return values
