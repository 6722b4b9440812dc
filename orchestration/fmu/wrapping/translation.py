"""The model description of FMI 3.0 in terms of FMI 2.0.

Arrays become scalars, named by their indices from 1 and in row-major order: ``A[2,1]``. Structural
parameters keep their start values, as the sizes of arrays depend on them. Variables without a
counterpart, which are binary or clocks, are left out.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

from fmus.kit import UserError

# types that a wrapped FMU can exchange, in the order of their numbers in `wrapper.h`
_NUMBERS = (
    "Float32",
    "Float64",
    "Int8",
    "UInt8",
    "Int16",
    "UInt16",
    "Int32",
    "UInt32",
    "Int64",
    "UInt64",
    "Boolean",
    "String",
)
_SCALARS = {"Float32": "Real", "Float64": "Real"}
_SCALARS |= {kind: kind for kind in ("Boolean", "String", "Enumeration")}
_COUNT = "1"  # the unit of wide integers
_WIDE = ("UInt32", "Int64", "UInt64")  # beyond the integers of FMI 2.0
_RANGES = {"Int8": (-128, 127), "UInt8": (0, 255), "Int16": (-(2**15), 2**15 - 1)}
_RANGES |= {"UInt16": (0, 2**16 - 1)} | dict.fromkeys(("UInt32", "UInt64"), (0, 2**31 - 1))
_PARAMETERS = ("parameter", "calculatedParameter", "structuralParameter")
MOST_ELEMENTS = 200_000  # of all variables
_MOST_DEPENDENCIES = 1_000_000  # beyond these an unknown may depend on all, which FMI 2.0 assumes

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
_OF_TYPE = {
    "Real": ("quantity", "unit", "displayUnit", "relativeQuantity", "min", "max", "nominal"),
    "Integer": ("quantity", "min", "max"),
    "Enumeration": ("quantity", "min", "max"),
    "Boolean": (),
    "String": (),
}
_STRUCTURE = {
    "Outputs": "Output",
    "Derivatives": "ContinuousStateDerivative",
    "InitialUnknowns": "InitialUnknown",
}


class TableRow(NamedTuple):
    """A variable in the table of the wrapper: number of its type, value reference, elements."""

    type: int
    reference: int
    elements: int


class DeclaredVariable(NamedTuple):
    """A variable as FMI 3.0 has it.

    Attributes
    ----------
    kind : str
        Its type in FMI 3.0.
    shape : tuple of int
        Empty for a scalar.
    elements : tuple of str
        Names of its elements in FMI 2.0; of a scalar its own.
    """

    kind: str
    shape: tuple[int, ...]
    elements: tuple[str, ...]


@dataclass(frozen=True)
class Translation:
    """A translated model description.

    Attributes
    ----------
    root : Element
        ``fmiModelDescription`` of FMI 2.0; its value references are indices of elements.
    table : list of TableRow
        The variables whose elements these are, in their order.
    declared : dict of str to DeclaredVariable
        The same variables, and their aliases, by name.
    """

    root: Element
    table: list[TableRow]
    declared: dict[str, DeclaredVariable]


def translate(root: Element, label: str) -> Translation:
    """Translate a model description.

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
        If a size, a start value or a reference to a variable makes no sense, or arrays are too
        large.
    """
    return _Translator(root, label).translated()


class _Variable:
    """A variable of FMI 3.0 with the attributes of its declared type.

    Attributes
    ----------
    node : Element
    kind : str
        Its type in FMI 3.0.
    reference : int
    shape : tuple of int
        Empty for a scalar.
    attributes : Mapping of str to str
    first : int
        Index of its first element among all elements.
    """

    def __init__(self, node: Element, reference: int, shape: tuple[int, ...], first: int):
        self.node = node
        self.kind = node.tag
        self.reference = reference
        self.shape = shape
        self.first = first
        self.count = math.prod(shape)
        self.attributes: Mapping[str, str] = node.attrib

    @property
    def causality(self) -> str:
        return self.attributes.get("causality", "local")

    @property
    def variability(self) -> str:
        usual = "continuous" if self.kind.startswith("Float") else "discrete"
        if self.causality in _PARAMETERS:
            usual = "fixed"
        return self.attributes.get("variability", usual)

    @property
    def is_wide(self) -> bool:
        """True if its values may be beyond the integers of FMI 2.0; those that are set are not."""
        is_set = self.causality in ("parameter", "input", "structuralParameter")
        return self.kind in _WIDE and not is_set

    @property
    def scalar_type(self) -> str:
        """Type of its elements in FMI 2.0; wide integers are exact as reals up to 2**53."""
        return "Real" if self.is_wide else _SCALARS.get(self.kind, "Integer")

    @property
    def elements(self) -> range:
        """Indices of its elements."""
        return range(self.first, self.first + self.count)

    def names(self, name: str) -> Iterator[str]:
        """Yield the names of its elements under its own name, or that of an alias."""
        return element_names(name, self.shape)


def element_names(name: str, shape: tuple[int, ...]) -> Iterator[str]:
    """Yield the names of the elements of an array in row-major order; of a scalar its own.

    Parameters
    ----------
    name : str
    shape : tuple of int

    Yields
    ------
    str
    """
    if not shape:
        yield name
        return
    # the index of a derivative belongs to the variable: der(x[2])
    stem, end = (name[:-1], ")") if name.startswith("der(") else (name, "")
    for indices in itertools.product(*(range(1, size + 1) for size in shape)):
        yield f"{stem}[{','.join(map(str, indices))}]{end}"


class _Translator:
    """The translation of one description."""

    def __init__(self, root: Element, label: str):
        self._root = root
        self._where = f"{label}: modelDescription.xml"
        self._types = {node.get("name", ""): node for node in root.iterfind("TypeDefinitions/*")}
        self._inverse_units = {
            (unit.get("name"), display.get("name"))
            for unit in root.iterfind("UnitDefinitions/Unit")
            for display in unit.iterfind("DisplayUnit")
            if display.get("inverse") in ("true", "1")
        }
        self._variables: dict[int, _Variable] = {}
        self._aliases: dict[int, list[int]] = {}  # of outputs, by the index of an element
        self._read_variables()

    def translated(self) -> Translation:
        root = Element("fmiModelDescription", fmiVersion="2.0")
        self._copy(self._root, root, _OF_MODEL)
        root.set("guid", self._root.get("instantiationToken", ""))
        indicators = sum(
            variable.count for variable, _ in self._unknowns("EventIndicator") if variable
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
            TableRow(_NUMBERS.index(_number_type(v.kind)), v.reference, v.count)
            for v in self._variables.values()
        ]
        return Translation(root, table, self._declared_variables())

    def _declared_variables(self) -> dict[str, DeclaredVariable]:
        declared = {}
        for variable in self._variables.values():
            for own in (variable.node, *variable.node.iterfind("Alias")):
                name = own.get("name", "")
                elements = tuple(variable.names(name))
                declared[name] = DeclaredVariable(variable.kind, variable.shape, elements)
        return declared

    # --- what is read

    def _fail(self, name: str, problem: str) -> UserError:
        return UserError(f"{self._where}: {name}: {problem}")

    def _whole(self, text: str | None, name: str, attribute: str) -> int:
        if text is None or not text.strip().isascii() or not text.strip().isdigit():
            raise self._fail(name, f"{attribute} {(text or '')[:40]!r} is no whole number")
        return int(text)

    def _read_variables(self) -> None:
        nodes: dict[int, Element] = {}
        for node in self._root.iterfind("ModelVariables/*"):
            name = node.get("name", "")
            reference = self._whole(node.get("valueReference"), name, "valueReference")
            if reference in nodes:
                other = nodes[reference].get("name", "")
                raise self._fail(name, f"has the value reference {reference} of {other}")
            nodes[reference] = node
        first = 0
        for reference, node in nodes.items():
            if _number_type(node.tag) not in _NUMBERS:
                continue
            shape = tuple(self._size(size, node, nodes) for size in node.iterfind("Dimension"))
            variable = _Variable(node, reference, shape, first)
            variable.attributes = self._declared(node) | node.attrib
            first += variable.count
            if first > MOST_ELEMENTS:
                raise UserError(
                    f"{self._where}: its arrays have more than {MOST_ELEMENTS:,} elements; these"
                    " are not taken one by one"
                )
            self._variables[reference] = variable

    def _declared(self, node: Element) -> dict[str, str]:
        """Return the attributes of the declared type of a variable."""
        declared = self._types.get(node.get("declaredType", ""))
        if declared is None:
            return {}
        return {name: text for name, text in declared.attrib.items() if name != "description"}

    def _size(self, size: Element, node: Element, nodes: Mapping[int, Element]) -> int:
        name = node.get("name", "")
        if size.get("start") is not None:
            return self._whole(size.get("start"), name, "the size")
        reference = self._whole(size.get("valueReference"), name, "valueReference of a dimension")
        if reference not in nodes:
            raise self._fail(name, f"there is no variable {reference}, which is its dimension")
        return self._whole(nodes[reference].get("start"), name, "the size")

    def _starts(self, variable: _Variable) -> list[str]:
        """Return a start value for each element; nothing if none are declared."""
        if variable.kind == "String":
            texts = [start.get("value", "") for start in variable.node.iterfind("Start")]
        else:
            texts = variable.node.get("start", "").split()
        if len(texts) == 1:
            texts *= variable.count
        if texts and len(texts) != variable.count:
            name = variable.attributes.get("name", "")
            expected = "1" if variable.count == 1 else f"1 or {variable.count}"
            raise self._fail(name, f"has {len(texts)} start values; expected {expected}")
        return texts

    def _unknowns(self, tag: str) -> Iterator[tuple[_Variable | None, Element]]:
        """Yield the variables of a part of the model structure; None for one not exchanged."""
        for unknown in self._root.iterfind(f"ModelStructure/{tag}"):
            reference = self._whole(unknown.get("valueReference"), tag, "valueReference")
            yield self._variables.get(reference), unknown

    # --- what is written

    @staticmethod
    def _copy(source: Element, target: Element, names: Mapping[str, str]) -> None:
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
        for node in self._root.iterfind("CoSimulation"):
            self._copy(node, SubElement(root, "CoSimulation"), _OF_INTERFACE | _OF_CO_SIMULATION)

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
            own = SubElement(definitions, "Unit", name=unit.get("name", ""))
            own.extend(unit.findall("BaseUnit"))
            for display in unit.iterfind("DisplayUnit"):
                if (unit.get("name"), display.get("name")) not in self._inverse_units:
                    self._copy(display, SubElement(own, "DisplayUnit"), _OF_DISPLAY_UNIT)

    def _add_enumerations(self, root: Element) -> None:
        enumerations = [node for node in self._types.values() if node.tag == "EnumerationType"]
        if not enumerations:
            return
        definitions = SubElement(root, "TypeDefinitions")
        for node in enumerations:
            simple = SubElement(definitions, "SimpleType")
            self._copy(node, simple, {"name": "name", "description": "description"})
            own = SubElement(simple, "Enumeration")
            self._copy(node, own, {"quantity": "quantity"})
            for item in node.iterfind("Item"):
                SubElement(own, "Item", item.attrib)

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
        self, parent: Element, variable: _Variable, own: Element, causality: str
    ) -> None:
        """Append the elements of a variable, under its name or an alias.

        Parameters
        ----------
        parent : Element
            ``ModelVariables``.
        variable : _Variable
        own : Element
            What gives name, description and display unit: the variable, or its alias.
        causality : str
        """
        is_alias = own is not variable.node
        fixed = causality == "structuralParameter"  # its size is settled
        shared = {"causality": "local" if fixed else causality, "variability": variable.variability}
        initial = variable.attributes.get("initial")
        if fixed:
            shared["variability"] = "fixed"
        elif initial is not None and not is_alias:
            shared["initial"] = initial
        description = own.get("description", variable.attributes.get("description"))
        if description is not None:
            shared["description"] = description
        attributes = self._scalar_attributes(variable, own)
        derivative = self._derivative(variable) if not is_alias else None
        starts = self._starts(variable) if not is_alias and not fixed else []
        for k, name in enumerate(variable.names(own.get("name", ""))):
            reference = str(variable.first + k)
            scalar = SubElement(parent, "ScalarVariable", name=name, valueReference=reference)
            scalar.attrib |= shared
            value = SubElement(scalar, variable.scalar_type, attributes)
            if derivative is not None:
                value.set("derivative", str(derivative.first + k + 1))
            if starts:
                value.set("start", starts[k])

    def _scalar_attributes(self, variable: _Variable, own: Element) -> dict[str, str]:
        """Return the attributes that the elements of a variable share, without their start."""
        given = dict(variable.attributes)
        if own.get("displayUnit") is not None:
            given["displayUnit"] = own.get("displayUnit", "")
        if (given.get("unit"), given.get("displayUnit")) in self._inverse_units:
            del given["displayUnit"]
        kind = variable.scalar_type
        attributes = {name: given[name] for name in _OF_TYPE[kind] if name in given}
        if kind == "Integer":
            low, high = _RANGES.get(variable.kind, (None, None))
            if low is not None:
                attributes = {"min": str(low), "max": str(high)} | attributes
        if kind == "Enumeration":
            attributes["declaredType"] = given.get("declaredType", "")
        if variable.is_wide:
            attributes["unit"] = _COUNT
        if kind == "Real" and given.get("unbounded") in ("true", "1"):
            attributes["unbounded"] = "true"
        return attributes

    def _derivative(self, variable: _Variable) -> _Variable | None:
        """Return the variable of which one is the derivative."""
        text = variable.node.get("derivative")
        if text is None:
            return None
        name = variable.node.get("name", "")
        state = self._variables.get(self._whole(text, name, "derivative"))
        if state is None or state.count != variable.count:
            raise self._fail(name, f"is the derivative of {text}, which is no variable of its size")
        return state

    def _add_structure(self, root: Element) -> None:
        structure = SubElement(root, "ModelStructure")
        for plural, tag in _STRUCTURE.items():
            section = SubElement(structure, plural)
            for variable, unknown in self._unknowns(tag):
                if variable is not None:
                    self._add_unknowns(section, variable, unknown)
            if not len(section):
                structure.remove(section)

    def _add_unknowns(self, section: Element, variable: _Variable, unknown: Element) -> None:
        dependencies = self._dependencies(variable, unknown)
        for element in variable.elements:
            for index in (element, *self._aliases.get(element, ())):
                SubElement(section, "Unknown", index=str(index + 1)).attrib |= dependencies

    def _dependencies(self, variable: _Variable, unknown: Element) -> dict[str, str]:
        """Return the dependencies of an unknown, and their kinds, as attributes."""
        text = unknown.get("dependencies")
        if text is None:
            return {}
        name = variable.node.get("name", "")
        references = [self._whole(word, name, "a dependency") for word in text.split()]
        kinds: Sequence[str | None] = unknown.get("dependenciesKind", "").split() or [None] * len(
            references
        )
        if len(kinds) != len(references):
            raise self._fail(
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
        if all(kind is not None for kind in kinds) and kinds:
            # of an array one element may depend otherwise than another
            is_scalar = variable.count == 1
            own = [
                kind if is_scalar and known.count == 1 and kind else "dependent"
                for known, kind in knowns
                for _ in known.elements
            ]
            attributes["dependenciesKind"] = " ".join(own)
        return attributes


def _number_type(kind: str) -> str:
    """Return the type with whose functions a type of FMI 3.0 is exchanged."""
    return "Int64" if kind == "Enumeration" else kind
