"""``modelDescription.xml`` of FMI 2.0 in full, from a component's declarations and its graph."""

from __future__ import annotations

import math
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement

from fmus.kit import units
from fmus.kit.build.date import generation_date
from fmus.kit.build.provenance import annotate
from fmus.kit.build.xml import serialized
from fmus.kit.component import Component
from fmus.kit.declare import (
    Declaration,
    DiscreteDeclaration,
    InputDeclaration,
    OutputDeclaration,
    ParameterDeclaration,
    StateDeclaration,
)
from fmus.kit.layout import Layout
from fmus.kit.spelling import to_modelica
from fmus.kit.symbolic.structure import dependencies
from fmus.kit.symbolic.trace import Graph

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

CATEGORIES = {
    "logStatusWarning": "something questionable was accepted",
    "logStatusDiscard": "a request was declined",
    "logStatusError": "a request failed; the message says why",
    "logStatusFatal": "the instance is unusable",
}


@dataclass(frozen=True)
class Capabilities:
    """What a build can do beyond the common; declared truthfully in ``CoSimulation`` and ``ModelExchange``.

    Attributes
    ----------
    needs_execution_tool : bool
        A Python interpreter must be there at run time.
    interpolates_inputs : bool
    directional_derivatives : bool
    model_exchange : bool
        A host may integrate the states.
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
    summary = (cls.__doc__ or "").strip().split("\n")[0].rstrip(".")
    text = ". ".join([summary, *cls.remark.splitlines()])
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
    for name, text in CATEGORIES.items():
        SubElement(categories, "Category", name=name, description=text)
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


def _origin(cls: type[Component]) -> dict[str, str]:
    """Author, copyright and licence, as the class declares them or ours where nothing of somebody else is in it."""
    package = __package__.partition(".")[0]
    ours = all(
        part.__module__.partition(".")[0] == package for part in cls.__mro__ if part is not object
    )
    declared = {"author": cls.author, "copyright": cls.copyright, "license": cls.license}
    return {name: text or _OURS[name] for name, text in declared.items() if text or ours}


def _flag(value: bool) -> str:
    return "true" if value else "false"


def _number(value: float) -> str:
    return repr(float(value)).removesuffix(".0")


def _units(root: Element, layout: Layout) -> None:
    displays: dict[str, set[str]] = {unit: set() for _, unit in layout.derivatives}
    types: dict[str, Declaration] = {}
    for variable in layout.variables:
        if variable.type != "real":
            continue
        displays.setdefault(variable.unit, set()).update(
            [variable.display] if variable.display else []
        )
        types.setdefault(_type_name(variable), variable)
    definitions = SubElement(root, "UnitDefinitions")
    defined: dict[str, Element] = {}
    for unit in sorted(
        displays, key=to_modelica
    ):  # two that are the same in Modelica, such as m/s/s and m/s^2, are one
        name = to_modelica(unit)
        if name not in defined:
            defined[name] = _define(SubElement(definitions, "Unit", name=name), unit)
        for display in sorted(displays[unit]):
            _display(defined[name], unit, display)
    if types:
        definitions = SubElement(root, "TypeDefinitions")
        for name in sorted(types):
            node = SubElement(definitions, "SimpleType", name=name)
            SubElement(
                node,
                "Real",
                {"quantity": _quantity(types[name].unit)} | _unit_attributes(types[name]),
            )


def _define(node: Element, unit: str) -> Element:
    base = units.base_unit(unit)
    attributes = {name: str(power) for name, power in sorted(base.exponents.items())}
    if base.factor != 1.0:
        attributes["factor"] = _number(base.factor)
    if base.offset:
        attributes["offset"] = _number(base.offset)
    SubElement(node, "BaseUnit", attributes)
    return node


def _display(node: Element, unit: str, display: str) -> None:
    name = to_modelica(display)
    if node.find(f"DisplayUnit[@name='{name}']") is not None:
        return
    # FMI: display value = factor * value + offset
    offset = units.convert(0.0, unit, display)
    factor = units.convert(1.0, unit, display) - offset
    SubElement(node, "DisplayUnit", name=name, factor=_number(factor), offset=_number(offset))


def _quantity(unit: str) -> str:
    return _QUANTITIES.get(unit, to_modelica(unit))


def _type_name(variable: Declaration) -> str:
    name = _quantity(variable.unit) + (
        f"_in_{to_modelica(variable.display)}" if variable.display else ""
    )
    return name.replace(" ", "_")


def _unit_attributes(variable: Declaration) -> dict[str, str]:
    display = {"displayUnit": to_modelica(variable.display)} if variable.display else {}
    return {"unit": to_modelica(variable.unit)} | display


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
    parent = SubElement(root, "ModelVariables")
    layout = cls.layout
    for reference, variable in enumerate(layout.variables):
        kind = dict(_KINDS[type(variable)])
        if getattr(variable, "output", False):
            kind["causality"] = "output"
        if variable.type != "real" and kind["variability"] == "continuous":
            kind["variability"] = "discrete"
        text = variable.doc + (f" [{variable.source}]" if variable.source else "")
        node = SubElement(
            parent,
            "ScalarVariable",
            {"name": variable.name, "valueReference": str(reference), "description": text} | kind,
        )
        value = SubElement(node, variable.type.capitalize())
        if variable.type == "real":
            value.set("declaredType", _type_name(variable))
            for name, text in _unit_attributes(variable).items():
                value.set(name, text)
        if variable.type != "boolean":
            for name in ("min", "max"):
                if math.isfinite(getattr(variable, name)):
                    number = getattr(variable, name)
                    value.set(
                        name, _number(number) if variable.type == "real" else str(int(number))
                    )
        if variable.type == "real" and variable.nominal != 1.0:
            value.set("nominal", _number(variable.nominal))
        if isinstance(variable, (ParameterDeclaration, InputDeclaration)):
            start = variable.start
            value.set(
                "start",
                {"real": _number, "integer": lambda v: str(int(v)), "boolean": _flag}[
                    variable.type
                ](start),
            )
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


def _structure(root: Element, layout: Layout, graph: Graph) -> None:
    parent = SubElement(root, "ModelStructure")
    for title, unknowns in dependencies(layout, graph).items():
        if unknowns:
            node = SubElement(parent, title)
            for reference in sorted(unknowns):
                known = " ".join(str(k + 1) for k in unknowns[reference])
                SubElement(node, "Unknown", index=str(reference + 1), dependencies=known)
