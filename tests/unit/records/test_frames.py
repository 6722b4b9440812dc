"""Claims: a DataFrame and arrays by name are the record that their file would be; the index is the
time where it has one.
"""

from datetime import datetime, timedelta

import numpy as np
import pandas as pd
import pytest

from orchestration.records import read_record
from tests.support.record_forms import CURRENT, DISPLACEMENT, SIGNALS, TIME, check, refusal

ARRAYS = {"time [s]": TIME, "current [mA]": 1e3 * CURRENT, "displacement [m]": DISPLACEMENT}
START = datetime(2026, 12, 31, 23, 59, 59)
INSTANTS = [START + timedelta(seconds=float(t)) for t in TIME]


def without_time():
    return {name: values for name, values in ARRAYS.items() if name != "time [s]"}


@pytest.mark.parametrize(
    "data",
    [
        ARRAYS,
        {name: list(values) for name, values in ARRAYS.items()},
        {**without_time(), "Zeit": INSTANTS},
        {**without_time(), "Zeit": np.array(INSTANTS, dtype="datetime64[ms]")},
        {**without_time(), "Zeit": [f"{moment:%d.%m.%Y %H:%M:%S,%f}" for moment in INSTANTS]},
        pd.DataFrame(ARRAYS),
        pd.DataFrame(ARRAYS).convert_dtypes(),
        pd.DataFrame(ARRAYS).set_index("time [s]"),
        pd.DataFrame(without_time(), index=pd.DatetimeIndex(INSTANTS)),
        pd.DataFrame(without_time(), index=pd.DatetimeIndex(INSTANTS, name="Zeitpunkt")),
        pd.DataFrame(without_time(), index=pd.DatetimeIndex(INSTANTS).tz_localize("Europe/Berlin")),
        pd.DataFrame(without_time(), index=pd.to_timedelta(TIME, unit="s")),
        pd.DataFrame({**without_time(), "t": pd.to_datetime(INSTANTS)}),
    ],
)
def test_tables_of_python_give_the_same_record(data):
    check(read_record(data, SIGNALS))


def test_missing_values_of_any_kind_are_missing():
    frame = pd.DataFrame({"t": [0.0, 1.0, 2.0], "x [m]": pd.array([1, None, 3], dtype="Int64")})
    record = read_record(frame, {"x": "m"})
    np.testing.assert_array_equal(record.signals["x"], [1.0, np.nan, 3.0])


def test_an_index_that_only_counts_is_not_the_time():
    frame = pd.DataFrame({"zeit [s]": TIME[1:], "current [A]": CURRENT[1:]}, index=[5, 6, 7])
    np.testing.assert_array_equal(read_record(frame, SIGNALS).time, TIME[1:])


def test_each_has_a_name_of_its_own():
    sources = {read_record(ARRAYS, SIGNALS).source for _ in range(3)}
    assert len(sources) == 3


@pytest.mark.parametrize(
    ("data", "says"),
    [
        ({**ARRAYS, "x": np.zeros(3)}, "'x' has 3 values, 'time [s]' has 4"),
        ({**ARRAYS, "x": np.zeros((4, 2))}, "column 'x' has shape (4, 2)"),
        ({"time": [], "current": []}, "no rows"),
        ({}, "no rows"),
        (pd.DataFrame(np.zeros((2, 2)), columns=["a", "a"]), "several columns are called 'a'"),
        ({"time": TIME, "current": ["1", "2", "jammed", "4"]}, "row 3, column 'current'"),
    ],
)
def test_what_is_no_table_is_refused(data, says):
    assert says in refusal(data)


def test_masked_samples_are_missing():
    values = np.ma.array(CURRENT.copy(), mask=[False, True, False, False])
    values.data[1] = 9.96920997e36
    record = read_record({"time [s]": TIME, "current [A]": values}, SIGNALS)
    assert np.flatnonzero(np.isnan(record.signals["current"])).tolist() == [1]
