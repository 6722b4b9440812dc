"""Connectors as a description declares them, held against the variables of the FMUs behind them."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from fmus.kit.errors import UserError, suggestion
from orchestration.fmu.archive import read_description
from orchestration.fmu.signal import read_signal, type_of
from orchestration.system.check import conversion
from orchestration.system.model import Member
from orchestration.system.ssp.grammar import local
from orchestration.system.ssp.vocabulary import NAMESPACES, tag

_TYPES = {
    tag(f"ssc:{name}"): type_
    for name, type_ in (
        ("Real", "real"),
        ("Integer", "integer"),
        ("Enumeration", "integer"),
        ("Boolean", "boolean"),
        ("String", "string"),
        ("Binary", "binary"),
    )
}


def check_connectors(element: Element, member: Member) -> None:
    """Hold all connectors of a member against its FMU.

    Parameters
    ----------
    element : Element
        The ``Component``.
    member : Member

    Raises
    ------
    UserError
        If there is no variable of a connector's name, or it is of another kind, type or unit than declared.
    """
    variables = variables_of(member)
    for connector in element.iterfind("ssd:Connectors/ssd:Connector", NAMESPACES):
        name = connector.get("name", "")
        where = f"connector {name!r}"
        if name not in variables:
            raise UserError(
                f"{where}: the FMU has no variable of this name{suggestion(name, variables)}"
            )
        declared, actual = connector.get("kind", ""), variables[name].causality or "local"
        if declared != actual:
            raise UserError(
                f"{where} is declared as {declared or 'no kind'}, but in the FMU it is {actual}"
            )
        check_declared(connector, variables[name], where)


def check_declared(connector: Element, variable: Any, where: str) -> None:
    """Hold type and unit of a connector, as far as they are declared, against a variable of fmpy's.

    Raises
    ------
    UserError
        If they differ, with both.
    """
    for node in connector:
        if node.tag not in _TYPES:
            continue
        if _TYPES[node.tag] != type_of(variable):
            raise UserError(
                f"{where} is declared as {local(node)}, but in the FMU it is {variable.type}"
            )
        unit = node.get("unit")
        if unit is None:
            continue
        actual = read_signal(variable).unit
        if conversion(unit, actual) != (1.0, 0.0):
            raise UserError(f"{where} is declared in {unit!r}, but in the FMU it is in {actual!r}")


def variables_of(member: Member) -> dict[str, Any]:
    """All variables of a member's FMU as fmpy has them, by name; UserError if it cannot be read."""
    path = member.fmu.absolute()
    return _variables(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=64)
def _variables(path: Path, written: int) -> dict[str, Any]:
    return {variable.name: variable for variable in read_description(path).modelVariables}
