"""Claims: writing and reading gives the same doubles back, a repaired record needs no second
repair, and a journal is a record at any moment.
"""

import math
from time import monotonic, sleep

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from fmus.kit.errors import UserError
from orchestration.records import Journal, read_record, write_record

SIGNALS = {"u": "V", "y": "m"}
finite = st.floats(-1e150, 1e150)
QUICK = settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])


def attempt(path):
    """The record, or None and the refusal."""
    try:
        return read_record(path, SIGNALS), ""
    except UserError as error:
        return None, str(error)


@QUICK
@given(
    times=st.lists(finite, min_size=2, max_size=30, unique=True),
    data=st.data(),
)
def test_write_then_read_gives_the_same_doubles(tmp_path, times, data):
    time = np.array(sorted(times))
    u = np.array(data.draw(st.lists(finite, min_size=time.size, max_size=time.size)))
    y = np.array(
        data.draw(
            st.lists(st.one_of(finite, st.just(math.nan)), min_size=time.size, max_size=time.size)
        )
    )
    assume(not np.isnan(y).all())
    write_record(tmp_path / "r.csv", time, {"u": u, "y": y}, SIGNALS)
    record = read_record(tmp_path / "r.csv", SIGNALS, inputs=["u"])
    # compared as bytes, so that the sign of zero counts
    assert record.time.tobytes() == time.tobytes()
    assert record.signals["u"].tobytes() == u.tobytes()
    assert np.array_equal(np.isnan(record.signals["y"]), np.isnan(y))
    assert record.signals["y"][~np.isnan(y)].tobytes() == y[~np.isnan(y)].tobytes()
    assert {repair.kind for repair in record.repairs if repair.changed_data} <= {"masked"}


cell = st.one_of(st.integers(-5, 5).map(float), st.just(math.nan), st.just(math.inf))


@QUICK
@given(rows=st.lists(st.tuples(st.integers(0, 40), cell, cell), min_size=2, max_size=40))
def test_repair_is_idempotent(tmp_path, rows):
    lines = [f"{t / 4},{u},{y}" for t, u, y in rows]
    path = tmp_path / "r.csv"
    path.write_text("\n".join(["time [s],u [V],y [m]", *lines]) + "\n", encoding="utf-8")
    first, message = attempt(path)
    if first is None:
        assert message.startswith(f"{path}: ")
        return
    assert np.all(np.diff(first.time) > 0)
    write_record(path, first.time, first.signals, first.units)
    second = read_record(path, SIGNALS)
    assert second.time.tobytes() == first.time.tobytes()
    assert list(second.signals) == list(first.signals)
    for name, values in first.signals.items():
        np.testing.assert_array_equal(second.signals[name], values)
    assert {repair.kind for repair in second.repairs if repair.changed_data} <= {"masked"}


@QUICK
@given(content=st.binary(max_size=300))
def test_any_bytes_give_a_record_or_one_line(tmp_path, content):
    path = tmp_path / "r.csv"
    path.write_bytes(content)
    with pytest.raises(UserError):
        read_record(path, SIGNALS)


@QUICK
@given(text=st.text(alphabet='time [s],u[V]\n0123.;\t"#-e', max_size=120))
def test_any_text_below_a_header_gives_a_record_or_one_line(tmp_path, text):
    path = tmp_path / "r.csv"
    path.write_text("time [s],u [V]\n" + text, encoding="utf-8")
    record, message = attempt(path)
    assert "\n" not in message
    if record is not None:
        assert record.time.size == record.signals["u"].size >= 2


def test_numbers_are_written_with_no_more_digits_than_needed(tmp_path):
    write_record(
        tmp_path / "r.csv",
        [0, 0.1],
        {"a,b": [1 / 3, math.nan], "y": [1e-3, 2]},
        {"a,b": "V", "y": "1"},
    )
    expected = 'time [s],"a,b [V]",y [1]\n0.0,0.3333333333333333,0.001\n0.1,,2.0\n'
    assert (tmp_path / "r.csv").read_text(encoding="utf-8") == expected
    record = read_record(tmp_path / "r.csv", {"a,b": "V", "y": "1"})
    assert record.signals["a,b"][0] == 1 / 3


def test_brackets_in_a_name_are_no_unit_where_another_follows(tmp_path):
    write_record(tmp_path / "r.csv", [0, 1], {"y [mm]": [1, 2]}, {"y [mm]": "m"})
    assert read_record(tmp_path / "r.csv", {"y [mm]": "m"}).signals["y [mm]"].tolist() == [1, 2]


@pytest.mark.parametrize(
    ("time", "signals", "units"),
    [
        ([0, 0], {"y": [1, 2]}, {"y": "m"}),
        ([0, math.nan], {"y": [1, 2]}, {"y": "m"}),
        ([0, 1], {"y": [1, 2, 3]}, {"y": "m"}),
        ([0, 1], {"y": [1, 2]}, {}),
        ([0, 1], {"y ": [1, 2]}, {"y ": "m"}),
    ],
)
def test_what_cannot_be_read_back_is_not_written(tmp_path, time, signals, units):
    with pytest.raises(ValueError):
        write_record(tmp_path / "r.csv", time, signals, units)
    assert not (tmp_path / "r.csv").exists()


def test_a_journal_is_a_record_and_is_not_overwritten(tmp_path):
    path = tmp_path / "j.csv"
    journal = Journal(path, {"u, raw": "V", "y": "m"})
    journal.add(0.0, [0.1, math.nan])
    journal.add(0.5, [1 / 3, -0.0])
    journal.close()
    assert journal.error == ""
    assert path.read_text().splitlines() == [
        'time [s],"u, raw [V]",y [m]',
        "0.0,0.1,",
        "0.5,0.3333333333333333,-0.0",
    ]
    with pytest.raises(UserError, match="exists: the record of a run that was killed"):
        Journal(path, SIGNALS)


def test_a_journal_goes_to_the_disk_while_it_is_made(tmp_path, monkeypatch):
    clock = iter([0.0, 1.9, 2.1, 2.1, 2.2, 2.2])
    monkeypatch.setattr("orchestration.records.writing.monotonic", lambda: next(clock))
    journal = Journal(tmp_path / "j.csv", {"u": "V"})
    for k in range(3):
        journal.add(float(k), [1.0])
        if k == 1:
            waited = monotonic() + 10.0
            while not (tmp_path / "j.csv").stat().st_size and monotonic() < waited:
                sleep(0.001)
            assert (tmp_path / "j.csv").read_text() == "time [s],u [V]\n0.0,1.0\n1.0,1.0\n"
    journal.close()
    assert read_record(tmp_path / "j.csv", {"u": "V"}).time.tolist() == [0.0, 1.0, 2.0]


def test_a_journal_without_a_row_leaves_no_file(tmp_path):
    Journal(tmp_path / "j.csv", SIGNALS).close()
    assert list(tmp_path.iterdir()) == []
