"""Datasets of records: signals with units, and how they were measured."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration.experiment import results
from orchestration.experiment.model import parse
from orchestration.master import Pacing
from orchestration.rig.record.data import dataset, empty_dataset, units
from orchestration.rig.record.driving import RecordedRun
from orchestration.rig.record.planning import plan_recording
from tests.support.rig.small_rig import LIMITS, STATUS

NAMES = ["current", "force", "voltage", "displacement", "voltage_age", "displacement_age"]


@pytest.fixture
def planned():
    given = {
        "component": "ppy_actuator",
        "duration": 0.2,
        "step": 0.05,
        "inputs": {"force": 1.0, "current": 0.5},
    }
    return plan_recording(parse(given, "here"), STATUS, "here")


def recorded(rows: int, failure: str = "") -> RecordedRun:
    cells = np.arange(6.0 * rows).reshape(rows, 6)
    pacing = Pacing(rows, 0, 0.0, 0.0, (1.0,), (rows, 0))
    return RecordedRun(cells[:, :2], cells[:, 2:4], cells[:, 4:], failure, pacing)


def test_signals_stand_in_their_order_with_their_units(planned):
    assert list(units(planned.inputs, planned.outputs)) == NAMES
    assert list(units(planned.inputs, planned.outputs).values()) == ["A", "N", "V", "m", "s", "s"]
    assert list(empty_dataset(planned)) == NAMES


@pytest.mark.parametrize(
    ("rows", "failure", "complete"), [(5, "", 1), (3, "", 0), (5, "lost", 0), (3, "lost", 0)]
)
def test_a_record_says_whether_it_came_to_its_end(planned, rows, failure, complete):
    data = dataset(planned, recorded(rows, failure), "here", "tcp://127.0.0.1:5570")
    assert data.sizes["time"] == rows
    assert data.attrs["complete"] == complete
    assert data.attrs.get("failure", "") == failure
    assert data.attrs["wall_time"] == pytest.approx(0.05 * (rows - 1))
    assert json.loads(data.attrs["limits"]) == LIMITS
    for column, name in enumerate(NAMES):
        assert data[name].values.tolist() == [6.0 * row + column for row in range(rows)]
        assert data[name].attrs["units"] == units(planned.inputs, planned.outputs)[name]


@pytest.mark.parametrize("suffix", [".nc", ".parquet"])
def test_a_record_keeps_what_the_rig_states_of_a_signal(planned, tmp_path, suffix):
    stated = {
        "voltage": {"standard_uncertainty": 0.002, "calibration_date": "2026-05-01", "units": "mV"},
        "unknown": {"standard_uncertainty": 1.0},
    }
    described = replace(planned, attributes=stated)
    results.check(empty_dataset(described), tmp_path / f"run{suffix}")
    results.write(dataset(described, recorded(5), "here", "rig"), tmp_path / f"run{suffix}")
    data = results.read(tmp_path / f"run{suffix}")
    assert data.voltage.attrs["standard_uncertainty"] == 0.002
    assert data.voltage.attrs["calibration_date"] == "2026-05-01"
    assert data.voltage.attrs["units"] == "V"
    assert "standard_uncertainty" not in data.displacement.attrs


@pytest.mark.parametrize("attributes", [[], {"voltage": 3}, {"voltage": {"gain": None}}])
def test_attributes_of_another_kind_are_refused(planned, attributes):
    with pytest.raises(UserError, match="attributes of signals must be finite numbers and texts"):
        plan_recording(planned.experiment, {**STATUS, "attributes": attributes}, "here")


@pytest.mark.parametrize("part", ["inputs", "outputs", "ages"])
def test_a_row_that_lacks_a_value_is_a_gap_and_the_record_incomplete(planned, part):
    run = recorded(5)
    getattr(run, part)[[1, 3, 3], [0, 0, 1]] = np.nan  # three values in two rows
    data = dataset(planned, run, "here", "tcp://127.0.0.1:5570")
    assert (data.attrs["complete"], data.attrs["gaps"]) == (0, 2)
    whole = dataset(planned, recorded(5), "here", "tcp://127.0.0.1:5570")
    assert (whole.attrs["complete"], whole.attrs["gaps"]) == (1, 0)
