"""Diagnosis of simulation models against measured records, and the FMI components of an artificial-muscle rig.

>>> import orchestration as ppy
>>> record = ppy.read_record("hidden.csv", model="ppy_actuator")  # doctest: +SKIP
>>> result = ppy.diagnose(record, model="ppy_actuator")  # doctest: +SKIP
>>> print(result)  # doctest: +SKIP

Importing this package is cheap: a name is loaded when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from orchestration.api.black_box import black_box
    from orchestration.api.diagnosis import diagnose
    from orchestration.api.identification import compare, fit
    from orchestration.api.laws import laws
    from orchestration.api.models import build, check
    from orchestration.api.records import read_record
    from orchestration.api.runs import run
    from orchestration.api.simulation import simulate
    from orchestration.api.sweeping import sweep, sweep_file
    from orchestration.fmu.model import find_model
    from orchestration.sweeps.sensitivity.bands import bands
    from orchestration.sweeps.sensitivity.indices import sensitivity
    from orchestration.sweeps.sensitivity.tornado import tornado
    from orchestration.system.model import System

_HOME = {
    "bands": "orchestration.sweeps.sensitivity.bands",
    "black_box": "orchestration.api.black_box",
    "build": "orchestration.api.models",
    "check": "orchestration.api.models",
    "compare": "orchestration.api.identification",
    "diagnose": "orchestration.api.diagnosis",
    "find_model": "orchestration.fmu.model",
    "fit": "orchestration.api.identification",
    "laws": "orchestration.api.laws",
    "read_record": "orchestration.api.records",
    "run": "orchestration.api.runs",
    "sensitivity": "orchestration.sweeps.sensitivity.indices",
    "simulate": "orchestration.api.simulation",
    "sweep": "orchestration.api.sweeping",
    "sweep_file": "orchestration.api.sweeping",
    "tornado": "orchestration.sweeps.sensitivity.tornado",
    "System": "orchestration.system.model",
}
__all__ = [
    "System",
    "bands",
    "black_box",
    "build",
    "check",
    "compare",
    "diagnose",
    "find_model",
    "fit",
    "laws",
    "read_record",
    "run",
    "sensitivity",
    "simulate",
    "sweep",
    "sweep_file",
    "tornado",
]


def __getattr__(name: str) -> Any:
    """Load a public name from where it lives."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_HOME[name]), name)
    return value


def __dir__() -> list[str]:
    """Public names, for completion."""
    return sorted([*globals(), *__all__])
