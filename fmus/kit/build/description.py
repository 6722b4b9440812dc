"""``modelDescription.xml`` of FMI 2.0 in full, from a component's declarations and its graph."""

from __future__ import annotations

import datetime
import math
import os
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement

from fmus.kit import units
from fmus.kit.build.parameters import serialized
from fmus.kit.build.provenance import annotate
from fmus.kit.component import Component
from fmus.kit.declare import (
    Declaration,
    DiscreteDeclaration,
    InputDeclaration,
    OutputDeclaration,
    ParameterDeclaration,
    StateDeclaration,
    summary,
)
from fmus.kit.errors import UserError
from fmus.kit.layout import Layout
from fmus.kit.symbolic import Graph, dependencies
from fmus.kit.units import to_modelica

# Names of quantities for TypeDefinitions, by the unit they are declared in.
_QUANTITIES = {
    "A": "ElectricCurrent",
    "V": "ElectricPotential",
    "C": "ElectricCharge",
    "ohm": "Resistance",
    "F": "Capacitance",
    "m": "Displacement",
    "N": "Force",
    "N/m": "Stiffness",
    "N*s/m": "Damping",
    "m/C": "DisplacementPerCharge",
    "s": "Time",
    "1": "Ratio",
    "Hz": "Frequency",
    "rad": "Angle",
    "m/s": "Velocity",
    "N*m": "Torque",
    "K": "Temperature",
}

_OURS = {
    "author": "the ppy-rig project",
    "copyright": "Copyright (c) 2026, the ppy-rig authors",
    "license": "BSD-3-Clause",
}

_RELEASED = "2026-11-20T00:00:00Z"  # of this version, as in CHANGELOG.md
_VARIABLE = "SOURCE_DATE_EPOCH"
_LATEST = 253402300799  # s, the end of the year 9999

CATEGORIES = {
    "logStatusWarning": "something questionable was accepted",
    "logStatusDiscard": "a request was declined",
    "logStatusError": "a request failed; the message says why",
    "logStatusFatal": "the instance is unusable",
}


@dataclass(frozen=True)
class Capabilities:
    """The capabilities of a build, for the elements ``CoSimulation`` and ``ModelExchange``.

    Attributes
    ----------
    needs_execution_tool : bool
        Whether a Python interpreter must be there at run time.
    interpolates_inputs : bool
    directional_derivatives : bool
    model_exchange : bool
        Whether a host may integrate the states.
    sources : tuple of str
        Source files listed for recompilation.
    """

    needs_execution_tool: bool
    interpolates_inputs: bool
    directional_derivatives: bool
    model_exchange: bool = False
    sources: tuple[str, ...] = ()


def describe(
    cls: type[Component], graph: Graph, can: Capabilities, version: str, guid: str
) -> bytes:
    """Write ``modelDescription.xml``.

    Parameters
    ----------
    cls : type[Component]
    graph : Graph
        The traced component; its sparsity gives the dependencies.
    can : Capabilities
    version : str
        Version of this package.
    guid : str

    Returns
    -------
    bytes
        UTF-8 XML.
    """
    text = ". ".join([summary(cls), *cls.remark.splitlines()])
    root = Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=cls.name,
        guid=guid,
        description=text,
        version=version,
        generationTool=f"ppy-rig {version}",
        generationDateAndTime=generation_date(),
        variableNamingConvention="structured",
    )
    root.attrib |= _origin(cls)
    if can.model_exchange:
        root.set("numberOfEventIndicators", str(graph.indicators.numel()))
    _interfaces(root, cls, can)
    _units(root, cls.layout)
    categories = SubElement(root, "LogCategories")
    for name, meaning in CATEGORIES.items():
        SubElement(categories, "Category", name=name, description=meaning)
    stop, step = cls.experiment
    SubElement(
        root,
        "DefaultExperiment",
        startTime="0",
        stopTime=_number(stop),
        stepSize=_number(step),
        tolerance=_number(cls.tolerance),
    )
    annotate(root, cls)
    _variables(root, cls)
    _structure(root, cls.layout, graph)
    return serialized(root)


