"""Claims: rows of plain numbers are read as float() rounds them, and anything else is left to those
who split the rows into cells.
"""

import sys

import numpy as np
import pytest

from orchestration.records.formats.plain import NotPlain, read_plain


def written_numbers():
    """Numbers of any bits and digits, in the notations of plain tables."""
    rng = np.random.default_rng(4)
    bits = rng.integers(-(2**63), 2**63 - 1, 20_000).view(np.float64)
    texts = [repr(value) for value in bits[np.isfinite(bits)].tolist()]
    for notation in (".3f", ".17g", ".5E", ".30f", ".25e", ".0f"):
        values = rng.normal(size=3_000) * 10.0 ** rng.integers(-8, 9, 3_000)
        texts += [format(value, notation) for value in values.tolist()]
    # halfway between two doubles, at the ends of their range, and without digits on a side
    return [
        *texts,
        "9007199254740993",
        "2.4703282292062328e-324",
        "4.9e-324",
        "-0",
        ".5",
        "5.",
        "007",
    ]


@pytest.mark.parametrize("delimiter", [",", ";", "\t", "|", " "])
def test_numbers_are_rounded_as_float_does(delimiter):
    texts = written_numbers()
    rows = "".join(f"{a}{delimiter}{b}\n" for a, b in zip(texts, texts[::-1], strict=True))
    expected = np.array([float(text) for text in texts])
    first, second = read_plain([rows.encode()], delimiter, 2)
    assert first.tobytes() == expected.tobytes()
    assert second.tobytes() == expected[::-1].tobytes()


def test_an_empty_cell_is_missing_and_line_ends_may_differ():
    first, second = read_plain([b"1,2\r\n3,\n", b"", b",6\r7,8"], ",", 2)
    np.testing.assert_array_equal(first, [1.0, 3.0, np.nan, 7.0])
    np.testing.assert_array_equal(second, [2.0, np.nan, 6.0, 8.0])


@pytest.mark.parametrize(
    "cell",
    [
        *("nan", "NA", "inf", "-Infinity", "1e400", "nan(ind)", "OVERLOAD", "true", "-", "."),
        *("0x10", "1_000", "1'000", "1 000", "1D+02", "\u22125", "1.2.3", "12 mA", '"3"', "  "),
        *("12:30", "2024-01-02", "1\x0b", "\u0661", "1\x00", "1\ufeff", "# 1"),
    ],
)
def test_what_is_no_plain_number_is_left_to_others(cell):
    with pytest.raises(NotPlain):
        read_plain([f"1,2\n{cell},4\n".encode()], ",", 2)


@pytest.mark.parametrize(
    ("rows", "delimiter", "width"),
    [
        *((b"1,2\n3\n", ",", 2), (b"1,2\n3,4,5\n", ",", 2), (b"1,2\n", ",", 3), (b"", ",", 2)),
        *((b"1,2\n\n3,4\n", ",", 2), (b"1,2\n,\n", ",", 2), (b"1\n\n2\n", ",", 1)),
        *((b"1,2\r\r\n3,4\n", ",", 2), (b"1  2\n", " ", 3)),
    ],
)
def test_rows_of_another_form_are_left_to_others(rows, delimiter, width):
    with pytest.raises(NotPlain):
        read_plain([rows], delimiter, width)


def test_without_pyarrow_all_rows_are_left_to_others(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(NotPlain):
        read_plain([b"1,2\n"], ",", 2)
