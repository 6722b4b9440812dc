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
from tests.contract.subjects import ACTUATORS, Subject, each_front_end
from tests.support import hosts
from tests.support.pace import slow_but

CYCLES = 200  # of the smallest block lost in each, half would be noticed
MEGABYTE = 2**20


def _initializing(one: Instance, subject: Subject) -> None:
    one.do("fmi2SetupExperiment", 0, 0.0, 5.0, 1, 9.0)
    one.set({subject.positive: subject.parameters[subject.positive]})
    one.do("fmi2EnterInitializationMode")


def _refused(one: Instance, subject: Subject) -> None:
    _initializing(one, subject)
    one.set({subject.positive: 0.0})
    assert one.call("fmi2ExitInitializationMode") == ERROR


@each_front_end
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


# --- leaks
# --------------------------------------------------------------------------------------------------


linux_only = pytest.mark.skipif(sys.platform != "linux", reason="memory is counted on Linux")


@pytest.mark.slow
@each_front_end
@linux_only
def test_creating_and_freeing_leaks_nothing(archive):
    returncode, grown = hosts.in_subprocess(leaks.grow_by_creating, str(archive), CYCLES)
    assert returncode == 0, grown
    assert grown < 0.5 * CYCLES * leaks.LEAST, f"{grown / CYCLES:.0f} bytes per instance"


@each_front_end
@linux_only
def test_steps_leak_nothing(archive, subject):
    returncode, answer = hosts.in_subprocess(leaks.grow_by_stepping, str(archive), subject, 1_000)
    assert returncode == 0, answer
    grown, steps = answer
    assert steps == pytest.approx(leaks.WARM_UP + leaks.WINDOWS * 1_000)
    assert grown < 0.5 * 1_000 * leaks.LEAST, f"{grown / 1_000:.0f} bytes per step"


@linux_only
@pytest.mark.slow
def test_a_million_steps_make_no_process_grow(archive, subject, runtime):
    # with laws in Python that take long, fewer; with many internal steps fewer still
    of_python = 15_000 if subject.tolerance is None else 2_000
    steps = 1_000_000 if runtime == "native" else of_python
    returncode, grown = hosts.in_subprocess(leaks.grow_by_many_steps, str(archive), subject, steps)
    assert returncode == 0, grown
    assert grown < 0.3 * MEGABYTE, f"{grown} bytes in {steps} steps"


@linux_only
@pytest.mark.parametrize("name", slow_but(ACTUATORS, "ppy_actuator"))
def test_states_and_errors_leak_nothing(archive, built, name, runtime):
    broken = built(stack(component(name), BrokenOutput), runtime)
    returncode, grown = hosts.in_subprocess(
        leaks.grow_by_everything_else, str(archive), str(broken), CYCLES
    )
    assert returncode == 0, grown
    assert grown < 0.5 * CYCLES * leaks.LEAST, f"{grown / CYCLES:.0f} bytes per cycle"
