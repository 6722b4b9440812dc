"""Vocabulary and grammar of SSP 1.0 and 2.0, as far as this program reads and writes them.

Version 2.0 adds the types of FMI 3.0 and connectors that are arrays, in the namespaces of 1.0.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from xml.etree.ElementTree import Element, register_namespace

from fmus.kit import UserError
from fmus.kit.build import SSC, SSV

SSM = "http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
SSB = "http://ssp-standard.org/SSP1/SystemStructureSignalDictionary"
SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"
NAMESPACES = {"ssd": SSD, "ssc": SSC, "ssv": SSV, "ssm": SSM, "ssb": SSB, "osp": OSP, "oms": OMS}
for _prefix, _namespace in NAMESPACES.items():
    register_namespace(_prefix, _namespace)  # of the process: no file may depend on earlier ones

ENDINGS = (".ssp", ".ssd")  # an archive, and a bare description
DESCRIPTION = "SystemStructure.ssd"
FMU = "application/x-fmu-sharedlibrary"
PARAMETERS = "application/x-ssp-parameter-set"
# name of the parameter set of every member; Ecos applies the sets of one name
PARAMETER_SET = "start"
# annotation of libcosim with the communication step, for which SSP has no element
STEP = "com.opensimulationplatform"
# annotation of OMSimulator with its master, without which it refuses a system
MASTER = "org.openmodelica"
# annotation with the inputs and outputs of the system, in SSP's own elements
CONNECTORS = "ppy-rig.system-connectors"
# the element in that annotation that contains them
OUTSIDE = "Outside"


# types of connectors and parameters -> types of signals here
_REALS = dict.fromkeys(("Float32", "Float64", "Real"), ("real",))
_INTEGERS = dict.fromkeys(("Int8", "UInt8", "Int16", "UInt16", "Int32", "Integer"), ("integer",))
# reals if they can only be read, see `orchestration.fmu.wrapping`
_WIDE = dict.fromkeys(("UInt32", "Int64", "UInt64"), ("integer", "real"))
_OTHERS = {
    "Boolean": ("boolean",),
    "String": ("string",),
    "Binary": ("string",),
    "Enumeration": ("integer",),
}
TYPES: dict[str, tuple[str, ...]] = {**_REALS, **_INTEGERS, **_WIDE, **_OTHERS}
BOOLEANS = {"true": 1.0, "1": 1.0, "false": 0.0, "0": 0.0}


WHOLE = re.compile(r"[0-9]{1,18}")  # an index or a size
_VERSION = re.compile(r"[12]\.\d+(\.\d+)?(-.+)?")
_NOT_EXCHANGED = ("Clock",)


def tag(name: str) -> str:
    """Return the qualified name of ``prefix:name`` for ElementTree."""
    prefix, _, local = name.partition(":")
    return f"{{{NAMESPACES[prefix]}}}{local}"


LINEAR = "ssc:LinearTransformation"
_KINDS = ("Boolean", "Integer", "Enumeration")
_MAPPINGS = [f"ssc:{kind}MappingTransformation" for kind in _KINDS]
MAPPINGS = frozenset(map(tag, _MAPPINGS))
_TYPE = " ".join(f"ssc:{name}" for name in (*TYPES, *_NOT_EXCHANGED, "Dimension"))
# Elements that an element may contain; ignoring any other would change the system.
_CONTENTS = {
    "ssd:SystemStructureDescription": "ssd:System ssd:DefaultExperiment",
    "ssd:System": "ssd:Connectors ssd:Elements ssd:Connections ssd:ParameterBindings"
    " ssd:SignalDictionaries",
    "ssd:SignalDictionaries": "ssd:SignalDictionary",
    "ssd:SignalDictionary": "ssb:SignalDictionary",
    "ssb:SignalDictionary": "ssb:DictionaryEntry",
    "ssb:DictionaryEntry": _TYPE,
    "ssd:Elements": "ssd:Component ssd:System ssd:SignalDictionaryReference",
    "ssd:SignalDictionaryReference": "ssd:Connectors",
    "ssd:Component": "ssd:Connectors ssd:ParameterBindings",
    "ssd:Connectors": "ssd:Connector",
    "ssd:Connector": _TYPE,
    "ssd:Connections": "ssd:Connection",
    "ssd:Connection": " ".join([LINEAR, *_MAPPINGS]),
    **dict.fromkeys(_MAPPINGS, "ssc:MapEntry"),
    "ssd:ParameterBindings": "ssd:ParameterBinding",
    "ssd:ParameterBinding": "ssd:ParameterValues ssd:ParameterMapping",
    "ssd:ParameterValues": "ssv:ParameterSet",
    "ssd:ParameterMapping": "ssm:ParameterMapping",
    "ssm:ParameterMapping": "ssm:MappingEntry",
    "ssm:MappingEntry": LINEAR,
    "ssd:DefaultExperiment": "",
    "ssv:ParameterSet": "ssv:Parameters",
    "ssv:Parameters": "ssv:Parameter",
}
# Elements that are ignored: graphics, annotations, signatures, and definitions of known names.
_IGNORED = (
    "ssd:Annotations ssc:Annotations ssv:Annotations ssd:ElementGeometry ssd:SystemGeometry"
    " ssd:ConnectorGeometry ssd:ConnectionGeometry ssd:GraphicalElements ssd:Units ssd:Enumerations"
    " ssv:Units ssv:Enumerations ssb:Units ssb:Enumerations ssb:Annotations ssc:MetaData"
    " ssc:Signature"
)
_ALLOWED = {
    tag(name): {tag(child) for child in children.split()} for name, children in _CONTENTS.items()
}
_ALLOWED[OUTSIDE] = {tag("ssd:Connectors"), tag("ssd:Connections")}
_IGNORED_TAGS = {tag(name) for name in _IGNORED.split()}


def node(name: str, /, *children: Element, **attributes: str) -> Element:
    """Return an element ``prefix:name`` with children and attributes."""
    element = Element(tag(name), attributes)
    element.extend(children)
    return element


def path_of(*names: str) -> str:
    """Return the name ``system.member.variable`` of names of which some may be empty."""
    return ".".join(filter(None, names))


def check_elements(element: Element) -> None:
    """Raise an error if an element contains an unknown element, at any depth.

    Parameters
    ----------
    element : Element
        An element of a description or a parameter set.

    Raises
    ------
    UserError
        With the first unknown element and its parent.
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
    """Raise an error if a description or parameter set is not of SSP 1 or 2.

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
    """Raise an error if a connector or parameter has a type that is not exchanged.

    Raises
    ------
    UserError
        If it is a clock, beginning with `where`.
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
    """Return an attribute as a number.

    Raises
    ------
    UserError
        If the attribute, or the default without one, is not a finite number.
    """
    text = element.get(name, default)
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise UserError(f"{name} {text!r} of a {local_name(element)} is not a finite number")
    return value


def enumerations(root: Element, prefix: str) -> dict[str, Element]:
    """Return the definitions of enumerations in a root element of a namespace, by name."""
    found = root.iterfind(f"{prefix}:Enumerations/ssc:Enumeration", NAMESPACES)
    return {element.get("name", ""): element for element in found}


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
