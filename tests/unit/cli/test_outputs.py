"""Claims: what cannot be written, or only over another file, is refused first; JSON is JSON."""

import json
import os
from pathlib import Path

import pytest

from fmus.kit.errors import UserError
from orchestration.cli.outputs import (
    SIGNALS,
    STANDARD_OUTPUT,
    Outputs,
    standard_output_for,
    write_json,
)
from orchestration.experiment import results


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Enter a folder with a record and links to it."""
    monkeypatch.chdir(tmp_path)
    Path("record.csv").write_text("a record", encoding="utf-8")
    Path("link.csv").symlink_to("record.csv")
    Path("hard.csv").hardlink_to("record.csv")
    Path("made").mkdir()
    return tmp_path


def test_what_costs_nothing_is_let_through(folder):
    Outputs().check()
    Path("old.json").write_text("earlier", encoding="utf-8")
    Outputs(
        {"the record": Path("record.csv"), "the holdout": None},
        {"--out": Path("new/deep/run.csv"), "--json": Path("old.json"), "--plot": None},
        {"--out": (".csv",), "--json": (".json",)},
        {"--folder": Path("new")},
    ).check()
    assert not Path("new").exists()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("record.csv", "--out record.csv: this is the record itself; it will not be overwritten"),
        ("./made/../record.csv", "this is the record itself; it will not be overwritten"),
        ("link.csv", "--out link.csv: this is the record itself"),
        ("hard.csv", "--out hard.csv: this is the record itself"),
        ("made", "--out made: this is a folder; name a file in it"),
        ("run.txt", "--out run.txt: its name must end in .csv, .nc, .parquet, not '.txt'"),
        ("run", "--out run: its name must end in .csv, .nc, .parquet, not 'nothing'"),
        ("record.csv/run.csv", "cannot write record.csv/run.csv: "),
        ("a" * 300 + ".csv", "File name too long"),
    ],
)
def test_what_is_refused(folder, name, message):
    with pytest.raises(UserError) as caught:
        Outputs(
            {"the record": Path("record.csv")},
            {"--out": Path(name)},
            {"--out": (".csv", ".nc", ".parquet")},
        ).check()
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_two_outputs_are_two_files(folder):
    with pytest.raises(UserError, match=r"^--out and --plot both name a\.png$"):
        Outputs({}, {"--out": Path("a.png"), "--plot": Path("./a.png")}).check()


def test_one_file_by_two_names_that_is_not_there_yet(folder):
    with pytest.raises(UserError, match="both name"):
        Outputs({}, {"--json": Path("made/../b.json"), "--out": Path("b.json")}).check()


@pytest.mark.skipif(
    os.name == "nt" or not hasattr(os, "geteuid") or os.geteuid() == 0,
    reason="root may write anywhere",
)
def test_a_folder_that_is_read_only(folder):
    Path("made").chmod(0o500)
    with pytest.raises(UserError, match="made is read-only"):
        Outputs({}, {"--out": Path("made/a.csv")}).check()


def test_a_file_in_the_place_of_a_folder(folder):
    with pytest.raises(UserError, match=r"cannot write record\.csv: .*record\.csv is no folder"):
        Outputs(folders={"--out": Path("record.csv")}).check()


def test_standard_output_is_no_file(folder):
    Outputs({"the record": Path("-")}, {"--json": STANDARD_OUTPUT}, {"--json": (".json",)}).check()


def test_formats_of_signals_are_those_that_are_written():
    assert SIGNALS == results.FORMATS


def test_json_has_no_numbers_that_are_none(tmp_path, capsys):
    data = {"a": float("nan"), "b": [float("inf"), 1.5, (2, "x")], "c": None, "d": True}
    expected = {"a": None, "b": [None, 1.5, [2, "x"]], "c": None, "d": True}
    write_json(None, data)
    assert capsys.readouterr().out == ""
    write_json(tmp_path / "a.json", data)
    assert json.loads((tmp_path / "a.json").read_text(encoding="utf-8")) == expected
    assert capsys.readouterr().out == f"wrote {tmp_path / 'a.json'}\n"
    with standard_output_for(STANDARD_OUTPUT):
        from orchestration.reporting.console import out

        out.print("a table")
        write_json(STANDARD_OUTPUT, data)
    assert json.loads(capsys.readouterr().out) == expected
