"""``modelDescription.xml`` of FMI 2.0, from the declarations and the graph of a component."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.etree.ElementTree import Element, SubElement

from fmus.kit.build.description import common
from fmus.kit.build.parameters import serialized
from fmus.kit.build.provenance import annotate
from fmus.kit.component import Component
from fmus.kit.layout import Layout
from fmus.kit.symbolic import Graph, dependencies


def describe_fmi2(
    cls: type[Component], graph: Graph, can: common.Capabilities, version: str, guid: str
) -> bytes:
    """Write ``modelDescription.xml`` of FMI 2.0.

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
    root = common.model_description(cls, version, {"fmiVersion": "2.0", "guid": guid})
    if can.model_exchange:
        root.set("numberOfEventIndicators", str(graph.indicators.numel()))
    _append_interfaces(root, graph, can)
    common.define_units(root, cls.layout)
    types = common.typed_reals(cls.layout)
    if types:
        definitions = SubElement(root, "TypeDefinitions")
        for name, variable in types.items():
            node = SubElement(definitions, "SimpleType", name=name)
            SubElement(node, "Real", common.type_attributes(variable))
    common.append_experiment(root, cls)
    annotate(root, cls, graph, 2)
    _append_variables(root, cls.layout)
    structure = dependencies(graph, states_known=can.directional_derivatives)
    _append_structure(root, structure)
    return serialized(root)


def _append_interfaces(root: Element, graph: Graph, can: common.Capabilities) -> None:
    """Append an element for each interface that the FMU has."""
    shared = {
        "modelIdentifier": graph.name,
        "needsExecutionTool": common.flag(can.needs_execution_tool),
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": common.flag(graph.restorable),
        "canSerializeFMUstate": common.flag(graph.restorable),
        "providesDirectionalDerivative": common.flag(can.directional_derivatives),
    }
    if can.runs_once:
        shared["canBeInstantiatedOnlyOncePerProcess"] = "true"
    interfaces = {}  # in the order of the schema
    if can.model_exchange:
        interfaces["ModelExchange"] = {"completedIntegratorStepNotNeeded": "true"}
    interfaces["CoSimulation"] = {
        "canHandleVariableCommunicationStepSize": common.flag(can.varies_step),
        "canInterpolateInputs": common.flag(can.interpolates_inputs),
    }
    for name, attributes in interfaces.items():
        interface = SubElement(root, name, shared | attributes)
        if can.sources:
            files = SubElement(interface, "SourceFiles")
            for source in can.sources:
                SubElement(files, "File", name=source)


def _append_variables(root: Element, layout: Layout) -> None:
    """Append an element for each variable, in the order of value references."""
    parent = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(layout.variables):
        node = SubElement(parent, "ScalarVariable", common.variable_attributes(reference, variable))
        SubElement(node, variable.type.capitalize(), common.value_attributes(variable))
    for attributes, unit, state in common.derivatives(layout):
        node = SubElement(parent, "ScalarVariable", attributes)
        SubElement(node, "Real", unit=unit, derivative=str(state + 1))
    for reference, parameter in enumerate(layout.texts, len(layout.names)):
        node = SubElement(parent, "ScalarVariable", common.text_attributes(reference, parameter))
        SubElement(node, "String", start=parameter.start)


def _append_structure(root: Element, structure: Mapping[str, Mapping[int, Sequence[int]]]) -> None:
    """Append the dependencies of outputs, derivatives and initial unknowns."""
    parent = SubElement(root, "ModelStructure")
    for title, unknowns in structure.items():
        if unknowns:
            node = SubElement(parent, title)
            for reference in sorted(unknowns):
                known = " ".join(str(k + 1) for k in unknowns[reference])
                SubElement(node, "Unknown", index=str(reference + 1), dependencies=known)
