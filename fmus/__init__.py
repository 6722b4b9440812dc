"""The components: each subpackage is one, ``kit`` is what they are made with."""

from __future__ import annotations

import difflib
import importlib
from typing import TYPE_CHECKING

from .kit.errors import UserError

if TYPE_CHECKING:
    from .kit import Component

# name of the FMU -> module and class; strings, so that listing them imports nothing
COMPONENTS = {
    "ppy_actuator": "ppy_actuator.model:PpyActuator",
    "ppy_actuator_length_driven": "ppy_actuator.model:PpyActuatorLengthDriven",
}


def component(name: str) -> type[Component]:
    """Load a component class by its FMU name.

    Raises
    ------
    UserError
        If there is none of that name.
    """
    if name not in COMPONENTS:
        near = difflib.get_close_matches(name, COMPONENTS, 1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise UserError(f"no component named {name!r}{hint} (there are {', '.join(COMPONENTS)})")
    module, cls = COMPONENTS[name].split(":")
    return getattr(importlib.import_module(f"{__name__}.{module}"), cls)
