"""Check of a server: every rule holds at ours, and a wrong one is told with exit status 1."""

from __future__ import annotations

import pytest

from tests.support.rig.conformance.__main__ import main
from tests.support.rig.conformance.check import RuleVerdict, check_server
from tests.support.rig.conformance.rules import RULES
from tests.support.rig.process import Server
from tests.support.rig.small_rig import free_port, small_rig_process

pytestmark = [pytest.mark.timeout(120), pytest.mark.real_time]


@pytest.mark.slow
def test_every_rule_holds_at_our_server(tmp_path, capsys):
    with Server(tmp_path) as server:
        server.wait_ready()
        status = main([server.endpoint, "--beyond-limits"])
        shown = capsys.readouterr().out
        assert status == 0, shown
        assert shown.splitlines() == [f"holds      {rule.text}" for rule in RULES]
        assert not any(" 2.3 " in call.what for call in server.calls()), "beyond the limit"


def test_in_lockstep_the_rules_about_time_are_not_tried(server):
    with server() as remote:
        verdicts = check_server(remote, tell=lambda verdict: None)
    assert [verdict.holds for verdict in verdicts].count(None) == 3
    assert not any(verdict.holds is False for verdict in verdicts)


def test_a_server_written_without_care_is_told_rule_by_rule(capsys):
    port = free_port()
    with small_rig_process(port):
        status = main([f"tcp://127.0.0.1:{port}"])
    assert status == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("BROKEN     what is no ZMTP 3, such as a browser, is turned away")
    assert lines[1].startswith("holds      a peer that has not said its name")
    assert any(line.startswith("BROKEN     a malformed message") for line in lines)


def test_a_server_that_does_not_answer_is_one_line(capsys):
    assert main([f"tcp://127.0.0.1:{free_port()}"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "no answer" in line


def test_a_verdict_is_a_line():
    assert str(RuleVerdict("a rule", True, "")) == "holds      a rule"
    assert str(RuleVerdict("a rule", None, "why")) == "not tried  a rule: why"
    assert str(RuleVerdict("a rule", False, "why")) == "BROKEN     a rule: why"
