"""Parameter files: SSV, the parameter format of SSP 1.0."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree.ElementTree import Element, SubElement, indent, register_namespace, tostring

from . import units
from .declare import Declaration

SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"


def to_ssv(name: str, values: Mapping[str, float], declared: Mapping[str, Declaration], doc: str = "") -> bytes:
    """Write a parameter set.

    Parameters
    ----------
    name : str
        Name of the set.
    values : Mapping[str, float]
        Parameter name to value in its declared unit.
    declared : Mapping[str, Declaration]
        Parameter name to declaration, for type and unit.
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
            SubElement(node, f"{{{SSV}}}Real", value=repr(float(value)), unit=declaration.unit)
            used.add(declaration.unit)
        else:
            text = str(bool(value)).lower() if declaration.type == "boolean" else str(int(value))
            SubElement(node, f"{{{SSV}}}{declaration.type.capitalize()}", value=text)
    if used:
        definitions = SubElement(root, f"{{{SSV}}}Units")
        for unit in sorted(used):
            node = SubElement(definitions, f"{{{SSC}}}Unit", name=unit)
            base = units.base_unit(unit)
            attributes = {k: str(v) for k, v in sorted(base.exponents.items())}
            if base.factor != 1.0:
                attributes["factor"] = repr(base.factor)
            SubElement(node, f"{{{SSC}}}BaseUnit", attributes)
    indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="utf-8") + b"\n"
