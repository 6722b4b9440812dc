"""Writing of the parameters of a member; those of FMI 3.0 have its types and whole arrays."""

from __future__ import annotations

from xml.etree.ElementTree import Element

from fmus.kit import UserError
from fmus.kit.build import define_units, serialized, to_ssv
from orchestration.fmu import Signal, Value
from orchestration.fmu.wrapping import DeclaredVariable
from orchestration.system.checking import variable
from orchestration.system.model import Member
from orchestration.system.ssp.arrays import declared, end_of, enumeration_items
from orchestration.system.ssp.connectors import known_unit
from orchestration.system.ssp.vocabulary import PARAMETER_SET, SSV, TYPES, node


def write_parameters(member: Member) -> bytes:
    """Return the parameter set of a member: of SSP 2.0 for FMI 3.0, of SSP 1.0 for FMI 2.0.

    SSP has values of whole arrays only: elements without a value are written with their start
    values.

    Parameters
    ----------
    member : Member

    Returns
    -------
    bytes
        UTF-8 XML.

    Raises
    ------
    UserError
        If a value is no item of its enumeration.
    """
    variables = declared(member)
    if not variables:
        signals = {name: variable(member, name) for name in member.parameters}
        return to_ssv(PARAMETER_SET, member.parameters, signals)
    used: set[str] = set()
    # each array once, in the place of its first element
    names = dict.fromkeys(end_of(member, each).connector for each in member.parameters)
    parameters = [
        node(
            "ssv:Parameter",
            _value(member, variables[name], used),
            *(node("ssc:Dimension", size=str(size)) for size in variables[name].shape),
            name=name,
        )
        for name in names
    ]
    root = node(
        "ssv:ParameterSet", node("ssv:Parameters", *parameters), version="2.0", name=PARAMETER_SET
    )
    define_units(root, SSV, used)
    return serialized(root)


def _value(member: Member, whole: DeclaredVariable, used_units: set[str]) -> Element:
    """Return the element with type, unit and values of a variable; add its unit to `used_units`."""
    signals = [known_unit(variable(member, element)) for element in whole.elements]
    texts = [
        _text(member, whole.kind, signal, member.parameters.get(signal.name, signal.default))
        for signal in signals
    ]
    attributes = {}
    if TYPES[whole.kind] == ("real",) and signals[0].unit:
        attributes["unit"] = signals[0].unit
        used_units.add(signals[0].unit)
    # one node for each text or item, or a list of numbers
    if whole.shape and whole.kind in ("String", "Enumeration"):
        return node(f"ssv:{whole.kind}", *(node("ssv:Value", value=text) for text in texts))
    return node(f"ssv:{whole.kind}", **attributes, value=" ".join(texts))


def _text(member: Member, kind: str, signal: Signal, value: Value) -> str:
    """Return a value as a text for XML."""
    if kind == "Enumeration":
        return _item(member, signal.name, value)
    if signal.type == "real":
        return repr(float(value))
    if signal.type == "boolean":
        return str(bool(value)).lower()
    return str(value) if signal.type == "string" else str(int(value))


def _item(member: Member, name: str, value: Value) -> str:
    """Return the name of the item of a value, as SSP has enumerations by name."""
    items = {number: item for item, number in enumeration_items(member, name).items()}
    if value not in items:
        known = ", ".join(f"{number:g}" for number in items)
        raise UserError(
            f"member {member.name}: {name}: {value:g} is no item of its enumeration; items are"
            f" {known or 'none'}"
        )
    return items[float(value)]
