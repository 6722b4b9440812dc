"""Numbers and parameters of the dataset of a sweep, and checks of its design and completeness."""

from __future__ import annotations

import numpy as np
import xarray

from fmus.kit import UserError, quoting
from orchestration.reporting import option


def require_design(data: xarray.Dataset, needed: str) -> None:
    """Raise if a dataset is not a sweep of a design with the dimension ``case``.

    Raises
    ------
    UserError
        With the design of the dataset.
    """
    design = data.attrs.get("design", "no sweep")
    if design != needed:
        raise UserError(
            f"this needs a sweep of the design {needed}, and the dataset is of {design}:"
            f" sweep(..., kind={needed!r})"
        )
    if "case" not in data.dims:
        raise UserError(
            f"this sweep of the design {needed} has lost its dimension case: pass it as"
            f" sweep(..., kind={needed!r}) returned it"
        )


def parameters_of(data: xarray.Dataset) -> list[str]:
    """Return the names of the parameters of a sweep."""
    return quoting.words(str(data.attrs["over"]))


def numbers(data: xarray.Dataset) -> list[str]:
    """Return the names of the variables with a number per case; raise if there are none."""
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
    """Raise if a case of a sweep failed, or a number is not finite.

    Parameters
    ----------
    data : xarray.Dataset
    analysis : str
        Name of the analysis, for the message.

    Raises
    ------
    UserError
        With the first failure.
    """
    reasons = failures(data)
    if reasons:
        raise UserError(
            f"no {analysis}: {len(reasons)} of {data.sizes['case']:,} cases failed, and nothing"
            f" stands in for them; the first: {reasons[0]}"
        )
    for name, value in data.items():
        is_number = value.dims == ("case",) and name != "failure"
        if is_number and not np.isfinite(value.values).all():
            raise UserError(f"no {analysis}: {name} is not a finite number in every case")
