"""Claims: ``ppy check`` tells by its exit status whether a finding counts that is not accepted."""

import json

import pytest
from junitparser import JUnitXml

from tests.support.archive import edited
from tests.support.command import here, refused

ACCEPTED = '[[accept]]\ncode = "model-description"\nwhy = "known"\n'


@pytest.fixture(scope="module")
def good(fmu):
    return fmu("ppy_actuator", "native")


@pytest.fixture
def spoilt(good, tmp_path):
    return edited(
        good,
        tmp_path / "spoilt.fmu",
        lambda n, c: (
            n,
            c.replace(b"<InitialUnknowns>", b"<InitialUnknowns><Unknown index='9999'/>"),
        ),
    )


def test_check_tells_errors_by_its_exit_code(spoilt, good, tmp_path):
    done = here("check", spoilt, good, cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    assert "spoilt.fmu: error (contract line 1, model-description)" in done.stdout
    assert "ppy_actuator.fmu: no errors" in done.stdout  # the second file is looked at too


def test_json_of_check(good, tmp_path):
    (answer,) = json.loads(here("check", good, "--json", "-", cwd=tmp_path).stdout)
    assert (answer["file"], answer["errors"], answer["warnings"]) == (str(good), 0, 0)
    assert all(f["severity"] == "note" and isinstance(f["line"], int) for f in answer["findings"])


def test_what_is_accepted_does_not_count(spoilt, tmp_path):
    (tmp_path / "findings.toml").write_text(
        ACCEPTED + '[[accept]]\ncode = "no-unit"\nwhy = "gone"\n'
    )
    options = ("--accept", "findings.toml", "--json", "out.json", "--junit", "out.xml")
    done = here("check", spoilt, *options, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "accepted (contract line 1, model-description)" in done.stdout
    assert "no errors, 1 warnings, 1 accepted" in done.stdout
    assert "findings.toml: no-unit: there is no such finding; the entry can go" in done.stderr
    (answer,) = json.loads((tmp_path / "out.json").read_text())
    assert answer["errors"] == 0
    assert [f["accepted"] for f in answer["findings"] if f["severity"] == "error"] == ["known"]
    (suite,) = JUnitXml.fromfile(str(tmp_path / "out.xml"))
    assert (suite.failures, suite.skipped > 1) == (0, True)


def test_a_finding_fails_from_the_severity_on_that_is_asked_for(good, tmp_path):
    assert here("check", good, "--fail-on", "warning", cwd=tmp_path).returncode == 0
    done = here("check", good, "--fail-on", "note", "--junit", "out.xml", cwd=tmp_path)
    assert done.returncode == 1
    (suite,) = JUnitXml.fromfile(str(tmp_path / "out.xml"))
    assert "no-range" in [case.name for case in suite if case.result]


def test_what_cannot_be_checked_has_another_exit_status(good, tmp_path, monkeypatch):
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    done = here("check", "gone.fmu", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith("::error title=ppy::gone.fmu")
    monkeypatch.delenv("GITHUB_ACTIONS")
    refused(tmp_path, "check", good, "--fail-on", "all", parts=["--fail-on 'all'", "note"])
    refused(tmp_path, "check", good, "--junit", "a.txt", parts=["--junit a.txt", ".xml"])
    refused(tmp_path, "check", good, "--accept", "gone.toml", parts=["gone.toml: cannot be read"])
