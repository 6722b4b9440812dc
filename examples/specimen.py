"""Raw files of a specimen on the emulated rig: one for each test of the thesis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import max_len_seq

from demonstrations.emulator import EmulatedRig, RigParameters
from orchestration.records import write_record

Array = NDArray[np.float64]
_UNITS = {"current": "A", "force": "N", "voltage": "V", "displacement": "m"}
_PERIOD = 0.1  # s, of samples; errata 21
_REST = 5.0  # s, before a load or a voltage
_LOAD = 1.96  # N, 200 g, of the experiments of figs. 3-4, 3-10 and 3-11


def write_tests(
    folder: str | Path,
    seed: int = 1,
    changed: Mapping[str, float] | None = None,
    noise: int | None = None,
) -> RigParameters:
    """Measure a specimen in all four tests, and write a CSV file of each.

    Parameters
    ----------
    folder : str or Path
        It is made if it does not exist.
    seed : int
        Of the specimen's parameters.
    changed : Mapping of str to float, optional
        Factors of some parameters, as of a specimen that has aged.
    noise : int, optional
        Seed of the noise; by default that of the specimen.

    Returns
    -------
    RigParameters
        The true parameters, which no file has.
    """
    true = asdict(RigParameters.scattered(seed))
    for name, factor in (changed or {}).items():
        true[name] *= factor
    parameters = RigParameters(**true)
    rig = EmulatedRig(parameters, seed if noise is None else noise)
    Path(folder).mkdir(parents=True, exist_ok=True)
    for name, (time, current, force) in _inputs(parameters).items():
        signals = {"current": current, "force": force, **rig.run(time, current, force)}
        write_record(Path(folder) / f"{name}.csv", time, signals, _UNITS)
    return parameters


def _inputs(parameters: RigParameters) -> dict[str, tuple[NDArray[Any], ...]]:
    """Return time (s), current (A) and force (N) of each test, each of shape (n,)."""
    slow = np.arange(0.0, 2405.0)
    minute = _PERIOD * np.arange(600)
    bits = np.repeat(max_len_seq(7)[0] * 1.0, 8)  # 127 bits of 0.8 s
    clock = _PERIOD * np.arange(bits.size)
    return {
        "held_force": (slow, np.zeros_like(slow), np.where(slow < _REST, 0.0, 2.75)),
        "held_voltage": (minute, _held_voltage(parameters, minute), np.full_like(minute, _LOAD)),
        "triangle": (
            minute,
            np.where(minute % 5.0 < 2.5 - 0.5 * _PERIOD, 0.9, -0.9),
            np.full_like(minute, _LOAD),
        ),
        "prbs": (clock, bits - 0.5, np.full_like(clock, _LOAD)),
    }


def _held_voltage(parameters: RigParameters, time: NDArray[Any], voltage: float = 0.5) -> Array:
    """Return the current (n,) in A that holds a voltage at every sample, after a rest.

    A potentiostat that samples: the current is constant in between, where the charge follows
    dQ/dt = (R2 i - Q/C)/(R1 + R2), fig. 3-1.
    """
    R1, R2, C = parameters.R1, parameters.R2, parameters.C
    decay = np.exp(-_PERIOD / ((R1 + R2) * C))
    charge = 0.0
    currents = []
    for wanted in np.where(time < _REST, 0.0, voltage):
        # wanted = R1 dQ/dt + Q/C
        current = (wanted * (R1 + R2) - charge / C * R2) / (R1 * R2)
        charge = R2 * C * current + (charge - R2 * C * current) * decay
        currents.append(current)
    return np.array(currents)
