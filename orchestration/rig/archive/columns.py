"""Columns of an archive's files, known before anything is written."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fmus.kit import UserError

_HEAD = ("number", "time", "wall")


def columns_of(inputs: Mapping[str, str], outputs: Mapping[str, str]) -> dict[str, dict[str, Any]]:
    """Return the columns of each kind of file after number, time and wall time.

    Parameters
    ----------
    inputs, outputs : Mapping of str to str
        Units.

    Returns
    -------
    dict of str to dict of str to object
        By kind: the unit of each column of numbers, None for one of texts.

    Raises
    ------
    UserError
        If two columns have one name.
    """
    reported = {f"{name}_read_back": unit for name, unit in inputs.items()}
    ages = {f"{name}_age": "s" for name in outputs}
    columns: dict[str, dict[str, Any]] = {
        "samples": {"missed": "1", **inputs, **reported, **outputs, **ages},
        "commands": {"order": None, **inputs},
        "events": {"what": None, "text": None},
    }
    own = {*_HEAD, "missed", "order", *reported, *ages}
    for name in (*inputs, *outputs):
        if name in own:
            raise UserError(f"--archive: the rig has a signal {name!r}, as a column of the archive")
    return columns
