"""Parameter sets in SSV, the format of SSP 1.0, and XML files of FMI and SSP."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Protocol
from xml.etree.ElementTree import Element, SubElement, indent, register_namespace, tostring

from fmus.kit import quoting, units
from fmus.kit.errors import UserError

_ILLEGAL = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # XML 1.0, 2.2
_SHOWN = 60  # characters before one
SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"


class Typed(Protocol):
    """A declaration, or a variable of an FMU, with a type and a unit."""

    @property
    def type(self) -> str:
        """Type: real, integer, boolean or string."""

    @property
    def unit(self) -> str:
        """Unit as pint reads it; empty if no unit is to be written."""


def to_ssv(
    name: str, values: Mapping[str, float | str], declared: Mapping[str, Typed], doc: str = ""
) -> bytes:
    """Write a parameter set in SSV.

    Parameters
    ----------
    name : str
        Name of the set.
    values : Mapping[str, float | str]
        Parameter name to value in its declared unit, or to a text.
    declared : Mapping[str, Typed]
        Parameter name to its type and unit.
    doc : str
        Description of the set.

    Returns
    -------
    bytes
        UTF-8 XML.
    """
    register_namespace("ssv", SSV)
    register_namespace("ssc", SSC)
    root = Element(f"{{{SSV}}}ParameterSet", version="1.0", name=name)
    if doc:
        root.set("description", doc)
    parameters = SubElement(root, f"{{{SSV}}}Parameters")
    used = set()
    for key, value in values.items():
        node = SubElement(parameters, f"{{{SSV}}}Parameter", name=key)
        declaration = declared[key]
        if declaration.type == "real":
            real = SubElement(node, f"{{{SSV}}}Real", value=repr(float(value)))
            with suppress(UserError):  # SSV has units that it can define
                units.base_unit(declaration.unit)
                real.set("unit", declaration.unit)
                used.add(declaration.unit)
        else:
            kind = declaration.type.capitalize()
            SubElement(node, f"{{{SSV}}}{kind}", value=written(value, declaration.type))
    define_units(root, SSV, used)
    return serialized(root)


def written(value: float | str, kind: str) -> str:
    """Write a value of type string, boolean or integer as XML does."""
    if kind == "string":
        return str(value)
    return str(bool(value)).lower() if kind == "boolean" else str(int(value))


def define_units(parent: Element, namespace: str, used: Iterable[str]) -> None:
    """Append an element ``Units`` with the definitions of units in SI base units, if any.

    Parameters
    ----------
    parent : Element
    namespace : str
        Namespace of the new elements: of SSV, or of the description of a system.
    used : iterable of str
        Units as pint reads them.

    Raises
    ------
    UserError
        See :func:`fmus.kit.units.base_unit`.
    """
    names = sorted(used)
    if not names:
        return
    definitions = SubElement(parent, f"{{{namespace}}}Units")
    for unit in names:
        base = units.base_unit(unit)
        attributes = {k: str(v) for k, v in sorted(base.exponents.items())}
        if base.factor != 1.0:
            attributes["factor"] = repr(base.factor)
        if base.offset != 0.0:
            attributes["offset"] = repr(base.offset)
        node = SubElement(definitions, f"{{{SSC}}}Unit", name=unit)
        SubElement(node, f"{{{SSC}}}BaseUnit", attributes)


def serialized(root: Element) -> bytes:
    """Write an element as an XML file: indented, with a fixed XML declaration.

    Parameters
    ----------
    root : Element
        Indented in place.

    Returns
    -------
    bytes
        UTF-8.

    Raises
    ------
    UserError
        If a text has a control character, or bytes that are no text: XML 1.0 can hold neither.
    """
    indent(root)
    body: str = tostring(root, encoding="unicode")
    illegal = _ILLEGAL.search(body)
    if illegal is not None:
        before = quoting.visible(body[max(illegal.start() - _SHOWN, 0) : illegal.start()])
        character = quoting.visible(illegal[0])
        raise UserError(f"XML cannot hold the character {character}, after: {before}")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}\n'.encode()
