"""Time and memory of a map of all laws over the length of the record."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from demonstrations.bench import NOISE
from demonstrations.emulator.emulator import EmulatedRig
from demonstrations.emulator.physics import RigParameters
from demonstrations.records import UNITS
from orchestration.experiment.waveforms import multilevel
from orchestration.fmu.model import find_model
from orchestration.records import Record
from orchestration.rig.signals import RIG_COMPONENT

from .tables import Cell, Table, Topic

ROWS = (3_000, 6_000, 12_000)  # samples
RATE = 10.0  # Hz
LIMIT = 6_000, 10.0, 1.0  # samples of ten minutes, s and GB that they may take


def measure(quick: bool = False) -> Topic:
    """Map ever longer records of one rig, each in a process of its own."""
    rows: list[list[Cell]] = []
    for count in (300, 600) if quick else ROWS:
        command = [sys.executable, "-c", f"from benchmarks.mapping import once; once({count})"]
        if not rows and not quick:  # whatever has to be compiled is compiled now
            subprocess.run(command, check=True, capture_output=True)
        numbers = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
        seconds, peak, entries, simulation = map(float, numbers)
        met = (
            ""
            if count != LIMIT[0]
            else "met"
            if seconds <= LIMIT[1] and peak / 1e6 <= LIMIT[2]
            else "missed"
        )
        rows.append(
            [
                count,
                int(entries),
                seconds,
                seconds / count * 1e6,
                peak / 1e6,
                entries * simulation / seconds,
                met,
            ]
        )
    text = (
        f"Records at {RATE:g} Hz of an emulated rig in which nothing is hidden; every law of the"
        " actuator is asked of every signal and what is remembered of it. The peak is the memory"
        " of the whole process. Beside it stands one simulation of the model with its derivatives,"
        " for every entry that would explain anything: what as many corrections cost that are only"
        f" simulated once. Target: {LIMIT[1]:g} s and {LIMIT[2]:g} GB for ten minutes."
    )
    columns = [
        "samples",
        "entries",
        "s",
        "µs for a sample",
        "peak, GB",
        "simulations of each / map",
        "target",
    ]
    return Topic("What laws lack", [text, Table(columns, rows)])


def once(count: int) -> None:
    """Map one record; print seconds, peak memory in kB, entries and seconds of one simulation."""
    import resource  # not on every system

    from orchestration.discrepancy.laws.base import search_of
    from orchestration.discrepancy.laws.map import LawMap
    from orchestration.discrepancy.pipeline import DiagnosisOptions, diagnose_only

    instants = np.arange(count) / RATE
    current = multilevel(instants, [-1.2, -0.5, 0.2, 0.8, 1.2], (2.0, 9.0), 1)
    force = multilevel(instants, [0.4, 1.0, 1.8, 2.8], (10.0, 30.0), 2)
    rig = EmulatedRig(RigParameters(), 3, NOISE["voltage"], NOISE["displacement"], 0.0)
    signals = {"current": current, "force": force} | rig.run(instants, current, force)
    record = Record(instants, signals, UNITS, Path("drawn.csv"))
    diagnosis = diagnose_only(
        record, find_model(RIG_COMPONENT), None, DiagnosisOptions(effects=[])
    ).diagnosis
    search = search_of(diagnosis)
    base = diagnosis.selection.best
    LawMap(search, base).entries()  # what is made once for a model is not counted
    began = time.perf_counter()
    entries = LawMap(search, base).entries()
    seconds = time.perf_counter() - began
    base.problem.forget_simulation()
    began = time.perf_counter()
    base.problem.evaluate(base.fit.q)
    simulation = time.perf_counter() - began
    print(seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, len(entries), simulation)
