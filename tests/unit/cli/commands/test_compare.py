"""Claims: ``ppy compare`` holds a model against a record, and recalibrates it."""

import json

import pytest

from demonstrations.emulator.emulator import EmulatedRig
from tests.support.command import PNG, answered, here, measure, works


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
