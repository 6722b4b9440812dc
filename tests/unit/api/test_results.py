"""Claims: a result says what its diagnosis says, and laws that are asked what they lack."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

import ppy_rig as ppy
from fmus.kit import UserError
from orchestration.api.results import DiagnosisResult
from orchestration.diagnosis.law_map import map_laws
from tests.support.oscillator import (
    CUBE,
    DRY,
    diagnosis_with,
    diagnosis_without_terms,
    oscillator_record,
    telling_apart,
    with_group,
)
from tests.support.oscillator_model import Oscillator
from tests.support.reference import documented_of_laws, fields


@pytest.fixture(scope="module")
def dry():
    diagnosis = diagnosis_with(oscillator_record(1, dry=1.5), (DRY,), (CUBE,))
    return DiagnosisResult(diagnosis, ("ppy", "laws"), law_map=map_laws(diagnosis))


@pytest.fixture(scope="module")
def right():
    diagnosis = diagnosis_without_terms(oscillator_record(2))
    return DiagnosisResult(diagnosis, ("ppy", "laws"), law_map=map_laws(diagnosis))


def test_the_map_is_told_in_every_form(dry):
    figures = dry.to_dict()
    assert json.loads(json.dumps(figures, allow_nan=False)) == figures
    assert figures["law_map"] == dry.law_map
    told = {name for name, _ in fields({"law_map": dry.law_map})}
    assert told == documented_of_laws().keys()
    assert "friction over velocity" in str(dry).split("what each law lacks")[1]


def test_a_diagnosis_has_no_map_unless_laws_are_asked(dry):
    plain = DiagnosisResult(dry.details)
    assert plain.law_map == []
    assert "law_map" not in plain.to_dict()
    assert "what each law lacks" not in str(plain)


def test_a_model_that_is_right_has_nothing_to_write(right, tmp_path):
    assert right.causes == []
    for write, name in ((right.effect, "law.py"), (right.plot, "curve.png")):
        with pytest.raises(UserError, match="no law is found to lack anything"):
            write(tmp_path / name)
        assert not (tmp_path / name).exists()


def test_a_class_goes_to_a_file_of_python(dry, tmp_path):
    with pytest.raises(UserError, match=r"ends in \.py"):
        dry.effect(tmp_path / "law.txt")
    assert "class FrictionOfVelocity" in dry.effect(tmp_path / "law.py").read_text(encoding="utf-8")


def test_the_result_in_python_has_the_attributes_of_any_diagnosis():
    dry = diagnosis_with(oscillator_record(1, dry=1.5), (DRY,), (CUBE,))
    result = DiagnosisResult(dry)
    assert result.causes == ["friction(velocity)"]
    assert result.alternatives == []
    assert result.probabilities["friction(velocity)"] > 0.9
    assert result.gain.after["position"] < result.gain.before["position"]
    assert "cause friction(velocity): oscillator, oscillator_1.csv" in repr(result)


def test_a_later_record_gives_its_changes_and_its_own_diagnosis():
    record, later = (oscillator_record(seed, damping=0.8 * seed, samples=400) for seed in (1, 2))
    only = {"effects": [], "laws": False}
    result = ppy.diagnose(record, Oscillator, compare=later, **only)
    assert {one.name for one in result.changes if one.changed} == {"damping"}
    assert result.later.verdict == "recalibrate"
    assert result.later.records == [later]
    figures = result.to_dict()
    assert figures["comparison"][0]["parameter"] == "damping"
    assert figures["later"].items() <= result.later.to_dict().items()
    assert "What changed: damping, times 2" in str(result)


@pytest.mark.slow
def test_several_later_records_are_in_the_history():
    first, second, third = (
        oscillator_record(seed, damping=0.8 * max(1, seed - 1), samples=400) for seed in (1, 2, 3)
    )
    only = {"effects": [], "laws": False}
    result = ppy.diagnose(first, Oscillator, compare=[second, third], **only)
    changed = [{one.name for one in found if one.changed} for found in result.history.values()]
    assert changed == [set(), {"damping"}]
    assert result.changes == [*result.history.values()][-1]
    assert result.later.records == [third]
    history = result.to_dict()["history"]
    assert [one["file"] for one in history] == [str(second.source), str(third.source)]
    assert history[1]["comparison"] == result.to_dict()["comparison"]
    lines = [line for line in str(result).splitlines() if ": Nothing" in line or ": What" in line]
    assert len(lines) == 2, "a line for each record"
    assert ": What changed: damping, times 2" in lines[1]


def test_the_record_itself_is_no_later_one():
    record = oscillator_record(1, samples=50)
    same = replace(record, source=Path("same.csv"))
    with pytest.raises(UserError, match=r"same\.csv.*: this is the same record as"):
        ppy.diagnose(record, Oscillator, compare=same)
    with pytest.raises(UserError, match=r"same\.csv: this is the same record"):
        ppy.diagnose(record, Oscillator, holdout=same)


def test_the_experiment_that_tells_causes_apart_is_written(tmp_path):
    dry = diagnosis_with(oscillator_record(1, dry=1.5), (DRY,), (CUBE,))
    assert DiagnosisResult(dry).experiment is None
    experiment = telling_apart("friction(velocity)", "friction(elongation)")
    group = with_group(dry, "ambiguous", 0.6, 0.35)
    result = DiagnosisResult(replace(group, experiment=experiment))
    path = result.experiment.to_toml(tmp_path / "next.toml")
    written = tomllib.loads(path.read_text(encoding="utf-8"))
    assert (written["component"], written["inputs"]["force"]["levels"][0]) == (
        "oscillator",
        "-6.0 N",
    )
    assert "60 % if it is friction(elongation)" in "".join(result.experiment.overview())


def test_the_evidence_is_of_every_set_that_was_fitted():
    dry = diagnosis_with(oscillator_record(1, dry=1.5), (DRY,), (CUBE,))
    evidence = DiagnosisResult(dry).evidence
    table = evidence.to_frame()
    assert list(table.columns) == ["fitted", "left_out", "score", "error"]
    assert table.index[0].startswith("friction over velocity")
    assert table["score"].is_monotonic_decreasing
    assert "friction over velocity" in str(evidence)
    assert evidence.draw().axes[0].get_xlabel() == "score [nat]"
    none = DiagnosisResult(diagnosis_without_terms(oscillator_record(2))).evidence
    assert "no set of terms was fitted" in str(none)
    with pytest.raises(UserError, match="nothing to draw"):
        none.draw()
