"""The authoring kit: declare a component once, get a Python FMU and a native FMU.

This module offers the language in which a component is written: declarations, and the functions of
laws. It needs only the standard library, because it travels inside Python FMUs. The other modules
of the kit are imported by their own names.
"""

from . import functions
from .component import Component
from .declare import Array, Constant, Discrete, Input, Output, Parameter, Preset, State, Text
from .effects import Effect, Size, Term, stack
from .errors import UserError
from .functions import *  # noqa: F403 - the functions of laws are one language
from .integrate import Integrator
from .ports import PowerPort
from .sharing import shared

__all__ = [
    "Array",
    "Component",
    "Constant",
    "Discrete",
    "Effect",
    "Input",
    "Integrator",
    "Output",
    "Parameter",
    "PowerPort",
    "Preset",
    "Size",
    "State",
    "Term",
    "Text",
    "UserError",
    "shared",
    "stack",
]
__all__ += functions.__all__
