"""Columns of an archive's files, known before anything is written."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from fmus.kit import UserError

Columns = Mapping[str, Mapping[str, str | None]]


def columns_of(inputs: Mapping[str, str], outputs: Mapping[str, str]) -> Columns:
    """Return the columns of each kind of file after number, time and wall time.

    Parameters
    ----------
    inputs, outputs : Mapping of str to str
        Units.

    Returns
    -------
    Mapping of str to Mapping of str to str or None
        By kind: the unit of each column of numbers, None for one of texts.

    Raises
    ------
    UserError
        If two columns have one name.
    """
    reported = {f"{name}_read_back": unit for name, unit in inputs.items()}
    ages = {f"{name}_age": "s" for name in outputs}
    others = ("number", "time", "wall", "missed", "order")
    for name, count in Counter([*others, *inputs, *reported, *outputs, *ages]).items():
        if count > 1:
            raise UserError(f"--archive: the rig has a signal {name!r}, as a column of the archive")
    return {
        "samples": {"missed": "1", **inputs, **reported, **outputs, **ages},
        "commands": {"order": None, **inputs},
        "events": {"what": None, "text": None},
    }
