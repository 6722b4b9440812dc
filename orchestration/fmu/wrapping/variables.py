"""Variables of a model description of FMI 3.0: types, sizes and elements."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple
from xml.etree.ElementTree import Element

from fmus.kit import UserError

# types of the variables of a wrapped FMU, in the order of their numbers in `wrapper.h`
NUMBERS = (
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
    "Clock",
    "String",
    "Binary",
)
_TEXTS = ("String", "Binary")
_SCALARS = {"Float32": "Real", "Float64": "Real", "Binary": "String"}
_SCALARS |= {kind: kind for kind in ("Boolean", "String", "Enumeration")}
_WIDE = ("UInt32", "Int64", "UInt64")  # exceed the integers of FMI 2.0
_PARAMETERS = ("parameter", "calculatedParameter", "structuralParameter")
MOST_ELEMENTS = 200_000  # of all variables
_MOST_DIGITS = len(str(2**32))  # int() refuses a text of thousands


class DeclaredVariable(NamedTuple):
    """A variable as declared in FMI 3.0.

    Attributes
    ----------
    kind : str
        Type in FMI 3.0.
    shape : tuple of int
        Empty for a scalar.
    elements : tuple of str
        Names of the elements in FMI 2.0; for a scalar its name.
    """

    kind: str
    shape: tuple[int, ...]
    elements: tuple[str, ...]

    @property
    def is_wide(self) -> bool:
        """True if values may exceed the integers of FMI 2.0."""
        return self.kind in _WIDE


class Fmi3Variable:
    """A variable of FMI 3.0 with the attributes of its declared type.

    Attributes
    ----------
    node : Element
    kind : str
        Type in FMI 3.0.
    reference : int
        Value reference.
    shape : tuple of int
        Empty for a scalar.
    attributes : Mapping of str to str
        Attributes of the variable and of its declared type.
    first : int
        Index of the first element among the elements of all variables.
    count : int
        Number of elements.
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
        """Causality, declared or by default."""
        return self.attributes.get("causality", "local")

    @property
    def variability(self) -> str:
        """Variability, declared or by default."""
        if "variability" in self.attributes:
            return self.attributes["variability"]
        if self.causality in _PARAMETERS:
            return "fixed"
        return "continuous" if self.kind.startswith("Float") else "discrete"

    @property
    def is_wide(self) -> bool:
        """True if values may exceed the integers of FMI 2.0."""
        return self.kind in _WIDE

    @property
    def scalar_type(self) -> str:
        """Type of the elements in FMI 2.0; wide integers are reals, which are exact up to 2**53."""
        return "Real" if self.is_wide else _SCALARS.get(self.kind, "Integer")

    @property
    def elements(self) -> range:
        """Indices of the elements among those of all variables."""
        return range(self.first, self.first + self.count)

    def names(self, name: str) -> Iterator[str]:
        """Yield the names of the elements, given the name of the variable or of an alias."""
        return element_names(name, self.shape)


