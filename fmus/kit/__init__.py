"""The authoring kit: declare a component once, get a Python FMU and a native FMU.

Importing this package is cheap; it needs only the standard library, because it travels inside the Python FMUs.
"""

from .component import Component, Effect, stack
from .declare import Discrete, Input, Output, Parameter, Preset, State, Text
from .errors import UserError
from .functions import (
    absolute,
    arccos,
    arctan2,
    clip,
    cos,
    exp,
    floor,
    hypot,
    log,
    logical_and,
    logical_not,
    logical_or,
    maximum,
    minimum,
    sign,
    sin,
    smooth_table,
    sqrt,
    table,
    tanh,
    where,
)

__all__ = [
    "Component",
    "Discrete",
    "Effect",
    "Input",
    "Output",
    "Parameter",
    "Preset",
    "State",
    "Text",
    "UserError",
    "absolute",
    "arccos",
    "arctan2",
    "clip",
    "cos",
    "exp",
    "floor",
    "hypot",
    "log",
    "logical_and",
    "logical_not",
    "logical_or",
    "maximum",
    "minimum",
    "sign",
    "sin",
    "smooth_table",
    "sqrt",
    "stack",
    "table",
    "tanh",
    "where",
]
