"""The vocabulary and grammar of SSP 1.0 and 2.0, as far as this program reads and writes it.

In 2.0 a description may have the types of FMI 3.0, and connectors that are arrays; its namespaces
are those of 1.0.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from xml.etree.ElementTree import Element

from fmus.kit import UserError
from fmus.kit.build import SSC, SSV

SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"
NAMESPACES = {"ssd": SSD, "ssc": SSC, "ssv": SSV, "osp": OSP, "oms": OMS}

ENDINGS = (".ssp", ".ssd")  # an archive, and a bare description
DESCRIPTION = "SystemStructure.ssd"
FMU = "application/x-fmu-sharedlibrary"
PARAMETERS = "application/x-ssp-parameter-set"
# name of the parameter set of every member; Ecos applies the sets of the name that it is given
PARAMETER_SET = "start"
# annotation of libcosim with the communication step, for which SSP has no element
STEP = "com.opensimulationplatform"
# annotation of OMSimulator with its master, without which it refuses a system
MASTER = "org.openmodelica"
# annotation with the inputs and outputs of the system, in SSP's own elements
CONNECTORS = "ppy-rig.system-connectors"
# the element in that annotation that contains them
OUTSIDE = "Outside"


# types of connectors and parameters, and what values of them are here
_REALS = dict.fromkeys(("Float32", "Float64", "Real"), ("real",))
_INTEGERS = dict.fromkeys(("Int8", "UInt8", "Int16", "UInt16", "Int32", "Integer"), ("integer",))
# reals where they are only read, see `orchestration.fmu.wrapping`
_WIDE = dict.fromkeys(("UInt32", "Int64", "UInt64"), ("integer", "real"))
_OTHERS = {"Boolean": ("boolean",), "String": ("string",), "Enumeration": ("integer",)}
TYPES: dict[str, tuple[str, ...]] = {**_REALS, **_INTEGERS, **_WIDE, **_OTHERS}


_VERSION = re.compile(r"[12]\.\d+(\.\d+)?(-.+)?")
_NOT_EXCHANGED = ("Binary", "Clock")


def tag(name: str) -> str:
    """Return the qualified name, as ElementTree has it, of ``prefix:name``."""
    prefix, _, local = name.partition(":")
    return f"{{{NAMESPACES[prefix]}}}{local}"


# The elements that an element may contain. Any other would make another system than its author
# meant.
_CONTENTS = {
    "ssd:SystemStructureDescription": "ssd:System ssd:DefaultExperiment",
    "ssd:System": "ssd:Connectors ssd:Elements ssd:Connections ssd:ParameterBindings",
    # of these, the reader accepts components only
    "ssd:Elements": "ssd:Component ssd:System ssd:SignalDictionaryReference",
    "ssd:Component": "ssd:Connectors ssd:ParameterBindings",
    "ssd:Connectors": "ssd:Connector",
    "ssd:Connector": " ".join(f"ssc:{name}" for name in (*TYPES, *_NOT_EXCHANGED, "Dimension")),
    "ssd:Connections": "ssd:Connection",
    "ssd:Connection": "ssc:LinearTransformation",
    "ssd:ParameterBindings": "ssd:ParameterBinding",
    "ssd:ParameterBinding": "ssd:ParameterValues ssd:ParameterMapping",
    "ssd:ParameterValues": "ssv:ParameterSet",
    "ssd:DefaultExperiment": "",
    "ssv:ParameterSet": "ssv:Parameters",
    "ssv:Parameters": "ssv:Parameter",
}
# Elements that are ignored: graphics, annotations, signatures, and definitions of known names.
_IGNORED = (
    "ssd:Annotations ssc:Annotations ssv:Annotations ssd:ElementGeometry ssd:SystemGeometry"
    " ssd:ConnectorGeometry ssd:ConnectionGeometry ssd:GraphicalElements ssd:Units ssd:Enumerations"
    " ssv:Units ssv:Enumerations ssc:MetaData ssc:Signature"
)
_ALLOWED = {
    tag(name): {tag(child) for child in children.split()} for name, children in _CONTENTS.items()
}
_ALLOWED[OUTSIDE] = {tag("ssd:Connectors"), tag("ssd:Connections")}
_IGNORED_TAGS = {tag(name) for name in _IGNORED.split()}


def check_elements(element: Element) -> None:
    """Refuse an element with unknown elements in it.

    Parameters
    ----------
    element : Element
        An element of a description or a parameter set; all elements in it are checked.

    Raises
    ------
    UserError
        With the first unknown element, and the one that contains it.
    """
    for node in element:
        if node.tag in _IGNORED_TAGS:
            continue
        if element.tag in _ALLOWED and node.tag not in _ALLOWED[element.tag]:
            names = {name.rpartition("}")[2] for name in _ALLOWED[element.tag]}
            known = ", ".join(sorted(names.difference(_NOT_EXCHANGED)))
            raise UserError(
                f"{_describe(node)}, in {_describe(element)}, is not known to this program; known:"
                f" {known or 'nothing'}"
            )
        check_elements(node)


def check_version(element: Element, where: str) -> None:
    """Refuse a description, or a parameter set, of a version of SSP that is neither 1 nor 2.

    Raises
    ------
    UserError
        With the version, beginning with `where`.
    """
    version = element.get("version", "")
    if _VERSION.fullmatch(version) is None:
        raise UserError(
            f"{where}: SSP version {version[:40] or 'not stated'}; this program knows SSP 1.0 and"
            " 2.0"
        )


def check_exchanged(element: Element, where: str) -> None:
    """Refuse a connector, or a parameter, of a type whose values this program does not exchange.

    Raises
    ------
    UserError
        If it is binary or a clock, beginning with `where`.
    """
    for node in element:
        if local_name(node) in _NOT_EXCHANGED:
            raise UserError(f"{where} is {local_name(node)}; known are {', '.join(TYPES)}")


def attribute(element: Element, name: str) -> str:
    """Return an attribute of an element.

    Raises
    ------
    UserError
        If it has none of that name.
    """
    value = element.get(name)
    if value is None:
        raise UserError(f"a {local_name(element)} has no attribute {name!r}")
    return value


def number(element: Element, name: str, default: str) -> float:
    """Return an attribute that is a number.

    Raises
    ------
    UserError
        If it, or the default in its place, is not a finite number.
    """
    text = element.get(name, default)
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise UserError(f"{name} {text!r} of a {local_name(element)} is not a finite number")
    return value


def find_all(parts: Iterable[Element], path: str) -> list[Element]:
    """Return the elements at a path in several elements."""
    return [node for part in parts for node in part.findall(path, NAMESPACES)]


def local_name(element: Element) -> str:
    """Return the name of an element without its namespace."""
    return element.tag.rpartition("}")[2]


def _describe(element: Element) -> str:
    """Return the name of an element with the attributes that identify it."""
    keys = ("name", "startElement", "startConnector", "endElement", "endConnector")
    return " ".join([local_name(element), *filter(None, map(element.get, keys))])
