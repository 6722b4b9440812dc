"""Claims: what cannot be written, or only over another file, is refused first; JSON is JSON."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
import xarray

from demonstrations.emulator.emulator import EmulatedRig
from fmus.kit.errors import UserError
from orchestration.cli.outputs import (
    SIGNALS,
    STANDARD_OUTPUT,
    check_outputs,
    standard_output_for,
    write_json,
)
from orchestration.experiment import results
from orchestration.records import read_record
from tests.support.command import UNITS, here, measure, refused


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
    check_outputs({})
    Path("old.json").write_text("earlier", encoding="utf-8")
    check_outputs(
        {"out": Path("new/deep/run.csv"), "json": Path("old.json"), "plot": None, "time": "1s"},
        {"the record": Path("record.csv"), "the holdout": None},
        folder=Path("new"),
        out=(".csv",),
    )
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
        check_outputs(
            {"out": Path(name)},
            {"the record": Path("record.csv")},
            out=(".csv", ".nc", ".parquet"),
        )
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_two_outputs_are_two_files(folder):
    with pytest.raises(UserError, match=r"^--out and --plot both name a\.png$"):
        check_outputs({"plot": Path("./a.png"), "out": Path("a.png")}, out=())


def test_one_file_by_two_names_that_is_not_there_yet(folder):
    with pytest.raises(UserError, match="both name"):
        check_outputs({"json": Path("made/../b.json")}, more={"the page": Path("b.json")})


def test_the_model_of_a_command_is_not_overwritten(folder):
    with pytest.raises(UserError, match=r"--out record\.csv: this is the model itself"):
        check_outputs({"model": "record.csv", "out": Path("record.csv")}, out=())


@pytest.mark.skipif(
    os.name == "nt" or not hasattr(os, "geteuid") or os.geteuid() == 0,
    reason="root may write anywhere",
)
def test_a_folder_that_is_read_only(folder):
    Path("made").chmod(0o500)
    with pytest.raises(UserError, match="made is read-only"):
        check_outputs({"out": Path("made/a.csv")}, out=())


def test_a_file_in_the_place_of_a_folder(folder):
    with pytest.raises(UserError, match=r"cannot write record\.csv: .*record\.csv is no folder"):
        check_outputs({}, folder=Path("record.csv"))


def test_standard_output_is_no_file(folder):
    check_outputs({"json": STANDARD_OUTPUT}, {"the record": Path("-")})
    with pytest.raises(UserError, match=r"--mat -: its name must end in \.mat, not 'nothing'"):
        check_outputs({"mat": STANDARD_OUTPUT}, mat=(".mat",))


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


SIMULATE = ("simulate", "ppy_actuator", "--set", "current=0.5", "--set", "force=1")


@pytest.fixture
def record(tmp_path):
    return measure(tmp_path / "record.csv", EmulatedRig(seed=1), 300)


@pytest.mark.parametrize(
    "arguments",
    [
        ["list"],
        ["info", "ppy_actuator"],
        ["check", "x.fmu"],
        ["compare", "record.csv"],
        ["run", "fig_3_4"],
        ["diagnose", "record.csv"],
        ["thesis"],
    ],
    ids=lambda value: value[0],
)
def test_json_goes_into_a_file_of_that_name(arguments, record, tmp_path):
    refused(
        tmp_path,
        *arguments,
        "--json",
        "answer.csv",
        parts=["--json answer.csv", ".json, not '.csv'"],
    )
    refused(tmp_path, *arguments, "--json", ".", parts=["--json .: this is a folder"])


def test_signals_go_into_the_format_of_the_name(tmp_path):
    for name in ("run.csv", "run.nc", "run.parquet"):
        assert here(*SIMULATE, "--stop", 2, "--out", name, cwd=tmp_path).returncode == 0
    assert (tmp_path / "run.nc").read_bytes().startswith(b"CDF")
    assert (tmp_path / "run.parquet").read_bytes().startswith(b"PAR1")
    data = xarray.load_dataset(tmp_path / "run.nc", engine="scipy", decode_times=False)
    assert data.voltage.units == "V"
    for name in ("run.csv", "run.parquet"):
        record = read_record(tmp_path / name, {**UNITS, "charge": "C"}, inputs=["current", "force"])
        for signal in ("current", "charge", "voltage"):
            assert record.signals[signal].tobytes() == data[signal].values.tobytes()
    done = here("compare", "run.nc", "--json", "-", cwd=tmp_path)
    assert json.loads(done.stdout)["outputs"]["voltage"]["rms"] == 0.0


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        ([*SIMULATE, "--out", "run.xlsx"], ["--out run.xlsx", ".nc, .csv, .parquet, not '.xlsx'"]),
        ([*SIMULATE, "--out", "run"], ["--out run", ".nc, .csv, .parquet, not 'nothing'"]),
        ([*SIMULATE, "--plot", "run.csv"], ["--plot run.csv", ".png, .svg, .pdf, not '.csv'"]),
        (
            ["compare", "record.csv", "--out", "figures.csv"],
            ["--out figures.csv", ".json, not '.csv'"],
        ),
        (["run", "fig_3_4", "--out", "run.json"], ["--out run.json", ".nc, .csv, .parquet"]),
        (["run", "fig_3_4", "--plot", "run.nc"], ["--plot run.nc", ".png, .svg, .pdf, .html"]),
        (["diagnose", "record.csv", "--report", "r.json"], ["--report r.json", ".html"]),
        (["diagnose", "record.csv", "--experiment", "e.json"], ["--experiment e.json", ".toml"]),
        (["diagnose", "record.csv", "--fmu", "f.zip"], ["--fmu f.zip", ".fmu"]),
        (["system", "draw", "dma_bench", "--out", "d.ssp"], ["--out d.ssp", ".png, .svg, .pdf"]),
        (["system", "export", "dma_bench", "--out", "d.png"], ["--out d.png", ".ssp or .ssd"]),
    ],
    ids=lambda value: " ".join(value),
)
def test_another_ending_is_refused_with_what_is_allowed(arguments, parts, record, tmp_path):
    refused(tmp_path, *arguments, parts=parts)


def test_the_record_of_another_option_is_safe_everywhere(record, tmp_path):
    (tmp_path / "m.nc").write_bytes(record.read_bytes())
    refused(
        tmp_path,
        "simulate",
        "ppy_actuator",
        "--input",
        "m.nc",
        "--out",
        "m.nc",
        parts=["the record itself"],
    )
    refused(tmp_path, "simulate", "record.csv", "--out", "record.csv", parts=["the model itself"])
    refused(
        tmp_path, "build", "ppy_actuator", "--out", "record.csv", parts=["cannot write record.csv"]
    )
    assert np.isfinite(read_record(record, UNITS).time).all()
