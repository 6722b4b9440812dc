"""Claims: a diagnosis by terms has the attributes of any, those of a later record too."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

import ppy_rig as ppy
from fmus.kit import UserError
from orchestration.api.term_results import TermDiagnosisResult
from tests.support.oscillator import (
    CUBE,
    DRY,
    diagnosis_with,
    oscillator_record,
    telling_apart,
    with_group,
)
from tests.support.oscillator_model import Oscillator


def test_the_result_in_python_has_the_attributes_of_any_diagnosis():
    dry = diagnosis_with(oscillator_record(1, dry=1.5), (DRY,), (CUBE,))
    result = TermDiagnosisResult(dry)
    assert result.causes == ["friction(velocity)"]
    assert result.alternatives == []
    assert result.probabilities["friction(velocity)"] > 0.9
    assert result.gain.after["position"] < result.gain.before["position"]
    assert "cause friction(velocity): oscillator, oscillator_1.csv" in repr(result)


def test_a_later_record_gives_its_changes_and_its_own_diagnosis():
    record, later = (oscillator_record(seed, damping=0.8 * seed, samples=400) for seed in (1, 2))
    only = {"effects": [], "laws": False, "engine": "new"}
    result = ppy.diagnose(record, Oscillator, compare=later, **only)
    assert {one.name for one in result.changes if one.changed} == {"damping"}
    assert result.later.verdict == "recalibrate"
    assert result.later.records == [later]
    figures = result.to_dict()
    assert figures["comparison"][0]["parameter"] == "damping"
    assert figures["later"] == result.later.to_dict()
    assert "What changed: damping, times 2" in str(result)


def test_the_record_itself_is_no_later_one():
    record = oscillator_record(1, samples=50)
    same = replace(record, source=Path("same.csv"))
    with pytest.raises(UserError, match=r"same\.csv.*: this is the same record as"):
        ppy.diagnose(record, Oscillator, engine="new", compare=same)
    with pytest.raises(UserError, match=r"same\.csv: this is the same record"):
        ppy.diagnose(record, Oscillator, engine="new", holdout=same)


def test_the_experiment_that_tells_causes_apart_is_written(tmp_path):
    dry = diagnosis_with(oscillator_record(1, dry=1.5), (DRY,), (CUBE,))
    assert TermDiagnosisResult(dry).experiment is None
    experiment = telling_apart("friction(velocity)", "friction(elongation)")
    group = with_group(dry, "ambiguous", 0.6, 0.35)
    result = TermDiagnosisResult(replace(group, experiment=experiment))
    path = result.experiment.to_toml(tmp_path / "next.toml")
    written = tomllib.loads(path.read_text(encoding="utf-8"))
    assert (written["component"], written["inputs"]["force"]["levels"][0]) == (
        "oscillator",
        "-6.0 N",
    )
    assert "60 % if it is friction(elongation)" in "".join(result.experiment.overview())
