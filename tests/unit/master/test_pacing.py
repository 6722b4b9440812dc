"""Claims: a run in real time is the same run, never early, without drift; what is late is counted,
bounded and told.

What is computed takes a known time (`c/sleeper.c`), so how late each point must be follows by hand.
On a busy machine everything may come later than that, nothing earlier: times are held from below,
and from above by `LATE` only.
"""

from __future__ import annotations

import gc
import os
import signal
import threading
from bisect import bisect_left
from time import perf_counter, sleep

import numpy as np
import pytest

from fmus.kit.errors import UserError
from fmus.kit.interrupt import Interrupt
from orchestration.master import RealTime, Stopped, run
from orchestration.master.pacing import EDGES, Pacer
from orchestration.system import Member, System
from tests.support.command import posix
from tests.support.master.samples import build_member, ring
from tests.support.master.sleeper import build_sleeper
from tests.support.pace import slow_but

pytestmark = pytest.mark.real_time

LATE = 0.5  # s; what a busy machine may take


@pytest.fixture(scope="module")
def sleeper(tmp_path_factory):
    return build_sleeper(tmp_path_factory.mktemp("sleeper"))


def sleeping(fmu, **parameters) -> System:
    return System("sleeping", (Member("a", fmu, parameters),), ())


def points(step: float, stop: float) -> np.ndarray:
    return step * np.arange(round(stop / step) + 1)


@pytest.mark.parametrize(
    "options", slow_but([{}, {"method": "jacobi"}, {"tolerance": 1e-3}, {"rates": {"b": 0.5}}], {})
)
def test_a_paced_run_is_the_same_to_the_last_bit_and_never_early(tmp_path, options):
    fmu, time, came = build_member(tmp_path), points(0.01, 0.5), []
    system = ring(fmu, {"a": {}, "b": {}}, "a.x -> b.u; b.x -> -2 a.u + 1")
    pace = RealTime(watch=lambda k, values, lag, missed: came.append(perf_counter()))
    fast, paced = run(system, time, **options), run(system, time, real_time=pace, **options)
    assert fast.statistics.pacing is None
    assert [v.tobytes() for v in paced.signals.values()] == [
        v.tobytes() for v in fast.signals.values()
    ]
    assert (np.array(came[1:]) - came[0] >= time[:-1] - 1e-6).all()
    assert time[-1] <= paced.statistics.wall
    assert came[-1] - came[0] <= time[-1] + paced.statistics.pacing.worst_lag + LATE, (
        "what is late is told"
    )
    assert paced.statistics.pacing.deadlines == sum(paced.statistics.pacing.counts) == time.size - 1


@pytest.mark.real_time(limit=0.005)
def test_errors_do_not_add_up(sleeper):
    """100 steps of 10 ms in each of which 4 ms are slept last a second, not 1.4 s."""
    lags = []
    pace = RealTime(watch=lambda k, values, lag, missed: lags.append(lag))
    done = run(sleeping(sleeper, delay=0.004, until=9.0), points(0.01, 1.0), real_time=pace)
    assert 1.0 <= done.statistics.wall < 1.0 + 0.35
    assert np.median(lags[50:]) < 0.004


def test_the_watch_sees_every_point_with_the_recorded_values(sleeper):
    seen = []
    pace = RealTime(watch=lambda k, values, lag, missed: seen.append((k, *values)))
    done = run(
        sleeping(sleeper),
        points(0.01, 0.1),
        record=["a.link_state", "a.voltage_age"],
        real_time=pace,
    )
    expected = zip(
        range(11), done.signals["a.link_state"], done.signals["a.voltage_age"], strict=True
    )
    assert seen == list(expected)


