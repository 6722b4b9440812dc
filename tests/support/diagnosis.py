"""Records of the emulated rig as a diagnosis takes them, and noise of known colour."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from demonstrations.records import UNITS, draw
from fmus.ppy_actuator.effects import EFFECTS
from orchestration.records import Record, write_record
from tests.support.measured import Measured

FEW = [
    EFFECTS[name]
    for name in ("strain_saturation", "quadratic_strain", "strain_lag", "force_to_voltage")
]
SHORT = {"duration": 300.0, "rate": 5.0}  # a record of five minutes at 5 Hz


def short_record(hidden: str | None = None, seed: int = 1, **options) -> Measured:
    """A short record of the rig."""
    drawn = draw(hidden, seed, **SHORT | options)
    return Measured(drawn.time, drawn.inputs, drawn.outputs)


def rig_record(hidden: str | None = None, *signals: str, seed: int = 1, **options) -> Record:
    """A short record of the rig as if it had been read from a file, of some signals or all of
    them.
    """
    drawn = draw(hidden, seed, **SHORT | options)
    chosen = {
        n: v for n, v in (drawn.inputs | drawn.outputs).items() if not signals or n in signals
    }
    return Record(drawn.time, chosen, {n: UNITS[n] for n in chosen}, Path("lab record.csv"))


def broken_off(
    path: Path, seed: int, columns: Mapping[str, str], duration: float = SHORT["duration"]
) -> Path:
    """Write a record of the rig, columns by signal, that was broken off in the middle of a line."""
    drawn = draw("strain_saturation", seed, duration=duration, rate=SHORT["rate"])
    signals = {columns[n]: v for n, v in (drawn.inputs | drawn.outputs).items() if n in columns}
    write_record(path, drawn.time, signals, {column: UNITS[n] for n, column in columns.items()})
    with path.open("a", encoding="utf-8") as file:
        file.write("300.0,0.")
    return path


def coloured(colour: float, seed: int, n: int = 4000) -> NDArray[np.float64]:
    """First-order autoregressive noise of unit innovations."""
    return np.asarray(
        lfilter([1.0], [1.0, -colour], np.random.default_rng(seed).standard_normal(n))
    )
