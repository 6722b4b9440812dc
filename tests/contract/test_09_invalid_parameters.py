"""Line 9: senseless parameters are refused at the end of initialization, each by its range."""

from __future__ import annotations

import math

import pytest

from tests.contract import checks
from tests.contract.checks import ranges, refused
from tests.contract.models import Sampler
from tests.contract.raw import OK, instance
from tests.contract.subjects import actuators_only


def test_every_bound_of_every_parameter_holds(archive):
    checks.every_bound_of_every_parameter_holds(archive)


def test_the_bounds_themselves_are_allowed(archive, one, subject, runtime):
    """There a parameter may be beyond what can be integrated, but then it is said."""
    for name, _, low, high in ranges(archive):
        for value in (low, high):
            if not math.isfinite(value):
                continue
            one.do("fmi2Reset")
            one.initialize({**subject.inputs, name: value})
            if runtime == "python":
                # a million internal steps, of the same algorithm, would take minutes there
                continue
            one.messages.clear()
            if one.call("fmi2DoStep", 0.0, one.library.step, 1) == OK:
                assert all(map(math.isfinite, one.everything())), name
            else:
                assert one.messages, name


@actuators_only
@pytest.mark.parametrize(
    ("name_", "value", "range_"),
    [
        ("R1", -0.1, "[0, 1000000] ohm"),
        ("C", 0.0, "[1e-09, 1000000000] F"),
        ("k2", -5.0, "[1e-06, 1e+15] N/m"),
    ],
)
def test_sentence_for_people(one, name_, value, range_):
    (message,) = refused(one, {name_: value})
    assert (
        message
        == f"parameter '{name_}' = {value:.10g} {range_.split()[-1]} is outside its range {range_}"
    )


@actuators_only
def test_every_offender_is_named_at_once(one):
    messages = refused(one, {"R1": -1.0, "C": 0.0, "b1": -3.0})
    assert [m.split("'")[1] for m in messages] == ["R1", "C", "b1"]


def test_integers_and_sample_periods(built, runtime):
    with instance(built(Sampler, runtime)) as one:
        assert refused(one, {"step": 0.0}) == ["parameter 'step' = 0 is outside its range [1, 9]"]
        messages = refused(one, {"period": 0.0})
        assert "parameter 'period' = 0 s is outside its range [0.001, 10] s" in messages[0]
