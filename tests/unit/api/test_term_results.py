"""Claims: a diagnosis by terms has the attributes of any, and refuses options that it ignores."""

from __future__ import annotations

import tomllib
from dataclasses import replace

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


def test_the_result_in_python_has_the_attributes_of_any_diagnosis():
    dry = diagnosis_with(oscillator_record(1, dry=1.5), (DRY,), (CUBE,))
    result = TermDiagnosisResult(dry)
    assert result.causes == ["friction(velocity)"]
    assert result.alternatives == []
    assert result.probabilities["friction(velocity)"] > 0.9
    assert result.gain.after["position"] < result.gain.before["position"]
    assert "cause friction(velocity): oscillator, oscillator_1.csv" in repr(result)


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


def test_options_of_the_old_engine_are_refused():
    record, later = (oscillator_record(seed, samples=50) for seed in (1, 2))
    with pytest.raises(UserError, match=r"compare.*: the new engine does not take it"):
        ppy.diagnose(record, "ppy_actuator", engine="new", compare=later)
