"""Line 9: parameters that make no sense are refused at the end of initialization, each by name, value and range."""

from __future__ import annotations

import math

import fmpy
import pytest

from tests.contract.models import Sampler
from tests.contract.raw import ERROR, OK, Instance, instance
from tests.contract.subjects import actuators_only


def ranges(archive) -> list[tuple[str, str, float, float]]:
    """Name, what follows a value in a message, minimum and maximum of every parameter that has one of them."""
    found = []
    for v in fmpy.read_model_description(str(archive), validate=False).modelVariables:
        if v.causality == "parameter" and (v.min is not None or v.max is not None):
            low, high = (math.inf * sign if text is None else float(text) for text, sign in ((v.min, -1), (v.max, 1)))
            found.append((v.name, "" if v.unit in (None, "1") else f" {v.unit}", low, high))
    return found


def beyond(bound: float, sign: int, kind: str) -> float:
    """Value next to a bound, on the side that the sign tells."""
    return bound + sign * (1.0 if kind == "Integer" else 1e-6 * abs(bound) or 1e-9)


def refused(one: Instance, values: dict[str, float]) -> list[str]:
    """Messages of an initialization that has to fail, and then to succeed with the original values."""
    one.do("fmi2Reset")
    one.messages.clear()
    one.do("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
    one.do("fmi2EnterInitializationMode")
    before = dict(zip(values, one.get(*values), strict=True))
    one.set(values)
    assert one.call("fmi2ExitInitializationMode") == ERROR
    one.set(before)
    one.do("fmi2ExitInitializationMode")
    one.time = 0.0
    one.step(0.1)
    return one.messages


def test_every_bound_of_every_parameter_holds(archive, one):
    checked = 0
    for name, unit, low, high in ranges(archive):
        for bound, sign in ((low, -1), (high, 1)):
            if not math.isfinite(bound):
                continue
            value = beyond(bound, sign, one.variables[name][1])
            messages = refused(one, {name: value})
            assert len(messages) == 1, name
            assert f"parameter '{name}' = {value:.10g}{unit}" in messages[0]
            assert f"is outside its range [{low:.10g}, {high:.10g}]{unit}" in messages[0]
            checked += 1
    assert checked >= 10


def test_the_bounds_themselves_are_allowed(archive, one, subject, runtime):
    """There a parameter may be beyond what can be integrated, but then it is said."""
    for name, _, low, high in ranges(archive):
        for value in (low, high):
            if not math.isfinite(value):
                continue
            one.do("fmi2Reset")
            one.initialize({**subject.inputs, name: value})
            if runtime == "python":
                continue  # a million internal steps, of the same algorithm, would take minutes there
            one.messages.clear()
            if one.call("fmi2DoStep", 0.0, one.library.step, 1) == OK:
                assert all(map(math.isfinite, one.everything())), name
            else:
                assert one.messages, name


@actuators_only
@pytest.mark.parametrize(
    ("name_", "value", "range_"),
    [("R1", -0.1, "[0, 1000000] ohm"), ("C", 0.0, "[1e-09, 1000000000] F"), ("k2", -5.0, "[1e-06, 1e+15] N/m")],
)
def test_sentence_for_people(one, name_, value, range_):
    (message,) = refused(one, {name_: value})
    assert message == f"parameter '{name_}' = {value:.10g} {range_.split()[-1]} is outside its range {range_}"


@actuators_only
def test_every_offender_is_named_at_once(one):
    messages = refused(one, {"R1": -1.0, "C": 0.0, "b1": -3.0})
    assert [m.split("'")[1] for m in messages] == ["R1", "C", "b1"]


def test_integers_and_sample_periods(built, runtime):
    with instance(built(Sampler, runtime)) as one:
        assert refused(one, {"step": 0.0}) == ["parameter 'step' = 0 is outside its range [1, 9]"]
        messages = refused(one, {"period": 0.0})
        assert "parameter 'period' = 0 s is outside its range [0.001, 10] s" in messages[0]
