"""Which parameters are told to differ, and which no specimen can have: by hand."""

from __future__ import annotations

import math

import pytest

from orchestration.discrepancy.validation.estimates import implausible
from orchestration.identify.estimate import Estimate, significantly_different


@pytest.mark.parametrize(
    ("change", "error", "differs"),
    [
        (0.30, 0.05, True),
        (-0.30, 0.05, True),
        (0.30, 0.07, False),  # 4.3 standard errors
        (0.025, 0.001, True),
        (0.015, 0.001, False),  # fifteen standard errors, but a percent and a half
    ],
)
def test_a_parameter_differs_surely_and_noticeably_or_not_at_all(change, error, differs):
    assert significantly_different(change, error) is differs


@pytest.mark.parametrize(
    ("ratio", "odd"), [(20.0, False), (50.0, True), (1.0 / 20.0, False), (1.0 / 50.0, True)]
)
def test_a_parameter_fifty_times_nominal_is_that_of_no_specimen(ratio, odd):
    ends = (1.8 * ratio, 2.2 * ratio)
    values = {
        "R": Estimate(2.0 * ratio, 2.0, ends, "ohm"),
        "zero": Estimate(5.0, 0.0, (4.0, 6.0), "V"),
    }
    assert implausible(values, ["R", "zero"]) == ({"R": pytest.approx(ratio)} if odd else {})


@pytest.mark.parametrize("ends", [(0.0, math.inf), (math.nan, math.nan), (2.1, 1e9), (59.0, 1e9)])
def test_a_parameter_that_may_be_that_of_a_specimen_is_not_out_of_all_reason(ends):
    assert implausible({"R": Estimate(100.0, 2.0, ends, "ohm")}, ["R"]) == {}
    reciprocal = tuple(4.0 / end if end else math.inf for end in reversed(ends))
    assert implausible({"R": Estimate(0.04, 2.0, reciprocal, "ohm")}, ["R"]) == {}
