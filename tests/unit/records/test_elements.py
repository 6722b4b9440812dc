"""Claims: an array in one column is read as its elements in columns of their own."""

import pytest

from fmus.kit import UserError
from orchestration.records import read_record

UNITS = {"u[1]": "V", "u[2]": "V", "y": "m"}


def file(folder, second):
    path = folder / "record.csv"
    path.write_text(f"time,u [mV],y\n0,1 2,5\n1,{second},6\n")
    return path


def test_the_elements_have_columns_of_their_own_in_the_unit_of_the_array(tmp_path):
    record = read_record(file(tmp_path, "3 4"), UNITS)
    assert record.signals["u[1]"].tolist() == pytest.approx([0.001, 0.003])
    assert record.signals["u[2]"].tolist() == pytest.approx([0.002, 0.004])
    assert record.signals["y"].tolist() == [5.0, 6.0]


@pytest.mark.parametrize(("second", "count"), [("3", 1), ("3 4 5", 3), ("", 0)])
def test_another_number_of_elements_is_refused(tmp_path, second, count):
    told = rf"row 3, column 'u': {count} values for the 2 elements u\[1\] to u\[2\]"
    with pytest.raises(UserError, match=told):
        read_record(file(tmp_path, second), UNITS)


def test_words_that_are_no_numbers_are_named_with_their_element(tmp_path):
    with pytest.raises(UserError, match=r"column 'u\[2\]': 'x' is not a number"):
        read_record(file(tmp_path, "3 x"), UNITS)
