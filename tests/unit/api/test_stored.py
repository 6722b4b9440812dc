"""Claims: a result from its file looks as it did; any other file is refused in one line."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

import ppy_rig as ppy
from fmus.kit import UserError
from orchestration.api.results import DiagnosisResult
from orchestration.api.stored import load
from orchestration.diagnosis.changes import Changed
from orchestration.diagnosis.law_map import map_laws
from orchestration.fmu.check.finding import Finding, Findings
from orchestration.reporting import make_page
from orchestration.reporting.saving import FORMAT
from tests.support.browser import chromium
from tests.support.oscillator import CUBE, DRY, diagnosis_with, oscillator_record
from tests.support.oscillator_model import Oscillator

PINNED = Path(__file__).with_name("pinned")  # files of format 1, as written when it began


@pytest.fixture(scope="module")
def dry():
    return diagnosis_with(oscillator_record(1, dry=1.5), (DRY,), (CUBE,), (DRY, CUBE))


def kept(result, folder):
    return result.save(folder / "diagnosis.json")


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
    stored = load(kept(result, tmp_path))
    assert str(stored) == str(result)
    pages = [one.report(tmp_path / name) for one, name in ((result, "a.html"), (stored, "b.html"))]
    assert pages[0].read_bytes() == pages[1].read_bytes()
    assert "--fmu b.fmu" in pages[0].read_text(encoding="utf-8")
    assert stored.verdict == result.verdict
    assert stored.to_dict() == json.loads(json.dumps(result.to_dict()))
    assert stored.save(tmp_path / "again.json").read_bytes() == kept(result, tmp_path).read_bytes()


@pytest.fixture(scope="module")
def compared():
    record = oscillator_record(1, samples=150)
    units = {"force": "N", "position": "m"}
    columns = {f"{name} [{unit}]": record.signals[name] for name, unit in units.items()}
    return ppy.compare({"time [s]": record.time} | columns, Oscillator, fit=["damping"])


@pytest.mark.parametrize("part", ["whole", "without a fit", "fit alone"])
def test_a_comparison_has_its_page(compared, part, tmp_path):
    plain = replace(compared, fit=None, after=None)
    compared = {"whole": compared, "without a fit": plain, "fit alone": compared.fit}[part]
    stored = load(compared.save(tmp_path / "compared.json"))
    assert (str(stored), repr(stored)) == (str(compared), repr(compared))
    assert stored.report(tmp_path / "a.html").read_text("utf-8") == make_page(compared).html()
    assert stored.to_dict() == json.loads(json.dumps(compared.to_dict()))
    assert stored.save(tmp_path / "again.json").read_bytes() == (
        (tmp_path / "compared.json").read_bytes()
    )


def test_a_result_without_page_or_figures_prints(tmp_path):
    findings = Findings([Finding("symbolic-link", "x has no [unit]")])
    stored = load(findings.save(tmp_path / "findings.json"))
    assert str(stored) == str(findings)
    with pytest.raises(UserError, match="Findings: this has no page"):
        stored.report(tmp_path / "a.html")


@pytest.mark.parametrize("name", ["diagnosis", "comparison"])
def test_a_file_of_the_first_format_is_read(name, tmp_path):
    stored = load(PINNED / f"{name}.json")
    assert f"{stored}\n" == (PINNED / f"{name}.txt").read_text(encoding="utf-8")
    assert "<h1>" in stored.report(tmp_path / "page.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_page_from_a_file_runs_nothing(browser, compared, tmp_path):
    """Unlike text, elements of a page are not escaped again."""
    data = json.loads(compared.save(tmp_path / "a.json").read_text("utf-8"))
    ill = "document.title = 'ill'"
    data["shown"]["page"]["parts"] += [f"<script>{ill}</script>", f'<img src="x" onerror="{ill}">']
    (tmp_path / "a.json").write_text(json.dumps(data), encoding="utf-8")
    page = load(tmp_path / "a.json").report(tmp_path / "page.html")
    with chromium(browser, tmp_path / "profile") as tab:
        tab.open(page, 1280)
        assert tab.run("document.scripts.length") == 1
        assert tab.run("document.title") != "ill"


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
        load(path)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "this is no JSON"),
        ("[" * 100_000, "this is no JSON"),
        ("[]", "it has no format"),
        ('{"verdict": "cause"}', "no format"),
    ],
)
def test_another_file_is_refused_in_one_line(text, message, tmp_path):
    path = tmp_path / "d.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match=message):
        load(path)
    with pytest.raises(UserError, match="No such file"):
        load(tmp_path / "e.json")


def test_code_in_a_file_stays_a_text(results, tmp_path):
    """The page of somebody else's file."""
    path = kept(results["alone"], tmp_path)
    nasty = '</style><script>alert("a")</script>'
    text = json.dumps(nasty)[1:-1]
    spoilt = re.sub(r'(": |\[)"[^"]*"', lambda m: f'{m[1]}"{text}"', path.read_text("utf-8"))
    data = json.loads(spoilt)
    path.write_text(json.dumps(data | {"format": FORMAT}), encoding="utf-8")
    page = load(path).report(tmp_path / "p.html").read_text(encoding="utf-8")
    assert "<script" not in page
    assert page.count("</style>") == 1
