"""Line 7: a reset instance is a fresh one, and nothing leaks."""

from __future__ import annotations

import sys

import pytest

from fmus import component
from fmus.kit import stack
from tests.contract import checks, leaks
from tests.contract.checks import STEPS
from tests.contract.models import BrokenOutput, Oscillator, Sampler
from tests.contract.raw import ERROR, Instance, instance
from tests.contract.schedule import go, schedule
from tests.contract.subjects import ACTUATORS, Subject, actuators_only
from tests.support import hosts

CYCLES = 10_000
# Python's allocator settles only after thousands of objects have come and gone.
WARM_UP = {"native": 2_000, "python": 6_000}
MEGABYTE = 2**20


def _initializing(one: Instance, subject: Subject) -> None:
    one.do("fmi2SetupExperiment", 0, 0.0, 5.0, 1, 9.0)
    one.set({subject.positive: subject.parameters[subject.positive]})
    one.do("fmi2EnterInitializationMode")


def _refused(one: Instance, subject: Subject) -> None:
    _initializing(one, subject)
    one.set({subject.positive: 0.0})
    assert one.call("fmi2ExitInitializationMode") == ERROR


@pytest.mark.parametrize("spoil", [_initializing, _refused, checks.stepping, checks.terminated])
def test_reset_then_run_is_a_fresh_run(archive, subject, spoil):
    checks.reset_then_run_is_a_fresh_run(archive, subject, spoil)


@pytest.mark.parametrize("cls", [Sampler, Oscillator])
def test_reset_of_other_models(built, cls, runtime):
    with instance(built(cls, runtime)) as one:
        blank = one.serialize(one.save())
        trails = []
        for _ in range(2):
            one.initialize()
            trails.append(go(one, schedule(one.library, 7, STEPS)))
            one.do("fmi2Reset")
            assert one.serialize(one.save()) == blank
        assert trails[0] == trails[1]


# --- leaks ----------------------------------------------------------------------------------------------------------


linux_only = pytest.mark.skipif(sys.platform != "linux", reason="memory is measured on Linux")


@linux_only
def test_creating_and_freeing_leaks_nothing(archive, runtime):
    returncode, grown = hosts.in_subprocess(leaks.grow_by_creating, str(archive), WARM_UP[runtime], CYCLES)
    assert returncode == 0, grown
    # A leak of a single block of memory per instance, or of one Python object, would be more.
    assert grown < 0.3 * MEGABYTE, f"{grown / CYCLES:.0f} bytes per instance"


@linux_only
def test_a_million_steps_leak_nothing(archive, name, subject, runtime):
    # with laws in Python that take long, fewer: a float lost in each step is still above the limit
    steps = 1_000_000 if runtime == "native" or name in ACTUATORS else 15_000
    returncode, answer = hosts.in_subprocess(leaks.grow_by_stepping, str(archive), subject, steps)
    assert returncode == 0, answer
    grown, time, size = answer
    assert time == pytest.approx((leaks.WARM_UP + steps) * size)
    assert grown < 0.3 * MEGABYTE, f"{grown} bytes in {steps} steps"


@linux_only
@actuators_only
def test_states_and_errors_leak_nothing(archive, built, name, runtime):
    broken = built(stack(component(name), BrokenOutput), runtime)
    returncode, grown = hosts.in_subprocess(leaks.grow_by_everything_else, str(archive), str(broken))
    assert returncode == 0, grown
    assert grown < 0.3 * MEGABYTE, f"{grown / 3000:.0f} bytes per cycle"
