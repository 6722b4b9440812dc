"""Time of a diagnosis with the full catalogue over the length of the record."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Collection
from functools import partial
from pathlib import Path

import numpy as np

from demonstrations.bench import NOISE
from demonstrations.emulator.emulator import EmulatedRig
from demonstrations.emulator.hidden_coupling import SaturatingStrain
from demonstrations.emulator.physics import RigParameters
from demonstrations.records import UNITS
from orchestration.discrepancy.candidates.candidate import catalogue, label
from orchestration.discrepancy.data.dataset import dataset_of
from orchestration.discrepancy.diagnosis import diagnose
from orchestration.experiment.waveforms import multilevel
from orchestration.fmu.effects import catalogue as known_effects
from orchestration.fmu.model import find_model
from orchestration.records import Record
from orchestration.rig.signals import RIG_COMPONENT

from .tables import Cell, Table, Topic

ROWS = (6_000, 60_000, 180_000)  # samples
RATE = 10.0  # Hz
FEW = ("strain_saturation", "quadratic_strain")  # effects that are looked at for a quick look
LIMITS = {6_000: 5.0, 180_000: 60.0}  # s


def measure(quick: bool = False) -> Topic:
    """Diagnose ever longer records of one rig with a hidden saturation, a process each."""
    rows: list[list[Cell]] = []
    for count in (600, 1_200) if quick else ROWS:
        command = [
            sys.executable,
            "-c",
            f"from benchmarks.diagnosing import once; once({count}, {FEW if quick else ()})",
        ]
        if not rows and not quick:  # whatever has to be compiled is compiled now
            subprocess.run(command, check=True, capture_output=True)
        seconds, peak, cause = subprocess.run(
            command, check=True, capture_output=True, text=True
        ).stdout.split()
        limit = LIMITS.get(count)
        met = (
            ""
            if limit is None
            else f"{'met' if float(seconds) <= limit else 'missed'}: {limit:g} s"
        )
        rows.append(
            [count, float(seconds), float(seconds) / count * 1e6, float(peak) / 1e6, cause, met]
        )
    text = (
        f"Records at {RATE:g} Hz of an emulated rig whose strain saturates; all effects of the"
        " actuator and of both measurements are looked at. The time is that of `diagnose` alone,"
        " models compiled before; the peak is the memory of the whole process."
    )
    columns = ["samples", "s", "µs for a sample", "peak, GB", "named first", "target"]
    return Topic("Naming a cause", [text, Table(columns, rows)])


def once(count: int, effects: Collection[str] = ()) -> None:
    """Diagnose one record; print seconds, peak memory in kB and the first cause."""
    import resource  # not on every system

    instants = np.arange(count) / RATE
    current = multilevel(instants, [-1.2, -0.5, 0.2, 0.8, 1.2], (2.0, 9.0), 1)
    force = multilevel(instants, [0.4, 1.0, 1.8, 2.8], (10.0, 30.0), 2)
    hidden = partial(SaturatingStrain, saturation=0.4)
    rig = EmulatedRig(
        RigParameters(), 3, NOISE["voltage"], NOISE["displacement"], 0.0, hidden=hidden
    )
    signals = {"current": current, "force": force} | rig.run(instants, current, force)
    record = Record(instants, signals, UNITS, Path("drawn.csv"))
    model = find_model(RIG_COMPONENT)
    began = time.perf_counter()
    data = dataset_of(record, model, {})
    known = catalogue(model.cls, known_effects(model.cls), data.measured)
    candidates = [effect for effect in known if not effects or label(effect) in effects]
    diagnosis = diagnose(model.cls, data, candidates)
    seconds = time.perf_counter() - began
    print(
        seconds,
        resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
        (diagnosis.causes or ["nothing"])[0],
    )
