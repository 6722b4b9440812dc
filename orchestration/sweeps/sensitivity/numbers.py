"""What of a swept dataset is asked about: its numbers, its parameters, whether it is whole."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray

from fmus.kit.errors import UserError

MOST = 6  # panels of a picture


def designed(found: xarray.Dataset, kind: str) -> None:
    """Refuse a dataset that is not of a sweep of a design.

    Raises
    ------
    UserError
    """
    if found.attrs.get("design") != kind or "case" not in found.dims:
        other = found.attrs.get("design", "no sweep")
        raise UserError(
            f"this is of a sweep of the design {kind}, not {other}: sweep(..., kind={kind!r})"
        )


def parameters_of(found: xarray.Dataset) -> list[str]:
    """What was swept, by name."""
    return str(found.attrs["over"]).split(" ")


def numbers(found: xarray.Dataset) -> list[str]:
    """Names of the numbers that a sweep left of each case."""
    names = [
        str(name) for name, value in found.items() if value.dims == ("case",) and name != "failure"
    ]
    if not names:
        raise UserError("the sweep kept no numbers, such as --keep last")
    return names


def drawn(names: Sequence[str]) -> list[str]:
    """As many as a picture has room for."""
    return list(names[:MOST])


def failures(found: xarray.Dataset) -> list[str]:
    """Why cases left nothing."""
    return (
        [str(reason) for reason in found["failure"].values.ravel() if reason]
        if "failure" in found
        else []
    )


def complete(found: xarray.Dataset, what: str) -> None:
    """Refuse a sweep of which a case is missing, or has a number that is none.

    Parameters
    ----------
    found : xarray.Dataset
    what : str
        That there cannot be then.

    Raises
    ------
    UserError
    """
    failed = failures(found)
    if failed:
        raise UserError(
            f"no {what}: {len(failed)} of {found.sizes['case']:,} cases failed, and nothing stands in for them; the "
            f"first: {failed[0]}"
        )
    whole = {
        name: value
        for name, value in found.items()
        if value.dims == ("case",) and name != "failure"
    }
    endless = next(
        (name for name, value in whole.items() if not np.isfinite(value.values).all()), None
    )
    if endless is not None:
        raise UserError(f"no {what}: {endless} is no finite number in a case")
