"""Claims: ``ppy compare`` holds a model against a record, and recalibrates it."""

import json

import numpy as np
import pytest
from junitparser import JUnitXml

from demonstrations.emulator.emulator import EmulatedRig
from tests.support.command import PNG, answered, here, measure, refused, works


def test_compare_with_a_fit(record, tmp_path):
    """Rename and rescale a column, set a value, fit two parameters; write figures and a picture."""
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


def test_json_of_compare(record, tmp_path):
    answer = answered("compare", record.name, "--fit", "R1", cwd=tmp_path)
    assert answer["outputs"]["voltage"]["unit"] == "V"
    assert set(answer["fitted"]["parameters"]) == {"R1"}


@pytest.mark.parametrize(
    ("arguments", "code"),
    [((), 1), (("--fit", "R1,C"), 0)],
)
def test_what_is_required_sets_the_exit_status(record, tmp_path, arguments, code):
    """The rig has another R1 and C than the model, and nothing else is wrong with it."""
    done = here("compare", record, *arguments, "--require", "95%", "--json", "f.json", cwd=tmp_path)
    assert done.returncode == code
    figures = json.loads((tmp_path / "f.json").read_text(encoding="utf-8"))
    outputs = figures["fitted"]["outputs"] if arguments else figures["outputs"]
    short = [name for name, one in outputs.items() if one["fit_percent"] < 95.0]
    assert bool(short) == bool(code)
    for name in short:
        assert f"warning: --require 95%: {name} fits" in done.stderr


def test_what_cannot_be_required_is_refused(record, tmp_path):
    done = here("compare", record, "--require", "much", cwd=tmp_path)
    assert done.returncode == 2
    assert "such as 95%" in done.stderr


# --- two files -----------------------------------------------------------------------------------


@pytest.fixture
def files(tmp_path):
    """A result of another tool, and a reference in other units and at other times."""
    for name, step, late, factor, unit in (
        ("result.csv", 0.01, 0.015, 1e3, "mV"),
        ("reference.csv", 0.02, 0.0, 1.0, "V"),
    ):
        time = np.arange(0.0, 5.0 + step / 2, step)
        values = factor * np.where(time < 1.0 + late, 0.0, -np.expm1(1.0 + late - time))
        rows = np.column_stack([time, values])
        header = f"time [s],u [{unit}]"
        np.savetxt(tmp_path / name, rows, delimiter=",", header=header, comments="", fmt="%.9g")
    return tmp_path


def test_a_result_in_the_tube_is_accepted(files):
    outputs = ("--report", "page.html", "--plot", "page.png", "--junit", "out.xml")
    printed = works(
        "compare", "result.csv", "reference.csv", "--tube", "20ms,1%", *outputs, cwd=files
    )
    assert "result.csv and reference.csv: none of 1 signals differ" in printed
    assert "as allowed" in (files / "page.html").read_text()
    assert (files / "page.png").read_bytes().startswith(PNG)
    (suite,) = JUnitXml.fromfile(str(files / "out.xml"))
    assert [(case.classname, case.name, case.result) for case in suite] == [("result.csv", "u", [])]


def test_one_outside_has_an_exit_status_its_place_and_an_annotation(files, monkeypatch):
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    done = here(
        "compare", "result.csv", "reference.csv", "--tube", "u=1mV", "--json", "-", cwd=files
    )
    assert done.returncode == 1
    answer = json.loads(done.stdout)
    assert (answer["same"], answer["signals"]["u"]["unit"]) == (False, "V")
    # a delay of 15 ms is worst where the curve is steepest
    assert answer["signals"]["u"]["at"] == pytest.approx(1.0, abs=0.021)
    assert done.stderr.startswith("::error file=result.csv,title=ppy compare%3A u::differs by")


def test_what_cannot_be_compared_has_another_one(files):
    (files / "other.csv").write_text("time [s],x [V]\n0,1\n1,2\n")
    for arguments, parts in (
        (("result.csv", "gone.csv"), ["gone.csv: cannot be read"]),
        (("result.csv", "other.csv"), ["nothing to compare: result.csv has u, other.csv has x"]),
        (("result.csv", "reference.csv", "--fit", "R1"), ["--fit is for a model and a record"]),
        (("result.csv", "reference.csv", "--model", "dma"), ["--model is for a model"]),
        (("result.csv", "reference.csv", "--tube", "wide"), ["--tube 'wide'"]),
        (("result.csv", "reference.csv", "--tube", "v=1%"), ["tolerance of v", "no such signal"]),
        (("result.csv", "--tube", "1%"), ["ppy compare RESULT REFERENCE"]),
        (("result.csv", "--report", "page.html"), ["--report is for two files"]),
        (("result.csv", "reference.csv", "--plot", "result.csv"), ["--plot result.csv"]),
    ):
        refused(files, "compare", *arguments, parts=parts)
