"""Claims: cells of a table are the numbers that their text says, and what is none is refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus.kit import UserError
from orchestration.records.tables.table import (
    Column,
    Table,
    as_numbers,
    numbers,
    parse_cell,
    split_header_cell,
)


@pytest.mark.parametrize(
    ("cell", "parts"),
    [
        ("current [A]", ("current", "A")),
        ("  current[A] ", ("current", "A")),
        ("current", ("current", None)),
        ("current []", ("current", None)),
        ("a [b] [V]", ("a [b]", "V")),
    ],
)
def test_the_unit_of_a_header_is_in_its_last_brackets(cell, parts):
    assert split_header_cell(cell) == parts


@given(value=st.floats(allow_nan=False))
def test_a_number_is_read_as_python_writes_it(value):
    assert parse_cell(f" {value!r} ") == value


def test_a_truth_value_is_a_number():
    assert [parse_cell(cell) for cell in ("true", " False")] == [1.0, 0.0]


@pytest.mark.parametrize("cell", ["", " NaN", "n/a", "#N/A", "-1.#IND"])
def test_a_missing_value_is_no_number_and_no_mistake(cell):
    assert np.isnan(parse_cell(cell))


@pytest.mark.parametrize("cell", ["1_000", "0x10", "1,5", "١٢", "one", "1 2", "."])
def test_what_is_no_number_is_none(cell):
    """Some of these are numbers to `float`, or to another program."""
    assert parse_cell(cell) is None


def test_a_column_is_read_and_its_first_wrong_cell_refused_with_its_row(tmp_path):
    column = Column("u", "V", ["1", "", "1.#INF", "2e3"])
    table = Table(tmp_path / "r.csv", [column], np.array([2, 3, 5, 6]))
    np.testing.assert_array_equal(numbers(table, column), [1.0, np.nan, np.inf, 2000.0])
    column.cells = ["1", "2", "3_0", "x"]
    with pytest.raises(UserError, match=r"r\.csv: row 5, column 'u': '3_0' is not a number"):
        numbers(table, column)


def test_instants_and_durations_become_seconds_and_objects_text():
    instants = np.array(["2020-01-01T00:00:00", "2020-01-01T00:01:30"], dtype="datetime64[ms]")
    assert as_numbers(instants).tolist() == [0.0, 90.0]
    assert as_numbers(np.array([0, 250], dtype="timedelta64[ms]")).tolist() == [0.0, 0.25]
    assert as_numbers(np.array([True, False])).tolist() == [1.0, 0.0]
    assert as_numbers(np.array([None, "a", 1.5], dtype=object)) == ["", "a", "1.5"]


def test_instants_are_in_seconds_whatever_their_header_says():
    instants = np.array(["2026-01-01T00:00:00", "2026-01-01T00:00:02"], dtype="datetime64[ns]")
    column = Column.read("time [ms]", instants)
    assert (column.name, column.unit, column.cells.tolist()) == ("time", "s", [0.0, 2.0])


def test_the_unit_of_a_header_is_before_one_that_is_stated_beside_it():
    assert Column.read("force [mN]", ["1"], "N").unit == "mN"
    assert Column.read("force", ["1"], "N").unit == "N"
    assert Column.read("force", ["1"]).unit is None


def test_columns_of_different_length_and_none_are_refused(tmp_path):
    columns = [Column("u", "V", np.zeros(3)), Column("time", "s", np.zeros(2))]
    with pytest.raises(UserError, match="'u' has 3 values, 'time' has 2"):
        Table.of(tmp_path, columns)
    with pytest.raises(UserError, match="nothing here"):
        Table.of(tmp_path, [], "nothing here")
    assert Table.of(tmp_path, columns[:1]).rows.tolist() == [1, 2, 3]
