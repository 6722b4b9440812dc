"""Claims: a diagnosis from its file looks as it did; any other file is refused in one line."""

from __future__ import annotations

import json
import re

import pytest

from fmus.kit import UserError
from orchestration.api.results import DiagnosisResult
from orchestration.api.stored import FORMAT, read_diagnosis
from orchestration.diagnosis.changes import Changed
from orchestration.diagnosis.law_map import map_laws
from orchestration.reporting import in_shell
from tests.support.oscillator import CUBE, DRY, diagnosis_with, oscillator_record


@pytest.fixture(scope="module")
def dry():
    return diagnosis_with(oscillator_record(1, dry=1.5), (DRY,), (CUBE,), (DRY, CUBE))


def kept(result, folder):
    path = folder / "diagnosis.json"
    path.write_text(json.dumps(result.to_dict(), allow_nan=False), encoding="utf-8")
    return path


@pytest.fixture
def results(dry):
    return {
        "alone": DiagnosisResult(dry, ["ppy", "diagnose", "a.csv"]),
        "changed": DiagnosisResult(dry, ["ppy"], Changed(dry, dry, ())),
        "laws": DiagnosisResult(dry, ["ppy", "laws"], law_map=map_laws(dry)),
    }


@pytest.mark.parametrize("kind", ["alone", "changed", "laws"])
def test_terminal_and_page_are_those_of_the_time(results, kind, tmp_path):
    result = results[kind].as_typed("ppy diagnose a.csv --fmu b.fmu", {"fmu": "b.fmu"})
    stored = read_diagnosis(kept(result, tmp_path))
    with in_shell():
        assert str(stored) == str(result)
    pages = [one.report(tmp_path / name) for one, name in ((result, "a.html"), (stored, "b.html"))]
    assert pages[0].read_bytes() == pages[1].read_bytes()
    assert "--fmu b.fmu" in pages[0].read_text(encoding="utf-8")
    assert stored.verdict == result.verdict
    assert stored.to_dict() == json.loads(json.dumps(result.to_dict()))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"format": FORMAT + 1},
            f"{FORMAT + 1} of ppy-rig .* is not known; .* reads format",
        ),
        ({"format": "?", "product": None}, "format '.' of None is not known"),
        ({"shown": None}, "shown: input should be a valid dictionary"),
        ({"shown": {"answer": 1}}, "shown.answer: input should be a valid dictionary"),
    ],
)
def test_another_format_is_refused_in_one_line(results, change, message, tmp_path):
    path = tmp_path / "d.json"
    path.write_text(json.dumps(results["alone"].to_dict() | change), encoding="utf-8")
    with pytest.raises(UserError, match=message) as refused:
        read_diagnosis(path)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [("{", "this is no JSON"), ("[]", "it has no format"), ('{"verdict": "cause"}', "no format")],
)
def test_another_file_is_refused_in_one_line(text, message, tmp_path):
    path = tmp_path / "d.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match=message):
        read_diagnosis(path)
    with pytest.raises(UserError, match="No such file"):
        read_diagnosis(tmp_path / "e.json")


def test_code_in_a_file_stays_a_text(results, tmp_path):
    """The page of somebody else's file."""
    path = kept(results["alone"], tmp_path)
    nasty = '</style><script>alert("a")</script>'
    text = json.dumps(nasty)[1:-1]
    spoilt = re.sub(r'(": |\[)"[^"]*"', lambda m: f'{m[1]}"{text}"', path.read_text("utf-8"))
    data = json.loads(spoilt)
    path.write_text(json.dumps(data | {"format": FORMAT}), encoding="utf-8")
    page = read_diagnosis(path).report(tmp_path / "p.html").read_text(encoding="utf-8")
    assert "<script" not in page
    assert page.count("</style>") == 1
