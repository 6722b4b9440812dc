"""Numbers and parameters of a swept dataset, and checks that it is the right one and whole."""

from __future__ import annotations

import numpy as np
import xarray

from fmus.kit import UserError
from orchestration.reporting import option


def require_design(data: xarray.Dataset, needed: str) -> None:
    """Refuse a dataset that is not of a sweep of a design, or has no dimension ``case`` any more.

    Raises
    ------
    UserError
    """
    given = data.attrs.get("design", "no sweep")
    if given != needed:
        raise UserError(
            f"this needs a sweep of the design {needed}, and the dataset is of {given}:"
            f" sweep(..., kind={needed!r})"
        )
    if "case" not in data.dims:
        raise UserError(
            f"this sweep of the design {needed} has no dimension case, along which its cases are:"
            f" pass it on as sweep(..., kind={needed!r}) returned it"
        )


def parameters_of(data: xarray.Dataset) -> list[str]:
    """Return the names of the parameters that were swept."""
    return str(data.attrs["over"]).split(" ")


def numbers(data: xarray.Dataset) -> list[str]:
    """Return the names of the numbers that a sweep has of each case."""
    names = [
        str(name) for name, value in data.items() if value.dims == ("case",) and name != "failure"
    ]
    if not names:
        raise UserError(f"the sweep kept no numbers, such as {option('keep', ['last'])}")
    return names


def failures(data: xarray.Dataset) -> list[str]:
    """Return the reasons of failed cases."""
    if "failure" not in data:
        return []
    return [str(reason) for reason in data["failure"].values.ravel() if reason]


def require_complete(data: xarray.Dataset, analysis: str) -> None:
    """Refuse a sweep with a failed case, or with a number that is not finite.

    Parameters
    ----------
    data : xarray.Dataset
    analysis : str
        Name of the analysis, for the message.

    Raises
    ------
    UserError
    """
    failed = failures(data)
    if failed:
        raise UserError(
            f"no {analysis}: {len(failed)} of {data.sizes['case']:,} cases failed, and nothing"
            f" stands in for them; the first: {failed[0]}"
        )
    for name, value in data.items():
        is_number = value.dims == ("case",) and name != "failure"
        if is_number and not np.isfinite(value.values).all():
            raise UserError(f"no {analysis}: {name} is no finite number in a case")
