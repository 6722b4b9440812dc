"""Sentences."""

from __future__ import annotations

import pytest

from orchestration.discrepancy.report import wording


@pytest.mark.parametrize(
    ("gains", "why"),
    [
        ([50.0, 2.0], "alone it lowers BIC by 50.0; beside a it is not needed"),
        ([3.0], "too little: 10 would be evidence"),
        ([-3.0], "it explains less than its parameters cost"),
        ([99.0], "another explains the record much better"),
    ],
)  # fmt: skip
def test_why_an_effect_is_not_named(gains, why):
    assert wording.why_not(gains, "a") == why
