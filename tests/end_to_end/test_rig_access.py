"""Claims: neither a web page nor a peer of another protocol stops, releases or connects anything at
a server; a key lets its holder do what its role says, until it is struck out; without keys one
login alone drives; and a change of client is no step.
"""

from __future__ import annotations

import itertools
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
import zmq

from fmus.rig_proxy import Link, LinkError, local_key
from orchestration.rig.endpoint import read_endpoint
from orchestration.rig.keys import add_client, make_keys
from orchestration.rig.operator import acknowledge, ask, stop
from tests.support.browser import chromium
from tests.support.command import here
from tests.support.rig.driver import INPUTS, OUTPUTS, Driver, refusal
from tests.support.rig.process import ROOT, Server
from tests.support.rig.raw_peer import (
    RawPeer,
    message,
    post,
    say,
    smuggled,
    version_1,
    version_2,
)

pytestmark = [pytest.mark.timeout(120), pytest.mark.real_time]

PORTS = range(3)  # requests, telemetry, operators
FETCH = """Promise.all(%s.map(([port, body]) => fetch(`http://127.0.0.1:${port}/`, {
  method: "POST", mode: "no-cors", body: new Uint8Array(body) }).then(() => 1, () => 0)))"""


def messages(latch: str, session: str) -> list[bytes]:
    """Every message of the protocol, each with what it would need to be carried out."""
    signals = {"inputs": INPUTS, "outputs": OUTPUTS}
    exchange = {"session": session, "sequence": 9, "sent": 0.0, "seen": time.monotonic()}
    return [
        message("acknowledge", latch=latch),
        message("connect", client="page", instance="page", time=0.0, **signals),
        message("exchange", time=0.0, step=0.1, values=[1.0, 1.0], **exchange),
        message("disconnect", session=session),
        message("stop", reason="page"),
        message("status"),
    ]


@pytest.mark.slow
def test_a_page_and_peers_of_other_protocols_reach_nothing(tmp_path):
    with Server(tmp_path) as server:
        remote = read_endpoint(server.wait_ready())
        port = int(server.endpoint.rpartition(":")[2])
        latch = stop(remote, "smoke")["latch"]
        before = [call.what for call in server.calls()]
        for body in messages(latch, ""):
            whole = [version_1(b"ppy-1", body), version_2(b"ppy-1", body), post(body)]
            for offset in PORTS:
                for data in [*whole, *map(post, smuggled(body))]:
                    assert not say(port + offset, data).endswith(b"<open>")
                if offset != 1:
                    with RawPeer(port + offset, b"") as peer:
                        peer.send(body)
                        assert peer.receive(0.05) is None
        told = ask(remote, "status")
        assert (told["latch"], told["state"], told["reason"]) == (latch, "safe", "stopped: smoke")
        assert [call.what for call in server.calls()] == before
        with RawPeer(port + 2, b"ppy-12") as peer:  # which has said its name
            peer.send(message("status"), message("status"))
            assert peer.receive(0.2) is None, "a message of two frames is none"
            assert peer.ask("status") == {
                **told,
                "clock": pytest.approx(told["clock"], abs=5.0),
            } | {"counts": pytest.approx(peer.ask("status")["counts"])}
        server.wait_line("a peer was turned away")
        server.wait_line("a peer without a name")


def test_a_page_in_a_browser_stops_and_releases_nothing(tmp_path, browser):
    """Its requests arrive: the server turns them away and counts them."""
    # beside a browser the driver may be late by the usual watchdog
    late = ["--watchdog", 2.0]
    with Server(tmp_path, "Logged", *late) as server, chromium(browser, tmp_path / "p") as tab:
        remote = read_endpoint(server.wait_ready())
        port = int(server.endpoint.rpartition(":")[2])
        driver = Driver(server.endpoint).start()
        session = driver._link.session
        attempts = [
            [port + offset, list(data)]
            for body in messages("", session)
            for offset in PORTS
            for data in (body, *smuggled(body))
        ]
        tab.open("about:blank", 800)
        tab.run(FETCH % json.dumps(attempts))
        driver.wait(10)
        told = ask(remote, "status")
        assert (told["state"], told["client"]) == ("running", "driver")
        until = time.monotonic() + 10.0
        # the browser has a few connections at a time, and tries each again that is reset
        while ask(remote, "status")["counts"]["turned away"] < 2 * len(messages("", "")):
            assert time.monotonic() < until
            time.sleep(0.1)
        latch = stop(remote, "smoke")["latch"]
        attempts = [
            [port + offset, list(data)]
            for offset in PORTS
            for data in smuggled(message("acknowledge", latch=latch))
        ]
        tab.run(FETCH % json.dumps(attempts))
        assert ask(remote, "status")["latch"] == latch
        driver.stop()


