"""Claims: a record says in lines what it holds and what was repaired."""

import re
from pathlib import Path

import numpy as np
import pytest

from orchestration.records.record import Record, Repair, list_rows, refuse


@pytest.fixture
def record():
    repairs = [Repair("gap", "31 s before row 4"), Repair("order", "rows sorted", (3, 4))]
    signals = {"u": np.array([1.0, 2.0, 3.0]), "y": np.array([1e-3, np.nan, 3e-3])}
    units = {"u": "V", "y": "m"}
    return Record(np.array([0.0, 0.5, 31.5]), signals, units, Path("a/r.csv"), repairs, "b")


def test_it_says_what_was_changed_and_what_only_noticed(record):
    assert str(record).splitlines() == [
        "r.csv, run b: 3 samples over 31.5 s: u [V], y [m]",
        "noted: 31 s before row 4",
        "repaired: rows sorted",
    ]


def test_a_notebook_shows_what_every_signal_has(record):
    page = record._repr_html_()
    assert page.startswith("<p>r.csv, run b: 3 samples over 31.5 s</p>")
    cells = re.findall(r"<td[^>]*>(.*?)</td>", page)
    assert cells == ["u", "V", "1", "3", "0", "y", "m", "0.001", "0.003", "1"]
    assert "<p>repaired: rows sorted</p>" in page
    assert "data:image/png;base64," in page
    assert repr(record) == "<Record r.csv: 3 samples of u, y>"


def test_a_part_has_the_same_rows_of_all(record):
    part = record.part(np.array([True, False, True]))
    assert part.time.tolist() == [0.0, 31.5]
    assert {name: values.tolist() for name, values in part.signals.items()} == {
        "u": [1.0, 3.0],
        "y": [1e-3, 3e-3],
    }
    assert (part.source, part.label, record.time.size) == (record.source, "b", 3)


def test_a_table_has_its_signals_over_time(record):
    frame = record.to_frame()
    assert (frame.index.name, list(frame.index)) == ("time", [0.0, 0.5, 31.5])
    assert frame["u"].tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        ([4], "row 4"),
        ([3, 9], "rows 3, 9"),
        (range(1, 6), "rows 1, 2, 3, 4, 5"),
        (range(1, 19), "rows 1, 2, 3, 4, 5 and 13 more"),
    ],
)
def test_the_first_rows_are_spelled_out(rows, text):
    assert list_rows(rows) == text


def test_a_refusal_is_one_line_of_bearable_length():
    """A parser's message may hold line ends, control characters and half of the file."""
    message = str(refuse(Path("r.csv"), "row 3:\n\ttwo\x1b[31m\x00 words " + "x" * 5000))
    assert message.startswith(r"r.csv: row 3: two\x1b[31m\x00 words xxx")
    assert message.endswith("x...")
    assert len(message) == len("r.csv: ") + 1000 + len("...")
