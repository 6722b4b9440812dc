"""Claims: each of several records has the answer that it has alone, in its place, or a reason."""

from __future__ import annotations

import os
import signal

import numpy as np
import pytest

import ppy_rig as ppy
from demonstrations.records import draw, write
from fmus.kit import UserError
from orchestration.api import DiagnosisResult
from orchestration.api.batch import Diagnoses, diagnose_each, named_records
from orchestration.reporting import make_page
from tests.support.oscillator import CUBE, DRY, diagnosis_with, oscillator_record


@pytest.fixture(scope="module")
def dry():
    return DiagnosisResult(diagnosis_with(oscillator_record(1, dry=1.5), (DRY,), (CUBE,)))


def named(records):
    return named_records(records, {}, lambda text: None)


def by_name(*names):
    return dict(zip(names, names, strict=True))


@pytest.fixture
def found(dry):
    def diagnose(record):
        if record == "b.csv":
            raise UserError("b.csv: row 3: 'x' is not a number")
        return dry

    told = []
    found = diagnose_each(by_name("a.csv", "b.csv", "c.csv"), diagnose, 1, told.append)
    assert told[1:] == [
        "2 of 3 records: b.csv: row 3: 'x' is not a number",
        "3 of 3 records: c.csv: cause",
    ]
    return found


def test_a_record_that_cannot_be_used_stops_no_other(found, dry):
    assert [*found] == ["a.csv", "c.csv"]
    assert found["c.csv"] is dry
    assert found.failures == {"b.csv": "row 3: 'x' is not a number"}
    assert repr(found) == "<Diagnoses: 2 cause, 1 could not be diagnosed>"
    assert str(found).splitlines()[-1] == "b.csv: row 3: 'x' is not a number"


def test_table_and_figures_have_each_record(found, dry):
    frame = found.to_frame()
    assert [*frame.index] == ["a.csv", "c.csv"]
    assert set(frame["cause"]) == {"friction(velocity)"}
    assert set(frame["after"]) == {dry.gain.after["position"]}
    assert found.to_dict()["records"]["a.csv"]["verdict"] == "cause"


def test_a_page_has_the_page_of_each(found, tmp_path):
    text = make_page(found, "ppy diagnose a.csv").html()
    assert text.count("<h1>") == 1
    assert text.count("<h2>a.csv</h2>") == text.count("<h2>c.csv</h2>") == 1
    assert text.count("friction over velocity") > 2 * 2
    stored = ppy.load(found.save(tmp_path / "found.json"))
    assert str(stored) == str(found)
    assert stored.report(tmp_path / "page.html").read_text("utf-8") == make_page(found).html()


def test_ctrl_c_leaves_what_is_done(dry):
    def diagnose(record):
        if record == "b.csv":
            os.kill(os.getpid(), signal.SIGINT)
        return dry

    found = diagnose_each(by_name("a.csv", "b.csv", "c.csv"), diagnose, 1, lambda text: None)
    assert ([*found], found.missing) == (["a.csv"], ["b.csv", "c.csv"])
    with pytest.raises(KeyboardInterrupt):
        diagnose_each(by_name("b.csv", "c.csv"), diagnose, 1, lambda text: None)


def test_a_folder_is_its_files(tmp_path):
    for name in ("b.csv", "a.txt", ".hidden"):
        (tmp_path / name).write_text("time,current\n0,1\n1,2\n", encoding="utf-8")
    (tmp_path / "folder").mkdir()
    files = [str(tmp_path / name) for name in ("a.txt", "b.csv")]
    assert [*named([tmp_path])] == files
    assert [*named([{}, "x.csv", {}])] == ["record 1", "x.csv", "record 3"]
    with pytest.raises(UserError, match="no record"):
        named([tmp_path / "folder"])
    with pytest.raises(UserError, match=r"x.csv: there are 2 records of this name"):
        named(["x.csv", "x.csv"])
    with pytest.raises(UserError, match="this is a folder; workers= of diagnose takes each"):
        ppy.diagnose(tmp_path)


def test_files_of_a_folder_that_have_no_table_are_left_out_and_told(tmp_path):
    (tmp_path / "README.txt").write_text("Film C, measured by night.\nLoad cell 2.\n", "utf-8")
    (tmp_path / "a.csv").write_text("1;2\n2;3\n", encoding="utf-8")
    (tmp_path / "photo.png").write_bytes(b"\x89PNG\r\n\x1a\n\0\0")
    told = []
    form = {"columns": ["time=s", "current=A"]}
    assert [*named_records([tmp_path], form, told.append)] == [str(tmp_path / "a.csv")]
    note, photo = told
    assert note.startswith(f"left out, as it has no table: {tmp_path / 'README.txt'}: ")
    assert "photo.png: this is not a text file" in photo
    # a file that is named by itself is refused where it is read
    assert [*named([tmp_path / "README.txt"])] == [str(tmp_path / "README.txt")]
    with pytest.raises(UserError, match=r"README.txt: there is a header"):
        ppy.age(tmp_path / "README.txt")


@pytest.mark.parametrize("given", [{"system": "dma_bench"}, {"compare": "b.csv"}, {"each": "R1"}])
def test_what_is_about_all_records_is_refused(given):
    (name,) = given
    with pytest.raises(UserError, match=f"{name}= is about all records; workers= diagnoses each"):
        ppy.diagnose(["a.csv"], workers=2, **given)


@pytest.mark.parametrize("workers", [0, 1001, 1.5])
def test_a_number_of_workers_is_a_whole_one(workers):
    with pytest.raises(UserError, match="workers="):
        ppy.diagnose("a.csv", workers=workers)


@pytest.mark.slow
def test_processes_answer_as_one_after_another(tmp_path):
    for k, hidden in enumerate((None, "strain_saturation", None)):
        write(draw(hidden, seed=k, duration=60.0), tmp_path / f"{k}.csv")
    (tmp_path / "3.csv").write_text("time,level\n0,1\n1,2\n2,4\n", encoding="utf-8")
    alone, together = (ppy.diagnose(tmp_path, workers=n, effects=[]) for n in (1, 2))
    assert isinstance(together, Diagnoses)
    assert [*together] == [*alone] == [str(tmp_path / f"{k}.csv") for k in range(3)]
    assert together.to_dict() == alone.to_dict()
    assert [*together.failures] == [str(tmp_path / "3.csv")]
    first = together[str(tmp_path / "0.csv")]
    np.testing.assert_equal(first.to_dict(), ppy.diagnose(tmp_path / "0.csv", effects=[]).to_dict())
