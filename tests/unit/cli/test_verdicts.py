"""Claims: verdicts are JUnit that a reader of others reads, annotations of GitHub where it runs,
and an exit status.

Oracle: junitparser; the escapes that GitHub documents for workflow commands.
"""

from __future__ import annotations

import pytest
import typer
from junitparser import Failure, JUnitXml, Skipped

from orchestration.cli.verdicts import Case, annotate, conclude

CASES = [
    Case("plant.fmu", "voltage"),
    Case("plant.fmu", "omega <&> \x1b[1m", failure='leaves "the tube" by 1 mV\x00\n at 3 s'),
    Case("plant.fmu", "temperature", skipped="accepted"),
    Case("plant.fmu", "force", failure="another", skipped="and accepted"),
]


def test_junitparser_reads_what_is_written(tmp_path):
    path = tmp_path / "deep" / "verdicts.xml"
    with pytest.raises(typer.Exit) as ended:
        conclude("ppy compare", CASES, path)
    assert ended.value.exit_code == 1
    (suite,) = JUnitXml.fromfile(str(path))
    assert (suite.name, suite.tests, suite.failures, suite.errors, suite.skipped) == (
        "ppy compare",
        4,
        2,
        0,
        1,
    )
    voltage, omega, temperature, force = suite
    assert (voltage.classname, voltage.name, voltage.result) == ("plant.fmu", "voltage", [])
    assert omega.name == "omega <&> \\x1b[1m"
    (failure,) = omega.result
    assert isinstance(failure, Failure)
    assert failure.message == 'leaves "the tube" by 1 mV\\x00\\n at 3 s'
    assert [type(one) for one in temperature.result] == [Skipped]
    assert [one.message for one in force.result] == ["another"]


def test_cases_that_all_pass_end_nothing(tmp_path):
    conclude("ppy check", CASES[:1], None)
    conclude("ppy check", [], tmp_path / "empty.xml")
    assert JUnitXml.fromfile(str(tmp_path / "empty.xml")).tests == 0


def test_annotations_are_workflow_commands_where_github_runs(monkeypatch, capsys):
    monkeypatch.delenv("GITHUB_ACTIONS", raising=False)
    annotate("nothing")
    assert capsys.readouterr().err == ""
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    annotate("100 % of\nit", "a: b, c", "models/a,b.fmu")
    expected = "::error file=models/a%2Cb.fmu,title=a%3A b%2C c::100 %25 of%0Ait\n"
    assert capsys.readouterr().err == expected
