"""Records of closed loops, made without any FMU."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fmus.kit import stack
from fmus.kit.record.compiled import CompiledModel
from orchestration.discrepancy.systems.diagnose import diagnose_system
from orchestration.experiment.waveforms import multilevel
from orchestration.master.reference.fused import fuse
from orchestration.records import write_record
from orchestration.system import Member, library, ssp

NOISE = {"V": 4e-3, "m": 3e-6, "A": 1e-3, "N": 5e-3, "rad": 1e-4}
WATCH = {
    "current_command": "A",
    "force": "N",
    "galvanostat.current": "A",
    "actuator.voltage": "V",
    "actuator.displacement": "m",
    "estimator.voltage_limit": "V",
}


def measure(path, system, columns, time, inputs, every, hidden=None, values=None):
    """Record a closed loop, simulated as one flat model in which one member may be another than in
    the system.
    """
    if hidden:
        name = next(iter(values)).split(".")[0]
        old = system.member(name)
        new = Member.of(name, stack(old.cls, hidden), old.parameters)
        system = replace(
            system, members=tuple(new if m.name == name else m for m in system.members)
        )
    signals = (
        inputs | CompiledModel(fuse(configured(system, values or {}))).run(time, inputs).signals
    )
    random = np.random.default_rng(3)
    record = {
        name: signals[name][::every]
        + (0.0 if name in inputs else NOISE[unit] * random.standard_normal(time[::every].size))
        for name, unit in columns.items()
    }
    write_record(path, time[::every], record, columns)


def configured(system, settings):
    """System with other parameters: ``{"member.parameter": value}``."""
    members = list(system.members)
    for name, value in settings.items():
        of, parameter = name.split(".")
        place = next(i for i, m in enumerate(members) if m.name == of)
        members[place] = replace(
            members[place], parameters={**members[place].parameters, parameter: value}
        )
    return replace(system, members=tuple(members))


def watched(folder, columns=WATCH, settings=None, **hidden):
    """Degradation watch over five minutes at 10 Hz, its protection at rest; `settings` are those of
    the system.
    """
    system, time = (
        configured(library.system("degradation_watch"), settings or {}),
        0.1 * np.arange(3000),
    )
    inputs = {
        "current_command": multilevel(time, [-0.6, -0.2, 0.3, 0.6], (1.0, 5.0), 2),
        "force": multilevel(time, [0.5, 1.0, 2.0], (8.0, 20.0), 2),
    }
    measure(folder / "record.csv", system, columns, time, inputs, 1, **hidden)
    ssp.write(system, folder / "system.ssp")
    return diagnose_system(folder / "record.csv", folder / "system.ssp")
