"""Comparison of the declarations in a description with the variables of the FMUs."""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element

from fmus.kit.errors import UserError, suggestion
from orchestration.fmu.signal import read_signal, type_of
from orchestration.system.checking import conversion
from orchestration.system.model import Member
from orchestration.system.ssp.arrays import scalars, variable_of
from orchestration.system.ssp.vocabulary import (
    NAMESPACES,
    TYPES,
    check_exchanged,
    local_name,
    tag,
)

_TYPES = {tag(f"ssc:{name}"): kinds for name, kinds in TYPES.items()}


def check_connectors(element: Element, member: Member) -> None:
    """Compare all connectors of a member with the variables of its FMU.

    Parameters
    ----------
    element : Element
        The ``Component``.
    member : Member

    Raises
    ------
    UserError
        If a connector has no variable, or the variable has another kind, type or unit than
        declared.
    """
    variables = scalars(member)
    for connector in element.iterfind("ssd:Connectors/ssd:Connector", NAMESPACES):
        name = connector.get("name", "")
        where = f"connector {name!r}"
        check_exchanged(connector, where)
        check_shape(connector, name, member, where)
        for element_name in variable_of(member, name).elements:
            if element_name not in variables:
                raise UserError(
                    f"{where}: the FMU has no variable of this name{suggestion(name, variables)}"
                )
            scalar = variables[element_name]
            kind = connector.get("kind", "")
            actual = scalar.causality or "local"
            # structural parameters are fixed when an FMU is read, and local here
            if kind != actual and (kind, actual) != ("structuralParameter", "local"):
                raise UserError(
                    f"{where} is declared as {kind or 'no kind'}, but in the FMU it is {actual}"
                )
            check_type_and_unit(connector, scalar, where)


def check_shape(element: Element, name: str, member: Member, where: str) -> None:
    """Compare the declared size of an array with that of the variable.

    A dimension without a number, such as the size by another connector, always agrees.

    Parameters
    ----------
    element : Element
        A connector or a parameter.
    name : str
        Name of its variable.
    member : Member
    where : str
        Beginning of the message.

    Raises
    ------
    UserError
        If they differ, with both.
    """
    sizes = [node.get("size") for node in element.iterfind("ssc:Dimension", NAMESPACES)]
    actual = [str(size) for size in variable_of(member, name).shape]
    agree = len(sizes) == len(actual) and all(
        not declared or declared == size for declared, size in zip(sizes, actual, strict=True)
    )
    if sizes and not agree:
        given = " by ".join(size or "any" for size in sizes)
        raise UserError(
            f"{where} is declared as {given} elements, but in the FMU it has"
            f" {' by '.join(actual) or 'no dimension'}"
        )


def check_type_and_unit(connector: Element, scalar: Any, where: str) -> None:
    """Compare the declared type and unit of a connector with those of a variable.

    Parameters
    ----------
    connector : Element
    scalar : Any
        Scalar variable of fmpy.
    where : str
        Beginning of the message.

    Raises
    ------
    UserError
        If they differ, with both.
    """
    for node in connector:
        if node.tag not in _TYPES:
            continue
        if type_of(scalar) not in _TYPES[node.tag]:
            raise UserError(
                f"{where} is declared as {local_name(node)}, but in the FMU it is {scalar.type}"
            )
        unit = node.get("unit")
        if unit is None:
            continue
        signal = read_signal(scalar)
        actual = signal.unit
        has_unit = signal.declares_unit or signal.type != "real"
        if has_unit and conversion(unit, actual) != (1.0, 0.0):
            raise UserError(f"{where} is declared in {unit!r}, but in the FMU it is in {actual!r}")
