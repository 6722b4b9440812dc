"""``modelDescription.xml`` and ``buildDescription.xml`` of FMI 3.0."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from xml.etree.ElementTree import Element, SubElement

from fmus.kit.build.description import common
from fmus.kit.build.parameters import serialized
from fmus.kit.build.provenance import annotate
from fmus.kit.build.toolchain import FOLDERS_OF_FMI_3
from fmus.kit.component import Component
from fmus.kit.layout import ArrayPlace, Clock, Layout
from fmus.kit.symbolic import Graph, dependencies

_TYPES = {"real": "Float64", "integer": "Int32", "boolean": "Boolean"}
# name of an unknown in FMI 3.0 by the name of its list in FMI 2.0
_UNKNOWNS = {
    "Outputs": "Output",
    "Derivatives": "ContinuousStateDerivative",
    "InitialUnknowns": "InitialUnknown",
    "EventIndicators": "EventIndicator",
}


def describe_fmi3(
    cls: type[Component], graph: Graph, can: common.Capabilities, version: str, guid: str
) -> bytes:
    """Write ``modelDescription.xml`` of FMI 3.0.

    Parameters
    ----------
    cls : type[Component]
    graph : Graph
        The traced component; its sparsity gives the dependencies.
    can : Capabilities
    version : str
        Version of this package.
    guid : str
        Instantiation token.

    Returns
    -------
    bytes
        UTF-8 XML.
    """
    identity = {"fmiVersion": "3.0", "instantiationToken": guid}
    root = common.model_description(cls, version, identity)
    layout = cls.layout
    _append_interfaces(root, cls, can)
    common.define_units(root, layout, ["s", "1"])
    types = common.typed_reals(layout)
    if types:
        definitions = SubElement(root, "TypeDefinitions")
        for name, variable in types.items():
            SubElement(
                definitions, "Float64Type", {"name": name} | common.type_attributes(variable)
            )
    common.append_experiment(root, cls)
    indicators = graph.indicators.numel() if can.model_exchange else 0
    _append_variables(root, layout, indicators)
    first_clock = _time_reference(layout) + 1 + indicators
    clocks = range(first_clock, first_clock + len(layout.sampled) * can.clocks)
    _append_clocks(root, layout, clocks)
    _append_structure(root, layout, graph, can, clocks)
    annotate(root, cls, graph, 3)
    return serialized(root)


def build_description(
    cls: type[Component], unit: str, libraries: Mapping[str, Iterable[str]]
) -> bytes:
    """Write ``buildDescription.xml``, which tells a tool how to compile the sources.

    Parameters
    ----------
    cls : type[Component]
    unit : str
        Source file that includes every other.
    libraries : Mapping of str to iterable of str
        System libraries to link with, by the platform's name in FMI 2.0.

    Returns
    -------
    bytes
        UTF-8 XML.
    """
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    for target, folders in FOLDERS_OF_FMI_3.items():
        for folder in folders:
            configuration = SubElement(
                root, "BuildConfiguration", modelIdentifier=cls.name, platform=folder
            )
            files = SubElement(configuration, "SourceFileSet", language="C99")
            SubElement(files, "SourceFile", name=unit)
            for library in libraries.get(target, ()):
                SubElement(configuration, "Library", name=library, external="true")
    return serialized(root)


def _append_interfaces(root: Element, cls: type[Component], can: common.Capabilities) -> None:
    """Append an element for each interface that the FMU has."""
    shared = {
        "modelIdentifier": cls.name,
        "needsExecutionTool": common.flag(can.needs_execution_tool),
        "canGetAndSetFMUState": common.flag(cls.engine is None),
        "canSerializeFMUState": common.flag(cls.engine is None),
        "providesDirectionalDerivatives": common.flag(can.directional_derivatives),
        "providesAdjointDerivatives": common.flag(can.directional_derivatives),
    }
    if can.model_exchange:
        SubElement(root, "ModelExchange", shared | {"needsCompletedIntegratorStep": "false"})
    co_simulation = {
        "canHandleVariableCommunicationStepSize": "true",
        "maxOutputDerivativeOrder": "1" if can.directional_derivatives else "0",
        "hasEventMode": "true",
        "mightReturnEarlyFromDoStep": common.flag(bool(cls.layout.sampled)),
    }
    SubElement(root, "CoSimulation", shared | co_simulation)


def _append_variables(root: Element, layout: Layout, indicators: int) -> None:
    """Append an element for each variable or array, in the order of value references."""
    parent = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(layout.variables):
        attributes = common.variable_attributes(reference, variable)
        SubElement(parent, _TYPES[variable.type], attributes | common.value_attributes(variable))
    for attributes, unit, state in common.derivatives(layout):
        SubElement(parent, "Float64", attributes, unit=unit, derivative=str(state))
    for array in layout.arrays:
        _join(parent, array)
    for reference, parameter in enumerate(layout.texts, len(layout.names)):
        node = SubElement(parent, "String", common.text_attributes(reference, parameter))
        SubElement(node, "Start", value=parameter.start)
    time = _time_reference(layout)
    SubElement(
        parent,
        "Float64",
        name="time",
        valueReference=str(time),
        description="simulation time",
        causality="independent",
        variability="continuous",
        unit="s",
    )
    for index in range(indicators):
        description = "changes its sign where a law switches"
        attributes = common.calculated(f"indicator[{index + 1}]", time + 1 + index, description)
        SubElement(parent, "Float64", attributes | {"unit": "1"})


def _join(parent: Element, array: ArrayPlace) -> None:
    """Replace the elements of an array by one variable, with the reference of the first."""
    references = {str(array.first + k) for k in range(array.size)}
    elements = [node for node in parent if node.get("valueReference") in references]
    first, *others = elements
    place = f"[{','.join('1' for _ in array.shape)}]"
    starts = [node.get("start", "") for node in elements]
    first.set("name", array.name)
    first.set("description", first.get("description", "").replace(place, ""))
    if starts[0]:
        first.set("start", " ".join(starts))
    for size in array.shape:
        SubElement(first, "Dimension", start=str(size))
    for node in others:
        parent.remove(node)


def _append_clocks(root: Element, layout: Layout, references: Sequence[int]) -> None:
    """Append an output clock for each group of states that are sampled together.

    The standard has periodic clocks as inputs only, which a host activates; a component that
    samples by itself has triggered ones (FMI 3.0, section 2.2.8.2).
    """
    parent = root.find("ModelVariables")
    assert parent is not None
    for index, reference in enumerate(references):
        clock, members = layout.sampled[index]
        SubElement(
            parent,
            "Clock",
            name=f"clock[{index + 1}]",
            valueReference=str(reference),
            description=_clock_text(clock, [member.name for member in members]),
            causality="output",
            variability="discrete",
            intervalVariability="triggered",
        )


def _clock_text(clock: Clock, members: Sequence[str]) -> str:
    """Return the description of a clock, with its period and the states that it samples."""
    period = clock.period if isinstance(clock.period, str) else f"{common.number(clock.period)} s"
    shift = f", first after {' + '.join(clock.shift)}" if clock.shift else ""
    return f"active every {period}{shift}, when {', '.join(members)} are sampled"


def _time_reference(layout: Layout) -> int:
    """Return the value reference of the time; those of event indicators come after it."""
    return len(layout.names) + len(layout.texts)


def _append_structure(
    root: Element, layout: Layout, graph: Graph, can: common.Capabilities, clocks: Sequence[int]
) -> None:
    """Append the dependencies of outputs, derivatives, initial unknowns and event indicators."""
    parent = SubElement(root, "ModelStructure")
    array_of = {a.first + k: a.first for a in layout.arrays for k in range(a.size)}
    time = _time_reference(layout)
    structure = dependencies(graph, can.directional_derivatives, time)
    structure["Outputs"] |= {clock: [time] for clock in clocks}
    structure["InitialUnknowns"] |= {clock: [] for clock in clocks}
    for title, unknowns in structure.items():
        if title == "EventIndicators" and not can.model_exchange:
            continue
        joined: dict[int, set[int]] = {}
        for reference, known in unknowns.items():
            of = joined.setdefault(array_of.get(reference, reference), set())
            of.update(array_of.get(k, k) for k in known)
        for reference in sorted(joined):
            known_text = " ".join(map(str, sorted(joined[reference])))
            attributes = {"valueReference": str(reference), "dependencies": known_text}
            SubElement(parent, _UNKNOWNS[title], attributes)
