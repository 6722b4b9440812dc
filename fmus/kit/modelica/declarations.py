"""Modelica declarations of a component's parameters, signals, states and connectors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from fmus.kit.component import Component
from fmus.kit.declare import Declaration
from fmus.kit.modelica.annotations import placements
from fmus.kit.modelica.connectors import SIGNALS, connector_class, signal_class
from fmus.kit.modelica.names import comment, identifier, modification, real, string
from fmus.kit.modelica.registers import Register
from fmus.kit.units import to_modelica


def declared_identifiers(cls: type[Component]) -> set[str]:
    """Return the identifiers of the variables and connectors of a component."""
    connectors = {identifier(c) for port in cls.ports for c in port.connectors}
    return connectors | {identifier(name) for name in cls.layout.names}


def declarations(
    cls: type[Component], states: bool = True, registers: Sequence[Register] = ()
) -> list[str]:
    """Write the declarations of a component's variables and of the connectors of its ports.

    Parameters
    ----------
    cls : type[Component]
    states : bool
        Whether states are declared with their start values. Otherwise states that are outputs of
        the FMU are declared as outputs, and the others are omitted.
    registers : sequence of Register
        Those whose states are arrays.

    Returns
    -------
    list of str
    """
    places = placements(cls)
    elements = {name for register in registers for name in register.elements}
    lines = [
        declaration(f"parameter {SIGNALS[p.type]}", p, {}, value=literal(p.start, p.type))
        for p in cls.layout.parameters
        if p.name not in elements
    ]
    lines += [line for register in registers for line in _array_declarations(cls, register)]
    lines += [
        _signal(v, "Input", {"start": literal(v.start, v.type)}, places) for v in cls.layout.inputs
    ]
    if states:
        starts = cls.layout.start_of
        for v in (*cls.layout.states, *cls.layout.discretes):
            if v.name not in elements:
                start = {"start": identifier(starts[v.name]), "fixed": "true"}
                lines.append(_signal(v, "Output", start, places))
    outputs = cls.layout.outputs if states else cls.layout.shown
    lines += [_signal(v, "Output", {}, places) for v in outputs]
    for port in cls.ports:
        about = comment(f"of {port.name}")
        for name in port.connectors:
            connector = f"{connector_class(port.domain)} {identifier(name)}"
            lines.append(f"{connector}{about}{places[name]};")
    return lines


def _signal(
    v: Declaration, causality: str, attributes: Mapping[str, str], places: Mapping[str, str]
) -> str:
    """Declare a variable: as a connector if it has a place on the icon."""
    prefix = signal_class(v.type, causality) if v.name in places else SIGNALS[v.type]
    return declaration(prefix, v, attributes, annotation=places.get(v.name, ""))


def _array_declarations(cls: type[Component], register: Register) -> list[str]:
    """Write the declarations of the states of a shift register and of their start values."""
    declared = {d.name: d for d in cls.layout.discretes}
    parameters = {p.starts: p for p in cls.layout.parameters}
    state = declared[register.states[0]]
    starts = [real(parameters[name].start) for name in register.states]
    value = (
        f"fill({starts[0]}, {register.size})"
        if len(set(starts)) == 1
        else f"{{{', '.join(starts)}}}"
    )
    unit = f"each unit={string(to_modelica(state.unit))}"
    size = f"[{register.size}]"
    start = f"{register.name}_start"
    return [
        f"parameter Real {start}{size}({unit}) = {value}"
        f"{comment(f'values of {register.name} at the start')};",
        f"Real {register.array}{size}(start={start}, each fixed=true, {unit}){comment(state.doc)};",
    ]


def declaration(
    prefix: str,
    v: Declaration,
    attributes: Mapping[str, str],
    value: str = "",
    annotation: str = "",
    name: str = "",
) -> str:
    """Write the declaration of a variable with its unit, its range and further attributes.

    Parameters
    ----------
    prefix : str
        Type, after other prefixes.
    v : Declaration
    attributes : Mapping of str to str
        Further attributes by name.
    value : str
        Value that it is declared with; empty for none.
    annotation : str
        With a space before it; empty for none.
    name : str
        Its name if it is not that of the variable.

    Returns
    -------
    str
    """
    modifiers = dict(attributes)
    if v.type == "real":
        modifiers["unit"] = string(to_modelica(v.unit))
        if v.display:
            modifiers["displayUnit"] = string(to_modelica(v.display))
        if v.nominal != 1.0:
            modifiers["nominal"] = real(v.nominal)
    if v.type != "boolean":
        limits = {"min": v.min, "max": v.max}
        modifiers |= {k: literal(x, v.type) for k, x in limits.items() if math.isfinite(x)}
    declared = f"{prefix} {identifier(name or v.name)}{modification(modifiers)}"
    assigned = f" = {value}" if value else ""
    return f"{declared}{assigned}{comment(v.doc)}{annotation};"


def literal(value: float, type: str) -> str:
    """Write a literal of a type: real, integer or boolean."""
    if type == "boolean":
        return "true" if value else "false"
    return str(int(value)) if type == "integer" else real(value)