def test_missed_deadlines_are_counted(sleeper):
    """A step of 20 ms that takes 80 ms ends 60 ms late; the next ones 40 ms and 20 ms, for they
    take no time.
    """
    lags = []
    pace = RealTime(watch=lambda k, values, lag, missed: lags.append(lag))
    done = run(
        sleeping(sleeper, delay=0.08, until=0.11, **{"from": 0.1}),
        points(0.02, 0.4),
        real_time=pace,
    )
    pacing = done.statistics.pacing
    assert done.complete
    assert lags[7] >= 0.06 - 1e-6  # of point 6, told at the next
    assert lags[8] >= 0.04 - 1e-6
    assert pacing.missed >= 2
    assert pacing.worst_lag >= 0.06 - 1e-6
    assert pacing.worst_at == pytest.approx(0.12) or pacing.worst_lag > 0.08
    assert f"{pacing.missed} of 20 deadlines missed, the latest by" in str(pacing)
    counted = [0] * (len(EDGES) + 1)
    for lag in lags[2:]:  # of the points from the first on; that of the last is told to nobody
        counted[bisect_left(EDGES, lag)] += 1
    assert sum(abs(a - b) for a, b in zip(pacing.counts, counted, strict=True)) == 1


def test_a_missed_deadline_can_end_the_run_and_the_record_stays(sleeper):
    pace = RealTime(missed="stop", allowance=0.2)
    with pytest.raises(
        Stopped, match=r"deadline missed: 0.15 s was reached \d+ ms late; 200 ms are allowed"
    ) as caught:
        run(
            sleeping(sleeper, delay=0.4, until=9.0, **{"from": 0.1}),
            points(0.05, 1.0),
            real_time=pace,
        )
    partial = caught.value.run
    assert (partial.complete, partial.message) == (False, str(caught.value))
    assert partial.time.tolist() == points(0.05, 0.15).tolist()
    assert partial.signals["a.voltage_age"] == pytest.approx(partial.time)
    assert partial.statistics.pacing.missed == 1


def test_a_lag_beyond_its_bound_ends_the_run_in_any_case(sleeper):
    """Steps of 100 ms that take 300 ms are 200 ms later each time: beyond 500 ms at the third, at
    the latest.
    """
    with pytest.raises(
        Stopped, match=r"not in real time: .* s late; the lag may be 0\.5 s"
    ) as caught:
        run(sleeping(sleeper, delay=0.3, until=9.0), points(0.1, 5.0), real_time=RealTime(lag=0.5))
    assert 2 <= caught.value.run.time.size <= 4
    assert caught.value.run.statistics.pacing.worst_lag > 0.5


@posix
def test_an_interrupt_ends_a_wait(sleeper):
    begin = perf_counter()
    threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    done = run(sleeping(sleeper), points(30.0, 60.0), real_time=RealTime())
    assert perf_counter() - begin < 10.0  # it would wait for 30 s, and a busy machine takes seconds
    assert (done.complete, done.time.tolist()) == (False, [0.0, 30.0])
    assert done.message == "interrupted at 30 s of 60 s"


def test_what_is_not_allowed_is_noted(sleeper, monkeypatch):
    """Who may do what differs between machines; that the system refuses is what is simulated here,
    nothing else.
    """

    def refuse(*arguments):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "setpriority", refuse)
    monkeypatch.setattr(os, "sched_setaffinity", refuse, raising=False)
    pace = RealTime(processor=0, priority=True)
    notes = run(sleeping(sleeper), points(0.01, 0.02), real_time=pace).notes
    reason = "is not to be had here: Operation not permitted"
    assert notes == (f"running on processor 0 {reason}", f"a higher priority {reason}")
    assert gc.isenabled()


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"missed": "ignore"}, "'ignore'; there are: warn, stop"),
        ({"lag": 0.0}, "lag 0 s: must be above 0"),
        ({"allowance": float("nan")}, "allowance nan s"),
        ({"processor": 100000}, "processor 100000: there are 0"),
    ],
)
def test_settings_that_make_no_sense_are_refused(options, told):
    with pytest.raises(UserError, match=told):
        RealTime(**options)


@pytest.mark.parametrize("makes_up", [True, False])
def test_a_delay_is_made_up_for_unless_a_rig_waits_at_the_other_end(makes_up):
    time = points(0.02, 0.4)
    pacer = Pacer(RealTime(makes_up=makes_up), time.tolist(), Interrupt())
    pacer.begin(())
    sleep(0.2)
    pacer.keep(1, ())
    begin = perf_counter()
    for k in range(2, 10):
        pacer.keep(k, ())
    passed = perf_counter() - begin
    if makes_up:
        assert passed < 0.02 + LATE
        assert pacer.statistics().missed >= 7
    else:
        assert passed >= 8 * 0.02 - 1e-4
    assert pacer.statistics().worst_lag >= 0.18
