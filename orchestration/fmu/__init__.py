"""One FMU, anybody's: its file and its variables, a running instance of it, and what the FMU contract asks of it.

What users need stands here and is loaded when it is asked for, so that listing variables loads nothing that runs FMUs.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from orchestration.fmu.instance import Fmu
    from orchestration.fmu.model import Model, find_model

__all__ = ["Fmu", "Model", "find_model"]
_MODULES = {"Fmu": "instance", "Model": "model", "find_model": "model"}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
