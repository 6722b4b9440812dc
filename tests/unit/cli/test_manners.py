"""Claims: the command line completes names, is quiet or verbose, answers in JSON, takes units."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
import typer
import xarray

from fmus import MODELS
from fmus.kit.build.toolchain import host_platform
from orchestration.cli import app
from orchestration.cli.options import platform_list
from orchestration.records import read_record
from studies.emulator.emulator import EmulatedRig
from tests.support.command import UNITS, here, measure, ppy, refused, works

SIMULATE = ("simulate", "ppy_actuator", "--set", "current=0.5", "--set", "force=1")


@pytest.fixture
def record(tmp_path):
    return measure(tmp_path / "record.csv", EmulatedRig(seed=1), 300)


# --- version, help, completion
# ----------------------------------------------------------------------------------------


def test_version(tmp_path):
    from importlib.metadata import version

    assert works("--version", cwd=tmp_path) == f"ppy {version('ppy-rig')}\n"


def test_the_line_for_a_command_in_the_help_is_the_first_of_its_own_help():
    whole = typer.main.get_command(app.app)
    for name, (line, _) in app._COMMANDS.items():
        assert whole.get_command(None, name).help.split("\n")[0] == line


def complete(words, cwd):
    """Return what bash is offered for the last of some words."""
    place = str(len(words.split(" ")) - 1)
    environment = {
        **os.environ,
        "_PPY_COMPLETE": "complete_bash",
        "COMP_WORDS": words,
        "COMP_CWORD": place,
    }
    done = subprocess.run(
        [sys.executable, "-m", "orchestration.cli"],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.stderr == ""
    return done.stdout.split()


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("ppy sim", ["simulate"]),
        ("ppy info ppy_", ["ppy_actuator", "ppy_actuator_length_driven"]),
        ("ppy build galvanostat foo", ["foot", "foot_dynamic"]),
        ("ppy compare x.csv --model galv", ["galvanostat"]),
        (
            "ppy simulate ppy_actuator --with strain_sat",
            ["strain_saturation", "strain_saturation(slow)"],
        ),
        ("ppy simulate ppy_actuator --with slack,sensor_lag(v", ["slack,sensor_lag(voltage)"]),
        ("ppy diagnose x.csv --effects diff", ["diffusion"]),
        ("ppy run fig_4", ["fig_4_5"]),
        ("ppy system show dma", ["dma_bench"]),
        (
            "ppy simulate galvanostat --with cur",
            ["current_saturation", "current_offset", "current_gain"],
        ),
        (
            "ppy compare x.csv --model galvanostat --with cur",
            ["current_saturation", "current_offset", "current_gain"],
        ),
        ("ppy simulate gone.fmu --with s", []),
    ],
)
def test_names_are_completed(words, offered, tmp_path):
    assert complete(words, tmp_path) == offered


def test_the_script_that_completes_is_shown(tmp_path):
    assert "_PPY_COMPLETE" in works("--show-completion", "bash", cwd=tmp_path)


# --- quiet and verbose
# ------------------------------------------------------------------------------------------------


def test_quiet_prints_results_and_errors_only(record, tmp_path):
    done = here("--quiet", "compare", record.name, "--out", "f.json", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert "300 samples" in done.stdout
    assert "wrote" not in done.stdout
    assert (tmp_path / "f.json").exists()
    done = here("-q", "compare", "gone.csv", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("error: ")


def test_verbose_tells_what_is_used_and_how_long_it_took(tmp_path):
    lines = ppy("--verbose", *SIMULATE, "--stop", 1, cwd=tmp_path).stderr.splitlines()
    assert any(
        line.startswith("ppy_actuator: ") and line.endswith("ppy_actuator.fmu") for line in lines
    )
    assert any(line.startswith("simulating ppy_actuator: took ") for line in lines)


def test_one_cannot_have_both(tmp_path):
    refused(tmp_path, "-q", "-v", "list", parts=["--quiet and --verbose"])


def test_quiet_ends_with_the_command(tmp_path):
    here("--quiet", "list", cwd=tmp_path)
    assert "simulating" in here(*SIMULATE, "--stop", 1, cwd=tmp_path).stderr


# --- JSON
# --------------------------------------------------------------------------------------------------


def answered(*arguments, cwd):
    """Return what a command answers on standard output, where nothing else may be.

    The same must go into a file.
    """
    done = here(*arguments, "--json", "-", cwd=cwd)
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    done = here(*arguments, "--json", "answer.json", cwd=cwd)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "wrote answer.json"
    assert len(done.stdout.splitlines()) > 1
    assert json.loads((cwd / "answer.json").read_text(encoding="utf-8")) == answer
    return answer


def listed(answer):
    return {entry["name"]: entry for entry in answer}


def test_json_of_list_and_info(tmp_path):
    done = here("list", "--json", "-", cwd=tmp_path)
    assert list(listed(json.loads(done.stdout))) == list(MODELS)
    about = answered("info", "ppy_actuator", cwd=tmp_path)
    resistance = listed(about["parameters"])["R1"]
    assert (resistance["unit"], resistance["start"], resistance["min"]) == ("ohm", 0.43, 0)
    assert "table 3-1" in resistance["source"]
    assert listed(about["parameters"])["charge_start"]["max"] is None  # without a bound
    assert [s["name"] for s in about["inputs"]] == ["current", "force"]
    assert "strain_saturation" in [e["id"] for e in about["effects"]]
    assert {e["output"] for e in about["effects"] if e["id"] == "sensor_lag"} >= {
        "voltage",
        "displacement",
    }
    assert about["step"] == 0.1


def test_json_of_check(fmu, tmp_path):
    good = fmu("ppy_actuator", "native")
    (answer,) = json.loads(here("check", good, "--json", "-", cwd=tmp_path).stdout)
    assert (answer["file"], answer["errors"], answer["warnings"]) == (str(good), 0, 0)
    assert all(f["severity"] == "note" and isinstance(f["line"], int) for f in answer["findings"])


def test_json_of_compare(record, tmp_path):
    answer = answered("compare", record.name, "--fit", "R1", cwd=tmp_path)
    assert answer["outputs"]["voltage"]["unit"] == "V"
    assert set(answer["fitted"]["parameters"]) == {"R1"}


def test_json_of_run(tmp_path):
    answer = answered("run", "fig_3_4", "--set", "duration=2", "--out", "r.nc", cwd=tmp_path)
    assert (answer["subject"], answer["complete"], answer["seconds"]) == ("ppy_actuator", True, 2.0)
    assert answer["signals"]["current"]["largest"] == 0.9
    assert answer["again"] is None
    again = answered("run", "r.nc", cwd=tmp_path)["again"]
    assert again == {"of": "r.nc", "same": True, "apart": {}}


def test_json_of_diagnose(record, tmp_path):
    done = here("diagnose", record.name, "--effects", "none", "--json", "-", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["verdict"] in (
        "consistent",
        "recalibrate",
        "unexplained",
        "ambiguous",
    )


def test_json_of_the_thesis(tmp_path):
    done = here("thesis", "--out", "t.html", "--json", "-", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    claims = [claim for chapter in answer["chapters"] for claim in chapter["claims"]]
    assert {claim["verdict"] for claim in claims} == {
        "holds",
        "within rounding",
        "only as printed",
        "differs",
    }
    assert len(answer["errata"]) > 30
    assert (tmp_path / "t.html").exists()


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


# --- results by suffix
# ------------------------------------------------------------------------------------------------


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


# --- quantities with units
# --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("stop", "step", "points"),
    [
        ("30", "1", 31),
        ("30s", "500ms", 61),
        ("0.5 min", "1[s]", 31),
        ("500 ms", "1e-1", 6),
        ("1h", "1min", 61),
    ],
)
def test_times_have_units_and_plain_numbers_are_seconds(stop, step, points, tmp_path):
    printed = here(*SIMULATE, "--stop", stop, "--step", step, cwd=tmp_path).stdout
    assert f"ppy_actuator: {points} points from 0 s" in printed


@pytest.mark.parametrize(
    ("option", "given", "parts"),
    [
        ("--stop", "3V", ["'--stop'", "'3V'", "'V' cannot be converted to 's'"]),
        ("--step", "10mm", ["'--step'", "'mm'", "'s'"]),
        ("--stop", "3 fortnightly", ["'--stop'", "unknown unit 'fortnightly'"]),
        ("--stop", "soon", ["'--stop'", "'soon' is not a number with an optional unit"]),
        ("--stop", "1Hz", ["'Hz' cannot be converted to 's'"]),
    ],
)
def test_a_wrong_unit_is_one_line(option, given, parts, tmp_path):
    refused(tmp_path, *SIMULATE, option, given, parts=parts)


# --- builds for this machine
# ------------------------------------------------------------------------------------------


def platforms_of(path):
    from orchestration.fmu.archive import Archive

    with Archive(path) as archive:
        return archive.platforms


def test_build_is_for_this_machine_unless_others_are_asked(tmp_path):
    done = here("build", "galvanostat", "--runtime", "native", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"galvanostat: native for {host_platform()}" in done.stderr
    assert platforms_of(tmp_path / "fmu/native/galvanostat.fmu") == [host_platform()]


def test_build_for_some_platforms_and_for_all(tmp_path, monkeypatch):
    from fmus.kit import build as kit

    asked = []
    monkeypatch.setattr(
        kit, "build", lambda cls, kind, platforms, progress: asked.append(platforms) or b""
    )
    for given in (["--platforms", "linux64, win64"], ["--platforms", "all"], []):
        assert (
            here("build", "galvanostat", "--runtime", "native", *given, cwd=tmp_path).returncode
            == 0
        )
    assert asked == [["linux64", "win64"], None, [host_platform()]]


def test_diagnose_builds_for_this_machine(record, tmp_path):
    done = here("diagnose", record.name, "--effects", "none", "--fmu", "f.fmu", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (
        platforms_of(tmp_path / "f.fmu")
        == platforms_of(tmp_path / "f.python.fmu")
        == [host_platform()]
    )
    assert platform_list(None) == [host_platform()]
    assert platform_list("all") is None


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
