"""Claims: laws that are asked say what was hidden, and write it as code, picture and page."""

from __future__ import annotations

import json

import pytest

from fmus.kit import UserError
from orchestration.api.term_results import TermDiagnosisResult
from orchestration.diagnosis.law_map import map_laws
from tests.support.oscillator import (
    CUBE,
    DRY,
    diagnosis_with,
    diagnosis_without_terms,
    oscillator_record,
)
from tests.support.reference import documented_of_laws, fields


@pytest.fixture(scope="module")
def dry():
    diagnosis = diagnosis_with(oscillator_record(1, dry=1.5), (DRY,), (CUBE,))
    return TermDiagnosisResult(diagnosis, ("ppy", "laws"), law_map=map_laws(diagnosis))


@pytest.fixture(scope="module")
def right():
    diagnosis = diagnosis_without_terms(oscillator_record(2))
    return TermDiagnosisResult(diagnosis, ("ppy", "laws"), law_map=map_laws(diagnosis))


def test_the_map_is_told_in_every_form(dry):
    figures = dry.to_dict()
    assert json.loads(json.dumps(figures, allow_nan=False)) == figures
    assert figures["law_map"] == dry.law_map
    told = {name for name, _ in fields({"law_map": dry.law_map})}
    assert told == documented_of_laws().keys()
    assert "friction over velocity" in str(dry).split("what each law lacks")[1]


def test_a_diagnosis_has_no_map_unless_laws_are_asked(dry):
    plain = TermDiagnosisResult(dry.details)
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
