"""Claims: runs are held out by their labels or as other files, and something is left to fit to."""

from __future__ import annotations

import numpy as np
import pandas
import pytest

import orchestration as ppy
from fmus.kit import UserError
from orchestration.api.records import held_out, matching_record, matching_runs
from orchestration.fmu.model import declared_model
from orchestration.records import write_record


@pytest.fixture(scope="module")
def model(lag):
    return ppy.find_model(lag)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A file with runs a, b and c of 20 samples, and another one."""
    folder = tmp_path_factory.mktemp("records")
    time = 0.1 * np.arange(60)
    signals = {"u": np.sin(time), "x": np.cos(time), "run": np.repeat([1.0, 2.0, 3.0], 20)}
    write_record(folder / "three.csv", time, signals, dict.fromkeys(signals, "1"))
    single = {name: values[:20] for name, values in signals.items() if name != "run"}
    write_record(folder / "one.csv", time[:20], single, dict.fromkeys(single, "1"))
    return folder


def held(folder, model, holdout):
    fitted, judged = held_out(folder / "three.csv", model, {"holdout": holdout, "runs": "run"})
    return [run.label for run in fitted], [run.label or run.source.stem for run in judged]


@pytest.mark.parametrize(
    ("holdout", "labels"),
    [
        (None, (["1", "2", "3"], [])),
        ("2", (["1", "3"], ["2"])),
        ("3, 1", (["2"], ["3", "1"])),
        (["2", "2"], (["1", "3"], ["2"])),
    ],
)
def test_runs_are_held_out_by_their_labels(folder, model, holdout, labels):
    assert held(folder, model, holdout) == labels


def test_other_files_are_held_out_beside_labels(folder, model):
    other = matching_runs(folder / "one.csv", model, {})
    expected = (["1", "2"], ["3", "one"])
    assert held(folder, model, ["3", *other]) == expected


def test_a_label_that_is_none_is_refused_with_those_there_are(folder, model):
    with pytest.raises(UserError, match="holdout='2,7': 7 is neither a file nor one of"):
        held(folder, model, "2,7")


def test_something_is_left_to_fit_to(folder, model):
    with pytest.raises(UserError, match="all records are for validation, and none for estimation"):
        held(folder, model, "1,2,3")


def test_a_record_is_taken_as_it_is_and_a_file_read_with_its_mapping(folder, model):
    record = ppy.read_record(folder / "one.csv", model)
    assert matching_record(record, model, {}) is record
    swapped = matching_record(folder / "one.csv", model, {"mapping": {"x": "u", "u": "x"}})
    assert swapped.signals["u"].tolist() == record.signals["x"].tolist()


@pytest.mark.parametrize(
    "use",
    [
        ppy.compare,
        ppy.diagnose,
        ppy.laws,
        ppy.read_record,
        lambda record, model: ppy.fit(record, model, ["R1"]),
    ],
    ids=["compare", "diagnose", "laws", "read_record", "fit"],
)
def test_a_record_is_refused_before_anything_is_built(tmp_path, monkeypatch, use):
    def build(*_, **__):
        raise AssertionError("built")

    monkeypatch.setattr("fmus.kit.build.build_cached", build)
    (tmp_path / "r.csv").write_text("time [s],voltage [V]\n0,1\n1,jammed\n2,3\n")
    with pytest.raises(UserError, match="row 3, column 'voltage': 'jammed'"):
        use(tmp_path / "r.csv", "ppy_actuator")


def test_arrays_and_frames_are_taken_wherever_a_record_is():
    time = 0.1 * np.arange(40)
    arrays = {"t [s]": time, "current [A]": np.sin(time), "voltage [mV]": 700.0 * np.cos(time)}
    frame = pandas.DataFrame(arrays).set_index("t [s]")
    subject = declared_model("ppy_actuator")
    runs = matching_runs([arrays, frame], subject, {})
    fitted, judged = held_out(arrays, subject, {"holdout": frame})
    for record in (*runs, *fitted, *judged, ppy.read_record(frame)):
        np.testing.assert_allclose(record.signals["voltage"], 0.7 * np.cos(time))
    assert (len(fitted), len(judged)) == (1, 1)