@pytest.fixture
def keys(tmp_path):
    """Return the key file of a server, and those of a client in each role, by role."""
    folder = tmp_path / "keys"
    server, boss = make_keys(folder)
    lab = add_client(folder, "lab", "command")
    page = add_client(folder, "page", "watch")
    return {"server": server, "acknowledge": boss, "command": lab, "watch": page}


def published(remote):
    """Return a message of telemetry."""
    with zmq.Context() as context, context.socket(zmq.SUB) as watcher:
        remote.connect(watcher, remote.telemetry)
        watcher.subscribe(b"")
        assert watcher.poll(5000)
        return json.loads(watcher.recv())


@pytest.mark.slow
def test_a_key_is_for_what_its_role_says_and_the_log_says_whose_it_was(tmp_path, keys):
    with Server(tmp_path, "Logged", "--keys", keys["server"]) as server:
        endpoint = server.wait_ready()
        not_to_connect = "the key of page is for watch, not for connect"
        assert not_to_connect in refusal(endpoint, keys["watch"], 5.0)
        driver = Driver(endpoint, credentials=keys["command"]).start()
        server.wait_line("client connected: driver, lab (command) at 127.0.0.1")
        watching = read_endpoint(endpoint, keys["watch"])
        assert ask(watching, "status")["state"] == "running"
        assert published(watching)["client"] == "driver"
        latch = stop(watching, "smoke")["latch"]
        server.wait_line("SAFE STATE: stopped: smoke (by page (watch) at 127.0.0.1)")
        for role, name in (("watch", "page"), ("command", "lab")):
            access = ("--endpoint", endpoint, "--credentials", keys[role])
            done = here("rig", "acknowledge", *access, "--latch", latch, cwd=tmp_path)
            assert done.returncode == 2
            assert f"the key of {name} is for" in done.stderr
        boss = read_endpoint(endpoint, keys["acknowledge"])
        assert acknowledge(boss, latch)["state"] == "idle"
        server.wait_line(f"latch {latch} acknowledged by first-client (acknowledge) at 127.0.0.1")
        driver.stop()
        for offset in (0, 2):  # who has no key
            with pytest.raises((OSError, AssertionError)):
                RawPeer(int(endpoint.rpartition(":")[2]) + offset)


@pytest.mark.slow
def test_a_key_that_is_struck_out_drives_no_more_and_a_new_one_needs_no_restart(tmp_path, keys):
    file = keys["server"]
    # the driver may be late on a busy machine
    with Server(tmp_path, "Logged", "--keys", file, "--watchdog", 2.0) as server:
        endpoint = server.wait_ready()
        boss = read_endpoint(endpoint, keys["acknowledge"])
        driver = Driver(endpoint, credentials=keys["command"]).start()
        whole = file.read_text()
        file.write_text("clients = [")
        server.wait_line("the keys read before hold on")
        driver.wait(10)
        file.write_text(whole)
        driver.wait(10)
        new = add_client(file.parent, "new")
        server.wait_line("let in new (command); shut out nobody")
        assert ask(read_endpoint(endpoint, new), "status")["operator"] == "lab"
        struck = time.monotonic()
        rows = file.read_text().splitlines()
        file.write_text("\n".join(row for row in rows if '"lab"' not in row))
        server.wait_line("client driver is shut out: the key of lab may not drive")
        assert time.monotonic() - struck < 3.0
        until = time.monotonic() + 5.0
        while not driver.errors:
            assert time.monotonic() < until
            time.sleep(0.01)
        assert "its key is none" in driver.errors[0]
        assert server.wait_call("safe", struck)
        told = ask(boss, "status")
        assert (told["state"], told["latch"]) == ("idle", "")
        driver.stop()
        assert refusal(endpoint, keys["command"], 1.0).startswith("no answer")
        with Driver(endpoint, credentials=new):
            assert ask(boss, "status")["operator"] == "new"


OTHER = """
import os, sys, zmq
from fmus.rig_proxy import Link, LinkError, local_key
from orchestration.rig import ask, read_endpoint
from tests.support.rig.driver import refusal
endpoint, latch = sys.argv[1:]
remote = read_endpoint(endpoint)
ask(remote, "status")  # all is imported
os.setgroups([])
os.setgid(65534)
os.setuid(65534)
assert not local_key.read(endpoint)
print(refusal(endpoint))
print(ask(remote, "stop", reason="another login")["latch"])
try:
    ask(remote, "acknowledge", latch=latch)
except Exception as error:
    print(error)
"""


