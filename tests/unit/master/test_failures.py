"""The master and members that misbehave: told with component, time and their own words, never passed over."""

from __future__ import annotations

import os
import signal
from contextlib import suppress

import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration.fmu.instance import Fmu
from orchestration.master import Stopped, run
from orchestration.master.step_control import StepDoubling
from tests.support.command import ppy
from tests.support.master.samples import build_member, ring

H = 0.1
TIME = H * np.arange(51)
OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)


@pytest.fixture(scope="module")
def member(tmp_path_factory):
    return build_member(tmp_path_factory.mktemp("member"))


def chain(fmu, **bad):
    return ring(fmu, {"good": {}, "bad": bad}, "good.x -> bad.u", u="good.u")


def ones(points=TIME.size):
    return {"u": np.ones(points)}


@pytest.mark.parametrize(
    "options", [{}, {"method": "jacobi"}, {"extrapolation": 1}, {"rates": {"bad": 3}}]
)
@pytest.mark.parametrize(
    ("status", "told"),
    [
        (
            DISCARD,
            "failed (discard, it reached 3 s, it asks to end the simulation): I have had enough",
        ),
        (ERROR, "failed (error): I have had enough"),
        (FATAL, "failed (fatal): I have had enough"),
    ],
)
def test_a_step_that_fails_stops_the_run(member, status, told, options):
    with pytest.raises(Stopped) as caught:
        run(chain(member, status=status, when=3.0), TIME, ones(), **options)
    end = "3.033333333" if "rates" in options else "3.1"
    assert str(caught.value) == f"bad: member.fmu: step from 3 s to {end} s {told}"
    partial = caught.value.run
    assert not partial.complete
    assert partial.message == str(caught.value)
    assert partial.time.tolist() == TIME[:31].tolist()
    assert {values.shape for values in partial.signals.values()} == {(31,)}
    assert partial.signals["good.x"] == pytest.approx(-np.expm1(-TIME[:31]), abs=1e-13)


def test_a_slow_member_fails_in_a_step_of_its_own(member):
    with pytest.raises(Stopped) as caught:
        run(chain(member, status=ERROR, when=2.8), TIME, ones(), rates={"bad": 0.25})
    assert (
        str(caught.value)
        == "bad: member.fmu: step from 2.8 s to 3.2 s failed (error): I have had enough"
    )
    assert caught.value.run.time[-1] == TIME[31]


@pytest.mark.parametrize("options", [{}, {"rates": {"bad": 2}}, {"rates": {"bad": 0.5}}])
def test_warnings_of_the_initialization_are_counted_too(member, options):
    result = run(chain(member, init=WARNING), TIME, ones(), **options)
    assert result.notes == ("bad: 1 calls ended with a warning (I do not want to begin)",)


def test_warnings_are_counted_and_told(member):
    result = run(chain(member, status=WARNING, when=3.0), TIME, ones())
    assert result.complete
    assert result.notes[0].startswith("bad: 20 calls ended with a warning (I have had enough")


def test_warnings_of_one_fmu_alone_are_told_too(member, tmp_path):
    done = ppy(
        "simulate",
        member,
        "--set",
        f"status={WARNING}",
        "--set",
        "when=3",
        "--stop",
        "5s",
        "--step",
        "0.1s",
        cwd=tmp_path,
    )
    assert done.returncode == 0
    assert "20 calls ended with a warning (I have had enough" in " ".join(done.stderr.split())


def test_a_step_that_is_pending_is_waited_for(tmp_path, member):
    waits = build_member(tmp_path, canRunAsynchronuously=True)
    result = run(chain({"good": member, "bad": waits}, status=PENDING, when=0.0), TIME[:6], ones(6))
    expected = run(chain(member), TIME[:6], ones(6))
    assert result.complete
    assert result.signals["bad.x"].tolist() == expected.signals["bad.x"].tolist()


