"""The authoring kit: declare a component once, get a Python FMU and a native FMU.

Importing this package is cheap; it needs only the standard library, because it travels inside the
Python FMUs. What not every component needs is imported when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .component import (
    Component,
    Effect,
    Engine,
    Size,
    Term,
    effect_maker,
    effect_name,
    effects_by_name,
    made_by,
    made_with,
    make_effect,
    stack,
    stacked_with,
    unstack,
)
from .declare import (
    Constant,
    Declaration,
    Discrete,
    DiscreteDeclaration,
    Input,
    InputDeclaration,
    Output,
    OutputDeclaration,
    Parameter,
    ParameterDeclaration,
    Preset,
    State,
    StateDeclaration,
    Text,
    make_start_parameter,
    name_declaration,
    summary,
)
from .errors import DeclarationError, UserError, suggestion
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
    outside,
    sign,
    sin,
    slopes,
    smooth_table,
    sqrt,
    table,
    tanh,
    where,
)
from .layout import Layout, law_of
from .ports import DOMAINS, Domain, PowerPort
from .sharing import shared
from .titles import (
    capitalised,
    effect_title,
    in_words,
    law_title,
    titled,
    variable_title,
    within_sentence,
)

if TYPE_CHECKING:
    from .arms import lag_effect, storing_wall
    from .corrections import MEMORIES, SignalTerm, SmoothTable, correction, effect_family
    from .curves import SHAPES, EffectNames, curve
    from .generic import describe_effect
    from .integrate import Integrator
    from .sampling import Sampling
    from .sensors import MEASUREMENTS, measurement_effects, transport_delay
    from .slave import describe_error

__all__ = [
    "DOMAINS",
    "MEASUREMENTS",
    "MEMORIES",
    "SHAPES",
    "Component",
    "Constant",
    "Declaration",
    "DeclarationError",
    "Discrete",
    "DiscreteDeclaration",
    "Domain",
    "Effect",
    "EffectNames",
    "Engine",
    "Input",
    "InputDeclaration",
    "Integrator",
    "Layout",
    "Output",
    "OutputDeclaration",
    "Parameter",
    "ParameterDeclaration",
    "PowerPort",
    "Preset",
    "Sampling",
    "SignalTerm",
    "Size",
    "SmoothTable",
    "State",
    "StateDeclaration",
    "Term",
    "Text",
    "UserError",
    "absolute",
    "arccos",
    "arctan2",
    "capitalised",
    "clip",
    "correction",
    "cos",
    "curve",
    "describe_effect",
    "describe_error",
    "effect_family",
    "effect_maker",
    "effect_name",
    "effect_title",
    "effects_by_name",
    "exp",
    "floor",
    "hypot",
    "in_words",
    "lag_effect",
    "law_of",
    "law_title",
    "log",
    "logical_and",
    "logical_not",
    "logical_or",
    "made_by",
    "made_with",
    "make_effect",
    "make_start_parameter",
    "maximum",
    "measurement_effects",
    "minimum",
    "name_declaration",
    "outside",
    "shared",
    "sign",
    "sin",
    "slopes",
    "smooth_table",
    "sqrt",
    "stack",
    "stacked_with",
    "storing_wall",
    "suggestion",
    "summary",
    "table",
    "tanh",
    "titled",
    "transport_delay",
    "unstack",
    "variable_title",
    "where",
    "within_sentence",
]

_HOMES = {
    "lag_effect": "arms",
    "storing_wall": "arms",
    "MEMORIES": "corrections",
    "SignalTerm": "corrections",
    "SmoothTable": "corrections",
    "correction": "corrections",
    "effect_family": "corrections",
    "SHAPES": "curves",
    "EffectNames": "curves",
    "curve": "curves",
    "describe_effect": "generic",
    "Integrator": "integrate",
    "Sampling": "sampling",
    "MEASUREMENTS": "sensors",
    "measurement_effects": "sensors",
    "transport_delay": "sensors",
    "describe_error": "slave",
}
"""Name -> module of this package that is imported when the name is first used."""


def __getattr__(name: str) -> Any:
    """Import the module that a name is in."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
