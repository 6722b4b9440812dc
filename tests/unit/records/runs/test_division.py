"""Claims: runs in one file are told apart by a column or by a clock that restarts, and a few late
rows are no run.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus.kit.errors import UserError
from orchestration.records import read_record, read_runs
from orchestration.records.sampling import restarts

SIGNALS = {"voltage": "V"}


@given(
    st.lists(st.integers(25, 80), min_size=1, max_size=6),
    st.floats(0.001, 100.0),
    st.floats(0.0, 1e4),
)
def test_a_clock_restarts_where_the_next_run_begins(lengths, step, origin):
    time = np.concatenate([origin + step * np.arange(n) for n in lengths])
    assert restarts(time) == np.cumsum(lengths)[:-1].tolist()


@given(st.integers(30, 80), st.data())
def test_a_few_late_rows_are_no_run(n, data):
    time = np.arange(float(n))
    place = data.draw(st.integers(22, n - 2))
    moved = np.insert(np.delete(time, 1), place, time[1])
    assert restarts(moved) == []


def test_a_row_without_a_time_does_no_harm():
    time = np.concatenate([np.arange(30.0), [np.nan], np.arange(30.0)])
    assert restarts(time) == [31]


def written(folder, rows, header="time [s],voltage [V]"):
    path = folder / "record.csv"
    path.write_text("\n".join([header, *rows]), encoding="utf-8")
    return path


def test_runs_of_a_restarting_clock_are_numbered_and_noted(tmp_path):
    path = written(tmp_path, [f"{t},{k + t}" for k in (10, 20, 30) for t in range(25)])
    runs = read_runs(path, SIGNALS)
    assert [run.label for run in runs] == ["1", "2", "3"]
    assert [run.signals["voltage"][0] for run in runs] == [10.0, 20.0, 30.0]
    assert all(np.array_equal(run.time, np.arange(25.0)) for run in runs)
    (note,) = [repair for repair in runs[0].repairs if repair.kind == "runs"]
    assert (
        note.message == "the clock restarts 2 times, first before row 27: taken as 3 runs, 1 to 3"
    )
    assert not note.changed_data
    with pytest.raises(UserError, match="the clock restarts"):
        read_record(path, SIGNALS)


def test_one_run_has_no_label(tmp_path):
    path = written(tmp_path, [f"{t},{t}" for t in range(25)])
    (run,) = read_runs(path, SIGNALS)
    assert run.label == ""
    assert np.array_equal(run.signals["voltage"], read_record(path, SIGNALS).signals["voltage"])


def test_a_clock_that_restarts_within_a_label_begins_another_run(tmp_path):
    """Two sessions of A, with B between them."""
    rows = [f"{t},{10 * k + t},{rat}" for k, rat in enumerate("ABA") for t in range(25)]
    runs = read_runs(written(tmp_path, rows, "time [s],voltage [V],rat"), SIGNALS, column="rat")
    assert [run.label for run in runs] == ["A-1", "A-2", "B"]
    assert [run.signals["voltage"][0] for run in runs] == [0.0, 20.0, 10.0]
    assert [r.message for r in runs[0].repairs if r.kind == "runs"] == [
        "the clock restarts once, first before row 52: taken as 2 runs, 1 to 2"
    ]


def test_a_column_tells_runs_apart_wherever_their_rows_are(tmp_path):
    rows = [f"{t},{10 * k + t},{k}" for t in range(25) for k in (2, 1)]
    runs = read_runs(
        written(tmp_path, rows, "time [s],voltage [V],pulse [1]"), SIGNALS, column="pulse"
    )
    assert [run.label for run in runs] == ["2", "1"]
    assert [run.signals["voltage"].tolist() for run in runs] == [
        [10.0 * k + t for t in range(25)] for k in (2, 1)
    ]
    assert not any("pulse" in repair.message for run in runs for repair in run.repairs)


def test_labels_may_be_words(tmp_path):
    rows = [f"{t},{t},{name}" for name in ("cold", "warm @ 40") for t in range(3)]
    runs = read_runs(written(tmp_path, rows, "time,voltage,at"), SIGNALS, column="at")
    assert [run.label for run in runs] == ["cold", "warm @ 40"]


@pytest.mark.parametrize(
    ("column", "mapping", "message"),
    [
        ("puls", {}, "runs='puls': no column is called 'puls' (did you mean pulse?)"),
        (
            "other",
            {"other": "voltage"},
            "runs='other': this column is mapped to the signal voltage",
        ),
        ("gap", {}, "row 3: no value in column 'gap', which labels the runs"),
    ],
)
def test_what_tells_no_runs_apart_is_refused(tmp_path, column, mapping, message):
    path = written(tmp_path, ["0,1,1,5,1", "1,1,1,5,", "2,1,1,5,1"], "time,voltage,pulse,other,gap")
    with pytest.raises(UserError) as refusal:
        read_runs(path, SIGNALS, mapping=mapping, column=column)
    assert message in str(refusal.value)
