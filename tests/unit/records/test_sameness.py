"""Claims: a record that holds the samples of another is refused, however it is written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.records import Record, refuse_same

TIME = np.arange(30.0)
NOISE = np.random.default_rng(1).standard_normal(30)
RECORD = Record(TIME, {"force": TIME, "x": NOISE}, {"force": "N", "x": "m"}, Path("a.csv"))


@pytest.mark.parametrize(
    "changed",
    [
        {"time": TIME + 5.0},
        {"signals": {"x": np.round(NOISE, 9), "force": TIME}},
        {"signals": {"x": NOISE}},
    ],
)
def test_the_same_samples_are_refused(changed):
    other = replace(RECORD, source=Path("b.csv"), **changed)
    with pytest.raises(UserError, match=r"^--compare b\.csv: this is the same record as a\.csv"):
        refuse_same([RECORD, other], ["x"], "--compare")


@pytest.mark.parametrize(
    "changed",
    [
        {"signals": {"force": TIME, "x": NOISE + 1e-3}},
        {"time": 2.0 * TIME},
        {"time": TIME[:-1], "signals": {"force": TIME[:-1], "x": NOISE[:-1]}},
        {"signals": {"force": TIME}},
    ],
)
def test_other_samples_are_another_record(changed):
    refuse_same([RECORD, replace(RECORD, source=Path("b.csv"), **changed)], ["x"])
