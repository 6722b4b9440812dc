"""Claims: a diagnosis by terms has the attributes of any, and refuses options that it ignores."""

from __future__ import annotations

import pytest

import ppy_rig as ppy
from fmus.kit import UserError
from orchestration.api.term_results import TermDiagnosisResult
from tests.support.oscillator import CUBE, DRY, diagnosis_with, oscillator_record


def test_the_result_in_python_has_the_attributes_of_any_diagnosis():
    dry = diagnosis_with(oscillator_record(1, dry=1.5), (DRY,), (CUBE,))
    result = TermDiagnosisResult(dry)
    assert result.causes == ["friction(velocity)"]
    assert result.alternatives == []
    assert result.probabilities["friction(velocity)"] > 0.9
    assert result.gain.after["position"] < result.gain.before["position"]
    assert "cause friction(velocity): oscillator, oscillator_1.csv" in repr(result)


def test_options_of_the_old_engine_are_refused():
    record, later = (oscillator_record(seed, samples=50) for seed in (1, 2))
    with pytest.raises(UserError, match=r"compare.*: the new engine does not take it"):
        ppy.diagnose(record, "ppy_actuator", engine="new", compare=later)