def test_a_pending_step_of_one_that_is_not_allowed_to(member):
    with pytest.raises(
        Stopped, match=r"bad: member.fmu: step from 0 s to 0.1 s failed \(pending\)"
    ):
        run(chain(member, status=PENDING, when=0.0), TIME, ones())


def test_what_is_no_number_is_not_passed_on(member):
    system = ring(
        member, {"bad": {"nan": 1.0, "when": 3.0}, "good": {}}, "bad.y -> good.u", u="bad.u"
    )
    with pytest.raises(Stopped, match=r"^bad: its output y is nan at 3 s$") as caught:
        run(system, TIME, ones())
    assert caught.value.run.time[-1] == TIME[29]


@pytest.mark.parametrize("options", [{}, {"tolerance": 1e-3}])
def test_what_is_only_recorded_may_be_no_number(member, options):
    """y of bad is passed on to nobody; x is as without it."""
    found, plain = (
        run(chain(member, nan=nan, when=3.0), TIME, ones(), **options).signals for nan in (1.0, 0.0)
    )
    assert np.isnan(found["bad.y"]).tolist() == (TIME > 3.0 - 1e-9).tolist()
    assert found["bad.x"].tolist() == plain["bad.x"].tolist()


def test_a_member_that_fails_in_initialization(member, scratch):
    with pytest.raises(
        UserError, match=r"^bad: member.fmu: initialization failed: I do not want to begin$"
    ):
        run(chain(member, init=ERROR), TIME, ones())
    assert list(scratch.iterdir()) == []


def test_why_it_does_not_begin_matters_more_than_what_follows_from_it(member):
    """Values that are no number during initialization come from parameters that are refused at its end."""
    system = ring(
        member,
        {"bad": {"nan": 1.0, "when": -1.0, "init": ERROR}, "good": {}},
        "bad.y -> good.u",
        u="bad.u",
    )
    with pytest.raises(
        UserError, match=r"^bad: member\.fmu: initialization failed: I do not want to begin$"
    ):
        run(system, TIME, ones())


def test_a_member_that_did_not_get_to_the_end(member):
    with pytest.raises(Stopped, match=r"^bad: says that it is at 4.9 s at the end, 5 s$") as caught:
        run(chain(member, lag=0.1), TIME, ones())
    assert not caught.value.run.complete


@pytest.mark.parametrize("how", ["key", "exception"])
def test_ctrl_c_leaves_what_was_computed(member, how):
    """As a signal, which is heard after the step; and as the exception, wherever it comes from."""
    before = signal.getsignal(signal.SIGINT)

    def press(done):
        if done >= 20:
            if how == "exception":
                raise KeyboardInterrupt
            os.kill(os.getpid(), signal.SIGINT)
            undisturbed.append(done)

    undisturbed = []
    result = run(chain(member), TIME, ones(), progress=press)
    assert undisturbed == ([20] if how == "key" else [])
    assert not result.complete
    assert result.message.startswith("interrupted at ")
    assert result.message.endswith("of 5 s")
    expected = run(chain(member), TIME, ones())
    count = result.time.size
    assert 20 <= count <= 21
    assert result.signals["bad.x"].tolist() == expected.signals["bad.x"][:count].tolist()
    assert signal.getsignal(signal.SIGINT) is before


def test_ctrl_c_is_heard_between_the_steps_that_a_tolerance_demands(member, monkeypatch):
    """One step of the system in thousands of its own: it does not go on to the end."""
    plain, times = StepDoubling._step, []

    def step(adaptive, start, end, k):
        plain(adaptive, start, end, k)
        times.append(end)
        if len(times) == 30:
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(StepDoubling, "_step", step)
    system = ring(member, {"a": {"start": 1.0}, "b": {}}, "a.x -> b.u; b.x -> -1 a.u")
    result = run(system, TIME[[0, 50]], tolerance=1e-8)
    assert len(times) <= 32
    assert (result.time.tolist(), result.complete) == ([0.0], False)
    assert result.message == "interrupted at 0 s of 5 s"
    assert result.signals["a.x"].tolist() == [1.0]