def as_another_login(endpoint: str, latch: str) -> list[str]:
    """Return what another user of this machine gets, who knows where the key is."""
    if not hasattr(os, "geteuid") or os.geteuid() != 0:
        pytest.skip("only root can run a program as another user")
    command = [sys.executable, "-c", OTHER, endpoint, latch]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        command, env=environment, check=False, timeout=60, text=True, capture_output=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@pytest.mark.slow
def test_without_keys_the_user_drives_and_another_login_may_only_stop(tmp_path):
    late = ("--watchdog", 2.0)
    with Server(tmp_path, "Logged", *late) as server:
        endpoint = server.wait_ready()
        driver = Driver(endpoint).start()
        assert local_key.read(endpoint)
        refused, stopped, not_released = as_another_login(endpoint, "none")
        assert "connect needs the key of this server" in refused
        assert stopped == ask(read_endpoint(endpoint), "status")["latch"]
        assert "acknowledge needs the key of this server" in not_released
        server.wait_line("stopped: another login (by 127.0.0.1)")
        assert acknowledge(read_endpoint(endpoint), stopped)["state"] == "idle"
        driver.stop()
    assert not local_key.path(endpoint).exists()


def test_keys_can_be_given_up_which_the_log_says(tmp_path):
    begun = time.time()
    with Server(tmp_path, "Logged", "--no-keys") as server:
        endpoint = server.wait_ready()
        server.wait_line("WARNING: --no-keys: everybody on this machine may drive the rig")
        path = local_key.path(endpoint)
        # a server of another test that was killed may have left one of its port
        assert not path.exists() or path.stat().st_mtime < begun
        assert refusal(endpoint) == ""


@pytest.mark.slow
def test_a_change_of_client_is_no_step_and_the_watchdog_stays_armed(tmp_path):
    """The backend says what was written: only values between those of both clients."""
    first, second = [0.8, 1.0], [-0.4, 2.0]
    # the rig goes on for half a second at the most without a command
    with Server(tmp_path, "Logged", "--rate", 100, "--watchdog", 0.5) as server:
        endpoint = server.wait_ready()
        old = Link(endpoint, INPUTS, OUTPUTS, client="old")
        new = Link(endpoint, INPUTS, OUTPUTS, client="new", take_over=True)
        old.connect(0.0, 2.0)
        for k in range(30):
            old.exchange(first, 0.02 * k, 0.02, 0.5)
            time.sleep(0.02)
        with pytest.raises(LinkError, match="serves old"):
            new.connect(0.0, 2.0)
        begun = time.monotonic()
        assert old.hand_over(2.0)
        accepted = new.connect(0.0, 2.0)
        assert list(accepted["applied"].values()) == first
        for k in range(70):
            assert new.exchange(second, 0.02 * k, 0.02, 0.5)["refused"] == []
            time.sleep(0.02)
        with pytest.raises(LinkError, match="this session is over"):
            old.exchange(first, 0.0, 0.02, 1.0)
        written = [
            list(map(float, call.what.split()[1:]))
            for call in server.calls()
            if call.what.startswith("write") and call.time > begun
        ]
        shares = [(0.8 - current) / 1.2 for current, _ in written]
        assert shares == sorted(shares)
        assert [force - 1.0 for _, force in written] == pytest.approx(shares)
        assert max(b - a for a, b in itertools.pairwise(shares)) < 0.5
        assert (shares[0], shares[-1]) == pytest.approx((0.0, 1.0), abs=0.02)
        old.close()
        assert new.hand_over(2.0)
        third = Link(endpoint, INPUTS, OUTPUTS, client="third", take_over=True)
        third.connect(0.0, 2.0)  # and says nothing
        server.wait_line("SAFE STATE: no fresh command for 0.5 s", 5.0)
        for link in (new, third):
            link.close()


def test_the_log_is_opened_to_be_added_to(tmp_path):
    with Server(tmp_path, "Logged", "--log", tmp_path / "rig.log") as server:
        server.wait_ready()
        flags = []
        for link in Path("/proc", str(server.process.pid), "fd").glob("*"):
            if os.path.realpath(link) == str(tmp_path / "rig.log"):
                text = (link.parents[1] / "fdinfo" / link.name).read_text()
                flags.append(int(text.split("flags:")[1].split()[0], 8))
    if sys.platform == "linux":
        # its thread may still be reading what an earlier server wrote
        writing = [flag for flag in flags if flag & os.O_ACCMODE == os.O_WRONLY]
        assert len(writing) == 1
        assert writing[0] & os.O_APPEND
