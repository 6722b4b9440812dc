"""Writing of connectors: each has the type that its variable has in the FMU.

SSP 2.0 keeps Real and Integer, as other names of Float64 and Int32, and says of neither that it is
for one version of FMI. So a variable of FMI 2.0 is written in its own words, as in SSP 1.0.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from fmus.kit import UserError, units
from fmus.kit.build import define_units
from orchestration.fmu import Signal
from orchestration.fmu.signal import read_signal
from orchestration.system.model import Member
from orchestration.system.ssp.arrays import scalars, type_name
from orchestration.system.ssp.vocabulary import SSD, TYPES, tag

_ITEM = re.compile(r"[+-]?\d{1,10}")
_INT = range(-(2**31), 2**31)  # xs:int, which values of items are


@dataclass
class Definitions:
    """The units and the enumerations that the connectors of a description name.

    Attributes
    ----------
    units : set of str
    enumerations : dict of str to Mapping of str to str
        Values by the names of the items.
    """

    units: set[str] = field(default_factory=set)
    enumerations: dict[str, Mapping[str, str]] = field(default_factory=dict)

    def name_of(self, enumeration: Any) -> str | None:
        """Return the name under which an enumeration of fmpy is defined, which is added.

        Two of one name and with other items are told apart by a number. None where SSP cannot
        define it: without items, or with a value beyond 32 bits.
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
        if self.enumerations:
            parent = SubElement(root, tag("ssd:Enumerations"))
            for name, items in sorted(self.enumerations.items()):
                node = SubElement(parent, tag("ssc:Enumeration"), name=name)
                for item, value in items.items():
                    SubElement(node, tag("ssc:Item"), name=item, value=value)
        define_units(root, SSD, self.units)


def _is_int(text: str | None) -> bool:
    return _ITEM.fullmatch(text or "") is not None and int(text or "") in _INT


def connector(
    name: str, kind: str, own_type: Element | None, shape: tuple[int, ...] = ()
) -> Element:
    """Describe a connector.

    Parameters
    ----------
    name : str
    kind : {"input", "output"}
    own_type : Element, optional
        Its type; of an array that of an element.
    shape : tuple of int
        Of an array; empty for a scalar.

    Returns
    -------
    Element
    """
    element = Element(tag("ssd:Connector"), name=name, kind=kind)
    element.extend([] if own_type is None else [own_type])
    element.extend(Element(tag("ssc:Dimension"), size=str(size)) for size in shape)
    return element


def type_of(member: Member, variable: str, definitions: Definitions) -> Element | None:
    """Describe the type of a variable; None if SSP has no words for it, and leaves it to the FMU.

    Parameters
    ----------
    member : Member
    variable : str
        Its name, or that of an element.
    definitions : Definitions
        Its unit or its enumeration is added.
    """
    scalar = scalars(member)[variable]
    kind = type_name(member, variable)
    node = Element(tag(f"ssc:{kind}"))
    if kind == "Enumeration":
        name = definitions.name_of(scalar.declaredType)
        if name is None:
            return None
        node.set("name", name)
    elif TYPES[kind] == ("real",):
        unit = known_unit(read_signal(scalar)).unit
        if unit:
            node.set("unit", unit)
            definitions.units.add(unit)
    return node


def known_unit(signal: Signal) -> Signal:
    """Return a signal without its unit if that cannot be defined, for an FMU may name any."""
    try:
        units.base_unit(signal.unit)
    except UserError:
        return replace(signal, unit="")
    return signal
