"""Claims: ``ppy diagnose`` tells its result, writes what was asked for, and overwrites nothing."""

from __future__ import annotations

import json
import os
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from demonstrations.records import draw, write
from fmus import component
from fmus.kit.build import build_cached
from fmus.kit.errors import UserError
from orchestration.api.declaration import options_of
from orchestration.cli.commands.options import DiagnoseCommand
from orchestration.cli.diagnose import check_files, run_system
from orchestration.fmu.model import find_model
from tests.support.archive import edited, of_other_laws
from tests.support.command import here, ppy, works
from tests.support.diagnosis import FEW, SHORT, broken_off
from tests.support.oscillator import oscillator_record
from tests.support.pages import words_of

NASTY = os.fsdecode(b"r\xff <script>alert(1)&.csv")
MOTOR = Path(__file__).parents[3] / "studies" / "plants" / "models" / "motor.py"
OSCILLATOR = Path(__file__).parents[2] / "support" / "oscillator_model.py"
STAGE = Path(__file__).parents[3] / "examples" / "positioning_stage.py"


def fails(*arguments, cwd):
    """Return the message of a refusal, which is one line and exit code 2."""
    done = here(*arguments, cwd=cwd)
    assert done.returncode == 2
    assert done.stderr.strip().splitlines()[-1].startswith("error: ")
    return done.stderr


@pytest.mark.slow
def test_the_command_names_and_writes_it_down(tmp_path):
    write(draw("strain_saturation", 1, **SHORT), tmp_path / "record.csv")
    effects = ",".join(effect.id for effect in FEW)
    text = works(
        "diagnose", "record.csv", "--effects", effects, "--json", "diagnosis.json", cwd=tmp_path
    )
    assert "strain that levels off at large charge" in text
    written = json.loads((tmp_path / "diagnosis.json").read_text(encoding="utf-8"))
    assert written["group"][0]["effect"] == "strain_saturation"
    low, high = written["parameters"]["R1"]["ci95"]
    assert low < written["parameters"]["R1"]["value"] < high
    message = fails("diagnose", "record.csv", "--effects", "strain_saturatoin", cwd=tmp_path)
    assert "no effect named 'strain_saturatoin' (did you mean strain_saturation?)" in message
    message = fails("diagnose", "record.csv", "--json", "record.csv", cwd=tmp_path)
    assert "will not be overwritten" in message


def test_an_unknown_model_is_told(tmp_path):
    write(draw(None, 1, **SHORT | {"duration": 100.0}), tmp_path / "record.csv")
    assert "no component named" in fails(
        "diagnose", "record.csv", "--model", "ppy_actuatr", cwd=tmp_path
    )


@pytest.mark.slow
def test_an_input_that_is_absent_is_told_and_taken_as_it_starts(tmp_path):
    drawn = draw(None, 1, **SHORT)
    write(replace(drawn, inputs={"current": drawn.inputs["current"]}), tmp_path / "record.csv")
    text = " ".join(
        works("diagnose", "record.csv", "--effects", "none", "--no-laws", cwd=tmp_path).split()
    )
    assert (
        "force is not in record.csv: it is taken to be 0 N throughout; --set force=... says" in text
    )


def test_the_file_of_the_model_is_not_overwritten(tmp_path):
    shutil.copy(STAGE, tmp_path / "stage.py")
    write(draw(None, 1, **SHORT | {"duration": 100.0}), tmp_path / "record.csv")
    for option in (["--json", "stage.py"], ["--fmu", "s.fmu", "--json", "s.fmu"]):
        message = fails(
            "diagnose", "record.csv", "--model", "stage.py:PositioningStage", *option, cwd=tmp_path
        )
        assert "will not be overwritten" in message or "both name" in message