def _interfaces(root: Element, cls: type[Component], can: Capabilities) -> None:
    """Append an element for each interface that the FMU has."""
    common = {
        "needsExecutionTool": _flag(can.needs_execution_tool),
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": _flag(cls.engine is None),
        "canSerializeFMUstate": _flag(cls.engine is None),
        "providesDirectionalDerivative": _flag(can.directional_derivatives),
    }
    own = {
        "CoSimulation": {
            "canHandleVariableCommunicationStepSize": "true",
            "canInterpolateInputs": _flag(can.interpolates_inputs),
        }
    }
    if can.model_exchange:  # it comes first in the schema
        own = {"ModelExchange": {"completedIntegratorStepNotNeeded": "true"}} | own
    for name, attributes in own.items():
        interface = SubElement(root, name, {"modelIdentifier": cls.name} | common | attributes)
        if can.sources:
            files = SubElement(interface, "SourceFiles")
            for source in can.sources:
                SubElement(files, "File", name=source)


def generation_date() -> str:
    """Return the date and time for ``generationDateAndTime``.

    No clock sets it: the same sources give the same bytes.

    Returns
    -------
    str
        In UTC: ``SOURCE_DATE_EPOCH`` of the environment (seconds since 1970), or else the date of
        this version.

    Raises
    ------
    UserError
        If ``SOURCE_DATE_EPOCH`` is no such number.
    """
    given = os.environ.get(_VARIABLE, "")
    if not given:
        return _RELEASED
    if not (given.isascii() and given.isdigit() and int(given[:20]) <= _LATEST):
        raise UserError(
            f"{_VARIABLE} = {given[:40]!r}: seconds since 1970 are wanted, a whole number from 0 to"
            f" {_LATEST}"
        )
    return datetime.datetime.fromtimestamp(int(given), datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _origin(cls: type[Component]) -> dict[str, str]:
    """Return author, copyright and licence as the class declares them.

    The default is ours, if every part of the class is.
    """
    package = __package__.partition(".")[0]
    ours = all(
        part.__module__.partition(".")[0] == package for part in cls.__mro__ if part is not object
    )
    declared = {"author": cls.author, "copyright": cls.copyright, "license": cls.license}
    return {name: text or _OURS[name] for name, text in declared.items() if text or ours}


def _flag(value: bool) -> str:
    """Write a boolean as XML does."""
    return "true" if value else "false"


def _number(value: float) -> str:
    """Write a number with as many digits as it needs."""
    return repr(float(value)).removesuffix(".0")


def _units(root: Element, layout: Layout) -> None:
    """Append the units and the display units of real variables, and types that have them."""
    displays: dict[str, set[str]] = {unit: set() for _, unit in layout.derivatives}
    types: dict[str, Declaration] = {}
    for variable in layout.variables:
        if variable.type != "real":
            continue
        own = displays.setdefault(variable.unit, set())
        if variable.display:
            own.add(variable.display)
        types.setdefault(_type_name(variable), variable)
    definitions = SubElement(root, "UnitDefinitions")
    defined: dict[str, Element] = {}
    # two that are the same in Modelica, such as m/s/s and m/s^2, are defined once
    for unit in sorted(displays, key=to_modelica):
        name = to_modelica(unit)
        if name not in defined:
            defined[name] = _define(SubElement(definitions, "Unit", name=name), unit)
        for display in sorted(displays[unit]):
            _display(defined[name], unit, display)
    if types:
        definitions = SubElement(root, "TypeDefinitions")
        for name in sorted(types):
            node = SubElement(definitions, "SimpleType", name=name)
            attributes = {"quantity": _quantity(types[name].unit)} | _unit_attributes(types[name])
            SubElement(node, "Real", attributes)


def _define(node: Element, unit: str) -> Element:
    """Append the definition of a unit in SI base units, and return the node."""
    base = units.base_unit(unit)
    attributes = {name: str(power) for name, power in sorted(base.exponents.items())}
    if base.factor != 1.0:
        attributes["factor"] = _number(base.factor)
    if base.offset:
        attributes["offset"] = _number(base.offset)
    SubElement(node, "BaseUnit", attributes)
    return node


def _display(node: Element, unit: str, display: str) -> None:
    """Append the definition of a display unit, unless it is there."""
    name = to_modelica(display)
    if node.find(f"DisplayUnit[@name='{name}']") is not None:
        return
    # FMI: display value = factor * value + offset
    offset = units.convert(0.0, unit, display)
    factor = units.convert(1.0, unit, display) - offset
    SubElement(node, "DisplayUnit", name=name, factor=_number(factor), offset=_number(offset))


def _quantity(unit: str) -> str:
    """Return the name of the quantity that is measured in a unit."""
    return _QUANTITIES.get(unit, to_modelica(unit))


def _type_name(variable: Declaration) -> str:
    """Return the name of the type of a real variable, from its quantity and display unit."""
    name = _quantity(variable.unit)
    if variable.display:
        name += f"_in_{to_modelica(variable.display)}"
    return name.replace(" ", "_")


def _unit_attributes(variable: Declaration) -> dict[str, str]:
    """Return the attributes for the unit and the display unit of a variable."""
    attributes = {"unit": to_modelica(variable.unit)}
    if variable.display:
        attributes["displayUnit"] = to_modelica(variable.display)
    return attributes


_KINDS = {
    ParameterDeclaration: {"causality": "parameter", "variability": "fixed", "initial": "exact"},
    InputDeclaration: {"causality": "input", "variability": "continuous"},
    OutputDeclaration: {
        "causality": "output",
        "variability": "continuous",
        "initial": "calculated",
    },
    StateDeclaration: {"causality": "local", "variability": "continuous", "initial": "calculated"},
    DiscreteDeclaration: {"causality": "local", "variability": "discrete", "initial": "calculated"},
}


def _variables(root: Element, cls: type[Component]) -> None:
    """Append an element for each variable, in the order of value references."""
    parent = SubElement(root, "ModelVariables")
    layout = cls.layout
    for reference, variable in enumerate(layout.variables):
        _variable(parent, reference, variable)
    first_state = len(layout.parameters) + len(layout.inputs)
    for index, (name, unit) in enumerate(layout.derivatives):
        node = SubElement(
            parent,
            "ScalarVariable",
            name=name,
            valueReference=str(len(layout.variables) + index),
            description=f"time derivative of {layout.states[index].name}",
            causality="local",
            variability="continuous",
            initial="calculated",
        )
        SubElement(node, "Real", unit=to_modelica(unit), derivative=str(first_state + index + 1))
    for reference, parameter in enumerate(layout.texts, len(layout.names)):
        node = SubElement(
            parent,
            "ScalarVariable",
            name=parameter.name,
            valueReference=str(reference),
            description=parameter.doc,
            causality="parameter",
            variability="fixed",
            initial="exact",
        )
        SubElement(node, "String", start=parameter.start)


def _variable(parent: Element, reference: int, variable: Declaration) -> None:
    """Append the element of a declared variable."""
    kind = dict(_KINDS[type(variable)])
    if getattr(variable, "output", False):
        kind["causality"] = "output"
    if variable.type != "real" and kind["variability"] == "continuous":
        kind["variability"] = "discrete"
    description = variable.doc + (f" [{variable.source}]" if variable.source else "")
    node = SubElement(
        parent,
        "ScalarVariable",
        {"name": variable.name, "valueReference": str(reference), "description": description}
        | kind,
    )
    value = SubElement(node, variable.type.capitalize())
    if variable.type == "real":
        value.set("declaredType", _type_name(variable))
        for name, text in _unit_attributes(variable).items():
            value.set(name, text)
    if variable.type != "boolean":
        for name, bound in (("min", variable.min), ("max", variable.max)):
            if math.isfinite(bound):
                value.set(name, _written(bound, variable.type))
    if variable.type == "real" and variable.nominal != 1.0:
        value.set("nominal", _number(variable.nominal))
    if isinstance(variable, (ParameterDeclaration, InputDeclaration)):
        value.set("start", _written(variable.start, variable.type))


def _written(value: float, kind: str) -> str:
    """Write a value of an FMI type."""
    if kind == "real":
        return _number(value)
    return _flag(bool(value)) if kind == "boolean" else str(int(value))


def _structure(root: Element, layout: Layout, graph: Graph) -> None:
    """Append the dependencies of outputs, derivatives and initial unknowns."""
    parent = SubElement(root, "ModelStructure")
    for title, unknowns in dependencies(layout, graph).items():
        if unknowns:
            node = SubElement(parent, title)
            for reference in sorted(unknowns):
                known = " ".join(str(k + 1) for k in unknowns[reference])
                SubElement(node, "Unknown", index=str(reference + 1), dependencies=known)
