"""Runs of the master with FMUs of stock pythonfmu, for a process of their own."""

from __future__ import annotations

from typing import Any

import numpy as np

from orchestration.master import Stopped, run
from tests.support.hosts import MINIMAL_PYTHONFMU_SOURCE, build_minimal_pythonfmu, build_pythonfmu
from tests.support.master.samples import ring

TIME = 0.1 * np.arange(31)
_FAULTS = {
    "discard": "return False",
    "fatal": "raise ValueError('enough')",
    "nan": "self.x = float('nan'); return True",
}


def circle(folder: str) -> Any:
    """Two lags in a circle, and what is said of a third that goes wrong at 3 s."""
    fmu = build_minimal_pythonfmu(folder)
    result = run(
        ring(fmu, {"a": {}, "b": {}}, "a.x -> b.u; b.x -> -1 a.u + 1"), TIME, method="jacobi"
    )
    told, ends = {}, []
    for name, fault in _FAULTS.items():
        step = "    def do_step(self, current_time, step_size):\n"
        source = MINIMAL_PYTHONFMU_SOURCE.replace(
            step, f"{step}        if current_time > 2.99:\n            {fault}\n"
        )
        faulty = build_pythonfmu(folder, name, source.replace("Minimal", name.capitalize()))
        try:
            run(
                ring({"a": fmu, "c": faulty}, {"a": {}, "c": {"u": 0.0}}, "c.x -> a.u"),
                0.1 * np.arange(41),
            )
        except Stopped as error:
            told[name] = str(error)
            ends.append(float(error.run.time[-1]))
    return result.signals, result.notes, told, ends
