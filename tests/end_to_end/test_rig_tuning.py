"""Claims: a run in real time is tuned from a terminal and from the page of ``ppy rig watch``, over
sockets and between processes, and its result has what was done.
"""

from __future__ import annotations

import http.client
import json
import re
import signal
import time
from contextlib import contextmanager

import numpy as np
import pytest

from orchestration.experiment import results
from orchestration.rig.server import verify
from tests.support.browser import chromium
from tests.support.command import posix, refused, running, works
from tests.support.rig.small_rig import SmallRig

pytestmark = [pytest.mark.slow, posix]

PATIENCE = 45.0  # s, for what takes milliseconds on an idle machine
EXPERIMENT = """
component = "ppy_actuator"
duration = "300 s"
step = "0.05 s"
record = ["force_margin"]
inputs.current = 0
inputs.force = "0.5 N"
"""


def until(condition):
    began = time.monotonic()
    while not (found := condition()):
        assert time.monotonic() - began < PATIENCE
        time.sleep(0.05)
    return found


@contextmanager
def process(*arguments, cwd):
    """A command in a process of its own."""
    started = running(*arguments, cwd=cwd)
    try:
        yield started
    finally:
        started.kill()
        started.wait()
        started.stdout.close()
        started.stderr.close()


@contextmanager
def tuned_run(folder):
    """A run whose limit can be moved, and its address."""
    (folder / "run.toml").write_text(EXPERIMENT)
    arguments = ("--real-time", "--lag", "60s", "--tunable", "force_limit", "--tuning-port", "0")
    with process("run", "run.toml", *arguments, "--out", "run.nc", cwd=folder) as run:
        while not (found := re.search(r"--run (tcp://\S+)", run.stderr.readline())):
            pass
        until(lambda: (folder / "run.nc.part.csv").exists())
        run.address = found[1]
        yield run


def finish(run, folder):
    """Interrupt a run, and return its result."""
    run.send_signal(signal.SIGINT)
    run.wait(PATIENCE)
    return results.read(folder / "run.nc")


def expect_the_ramp(found, slew):
    """Check the closed form: from 3 N down to 1.5 N at a slew rate, and what is left of it."""
    (change,) = json.loads(found.attrs["tuning"])
    assert (change["name"], change["old"], change["new"]) == ("force_limit", 3.0, 1.5)
    assert change["slew"] == pytest.approx(slew)
    since = np.clip(found.time.values - change["time"], 0.0, None)
    expected = 3.0 - np.clip(slew * since, 0.0, 1.5)
    np.testing.assert_allclose(found.force_limit.values, expected, atol=1e-9)
    np.testing.assert_allclose(found.force_margin.values, expected - 0.5, atol=1e-9)
    assert found.force_limit.values[-1] < 1.7  # what a client sees is the next point's


def test_from_a_terminal(tmp_path):
    with tuned_run(tmp_path) as run:
        tune = ("rig", "tune", "--run", run.address)
        until(lambda: "force_limit  3 " in works(*tune, cwd=tmp_path))
        assert "allowed is 0" in refused(tmp_path, *tune, "force_limit=-1")
        assert "did you mean force_limit" in refused(tmp_path, *tune, "force_limt=1")
        works(*tune, "force_limit=1500mN@3N/s", cwd=tmp_path)
        until(lambda: "force_limit  1.5    1.5" in works(*tune, cwd=tmp_path))
        found = finish(run, tmp_path)
    expect_the_ramp(found, 3.0)
    log = tmp_path / "run.nc.tuning.log"
    assert "force_limit from 3 N to 1.5 N, 3 per s" in log.read_text()
    assert verify([log]) == 2


CARD = "document.querySelector('[data-parameter=force_limit]')"


def test_from_the_page(tmp_path, browser):
    with (
        SmallRig() as rig,
        tuned_run(tmp_path) as run,
        process(
            *("rig", "watch", "--no-browser", "--port", "0", "--endpoint", rig.endpoint),
            *("--run", run.address),
            cwd=tmp_path,
        ) as watch,
        chromium(browser, tmp_path / "profile") as tab,
    ):
        address = re.search(r"at (http://\S+)", watch.stdout.readline())[1]
        key = re.search(rf"{re.escape(address)}#(\S+)", watch.stdout.readline())[1]

        def shown(part):
            return tab.run(f"{CARD}?.querySelector({part!r}).textContent")

        tab.open(address, 1280)  # as anybody on this machine can
        until(lambda: shown(".number") == "3 N")
        assert tab.run(f"{CARD}.querySelector('button').disabled") is True
        assert "in its terminal" in tab.run("document.getElementById('tuning-hint').textContent")
        assert post(address, tab, {"X-Rig-Key": "guessed"}) == 403

        tab.open("about:blank", 1280)  # a fragment alone loads nothing
        tab.open(f"{address}#{key}", 1280)
        until(lambda: shown(".number") == "3 N")
        enter(tab, "-1", "")
        until(lambda: "allowed is 0" in shown(".said"))
        enter(tab, "a lot", "")
        assert shown(".said") == "a number is needed"
        enter(tab, "1.5", "3")
        until(lambda: shown(".said") == "taken")
        until(lambda: shown(".number") == "1.5 N")
        events = tab.run("document.getElementById('events').textContent")
        assert "force_limit moves to 1.5" in events
        found = finish(run, tmp_path)
        until(lambda: tab.run("document.getElementById('tuning').hidden"))
    expect_the_ramp(found, 3.0)


def enter(tab, value, slew):
    """Type into the two fields of the parameter, and press its button."""
    tab.run(
        f"""(card => {{ const [value, slew] = card.querySelectorAll("input");
          value.value = {value!r}; slew.value = {slew!r};
          card.querySelector("button").click(); }})({CARD})"""
    )


def post(address, tab, headers):
    """Ask to move the parameter as a program of another user of this machine could."""
    token = tab.run("document.querySelector('meta[name=rig-token]').content")
    host = address.removeprefix("http://").rstrip("/")
    connection = http.client.HTTPConnection(host, timeout=10)
    body = json.dumps({"name": "force_limit", "value": 1, "slew": None})
    connection.request("POST", "/tune", body, {"X-Rig-Token": token, **headers})
    status = connection.getresponse().status
    connection.close()
    return status
