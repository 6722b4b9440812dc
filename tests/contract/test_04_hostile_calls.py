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

# What the first message must tell, <role> standing for a variable of the subject. Every status must
# be Error.
EXPECTED = {
    "nan_input": r"fmi2SetReal: '<first>' = -?nan is not a finite number",
    "infinite_input": r"fmi2SetReal: '<first>' = inf is not a finite number",
    "one_bad_value_among_good_ones": r"'<second>' = -?nan is not a finite number",
    "setting_an_output": r"'<output>' is calculated and cannot be set",
    "setting_a_parameter_after_initialization": (
        r"parameter '<parameter>' cannot be set after initialization"
    ),
    "unknown_value_reference": (
        r"fmi2GetReal: value reference \d+ does not exist; the last one is \d+"
    ),
    "wrong_type": r"fmi2GetInteger: value reference \d+ is '<first>', which is of type Real",
    "text_variables": r"has no String variables",
    "null_arrays": r"fmi2GetReal: an array is NULL though it should have 1 elements",
    "negative_step": r"fmi2DoStep: .* step -0.1 s must be finite numbers, the step positive",
    "zero_step": r"fmi2DoStep: .* step 0 s must be finite numbers, the step positive",
    "nan_step": r"fmi2DoStep: .* step -?nan s must be finite",
    "infinite_step": r"fmi2DoStep: .* step inf s must be finite",
    "invisibly_small_step": r"a step of 1e-300 s cannot be represented at t = 0.1 s",
    "step_from_another_time": r"the step begins at 77.1 s but the instance is at 0.1 s",
    "step_beyond_the_stop_time": r"the step ends at 1.1 s, after the stop time 1 s",
    "initializing_again": r"fmi2SetupExperiment is not allowed between steps",
    "using_what_is_not_initialized": r"fmi2DoStep is not allowed before initialization",
    "using_what_is_terminated": r"fmi2DoStep is not allowed after termination",
    "cancelling_a_step": r"steps are never pending",
    "bad_experiment": r"start time -?nan is not a finite number",
    "nothing_where_something_is_needed": r"parameter '<positive>' = 0( \S+)? is outside its range",
    "nan_parameter": r"'<parameter>' = -?nan is not a finite number",
    "null_state": r"fmi2GetFMUstate: a pointer is NULL",
    "broken_serialized_state": (
        r"fmi2DeSerializeFMUstate: \d+ bytes are not a state of \w+, which has \d+"
    ),
    "wrong_directions": r"fmi2GetDirectionalDerivative",
    "wrong_slopes": r"fmi2SetRealInputDerivatives",
    "slopes_of_outputs": r"fmi2GetRealOutputDerivatives is not supported",
    "enormous_input": r"",
}
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
    assert set(EXPECTED) == set(hostile.CASES)
    assert set(REFUSED) == set(hostile.CREATING)


@each_front_end
@pytest.mark.parametrize("case", [c for c in EXPECTED if c != "enormous_input"])
def test_answer_is_an_error_with_a_sentence(archive, name, case):
    statuses, messages, levels = answers(str(archive), name)[case]
    assert statuses == [ERROR] * len(statuses)
    assert len(messages) >= len(statuses), "every refusal is explained"
    assert set(levels) == {ERROR}
    expected = re.sub(r"<(\w+)>", lambda role: getattr(SUBJECTS[name], role[1]), EXPECTED[case])
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