# --- saved states ---------------------------------------------------------------------------------------------------


@pytest.fixture
def saved(monkeypatch):
    """Names of the members of which a state is saved, by what they were asked for; fatal ones abort if asked."""
    there, plain = [], Fmu.bound

    def bound(fmu, function, *arguments):
        call = plain(fmu, function, *arguments)
        if function not in ("fmi2GetFMUstate", "fmi2FreeFMUstate"):
            return call
        state = arguments[0]._obj

        def counted():
            before, status = bool(state), call()
            if bool(state) != before:
                (there.remove if before else there.append)(fmu.name)
            return status

        return counted

    monkeypatch.setattr(Fmu, "bound", bound)
    return there


LOOP = "good.y -> bad.u; bad.y -> -1 good.u + 1"


@pytest.mark.parametrize(
    ("wires", "options"), [(LOOP, {}), ("good.x -> bad.u; bad.x -> good.u", {"tolerance": 1e-3})]
)
@pytest.mark.parametrize(
    ("bad", "left"),
    [
        ({}, []),
        ({"status": ERROR, "when": 3.0}, []),
        ({"status": FATAL, "when": 3.0}, ["bad"]),
        ({"init": ERROR}, []),
        ({"lag": 0.1}, []),
        ("key", []),
        ("exception", []),
    ],
    ids=["end", "error", "fatal", "init", "not there", "key", "exception"],
)
def test_saved_states_are_released(member, saved, wires, options, bad, left):
    seen = []

    def progress(done):
        seen.extend(saved)
        if done == 20 and bad == "key":
            os.kill(os.getpid(), signal.SIGINT)
        if done == 20 and bad == "exception":
            raise KeyboardInterrupt

    of_bad = {"d": 0.5} | (bad if isinstance(bad, dict) else {})
    system = ring(member, {"good": {"d": 0.5}, "bad": of_bad}, wires)
    with suppress(UserError):
        run(system, TIME, progress=progress, **options)
    assert ({"good", "bad"} <= set(seen)) == ("init" not in of_bad)
    assert saved == left


def test_ctrl_c_at_the_very_end_leaves_nothing_unchecked(member):
    def press(done):
        if done == TIME.size:
            raise KeyboardInterrupt

    result = run(chain(member), TIME, ones(), progress=press)
    assert (result.time.size, result.complete, result.message) == (
        TIME.size,
        False,
        "interrupted at 5 s of 5 s",
    )


def test_progress_and_statistics(member):
    told = []
    result = run(chain(member), TIME, ones(), progress=told.append)
    assert told == sorted(told)
    assert told[-1] == TIME.size
    statistics = result.statistics
    assert statistics.steps == 50
    assert statistics.rollbacks == statistics.evaluations == 0
    for spent in statistics.components.values():
        assert spent.steps == 50
        assert 0.0 < spent.seconds < statistics.wall
        assert spent.share == pytest.approx(spent.seconds / statistics.wall)
    assert sum(spent.share for spent in statistics.components.values()) < 1.0


def test_an_fmu_is_unzipped_once_and_removed(member, scratch):
    seen = []

    def count(done):
        seen.append(sum(path.is_dir() for path in scratch.iterdir()))

    run(chain(member), TIME, ones(), progress=count)
    assert set(seen) == {1}
    assert list(scratch.iterdir()) == []


def test_an_fmu_that_runs_once_only(tmp_path):
    fmu = build_member(tmp_path, canBeInstantiatedOnlyOncePerProcess=True)
    with pytest.raises(
        UserError,
        match=r"^bad: member.fmu can run once only \(canBeInstantiatedOnlyOncePerProcess\)$",
    ):
        run(chain(fmu), TIME, ones())
