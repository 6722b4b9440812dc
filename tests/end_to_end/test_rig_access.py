"""Claims: neither a web page nor a peer of another protocol stops, releases or connects anything at
a server, and a key lets its holder do what its role says.
"""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path

import pytest
import zmq

from orchestration.rig.endpoint import read_endpoint
from orchestration.rig.keys import add_client, make_keys
from orchestration.rig.operator import acknowledge, ask, stop
from tests.support.browser import chromium
from tests.support.command import here
from tests.support.rig.driver import INPUTS, OUTPUTS, Driver, refusal
from tests.support.rig.process import Server
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


def test_the_log_is_opened_to_be_added_to(tmp_path):
    with Server(tmp_path, "Logged", "--log", tmp_path / "rig.log") as server:
        server.wait_ready()
        flags = []
        for link in Path("/proc", str(server.process.pid), "fd").glob("*"):
            if os.path.realpath(link) == str(tmp_path / "rig.log"):
                text = (link.parents[1] / "fdinfo" / link.name).read_text()
                flags.append(int(text.split("flags:")[1].split()[0], 8))
    if sys.platform == "linux":
        assert len(flags) == 1
        assert flags[0] & os.O_APPEND
