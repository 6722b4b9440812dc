"""Records of the emulated rig as a diagnosis takes them, and noise of known colour."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from fmus.ppy_actuator.effects import EFFECTS
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.rig.emulator.records import Drawn, draw

FEW = [EFFECTS[name] for name in ("strain_saturation", "quadratic_strain", "strain_lag", "force_to_voltage")]
SHORT = {"duration": 300.0, "rate": 5.0}  # a record of five minutes at 5 Hz


def as_measured(drawn: Drawn) -> Dataset:
    """A drawn record without its truth."""
    return Dataset(drawn.time, drawn.inputs, drawn.outputs)


def short_record(hidden: str | None = None, seed: int = 1, **options) -> Dataset:
    """A short record of the rig."""
    return as_measured(draw(hidden, seed, **SHORT | options))


def coloured(colour: float, seed: int, n: int = 4000) -> NDArray[np.float64]:
    """First-order autoregressive noise of unit innovations."""
    return np.asarray(lfilter([1.0], [1.0, -colour], np.random.default_rng(seed).standard_normal(n)))
