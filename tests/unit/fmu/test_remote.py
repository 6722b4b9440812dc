"""Claims: of an FMU that a process can instantiate only once, a system runs as many as it has, with
the results of any other FMU to the last bit; a process that ends is told in one line, and none is
left.

The FMU refuses a second instance in its process. Oracle: the exact answer of two lags in a row.
"""

from __future__ import annotations

import os
import shutil
import signal

import numpy as np
import psutil
import pytest

from fmus.kit.errors import UserError
from orchestration.fmu.isolation import Limits
from orchestration.master import Stopped, run
from tests.support import processes
from tests.support.master.failing import ERROR, TIME, H, chain, ones
from tests.support.master.samples import build_member, ring


@pytest.fixture(scope="module")
def member(tmp_path_factory):
    return build_member(tmp_path_factory.mktemp("member"), canInterpolateInputs=True)


@pytest.fixture(scope="module")
def once(tmp_path_factory):
    folder = tmp_path_factory.mktemp("once")
    return build_member(folder, canInterpolateInputs=True, canBeInstantiatedOnlyOncePerProcess=True)


def two_lags():
    """Of time constant 1 s each, driven by 1; the second receives the newest of the first."""
    first, second = [0.0], [0.0]
    for _ in TIME[1:]:
        first.append(1.0 + (first[-1] - 1.0) * np.exp(-H))
        second.append(first[-1] + (second[-1] - first[-1]) * np.exp(-H))
    return second


@pytest.mark.parametrize("copied", [False, True])
@pytest.mark.parametrize("isolation", [None, Limits()])
def test_two_instances_give_what_the_equations_say(once, tmp_path, copied, isolation):
    """Also of two copies of the file, and in a run that has a process of its own itself."""
    copy = shutil.copy(once, tmp_path / "another.fmu") if copied else once
    system = ring(
        {"good": once, "bad": copy}, {"good": {}, "bad": {}}, "good.x -> bad.u", u="good.u"
    )
    result = run(system, TIME, ones(), isolation=isolation)
    assert result.complete
    np.testing.assert_allclose(result.signals["bad.x"], two_lags(), rtol=1e-12)
    assert processes.of_fmus() == []


@pytest.mark.parametrize(
    "options", [{}, {"extrapolation": 1}, {"tolerance": 1e-3}, {"rates": {"bad": 2}}]
)
def test_results_are_those_of_instances_in_this_process(once, member, options):
    """Also where states are saved, and slopes are set."""
    expected = run(chain(member), TIME, ones(), **options)
    result = run(chain(once), TIME, ones(), **options)
    assert {name: values.tolist() for name, values in result.signals.items()} == {
        name: values.tolist() for name, values in expected.signals.items()
    }


def test_what_the_fmu_says_is_told(once, member):
    messages = []
    for fmu in (member, once):
        with pytest.raises(Stopped) as told:
            run(chain(fmu, status=ERROR, when=2.0), TIME, ones())
        messages.append(str(told.value))
        with pytest.raises(UserError) as refused:
            run(chain(fmu, init=ERROR), TIME, ones())
        messages.append(str(refused.value))
    assert messages[:2] == messages[2:]


def test_a_process_that_is_killed_is_told_in_one_line(once):
    def kill(done):
        if done == 20:
            processes.of_fmus()[0].kill()

    with pytest.raises(
        Stopped, match=r"^bad: member\.fmu: its process was ended by SIGKILL$"
    ) as end:
        run(chain(once), TIME, ones(), progress=kill)
    assert end.value.run.time.size >= 20
    assert processes.of_fmus() == []


def test_ctrl_c_leaves_no_process(once):
    def press(done):
        if done == 20:
            os.kill(os.getpid(), signal.SIGINT)

    result = run(chain(once), TIME, ones(), progress=press)
    assert not result.complete
    assert 20 <= result.time.size <= 21
    assert processes.of_fmus() == []


def test_a_process_that_hangs_ends_with_the_isolated_one_that_started_it(once):
    suspended = []

    def suspend(done):
        if not suspended:
            suspended.extend(processes.of_fmus()[0].children())
            suspended[0].suspend()

    time = np.arange(20000) * 0.01
    with pytest.raises(Stopped, match=r"^bad: member\.fmu: its process: no answer within 0\.5 s$"):
        run(chain(once), time, ones(20000), progress=suspend, isolation=Limits(step_timeout=0.5))
    _, left = psutil.wait_procs(suspended, timeout=0.5)
    assert all(process.status() == psutil.STATUS_ZOMBIE for process in left)
