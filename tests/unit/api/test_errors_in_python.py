"""Claims: data that cannot be used are refused in a line with the argument and the remedy."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import orchestration as ppy

TIME = np.arange(0.0, 20.0, 0.1)
CURRENT = np.sin(TIME)
VOLTAGE = 0.4 * CURRENT
NAN = np.full(TIME.size, np.nan)
RECORD = {"time": TIME, "current": CURRENT, "voltage": VOLTAGE}


@pytest.mark.parametrize(
    ("record", "said"),
    [
        ({**RECORD, "voltage": NAN}, r"voltage: the column has no values \(all are NaN\)"),
        ({**RECORD, "current": NAN}, r"'current' is required.*no values \(all are NaN\)"),
        ({"time": TIME, "current": CURRENT}, r"no column is an output.*mapping={'column'"),
        (
            {"time": TIME, "amps": CURRENT, "voltag": VOLTAGE},
            "mapping={'amps': 'current', 'voltag': 'voltage'}",
        ),
        (
            np.column_stack([TIME, CURRENT]),
            r"record: an array of shape \(200, 2\) has no names.*{'",
        ),
        ([TIME, CURRENT], "record: list has no names"),
        (pd.DataFrame(RECORD)[::-1], r"reverse order: the first is at 19.9 s.*\[::-1\]"),
    ],
)
def test_what_cannot_be_compared_is_refused_with_the_remedy(record, said):
    with pytest.raises(ppy.UserError, match=said):
        ppy.compare(record, "ppy_actuator")


def test_inputs_without_names_are_refused():
    with pytest.raises(ppy.UserError, match=r"inputs: ndarray has no names.*{'current': values}"):
        ppy.simulate("ppy_actuator", CURRENT, time=TIME)
