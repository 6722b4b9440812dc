"""Claims: pending steps are waited for, warnings are counted, and saved states are released."""

from __future__ import annotations

import os
import signal
from contextlib import suppress

import pytest

from fmus.kit.errors import UserError
from orchestration.fmu.instance import Fmu
from orchestration.master import Stopped, run
from tests.support.command import ppy
from tests.support.master.failing import ERROR, FATAL, PENDING, TIME, WARNING, chain, ones
from tests.support.master.samples import build_member, ring


def test_warnings_are_counted_and_told(member):
    result = run(chain(member, status=WARNING, when=3.0), TIME, ones())
    assert result.complete
    assert result.notes[0].startswith("bad: 20 calls ended with a warning (I have had enough")


@pytest.mark.slow
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


@pytest.fixture
def saved(monkeypatch):
    """Names of the members of which a state is saved, by what they were asked for; fatal ones abort
    if asked.
    """
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
