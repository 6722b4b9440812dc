"""Claims: every command does what its help says, as a process of its own, and is quick to answer a simple question."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fmus import MODELS
from fmus.kit.build.toolchain import host_platform
from orchestration.records import read_record
from orchestration.rig.emulator.emulator import EmulatedRig, RigParameters
from tests.support.archive import edited
from tests.support.command import PNG, UNITS, here, measure, works

COMMANDS = (
    "list",
    "info",
    "build",
    "check",
    "simulate",
    "run",
    "compare",
    "diagnose",
    "laws",
    "demo",
    "thesis",
)


@pytest.fixture
def record(tmp_path):
    return measure(tmp_path / "record.csv", EmulatedRig(RigParameters(R1=0.6, C=2.0), seed=1))


@pytest.mark.parametrize("command", [(), *((c,) for c in COMMANDS)], ids=" ".join)
def test_help_of(command, tmp_path):
    text = works(*command, "--help", cwd=tmp_path)
    assert "Usage: " in text
    for expected in COMMANDS if not command else ("--help",):
        assert expected in text


def test_without_a_command_there_is_help(tmp_path):
    assert "Usage: " in works(cwd=tmp_path)


def test_the_installed_script_is_this_command_line(tmp_path):
    script = Path(sys.executable).with_name("ppy.exe" if os.name == "nt" else "ppy")
    if not script.exists():
        pytest.skip("the project is not installed in this environment")
    done = subprocess.run([script, "list"], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, works("list", cwd=tmp_path))


@pytest.mark.parametrize(
    "arguments", [["--help"], ["list"], ["simulate", "--help"], ["run", "--list"]], ids=" ".join
)
def test_a_simple_question_imports_nothing_heavy(arguments, tmp_path):
    command = [sys.executable, "-X", "importtime", "-m", "orchestration.cli", *arguments]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, encoding="utf-8")
    assert done.returncode == 0
    imported = {
        line.rsplit("|", 1)[1].strip().split(".")[0]
        for line in done.stderr.splitlines()
        if "|" in line
    }
    assert "typer" in imported
    heavy = {
        "numpy",
        "scipy",
        "casadi",
        "pandas",
        "pint",
        "matplotlib",
        "fmpy",
        "statsmodels",
        "control",
        "xarray",
    }
    assert not imported & heavy


def test_list_names_every_component(tmp_path):
    lines = works("list", cwd=tmp_path).splitlines()
    assert [line.split()[0] for line in lines] == list(MODELS)
    assert all(len(line.split()) > 3 for line in lines)


def test_info_says_what_one_needs_to_set_a_parameter(tmp_path):
    text = works("info", "ppy_actuator", cwd=tmp_path)
    row = next(line for line in text.splitlines() if line.startswith("R2 "))
    for part in ("2.35 ohm", "1e-06 … 1e+12 ohm", "leakage"):
        assert part in row
    row = next(line for line in text.splitlines() if line.startswith("alpha "))
    for part in ("0.068 mm/C", "-1000 … 1000 mm/C"):  # both in the unit people read
        assert part in row
    assert "inf" not in text.split("parameters")[1].split()
    for part in ("current", "displacement", "five_layer", "table 3-1"):
        assert part in text


def test_build_then_check_then_simulate_the_file(tmp_path):
    """One component, both builds, for this machine."""
    printed = works(
        "build", "ppy_actuator", "--platforms", host_platform(), "--out", "made", cwd=tmp_path
    )
    paths = [Path("made") / runtime / "ppy_actuator.fmu" for runtime in ("python", "native")]
    assert [Path(line) for line in printed.split()] == paths
    assert sorted(p for p in (tmp_path / "made").rglob("*") if p.is_file()) == sorted(
        tmp_path / p for p in paths
    )
    for path in paths:
        text = works("check", path, cwd=tmp_path)
        assert f"{path}: no errors" in text
    again = works(
        "build", "ppy_actuator", "--platforms", host_platform(), "--out", "again", cwd=tmp_path
    )
    for line in again.split():
        assert (tmp_path / line).read_bytes() == (
            tmp_path / line.replace("again", "made", 1)
        ).read_bytes()
    works(
        "simulate", paths[1], "--set", "current=0.5", "--stop", 2, "--out", "run.csv", cwd=tmp_path
    )
    assert (tmp_path / "run.csv").exists()


def test_build_runtime_builds_only_that(tmp_path):
    printed = works(
        "build",
        "ppy_actuator_length_driven",
        "--runtime",
        "native",
        "--platforms",
        host_platform(),
        cwd=tmp_path,
    )
    assert Path(printed.strip()) == Path("fmu/native/ppy_actuator_length_driven.fmu")


def test_build_runtime_pythonfmu_says_what_it_cannot_promise(tmp_path):
    pytest.importorskip("pythonfmu", reason="pythonfmu is not installed")
    done = here(
        "build", "galvanostat", "--runtime", "pythonfmu", "--platforms", "linux64", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert [Path(line) for line in done.stdout.split()] == [Path("fmu/pythonfmu/galvanostat.fmu")]
    assert (
        "noted: pythonfmu promises less: errors: whatever fails is Fatal, not Error" in done.stderr
    )


def test_check_tells_errors_by_its_exit_code(fmu, tmp_path):
    spoilt = edited(
        fmu("ppy_actuator", "native"),
        tmp_path / "spoilt.fmu",
        lambda n, c: (
            n,
            c.replace(b"<InitialUnknowns>", b"<InitialUnknowns><Unknown index='9999'/>"),
        ),
    )
    done = here("check", spoilt, fmu("ppy_actuator", "native"), cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    assert "spoilt.fmu: error (contract line 1)" in done.stdout
    assert "ppy_actuator.fmu: no errors" in done.stdout  # the second file is looked at too


def test_simulate_a_recorded_stimulus(record, tmp_path):
    """Inputs from a file, a renamed column, units, a preset; result and picture."""
    text = record.read_text(encoding="utf-8").replace("current [A]", "drive [A]", 1)
    record.write_text(text, encoding="utf-8")
    printed = works(
        "simulate",
        "ppy_actuator",
        "--input",
        record,
        "--map",
        "drive=current",
        "--preset",
        "five_layer",
        "--set",
        "R1=800mohm",
        "--set",
        "k1=6.3[N/mm]",
        "--out",
        "run.csv",
        "--plot",
        "run.png",
        cwd=tmp_path,
    )
    assert "600 points from 0 s to 59.9 s" in printed
    units = {**UNITS, "charge": "C", "mechanical_displacement": "m"}
    run, inputs = (
        read_record(tmp_path / "run.csv", units),
        read_record(record, UNITS, mapping={"drive": "current"}),
    )
    assert run.time.tobytes() == inputs.time.tobytes()
    assert run.signals["current"].tobytes() == inputs.signals["current"].tobytes()
    # the preset's C and R2 with R1 as set, checked where nothing is differentiated: V (R1 + R2) = R1 R2 i + R2 Q / C
    u, q, i = (run.signals[n] for n in ("voltage", "charge", "current"))
    assert u * (0.8 + 2.72) == pytest.approx(0.8 * 2.72 * i + 2.72 * q / 0.46, abs=1e-9)
    assert run.signals["mechanical_displacement"][0] == pytest.approx(
        run.signals["force"][0] / 6300.0
    )
    assert (tmp_path / "run.png").read_bytes().startswith(PNG)


@pytest.mark.parametrize("ending", ["svg", "pdf"])
def test_pictures_in_other_formats(ending, tmp_path):
    works(
        "simulate",
        "ppy_actuator",
        "--set",
        "force=1",
        "--stop",
        5,
        "--plot",
        f"run.{ending}",
        cwd=tmp_path,
    )
    assert (tmp_path / f"run.{ending}").read_bytes().lstrip()[:5] in (b"<?xml", b"%PDF-")


def test_simulate_with_its_own_steps(tmp_path):
    """Constant inputs from the start on; the last step is shorter. Both builds print the same table."""
    arguments = [
        "simulate",
        "ppy_actuator",
        "--set",
        "current=0.9A",
        "--set",
        "force=2",
        "--stop",
        5,
        "--step",
        0.3,
    ]
    native = works(*arguments, "--out", "native.csv", cwd=tmp_path)
    assert "18 points from 0 s to 5 s" in native
    assert works(
        *arguments, "--runtime", "python", "--out", "python.csv", cwd=tmp_path
    ) == native.replace("native.csv", "python.csv")
    run = read_record(tmp_path / "native.csv", {**UNITS, "charge": "C"})
    assert run.time[-2:] == pytest.approx([4.8, 5.0])
    settled = 2.35 * 2.7 * 0.9
    assert run.signals["charge"] == pytest.approx(
        settled * (1 - np.exp(-run.time / (2.78 * 2.7))), abs=1e-7
    )


def test_simulate_a_part_of_a_record(record, tmp_path):
    assert "101 points from 0 s to 10 s" in works(
        "simulate", "ppy_actuator", "--input", record, "--stop", 10, cwd=tmp_path
    )
    assert "121 points from 0 s to 120 s" in works(
        "simulate", "ppy_actuator", "--input", record, "--stop", 120, "--step", 1, cwd=tmp_path
    )


def test_compare_with_a_fit(record, tmp_path):
    """A renamed and rescaled column, a setting, two fitted parameters; figures as JSON, and a picture."""
    lines = record.read_text(encoding="utf-8").splitlines()
    rows = [lines[0].replace("voltage [V]", "U_cell [mV]")]
    for line in lines[1:]:
        cells = line.split(",")
        cells[3] = repr(1e3 * float(cells[3]))
        rows.append(",".join(cells))
    record.write_text("\n".join(rows) + "\n", encoding="utf-8")
    printed = works(
        "compare",
        record,
        "--map",
        "U_cell=voltage",
        "--set",
        "R2=2350mohm",
        "--fit",
        "R1, C",
        "--out",
        "figures.json",
        "--plot",
        "compare.png",
        cwd=tmp_path,
    )
    assert "600 samples" in printed
    assert "wrote figures.json" in printed
    page = json.loads((tmp_path / "figures.json").read_text(encoding="utf-8"))
    assert page["model"] == "ppy_actuator"
    assert page["set"] == {"R2": pytest.approx(2.35)}
    found = page["fitted"]["parameters"]
    assert list(found) == ["R1", "C"]
    for name, truth in (("R1", 0.6), ("C", 2.0)):
        low, high = found[name]["ci95"]
        assert 0.99 * truth < low < truth < high < 1.01 * truth
    assert (
        page["outputs"]["voltage"]["fit_percent"]
        < 90
        < 98
        < page["fitted"]["outputs"]["voltage"]["fit_percent"]
    )
    assert page["outputs"]["voltage"]["white"] is False
    assert page["fitted"]["outputs"]["voltage"]["white"] is True
    assert (tmp_path / "compare.png").read_bytes().startswith(PNG)


def test_compare_with_an_fmu_file(record, fmu, tmp_path):
    printed = works(
        "compare", record, "--model", fmu("ppy_actuator", "python"), "--set", "R1=0.6", cwd=tmp_path
    )
    assert "ppy_actuator.fmu: 600 samples" in printed


def test_absent_inputs_are_told(tmp_path):
    record = measure(tmp_path / "r.csv", EmulatedRig(), names=["current", "voltage"])
    done = here("compare", record, cwd=tmp_path)
    assert done.returncode == 0
    assert "warning: no values for the input force; it stays at 0 N" in done.stderr
    assert "warning" not in here("compare", record, "--set", "force=1", cwd=tmp_path).stderr


def test_a_terminal_without_unicode_is_served_too(tmp_path):
    assert "R2" in works(
        "info", "ppy_actuator", cwd=tmp_path, environment={"PYTHONIOENCODING": "ascii"}
    )