def element_names(name: str, shape: tuple[int, ...]) -> Iterator[str]:
    """Yield the names of the elements of an array in row-major order; for a scalar its name.

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


class Fmi3Description:
    """A model description of FMI 3.0.

    Parameters
    ----------
    root : Element
        ``fmiModelDescription``.
    label : str
        Name of the FMU in messages.

    Attributes
    ----------
    root : Element
    types : dict of str to Element
        Type definitions by name.
    variables : dict of int to Fmi3Variable
        Variables of the types in `NUMBERS`, by value reference.
    clocks : list of Element

    Raises
    ------
    UserError
        If a value reference or a size is invalid, or arrays are too large.
    """

    def __init__(self, root: Element, label: str):
        self.root = root
        self.types = {node.get("name", ""): node for node in root.iterfind("TypeDefinitions/*")}
        self._where = f"{label}: modelDescription.xml"
        self.variables: dict[int, Fmi3Variable] = {}
        self.clocks = root.findall("ModelVariables/Clock")
        self._read_variables()

    def error(self, name: str, problem: str) -> UserError:
        """Return an error about an element with a name."""
        return UserError(f"{self._where}: {name}: {problem}")

    def whole_number(self, text: str | None, name: str, attribute: str) -> int:
        """Return an unsigned integer of 32 bits from a text; UserError if it is no such number."""
        digits = (text or "").strip()
        if not digits.isascii() or not digits.isdigit():
            raise self.error(name, f"{attribute} {digits[:40]!r} is no whole number")
        if len(digits) > _MOST_DIGITS or int(digits) >= 2**32:  # C would drop the upper bits
            raise self.error(name, f"{attribute} {digits[:40]} is beyond 32 bits")
        return int(digits)

    def _read_variables(self) -> None:
        """Read `variables`; UserError for a duplicate, an invalid number or too many elements."""
        nodes: dict[int, Element] = {}
        names: set[str] = set()
        for node in self.root.iterfind("ModelVariables/*"):
            name = node.get("name", "")
            if name in names:
                raise self.error(name, "is the name of two variables")
            names.add(name)
            reference = self.whole_number(node.get("valueReference"), name, "valueReference")
            if reference in nodes:
                other = nodes[reference].get("name", "")
                raise self.error(name, f"has the value reference {reference} of {other}")
            nodes[reference] = node
        first = 0
        for reference, node in nodes.items():
            if number_type(node.tag) not in NUMBERS or _is_input_clock(node):
                continue
            dimensions = node.iterfind("Dimension")
            shape = tuple(self._size_of(dimension, node, nodes) for dimension in dimensions)
            variable = Fmi3Variable(node, reference, shape, first)
            variable.attributes = self._type_attributes(node) | node.attrib
            first += variable.count
            if first > MOST_ELEMENTS:
                raise UserError(
                    f"{self._where}: its arrays have more than {MOST_ELEMENTS:,} elements, which is"
                    " the most allowed"
                )
            self.variables[reference] = variable

    def _type_attributes(self, node: Element) -> dict[str, str]:
        """Return the attributes of the declared type of a variable, without its description."""
        declared = self.types.get(node.get("declaredType", ""))
        if declared is None:
            return {}
        return {name: text for name, text in declared.attrib.items() if name != "description"}

    def _size_of(self, dimension: Element, node: Element, nodes: Mapping[int, Element]) -> int:
        """Return a size of an array: a number, or the start value of a structural parameter."""
        name = node.get("name", "")
        if dimension.get("start") is not None:
            return self.whole_number(dimension.get("start"), name, "the size")
        reference = self.whole_number(
            dimension.get("valueReference"), name, "valueReference of a dimension"
        )
        if reference not in nodes:
            raise self.error(name, f"there is no variable {reference}, which is its dimension")
        return self.whole_number(nodes[reference].get("start"), name, "the size")

    def starts(self, variable: Fmi3Variable) -> list[str]:
        """Return a start value for each element; an empty list if none are declared."""
        if variable.kind in _TEXTS:
            texts = [start.get("value", "") for start in variable.node.iterfind("Start")]
        else:
            texts = variable.node.get("start", "").split()
        if len(texts) == 1:
            return texts * variable.count
        if texts and len(texts) != variable.count:
            name = variable.attributes.get("name", "")
            expected = "1" if variable.count == 1 else f"1 or {variable.count}"
            raise self.error(name, f"has {len(texts)} start values; expected {expected}")
        return texts

    def unknowns(self, tag: str) -> Iterator[tuple[Fmi3Variable | None, Element]]:
        """Yield variables and elements of a part of the model structure; None for other types."""
        for unknown in self.root.iterfind(f"ModelStructure/{tag}"):
            reference = self.whole_number(unknown.get("valueReference"), tag, "valueReference")
            yield self.variables.get(reference), unknown

    def declared_variables(self) -> dict[str, DeclaredVariable]:
        """Return the variables and their aliases by name; UserError for a duplicate name."""
        declared = {}
        known: set[str] = set()  # an element may have the name of another variable
        for variable in self.variables.values():
            for node in (variable.node, *variable.node.iterfind("Alias")):
                name = node.get("name", "")
                elements = tuple(variable.names(name))
                for element in elements:
                    if element in known:
                        raise self.error(element, "is the name of two variables")
                known.update(elements)
                declared[name] = DeclaredVariable(variable.kind, variable.shape, elements)
        return declared


def _is_input_clock(node: Element) -> bool:
    """Return whether a variable is a clock that the wrapper ticks, and which has no value."""
    return node.tag == "Clock" and node.get("causality") == "input"


def number_type(kind: str) -> str:
    """Return the type whose functions get and set variables of a type of FMI 3.0."""
    return "Int64" if kind == "Enumeration" else kind
