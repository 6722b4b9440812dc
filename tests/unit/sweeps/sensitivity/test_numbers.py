"""Claims: an analysis takes a sweep of its own design that is whole, and says what is missing."""

import re

import numpy as np
import pytest
import xarray

from fmus.kit import UserError
from orchestration.sweeps.sensitivity.numbers import (
    failures,
    numbers,
    parameters_of,
    require_complete,
    require_design,
)


@pytest.fixture
def swept():
    """Three cases, with a number and a trace of each."""
    return xarray.Dataset(
        {
            "x_last": ("case", np.array([1.0, 2.0, 3.0])),
            "x": (("case", "time"), np.zeros((3, 2))),
            "failure": ("case", np.array(["", "", ""], dtype=object)),
        },
        attrs={"design": "tornado", "over": "R1 C"},
    )


def test_the_numbers_of_each_case_are_neither_traces_nor_failures(swept):
    assert parameters_of(swept) == ["R1", "C"]
    assert numbers(swept) == ["x_last"]
    with pytest.raises(UserError, match=r"kept no numbers, such as keep=\['last'\]"):
        numbers(swept.drop_vars("x_last"))


def test_another_design_is_refused_by_its_name(swept):
    require_design(swept, "tornado")
    with pytest.raises(
        UserError, match="of the design sobol-indices, and the dataset is of tornado: sweep"
    ):
        require_design(swept, "sobol-indices")
    with pytest.raises(UserError, match="of the design tornado, and the dataset is of no sweep"):
        require_design(xarray.Dataset(), "tornado")


@pytest.mark.parametrize("change", [lambda d: d.isel(case=0), lambda d: d.rename(case="run")])
def test_a_sweep_that_has_lost_its_cases_is_not_called_one_of_another_design(swept, change):
    with pytest.raises(UserError, match="of the design tornado has lost its dimension case"):
        require_design(change(swept), "tornado")


def test_a_sweep_with_a_hole_is_refused_with_the_first_reason(swept):
    require_complete(swept, "tornado plot")
    swept["failure"].values[1:] = "R1 is 0", "R1 is -1"
    assert failures(swept) == ["R1 is 0", "R1 is -1"]
    message = "no tornado plot: 2 of 3 cases failed, and nothing stands in for them; the first: "
    with pytest.raises(UserError, match=f"^{re.escape(message)}R1 is 0$"):
        require_complete(swept, "tornado plot")


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_number_that_is_none_is_refused_and_a_trace_that_is_none_is_not(swept, value):
    swept["x"].values[0, 0] = np.nan
    require_complete(swept, "tornado plot")
    swept["x_last"].values[2] = value
    with pytest.raises(
        UserError, match="no tornado plot: x_last is not a finite number in every case"
    ):
        require_complete(swept, "tornado plot")


def test_a_sweep_in_which_nothing_can_fail_has_no_failures(swept):
    assert failures(swept.drop_vars("failure")) == []
