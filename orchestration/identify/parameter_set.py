"""Values of parameters as a parameter set (SSV) of SSP, a file that any system binds."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from fmus.kit import UserError, files
from fmus.kit.build import SSV, Typed, to_ssv
from orchestration.fmu.archive import parse_xml


def write(
    path: str | Path, values: Mapping[str, float], declared: Mapping[str, Typed], doc: str = ""
) -> None:
    """Write values as a parameter set, named after the file.

    Parameters
    ----------
    path : str or Path
        Ends in ``.ssv``.
    values : Mapping of str to float
        By parameter, in its declared unit.
    declared : Mapping of str to Typed
        Types and units: the parameters of a model, or ``declared`` of a fit.
    doc : str
        Description, such as the record they were identified from.

    Raises
    ------
    UserError
        If the ending is another, a parameter is not declared, a value is not finite, or the file
        cannot be written.
    """
    to = Path(path)
    if to.suffix.lower() != ".ssv":
        raise UserError(f"{to}: a parameter set must end in .ssv")
    for name, value in values.items():
        if name not in declared:
            raise UserError(f"{to}: no parameter is named {name}; there are {', '.join(declared)}")
        if not float("-inf") < value < float("inf"):
            raise UserError(f"{to}: {name} = {value:g} is no finite number")
    numbers = {name: float(value) for name, value in values.items()}
    files.write(to, to_ssv(to.stem, numbers, declared, doc))


def read(path: Path) -> dict[str, str]:
    """Read a parameter set: a number with its unit, or a text, by parameter.

    Raises
    ------
    UserError
        If the file cannot be read, is no parameter set, or a parameter has no single value.
    """
    try:
        contents = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error
    values = {}
    for parameter in parse_xml(contents, str(path), "the XML").iter(f"{{{SSV}}}Parameter"):
        name = parameter.get("name", "")
        typed = parameter.find("*[@value]")
        if not name or typed is None or len(parameter) != 1:
            raise UserError(f"{path}: parameter {name!r} has no single value")
        unit = typed.get("unit", "1")
        values[name] = f"{typed.get('value')} {'' if unit == '1' else unit}".strip()
    if not values:
        raise UserError(f"{path}: holds no parameter of a parameter set (SSV)")
    return values
