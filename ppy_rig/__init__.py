"""The package to import: simulation models, and their diagnosis against measured records.

>>> import ppy_rig as ppy
>>> record = ppy.read_record("hidden.csv", model="ppy_actuator")  # doctest: +SKIP
>>> result = ppy.diagnose(record, model="ppy_actuator")  # doctest: +SKIP
>>> print(result)  # doctest: +SKIP

Importing it is cheap: a name is loaded from ``orchestration`` when it is first used. Models are
written with ``fmus.kit``, which travels inside their Python FMUs, where there is no other package.
"""

from typing import Any

import orchestration

__all__ = orchestration.__all__


def __getattr__(name: str) -> Any:
    """Load a name of ``orchestration``."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(orchestration, name)


def __dir__() -> list[str]:
    """Return the names that are offered."""
    return sorted(__all__)