@pytest.mark.slow
def test_the_command_writes_a_report_of_another_record(tmp_path):
    columns = {"current": "I", "force": "F", "voltage": "U", "displacement": "x"}
    for name, seed in ((NASTY, 1), ("other.csv", 2)):
        broken_off(tmp_path / name, seed, columns)
    mapping = [f"--map={column}={name}" for name, column in columns.items()]
    arguments = [
        "diagnose",
        NASTY,
        *mapping,
        "--effects=strain_saturation",
        "--no-laws",
        "--holdout=other.csv",
    ]
    done = ppy(*arguments, "--report=r.html", "--json=r.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "repaired: all 2 records: " in done.stderr
    text = words_of((tmp_path / "r.html").read_text(encoding="utf-8"))
    assert "--holdout=other.csv" in text
    written = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert written["group"][0]["effect"].startswith("strain_saturation")
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(
        [NASTY, "other.csv", "r.html", "r.json"]
    )


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"report": "r.csv"},
            "--report r.csv: this is the record itself; it will not be overwritten",
        ),
        (
            {"json": "r.csv"},
            "--json r.csv: this is the record itself; it will not be overwritten",
        ),
        (
            {"report": "link.html"},
            "--report link.html: this is the record itself; it will not be overwritten",
        ),
        (
            {"holdout": "h.html", "report": "./h.html"},
            "--report h.html: this is the record held out itself",
        ),
        (
            {"holdout": "h.html", "json": "h.html"},
            "--json h.html: this is the record held out itself",
        ),
        (
            {"holdout": "r.csv"},
            "--holdout r.csv: this is the record itself; nothing would be held out",
        ),
        (
            {"compare": "r.csv"},
            "--compare r.csv: this is the record itself; nothing in it can have changed",
        ),
        ({"report": "a.html", "json": "a.html"}, "--json and --report both name a.html"),
        ({"report": "a.pdf"}, "--report a.pdf: its name must end in .html"),
        ({"report": "folder"}, "--report folder: this is a folder; name a file in it"),
        ({"report": "a" * 300 + ".html"}, "File name too long"),
    ],
)
def test_nothing_is_lost(given, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("r.csv", "h.html"):
        Path(name).write_text("a record", encoding="utf-8")
    Path("link.html").symlink_to("r.csv")
    Path("folder").mkdir()
    usual = {name: option.default for name, option in options_of(DiagnoseCommand).items()}
    usual["records"] = [Path("r.csv")]
    refused = {
        name: [Path(v)] if name in ("holdout", "compare") else Path(v) for name, v in given.items()
    }
    with pytest.raises(UserError, match=re.escape(message)):
        check_files(usual | refused)
    new = {"holdout": ["h.html"], "json": Path("new.json"), "report": Path("new.html")}
    check_files(usual | new)


def test_a_folder_is_refused_before_anything_of_a_system_is_read(tmp_path):
    usual = {name: option.default for name, option in options_of(DiagnoseCommand).items()}
    options = usual | {"records": [tmp_path / "no.csv"], "json": tmp_path}
    with pytest.raises(UserError, match=r"^--json .*: this is a folder; name a file in it$"):
        run_system(options, str(tmp_path / "no.ssp"))


@pytest.mark.parametrize(
    ("given", "flag"),
    [
        ({"model": "ppy_actuator"}, "--model"),
        ({"laws": False}, "--no-laws"),
        ({"interpolate": True}, "--interpolate"),
        ({"records": [Path("a.csv"), Path("b.csv")]}, "a second record"),
    ],
    ids=str,
)
def test_what_is_about_one_model_is_refused_of_a_system(given, flag):
    usual = {name: option.default for name, option in options_of(DiagnoseCommand).items()}
    options = usual | {"records": [Path("a.csv")]} | given
    with pytest.raises(UserError, match=f"^{flag} is about one model"):
        run_system(options, "s.ssp")


@pytest.mark.parametrize(
    "command",
    [("laws", "record.csv"), ("diagnose", "record.csv", "--compare", "later.csv")],
    ids=lambda command: command[0],
)
def test_laws_that_are_not_known_are_told_once(tmp_path, command):
    made = build_cached(component("ppy_actuator"), "native")
    edited(made, tmp_path / "old.fmu", of_other_laws)
    for seed, name in enumerate(("record.csv", "later.csv"), 1):
        write(draw(None, seed, **SHORT | {"duration": 100.0}), tmp_path / name)
    done = here(*command, "--model", "old.fmu", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("its laws have changed") == 1


def _rubbing(folder: Path) -> list[str]:
    """Write records of a mass that rubs and its model; return the words of their diagnosis."""
    for seed in (1, 2):
        record = oscillator_record(seed, dry=1.5)
        columns = np.column_stack([record.time, *record.signals.values()])
        head = "time [s],force [N],position [m]"
        np.savetxt(folder / f"{seed}.csv", columns, delimiter=",", header=head, comments="")
    shutil.copy(OSCILLATOR, folder / "oscillator.py")
    model = ("--model", "oscillator.py:Oscillator")
    return ["diagnose", "1.csv", "--holdout", "2.csv", *model]


def test_a_later_record_is_compared(tmp_path):
    words = _rubbing(tmp_path)
    only = ("--no-laws", "--effects", "none")
    written = ("--json", "d.json", "--report", "d.html")
    record, _, holdout = words[1:4]
    words = [word for word in words if word not in ("--holdout", holdout)]
    text = works(*words, *only, "--compare", holdout, *written, cwd=tmp_path)
    assert f"{holdout} by itself: " in text
    figures = json.loads((tmp_path / "d.json").read_text(encoding="utf-8"))
    assert {one["parameter"] for one in figures["comparison"]} == {"mass", "damping", "stiffness"}
    assert figures["later"]["verdict"] in text
    page = words_of((tmp_path / "d.html").read_text(encoding="utf-8"))
    assert f"What changed from {record} to {holdout}" in page
    assert f"SHA-256 of {holdout}" in page


@pytest.mark.slow
def test_a_diagnosis_goes_end_to_end(tmp_path):
    words = _rubbing(tmp_path)
    written = ("--json", "d.json", "--report", "d.html", "--fmu", "d.fmu")
    explained = ("--explain", "friction(velocity),nothing", "--require", "cause")
    text = works(*words, *written, *explained, cwd=tmp_path)
    assert "friction over velocity" in text
    assert "friction(velocity) is ahead of the model as it is" in text
    figures = json.loads((tmp_path / "d.json").read_text(encoding="utf-8"))
    assert figures["causes"][0]["effect"] == "friction(velocity)"
    assert "friction over velocity" in words_of((tmp_path / "d.html").read_text(encoding="utf-8"))
    assert "friction_of_velocity" in find_model(str(tmp_path / "d.fmu")).parameters
    failed = here(*words, "--require", "consistent", cwd=tmp_path)
    assert failed.returncode == 1


def test_options_that_make_no_sense_are_refused(tmp_path):
    words = _rubbing(tmp_path)
    text = works(*words, "--no-laws", "--effects", "none", cwd=tmp_path)
    assert "parameters" in text
    assert "causes" not in text
    message = fails(*words, "--compare", "2.csv", cwd=tmp_path)
    assert "--compare 2.csv: this is the same record as 2.csv" in message
    message = fails(*words, "--each", "mas", cwd=tmp_path)
    assert "--each mas: no parameter named 'mas'" in message
    message = fails(*words, "--fit", "mas", cwd=tmp_path)
    assert "--fit mas: no parameter named 'mas'" in message
    message = fails(*words, "--effects", "stiction", cwd=tmp_path)
    assert "no effect named 'stiction'" in message
    message = fails(*words, "--explain", "friction(velocity)", cwd=tmp_path)
    assert "it takes two candidates, not 1" in message
