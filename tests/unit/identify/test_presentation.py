"""Claims: a comparison is printed and given as plain JSON, with units and warnings."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from demonstrations.emulator.emulator import EmulatedRig
from demonstrations.emulator.physics import RigParameters
from orchestration.experiment.waveforms import multilevel
from orchestration.fmu.model import find_model
from orchestration.identify import comparison as comparing
from orchestration.records import Record

UNITS = {"current": "A", "force": "N", "voltage": "V", "displacement": "m"}
TIME: np.ndarray = 0.1 * np.arange(600)
INPUTS = {
    "current": multilevel(TIME, [-0.9, 0.0, 0.9], (2.0, 8.0), 1),
    "force": multilevel(TIME, [0.5, 1.0, 2.75], (5.0, 12.0), 2),
}


@pytest.fixture(scope="module")
def model():
    return find_model("ppy_actuator")


@pytest.fixture
def record():
    measured = EmulatedRig(RigParameters(R1=0.6, C=2.0), seed=1).run(TIME, **INPUTS)
    return Record(TIME, INPUTS | measured, UNITS, Path("record.csv"))


def test_json_is_plain_json_with_null_where_nothing_can_be_said(model, record):
    record.signals["displacement"] = np.full(TIME.size, 1e-3)
    result = comparing.compare(model, record, {"R2": 2.0}, ["R1"])

    def refuse(constant):
        raise AssertionError(f"{constant} is not JSON")

    page = json.loads(json.dumps(result.to_dict()), parse_constant=refuse)
    assert page["outputs"]["displacement"]["fit_percent"] is None  # of a constant
    assert page["outputs"]["displacement"]["unit"] == "m"
    assert page["record"] == {
        "file": "record.csv",
        "samples": 600,
        "seconds": pytest.approx(59.9),
        "notes": [],
    }
    assert page["set"] == {"R2": 2.0}
    estimate = page["fitted"]["parameters"]["R1"]
    assert estimate["ci95"][0] < estimate["value"] < estimate["ci95"][1]
    assert (estimate["nominal"], estimate["unit"]) == (0.43, "ohm")


def test_an_infinite_interval_becomes_null(model, record):
    record.signals["force"] = np.zeros(TIME.size)
    page = comparing.compare(model, record, {}, ["k1"]).to_dict()
    assert page["fitted"]["parameters"]["k1"]["ci95"] == [0.0, None]
    assert "this record does not determine k1" in page["fitted"]["warnings"]


def test_a_comparison_is_printed_with_its_units_and_warnings(model, record):
    record.signals["force"] = np.zeros(TIME.size)
    result = comparing.compare(model, record, {}, ["R1", "k1"])
    text = str(result)
    lines = text.splitlines()
    assert lines[0] == "record.csv against ppy_actuator: 600 samples"
    assert lines[1].split() == ["output", "run", "fit", "RMS", "error", "residual"]
    assert [line.split()[:2] for line in lines[2:6]] == [
        [output, run] for output in ("voltage", "displacement") for run in ("before", "fitted")
    ]
    assert f"{result.after['voltage'].fit_percent:.2f} %" in lines[3]
    assert lines[4].split()[5] == "mm"  # not metres
    assert lines[-len(result.fit.warnings) :] == [
        f"warning: {text}" for text in result.fit.warnings
    ]
    assert "this record does not determine k1" in result.fit.warnings
    assert str(result.fit) == "\n".join(lines[lines.index("") + 1 :])
    assert not any(line != line.rstrip() for line in lines)
    page = result._repr_html_()
    assert page.count("<tr>") == 1 + 4 + 1 + 2  # heads, outputs before and after, parameters
    assert "this record does not determine k1" in page
    assert repr(result).startswith("<Comparison voltage ")
    assert "record.csv" in repr(result)
