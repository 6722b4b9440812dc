"""Identified values as a parameter set (SSV) of SSP 1.0, a file that any system binds."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from fmus.kit import UserError, files
from fmus.kit.build import Typed, to_ssv


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
