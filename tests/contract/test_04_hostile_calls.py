"""Line 4: to whatever a host or a law does the answer is a status and a readable sentence."""

from __future__ import annotations

import functools
import re

import pytest

from fmus import component
from fmus.kit import stack
from tests.contract import hostile
from tests.contract.models import BrokenOutput, BrokenRate, Oscillator
from tests.contract.raw import ERROR, OK
from tests.contract.subjects import ACTUATORS, SUBJECTS, each_front_end
from tests.support import hosts
from tests.support.pace import slow_but

REFUSED = {
    "without_a_name": r"has no name",
    "with_an_empty_name": r"has no name",
    "of_another_kind": r"made for co-simulation( and model exchange)?, not for type 7",
    "with_another_guid": r"GUID \{%s%n\} does not belong to this build",
    "without_a_guid": r"GUID NULL does not belong to this build",
    "without_callbacks": None,
    "without_resources": r"needs the location of its resources",
    "with_missing_resources": r"no such|No such",
}


@functools.cache
def answers(archive: str, name: str) -> dict:
    """Play all cases once in a process of its own, which has to end with 0."""
    finished = hosts.finish_in_subprocess(hostile.play, archive, SUBJECTS[name])
    assert finished.returncode == 0, finished.output
    return finished.result


def test_every_case_is_judged():
    assert set(hostile.EXPECTED) == set(hostile.CASES)
    assert set(REFUSED) == set(hostile.CREATING)


@each_front_end
@pytest.mark.parametrize("case", [c for c in hostile.EXPECTED if c != "enormous_input"])
def test_answer_is_an_error_with_a_sentence(archive, name, case):
    statuses, messages, levels = answers(str(archive), name)[case]
    assert statuses == [ERROR] * len(statuses)
    assert len(messages) >= len(statuses), "every refusal is explained"
    assert set(levels) == {ERROR}
    expected = re.sub(
        r"<(\w+)>", lambda role: getattr(SUBJECTS[name], role[1]), hostile.EXPECTED[case]
    )
    assert re.search(expected, messages[0]), messages
    assert all("\n" not in message and len(message) < 400 for message in messages)


@each_front_end
def test_enormous_input_ends_in_ok_or_in_an_error_with_a_sentence(archive, name):
    statuses, messages, _ = answers(str(archive), name)["enormous_input"]
    assert statuses in ([OK], [ERROR])
    assert (statuses == [OK]) or re.search("not a? ?finite", messages[0]), messages


@each_front_end
@pytest.mark.parametrize("case", REFUSED)
def test_refused_instance(archive, name, runtime, case):
    refused, messages, levels = answers(str(archive), name)[case]
    if runtime == "native" and case in ("without_resources", "with_missing_resources"):
        assert not refused, "the native build needs no resources"
        return
    assert refused
    if REFUSED[case] is not None:
        assert len(messages) == 1
        assert re.search(REFUSED[case], messages[0]), messages
        assert levels == [ERROR]


@each_front_end
def test_null_instance(archive, runtime):
    returncode, statuses = hosts.in_subprocess(hostile.call_without_an_instance, str(archive))
    assert returncode == 0, statuses
    assert len(statuses) == {"python": 30, "native": 40}[runtime], (
        "model exchange has ten of its own"
    )
    assert {name: s for name, s in statuses.items() if s != ERROR} == {}


@each_front_end
def test_host_without_a_logger(archive, name):
    assert hosts.in_subprocess(hostile.without_a_logger, str(archive), SUBJECTS[name].first) == (
        0,
        [ERROR, ERROR],
    )


@each_front_end
def test_state_of_another_fmu(fmu, name, runtime):
    other = {"python": "native", "native": "python"}[runtime]
    returncode, answer = hosts.in_subprocess(
        hostile.foreign_state, str(fmu(name, runtime)), str(fmu(name, other))
    )
    assert returncode == 0, answer
    statuses, messages = answer
    assert statuses == [ERROR, ERROR]
    assert "does not belong to this build" in messages[0]


@pytest.mark.parametrize("name", slow_but(ACTUATORS, "ppy_actuator"))
@pytest.mark.parametrize("effect", [BrokenRate, BrokenOutput])
def test_bug_in_a_law(built, name, runtime, effect):
    cls = stack(component(name), effect)
    finished = hosts.finish_in_subprocess(hostile.meet_a_bug, str(built(cls, runtime)))
    assert finished.returncode == 0, finished.output
    assert "Traceback" not in finished.output
    found = finished.result
    assert found["statuses"] == {
        "step": ERROR,
        "step again": ERROR,
        "set": ERROR,
        "states": OK,
        "last time": OK,
        "reset": OK,
        "initialize": ERROR,
        "reset again": OK,
        "terminate": OK,
    }
    variable = {BrokenRate: "kelvin_elongation", BrokenOutput: "voltage"}[effect]
    for message in (found["message"], found["at start"]):
        assert "\n" not in message
        if runtime == "python":
            assert "ValueError: 100 % broken, %s %n (in _bug, line " in message
            assert "models.py)" in message
        else:
            assert variable in message
            assert "finite" in message
    assert found["charge kept"], "a failed step leaves the states as they were"
    assert found["time"] == pytest.approx(0.3)
    assert found["same"], "after a reset the failure is forgotten"
    assert set(found["levels"]) == {ERROR}


def test_state_that_runs_away(built, runtime):
    returncode, answer = hosts.in_subprocess(hostile.run_away, str(built(Oscillator, runtime)))
    assert returncode == 0, answer
    status, message, kept = answer
    assert status == ERROR
    accuracy = f"accuracy {Oscillator.tolerance:g} cannot be reached at 1"
    assert re.search(f"step from 0.5 s to 1.5 s failed: .*(runaway|{accuracy})", message)
    assert kept == pytest.approx(2.0, rel=1e-7), "the value before the step, 1 / (1 - 0.5)"
