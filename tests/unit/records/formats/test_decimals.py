"""Claims: decimal commas and separators of thousands give the numbers they mean, and a number that
may mean two is refused with its row.
"""

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.records.formats.decimals import normalise_decimals
from orchestration.records.tables import Column, Table, numbers


def table(*columns):
    rows = np.arange(2, 2 + len(columns[0]))
    return Table("r.csv", [Column(f"c{k}", None, list(c)) for k, c in enumerate(columns)], rows)


def settled(*columns, comma_divides=False):
    made = table(*columns)
    normalise_decimals(made, comma_divides)
    return made, [numbers(made, column).tolist() for column in made.columns]


@pytest.mark.parametrize(
    ("cells", "values"),
    [
        (["0,5", "-1,25", "3"], [0.5, -1.25, 3.0]),
        (["1.234,5", "0,25"], [1234.5, 0.25]),
        (["1.234.567,5", "1"], [1234567.5, 1.0]),
        (["1.234.567", "999"], [1234567.0, 999.0]),
        (["1 234,5", "12 345,25"], [1234.5, 12345.25]),
        (["1\u00a0234,5", "1\u202f000,0"], [1234.5, 1000.0]),
        (["1'234.5", "0.5"], [1234.5, 0.5]),
        (["1,5e-3", ",5", "5,"], [1.5e-3, 0.5, 5.0]),
        (["999,5", "1.000,5", "1.001"], [999.5, 1000.5, 1001.0]),
    ],
)
def test_numbers_are_read_as_they_are_meant(cells, values):
    assert settled(cells)[1] == [values]


@pytest.mark.parametrize(
    ("cells", "values"),
    [
        (["1,234.5", "0.25"], [1234.5, 0.25]),
        (["0,5", "1,25"], [0.5, 1.25]),
        (["0,123", "0,456"], [0.123, 0.456]),  # nobody writes that for thousands
    ],
)
def test_where_commas_divide_columns_one_before_three_digits_is_of_thousands(cells, values):
    assert settled(cells, comma_divides=True)[1] == [values]


def test_points_before_three_digits_are_decimal_where_commas_divide_columns():
    made, values = settled(["1.234", "2.345"], comma_divides=True)
    assert values == [[1.234, 2.345]]
    assert made.repairs == []


@pytest.mark.parametrize("cells", [["1,234", "2,345"], ["1.234", "2.345"], ["5", "-1.234"]])
def test_a_mark_before_three_digits_throughout_is_asked_for(cells):
    with pytest.raises(
        UserError, match=r"decimal='comma' for .*decimal='point' for|decimal='point'"
    ):
        settled(cells)


def test_what_was_changed_is_said_with_its_first_row():
    made, _ = settled(["5", "1.234,5"])
    assert [r.kind for r in made.repairs] == ["decimal comma", "thousands"]
    assert all("row 3" in r.message for r in made.repairs)


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ([["0.5", "1"], ["1,5", "2"]], "decimal comma or decimal point"),
        ([["0.000", "1"], ["1.002.000", "2"]], r"'1\.002\.000' \(points between thousands\)"),
        ([["1.234,5", "1,234.5"]], "decimal comma or decimal point"),
        ([["0,5", "0,6"], ["1.234", "2.345"]], "row 2, column 'c1': '1.234'"),
    ],
)
def test_what_may_mean_two_numbers_is_refused_with_its_row(columns, says):
    with pytest.raises(UserError, match=says):
        settled(*columns)


def test_dates_and_words_are_left_alone():
    cells = ["31.01.2026", "a, b", "12.5.26", "1.2.3"]
    made = table(cells, ["0,5"] * 4)
    normalise_decimals(made, False)
    assert list(made.columns[0].cells) == cells
