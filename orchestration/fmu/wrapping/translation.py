"""The model description of FMI 3.0 in terms of FMI 2.0.

Arrays become scalars, named by their indices from 1 and in row-major order: ``A[2,1]``. Structural
parameters keep their start values, because the sizes of arrays depend on them. Binary values are
texts of hexadecimal digits. Input clocks are no variables of FMI 2.0: the wrapper ticks those of
time. The value of any other clock is the number of its ticks.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

from orchestration.fmu.wrapping.clocks import InputClock, input_clocks
from orchestration.fmu.wrapping.variables import (
    NUMBERS,
    DeclaredVariable,
    Fmi3Description,
    Fmi3Variable,
    number_type,
)

_COUNT = "1"  # unit of wide integers
_EXACT = 2**53 - 1  # largest of the whole numbers that a real has, each
_RANGES = {"Int8": (-128, 127), "UInt8": (0, 255), "Int16": (-(2**15), 2**15 - 1)}
_RANGES |= {"UInt16": (0, 2**16 - 1), "UInt32": (0, 2**32 - 1)}
_RANGES |= {"Int64": (-_EXACT, _EXACT), "UInt64": (0, _EXACT)}
_MOST_DEPENDENCIES = 1_000_000  # above, none are declared, so that FMI 2.0 assumes all

# names of attributes in FMI 2.0 by those in FMI 3.0
_OF_MODEL = {
    name: name
    for name in (
        "modelName",
        "description",
        "author",
        "version",
        "copyright",
        "license",
        "generationTool",
        "generationDateAndTime",
        "variableNamingConvention",
    )
}
_OF_DISPLAY_UNIT = {name: name for name in ("name", "factor", "offset")}
_OF_INTERFACE = {
    "modelIdentifier": "modelIdentifier",
    "needsExecutionTool": "needsExecutionTool",
    "canBeInstantiatedOnlyOncePerProcess": "canBeInstantiatedOnlyOncePerProcess",
    "canGetAndSetFMUState": "canGetAndSetFMUstate",
    "canSerializeFMUState": "canSerializeFMUstate",
    "providesDirectionalDerivatives": "providesDirectionalDerivative",
}
_OF_CO_SIMULATION = {
    "canHandleVariableCommunicationStepSize": "canHandleVariableCommunicationStepSize",
    "maxOutputDerivativeOrder": "maxOutputDerivativeOrder",
}
# attributes of the types of FMI 2.0
_OF_TYPE = {
    "Real": ("quantity", "unit", "displayUnit", "relativeQuantity", "min", "max", "nominal"),
    "Integer": ("quantity", "min", "max"),
    "Enumeration": ("quantity", "min", "max"),
    "Boolean": (),
    "String": (),
}
# sections of the model structure of FMI 2.0, and the elements of FMI 3.0 that they contain
_STRUCTURE = {
    "Outputs": "Output",
    "Derivatives": "ContinuousStateDerivative",
    "InitialUnknowns": "InitialUnknown",
}


class TableRow(NamedTuple):
    """A variable in the table of the wrapper, with the index of its type in `NUMBERS`."""

    type: int
    reference: int
    elements: int


@dataclass(frozen=True)
class Translation:
    """A translated model description.

    Attributes
    ----------
    root : Element
        ``fmiModelDescription`` of FMI 2.0, whose value references are indices of elements.
    table : list of TableRow
        The variables in the order of their elements.
    interface : {0, 1, 2}
        Number in `wrapper.h`: without clocks, with them, or for scheduled execution alone.
    clocks : list of InputClock
        Those that tick by time, of the highest priority first.
    declared : dict of str to DeclaredVariable
        The variables and their aliases by name.
    """

    root: Element
    table: list[TableRow]
    interface: int
    clocks: list[InputClock]
    declared: dict[str, DeclaredVariable]


def translate(root: Element, label: str) -> Translation:
    """Translate a model description from FMI 3.0 to FMI 2.0.

    Parameters
    ----------
    root : Element
        ``fmiModelDescription`` of FMI 3.0.
    label : str
        Name of the FMU in messages.

    Returns
    -------
    Translation

    Raises
    ------
    UserError
        If a size, a start value or a reference to a variable is invalid, or arrays are too large.
    """
    return _Translator(root, label).translate()


class _Translator:
    """Translator of one model description."""

    def __init__(self, root: Element, label: str):
        self._root = root
        self._description = Fmi3Description(root, label)
        self._inverse_units = {
            (unit.get("name"), display.get("name"))
            for unit in root.iterfind("UnitDefinitions/Unit")
            for display in unit.iterfind("DisplayUnit")
            if display.get("inverse") in ("true", "1")
        }
        self._variables = self._description.variables
        self._aliases: dict[int, list[int]] = {}  # of outputs, by the index of an element
        self._is_scheduled = not any(
            root.find(tag) is not None for tag in ("CoSimulation", "ModelExchange")
        )

    def translate(self) -> Translation:
        """Return the translated description."""
        root = Element("fmiModelDescription", fmiVersion="2.0")
        self._copy(self._root, root, _OF_MODEL)
        root.set("guid", self._root.get("instantiationToken", ""))
        indicators = sum(
            variable.count
            for variable, _ in self._description.unknowns("EventIndicator")
            if variable
        )
        if indicators:
            root.set("numberOfEventIndicators", str(indicators))
        self._add_interfaces(root)
        self._add_units(root)
        self._add_enumerations(root)
        for name in ("LogCategories", "DefaultExperiment"):
            root.extend(self._root.findall(name))
        self._add_annotations(root)
        self._add_variables(root)
        self._add_structure(root)
        table = [
            TableRow(NUMBERS.index(number_type(v.kind)), v.reference, v.count)
            for v in self._variables.values()
        ]
        interface = 2 if self._is_scheduled else int(bool(self._description.clocks))
        clocks = input_clocks(self._description)
        return Translation(root, table, interface, clocks, self._description.declared_variables())

    @staticmethod
    def _copy(source: Element, target: Element, names: Mapping[str, str]) -> None:
        """Copy existing attributes, each to its name in FMI 2.0."""
        for old, new in names.items():
            text = source.get(old)
            if text is not None:
                target.set(new, text)

    def _add_interfaces(self, root: Element) -> None:
        for node in self._root.iterfind("ModelExchange"):
            interface = SubElement(root, "ModelExchange")
            self._copy(node, interface, _OF_INTERFACE)
            needed = node.get("needsCompletedIntegratorStep") in ("true", "1")
            interface.set("completedIntegratorStepNotNeeded", "false" if needed else "true")
        names = _OF_INTERFACE | _OF_CO_SIMULATION
        for node in self._root.iterfind("CoSimulation"):
            self._copy(node, SubElement(root, "CoSimulation"), names)
        if self._is_scheduled:
            for node in self._root.iterfind("ScheduledExecution"):
                interface = SubElement(root, "CoSimulation")
                self._copy(node, interface, names)
                interface.set("canHandleVariableCommunicationStepSize", "true")

    def _add_units(self, root: Element) -> None:
        units = self._root.findall("UnitDefinitions/Unit")
        is_wide = any(variable.is_wide for variable in self._variables.values())
        if is_wide and _COUNT not in {unit.get("name") for unit in units}:
            count = Element("Unit", name=_COUNT)
            SubElement(count, "BaseUnit")
            units.append(count)
        if not units:
            return
        definitions = SubElement(root, "UnitDefinitions")
        for unit in units:
            translated = SubElement(definitions, "Unit", name=unit.get("name", ""))
            translated.extend(unit.findall("BaseUnit"))
            for display in unit.iterfind("DisplayUnit"):
                if (unit.get("name"), display.get("name")) not in self._inverse_units:
                    self._copy(display, SubElement(translated, "DisplayUnit"), _OF_DISPLAY_UNIT)

    def _add_enumerations(self, root: Element) -> None:
        enumerations = [
            node for node in self._description.types.values() if node.tag == "EnumerationType"
        ]
        if not enumerations:
            return
        definitions = SubElement(root, "TypeDefinitions")
        for node in enumerations:
            simple = SubElement(definitions, "SimpleType")
            self._copy(node, simple, {"name": "name", "description": "description"})
            enumeration = SubElement(simple, "Enumeration")
            self._copy(node, enumeration, {"quantity": "quantity"})
            for item in node.iterfind("Item"):
                SubElement(enumeration, "Item", item.attrib)

    def _add_annotations(self, root: Element) -> None:
        annotations = self._root.findall("Annotations/Annotation")
        if not annotations:
            return
        vendors = SubElement(root, "VendorAnnotations")
        for annotation in annotations:
            tool = SubElement(vendors, "Tool", name=annotation.get("type", ""))
            tool.extend(annotation)

    def _add_variables(self, root: Element) -> None:
        variables = SubElement(root, "ModelVariables")
        for variable in self._variables.values():
            self._add_scalars(variables, variable, variable.node, variable.causality)
        index = sum(variable.count for variable in self._variables.values())
        for variable in self._variables.values():
            for alias in variable.node.iterfind("Alias"):
                causality = "output" if variable.causality == "output" else "local"
                self._add_scalars(variables, variable, alias, causality)
                for element in variable.elements:
                    if causality == "output":
                        self._aliases.setdefault(element, []).append(index)
                    index += 1

    def _add_scalars(
        self, parent: Element, variable: Fmi3Variable, node: Element, causality: str
    ) -> None:
        """Append a scalar variable for each element of a variable or of its alias.

        Parameters
        ----------
        parent : Element
            ``ModelVariables``.
        variable : Fmi3Variable
        node : Element
            The variable or its alias, which has the name, description and display unit.
        causality : str
        """
        is_alias = node is not variable.node
        is_structural = causality == "structuralParameter"
        initial = variable.attributes.get("initial")
        if is_structural:
            shared = {"causality": "local", "variability": "fixed"}
        else:
            shared = {"causality": causality, "variability": variable.variability}
            if initial is not None and not is_alias:
                shared["initial"] = initial
        description = node.get("description", variable.attributes.get("description"))
        if description is not None:
            shared["description"] = description
        attributes = self._scalar_attributes(variable, node)
        derivative = self._derivative(variable) if not is_alias else None
        starts = self._description.starts(variable) if not is_alias and not is_structural else []
        for k, name in enumerate(variable.names(node.get("name", ""))):
            reference = str(variable.first + k)
            scalar = SubElement(parent, "ScalarVariable", name=name, valueReference=reference)
            scalar.attrib |= shared
            value = SubElement(scalar, variable.scalar_type, attributes)
            if derivative is not None:
                value.set("derivative", str(derivative.first + k + 1))
            if starts:
                value.set("start", starts[k])

    def _scalar_attributes(self, variable: Fmi3Variable, node: Element) -> dict[str, str]:
        """Return the attributes of the type that all elements share, without start values."""
        given = dict(variable.attributes)
        if "displayUnit" in node.attrib:
            given["displayUnit"] = node.attrib["displayUnit"]
        if (given.get("unit"), given.get("displayUnit")) in self._inverse_units:
            del given["displayUnit"]
        kind = variable.scalar_type
        attributes = {}
        if variable.kind in _RANGES:
            low, high = _RANGES[variable.kind]
            attributes = {"min": str(low), "max": str(high)}
        attributes |= {name: given[name] for name in _OF_TYPE[kind] if name in given}
        if kind == "Enumeration":
            attributes["declaredType"] = given.get("declaredType", "")
        if variable.is_wide:
            attributes["unit"] = _COUNT
        if kind == "Real" and given.get("unbounded") in ("true", "1"):
            attributes["unbounded"] = "true"
        return attributes

    def _derivative(self, variable: Fmi3Variable) -> Fmi3Variable | None:
        """Return the variable whose derivative a variable is; None if it is no derivative."""
        text = variable.node.get("derivative")
        if text is None:
            return None
        name = variable.node.get("name", "")
        state = self._variables.get(self._description.whole_number(text, name, "derivative"))
        if state is None or state.count != variable.count:
            raise self._description.error(
                name, f"is the derivative of {text}, which is no variable of its size"
            )
        return state

    def _add_structure(self, root: Element) -> None:
        structure = SubElement(root, "ModelStructure")
        for plural, tag in _STRUCTURE.items():
            section = SubElement(structure, plural)
            for variable, unknown in self._description.unknowns(tag):
                if variable is not None:
                    self._add_unknowns(section, variable, unknown)
            if not len(section):
                structure.remove(section)

    def _add_unknowns(self, section: Element, variable: Fmi3Variable, unknown: Element) -> None:
        """Append an unknown for each element of a variable and for the aliases of each."""
        dependencies = self._dependencies(variable, unknown)
        for element in variable.elements:
            for index in (element, *self._aliases.get(element, ())):
                SubElement(section, "Unknown", index=str(index + 1)).attrib |= dependencies

    def _dependencies(self, variable: Fmi3Variable, unknown: Element) -> dict[str, str]:
        """Return the attributes of an unknown for its dependencies and their kinds."""
        text = unknown.get("dependencies")
        if text is None:
            return {}
        name = variable.node.get("name", "")
        references = [
            self._description.whole_number(word, name, "a dependency") for word in text.split()
        ]
        declared_kinds = unknown.get("dependenciesKind", "").split()
        # without kinds, FMI assumes the most general one
        kinds = declared_kinds or ["dependent"] * len(references)
        if len(kinds) != len(references):
            raise self._description.error(
                name, f"has {len(references)} dependencies, but {len(kinds)} kinds of them"
            )
        knowns = [
            (self._variables[reference], kind)
            for reference, kind in zip(references, kinds, strict=True)
            if reference in self._variables
        ]
        if variable.count * sum(known.count for known, _ in knowns) > _MOST_DEPENDENCIES:
            return {}
        indices = [str(index + 1) for known, _ in knowns for index in known.elements]
        attributes = {"dependencies": " ".join(indices)}
        if declared_kinds:
            attributes["dependenciesKind"] = " ".join(_scalar_kinds(variable, knowns))
        return attributes


def _scalar_kinds(
    variable: Fmi3Variable, knowns: Sequence[tuple[Fmi3Variable, str]]
) -> Iterator[str]:
    """Yield the kind of dependency of a variable on each element of its knowns.

    A kind holds for all elements of arrays together, so that one may differ from it.
    """
    for known, kind in knowns:
        is_scalar = variable.count == known.count == 1
        for _ in known.elements:
            yield kind if is_scalar else "dependent"
