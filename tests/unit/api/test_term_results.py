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


@pytest.mark.parametrize("option", [{"laws": False}, {"each": ["R1"]}])
def test_options_of_the_old_engine_are_refused(option):
    (name,) = option
    with pytest.raises(UserError, match=rf"{name}.*: the new engine does not take it"):
        ppy.diagnose(oscillator_record(1, samples=50), "ppy_actuator", engine="new", **option)
