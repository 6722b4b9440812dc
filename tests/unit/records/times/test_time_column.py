"""Claims: the time is found by name, unit or dates; of several columns that which runs through is
taken and it is said; without one the advice that is printed works, or there is none.
"""

import ast
import re

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.records import read_record
from tests.support.record_forms import write


def read(folder, header, rows, **options):
    text = "\n".join([header, *(";".join(map(str, row)) for row in rows)]) + "\n"
    return read_record(write(folder, text), {"I": "A"}, **options)


@pytest.mark.parametrize(
    "name", ["time", "TIME (s)", "t/s", "Test_Time(s)", "Zeit [s]", "elapsed time", "Dauer [s]"]
)
def test_time_is_found_by_its_name_or_unit_wherever_it_stands(tmp_path, name):
    record = read(tmp_path, f"n;I [A];{name}", [(5, 1, 0), (6, 2, 1), (4, 3, 2)])
    assert record.time.tolist() == [0.0, 1.0, 2.0]


def test_of_several_the_one_that_runs_through_is_taken_and_said(tmp_path):
    rows = [(k % 5, k, f"10:00:{k:02d}", k) for k in range(20)]
    record = read(tmp_path, "Time [s];Total Time [min];Uhrzeit;I [A]", rows)
    assert record.time.tolist() == [60.0 * k for k in range(20)]
    said = next(r for r in record.repairs if r.kind == "time column")
    assert "'Total Time', not 'Time', 'Uhrzeit'" in said.message


def test_a_count_of_cycles_is_no_clock_though_it_never_falls(tmp_path):
    rows = [(k % 25, k // 25, k) for k in range(50)]
    with pytest.raises(UserError, match="clock restarts"):
        read(tmp_path, "time [s];cycle_time [s];I [A]", rows)


def test_a_signal_in_seconds_is_not_taken_for_the_time(tmp_path):
    with pytest.raises(UserError, match="no time column"):
        read(tmp_path, "n;delay [s];I [A]", [(0, 3, 1), (1, 2, 2), (2, 4, 3)])


def test_a_temperature_called_t_is_not_the_time(tmp_path):
    with pytest.raises(UserError, match="no time column"):
        read(tmp_path, "n;T [degC];I [A]", [(0, 20, 1), (1, 21, 2), (2, 22, 3)])


def test_a_temperature_t_without_a_unit_is_not_the_time(tmp_path):
    rows = [(k, 24.0 + 0.1 * (k % 2), k) for k in range(9)]
    with pytest.raises(UserError, match=r"no time column.*'E': 'time"):
        read(tmp_path, "E;T;I [A]", rows)


def test_a_clock_t_that_restarts_is_the_time(tmp_path):
    with pytest.raises(UserError, match="the clock"):
        read(tmp_path, "n;t;I [A]", [(k, k % 15, 1) for k in range(30)])


@pytest.mark.parametrize("mapping", [{}, {"Datum": "time"}, {"Uhrzeit": "time"}])
def test_date_and_time_of_day_in_two_columns_are_one_instant(tmp_path, mapping):
    rows = [
        ("31.01.2026", "23:00:00", 1),
        ("01.02.2026", "01:00:00", 2),
        ("03.02.2026", "00:00:00", 3),
    ]
    record = read(tmp_path, "Datum;Uhrzeit;I [A]", rows, mapping=mapping)
    np.testing.assert_array_equal(record.time, [0.0, 7200.0, 176400.0])
    assert not any("ignored" in r.kind for r in record.repairs)


def test_the_advice_of_a_file_without_time_works_when_followed(tmp_path):
    rows = [("a", 5, 1), ("b", 6, 2), ("c", 7, 3)]
    with pytest.raises(UserError, match="no time column") as caught:
        read(tmp_path, "note;sample [1];I [A]", rows)
    advice = ast.literal_eval(re.search(r"mapping=({.*})", str(caught.value))[1])
    record = read(tmp_path, "note;sample [1];I [A]", rows, mapping=advice)
    assert record.time.tolist() == [5.0, 6.0, 7.0]


def test_no_column_is_advised_where_none_can_be_the_time(tmp_path):
    with pytest.raises(UserError, match="add a column of time"):
        read(tmp_path, "note;I [A]", [("a", 1), ("b", 0), ("c", 1)])
