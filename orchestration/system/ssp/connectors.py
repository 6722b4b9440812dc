"""Writing of connectors with the types of their variables in the FMUs.

SSP 2.0 has Real and Integer, too, as other names of Float64 and Int32, for any version of FMI. A
variable of FMI 2.0 is therefore written with its own type, as in SSP 1.0.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any
from xml.etree.ElementTree import Element

from fmus.kit import UserError, units
from fmus.kit.build import define_units
from orchestration.fmu import Signal
from orchestration.fmu.signal import read_signal
from orchestration.system.model import Member
from orchestration.system.ssp.arrays import scalars, type_name
from orchestration.system.ssp.vocabulary import SSD, TYPES, node

_ITEM = re.compile(r"[+-]?\d{1,10}")
_INT = range(-(2**31), 2**31)  # xs:int, the type of values of items


@dataclass
class Definitions:
    """Units and enumerations that the connectors of a description use.

    Attributes
    ----------
    units : set of str
    enumerations : dict of str to Mapping of str to str
        Values by the names of the items.
    """

    units: set[str] = field(default_factory=set)
    enumerations: dict[str, Mapping[str, str]] = field(default_factory=dict)

    def name_of(self, enumeration: Any) -> str | None:
        """Add an enumeration of fmpy, and return its name in the description.

        A number distinguishes enumerations of one name with different items. None if SSP cannot
        define it: without items, or with a value of more than 32 bits.
        """
        listed = enumeration.items if enumeration is not None else ()
        items = {item.name: item.value for item in listed or ()}
        if not items or not all(map(_is_int, items.values())):
            return None
        name: str = enumeration.name
        number = 1
        while self.enumerations.setdefault(name, items) != items:
            number += 1
            name = f"{enumeration.name}_{number}"
        return name

    def append_to(self, root: Element) -> None:
        """Append the definitions to a description."""
        enumerations = [
            node(
                "ssc:Enumeration",
                *(node("ssc:Item", name=item, value=value) for item, value in items.items()),
                name=name,
            )
            for name, items in sorted(self.enumerations.items())
        ]
        if enumerations:
            root.append(node("ssd:Enumerations", *enumerations))
        define_units(root, SSD, self.units)


def _is_int(text: str | None) -> bool:
    """Return whether a text is a whole number of 32 bits."""
    return _ITEM.fullmatch(text or "") is not None and int(text or "") in _INT


def connector(
    name: str, kind: str, type_element: Element | None, shape: tuple[int, ...] = ()
) -> Element:
    """Return the element of a connector.

    Parameters
    ----------
    name : str
    kind : {"input", "output"}
    type_element : Element, optional
        Element of its type, or of the type of an array's elements.
    shape : tuple of int
        Shape of an array; empty for a scalar.

    Returns
    -------
    Element
    """
    types = [] if type_element is None else [type_element]
    sizes = [node("ssc:Dimension", size=str(size)) for size in shape]
    return node("ssd:Connector", *types, *sizes, name=name, kind=kind)


def type_of(member: Member, variable: str, definitions: Definitions) -> Element | None:
    """Return the element of a variable's type; None for an enumeration that SSP cannot define.

    Parameters
    ----------
    member : Member
    variable : str
        Name of a scalar or an element.
    definitions : Definitions
        Receives its unit or its enumeration.
    """
    scalar = scalars(member)[variable]
    kind = type_name(member, variable)
    element = node(f"ssc:{kind}")
    if kind == "Enumeration":
        name = definitions.name_of(scalar.declaredType)
        if name is None:
            return None
        element.set("name", name)
    elif TYPES[kind] == ("real",):
        unit = known_unit(read_signal(scalar)).unit
        if unit:
            element.set("unit", unit)
            definitions.units.add(unit)
    return element


def known_unit(signal: Signal) -> Signal:
    """Return a signal, without its unit if SSP cannot define that unit."""
    try:
        units.base_unit(signal.unit)
    except UserError:
        return replace(signal, unit="")
    return signal
