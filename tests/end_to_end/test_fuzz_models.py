"""Claim: whatever a model is and however it was measured, a diagnosis and a search of its laws end
with an answer, or with an error that names a fault of what was given.
"""

from __future__ import annotations

import os
import subprocess
import sys
import warnings

import pytest

from fmus.kit import UserError
from tests.support import fuzz_models
from tests.support.fuzzed_models import written
from tests.support.source import ROOT


@pytest.mark.slow
@pytest.mark.timeout(0)
def test_models_and_records_of_any_kind_are_answered_or_refused(tmp_path):
    words = ["--seed", "20261125", "--cases", "60"]
    done = subprocess.run(
        [sys.executable, "-m", "tests.support.fuzz_models", *words],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"},
    )
    *findings, summary = done.stdout.splitlines()
    assert findings == [], done.stderr
    assert summary.startswith("60 cases, 0 findings")
    assert done.returncode == 0


def test_cases_are_of_all_kinds_and_the_same_again():
    cases = [fuzz_models.draw_case(1, number) for number in range(40)]
    models = [case.model for case in cases]
    for kind in ("Input", "State", "Discrete"):
        assert {bool(model.of_kind(kind)) for model in models} == {True, False}
    assert {len(model.measured) for model in models} >= {1, 2}
    assert any(model.listed for model in models)
    assert {case.task for case in cases} == {"diagnose", "laws"}
    options = {name for case in cases for name in case.options}
    assert options >= {"time", "hold", "each", "holdout", "settings", "interpolate", "effects"}
    again = fuzz_models.draw_case(1, 7)
    assert written(again.model) == written(models[7])
    assert again.records["record.csv"].text() == cases[7].records["record.csv"].text()


def test_a_case_without_a_part_is_the_rest_of_it():
    case = fuzz_models.draw_case(1, 7)
    for part in case.model.parts:
        less = fuzz_models.draw_case(1, 7, frozenset({part}))
        compile(written(less.model), "model.py", "exec")
        assert len(less.model.parts) < len(case.model.parts)


@pytest.mark.parametrize(
    ("answers", "finding"),
    [
        (lambda: 1 / 0, "ZeroDivisionError: division by zero"),
        (lambda: warnings.warn("something", RuntimeWarning, 1) or [], "warned: RuntimeWarning"),
        (lambda: (_ for _ in ()).throw(UserError("internal")), "refused: internal"),
        (lambda: ["printed: nan"], "printed: nan"),
    ],
)
def test_what_is_no_answer_is_named(monkeypatch, tmp_path, answers, finding):
    monkeypatch.setattr(fuzz_models, "_answered", lambda case, folder: answers())
    (only,) = fuzz_models.findings_of(fuzz_models.draw_case(1, 7), tmp_path)
    assert only.startswith(finding)


@pytest.mark.parametrize(
    ("message", "fault"),
    [
        ("12 samples are too few for a diagnosis; 225 are the least", True),
        ("12 samples are too few for a diagnosis; 225 are the least\nand more", False),
        ("singular matrix", False),
    ],
)
def test_a_refusal_names_a_fault_of_what_was_given(message, fault):
    assert fuzz_models.is_fault(message) == fault


def test_a_finding_is_shrunk_to_what_brings_it_about(monkeypatch):
    model = fuzz_models.draw_case(1, 7).model
    needed = model.laws[0].name

    def fails_with_its_law(seed, number, without):
        laws = fuzz_models.draw_case(seed, number, without).model.laws
        return ["KeyError: 'x'"] if needed in {law.name for law in laws} else []

    monkeypatch.setattr(fuzz_models, "run_case", fails_with_its_law)
    gone = fuzz_models.shrink(1, 7, "KeyError: 'y'")
    left = model.without(gone)
    assert [law.name for law in left.laws] == [needed]
    assert "--without" in fuzz_models.repeated(1, 7, gone)
