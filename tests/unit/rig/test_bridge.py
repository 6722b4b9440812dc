"""Bridge: plain clients reach a server with keys, each by itself, and nothing late or too large."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
import zmq

from fmus.rig_proxy import local_key
from orchestration.rig.bridge import Bridge
from orchestration.rig.endpoint import read_endpoint
from orchestration.rig.keys import add_client, make_keys
from orchestration.rig.operator import acknowledge, stop
from tests.support.command import refused
from tests.support.rig.raw_peer import RawPeer, message, post, say, version_1, version_2
from tests.support.rig.small_rig import SmallRig, free_port, small_rig_process

pytestmark = pytest.mark.real_time

PATIENCE = 10.0  # s, for what takes milliseconds on an idle machine


@pytest.fixture
def keys(tmp_path):
    return make_keys(tmp_path / "keys")


@pytest.fixture
def plain():
    """Return a function that makes clients without keys."""
    context, clients = zmq.Context(), []

    def client(port, name=None):
        clients.append(Client(context, port, name or f"client-{len(clients)}".encode()))
        return clients[-1]

    yield client
    context.destroy(linger=0)


class Client:
    def __init__(self, context, port, name):
        self.socket = context.socket(zmq.DEALER)
        self.socket.linger = 0
        self.socket.routing_id = name
        self.key = local_key.read(f"tcp://127.0.0.1:{port}")
        self.socket.connect(f"tcp://127.0.0.1:{port}")

    def send(self, kind, **fields):
        fields["key"] = self.key
        self.socket.send(json.dumps({"ppy": 2, "type": kind, **fields}).encode())

    def answer(self, within=PATIENCE):
        return json.loads(self.socket.recv()) if self.socket.poll(1000 * within) else None

    def ask(self, kind, within=PATIENCE, **fields):
        self.send(kind, **fields)
        return self.answer(within)

    def ask_until_answered(self, kind, **fields):
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            if (answer := self.ask(kind, 0.5, **fields)) is not None:
                return answer
        raise AssertionError("no answer")


class Carrying:
    """The command ``ppy rig bridge`` in a process of its own."""

    def __init__(self, server_port, client_file, port=None):
        self.port = free_port() if port is None else port
        command = [
            sys.executable,
            "-m",
            "orchestration.cli",
            "rig",
            "bridge",
            "--port",
            str(self.port),
        ]
        command += [
            "--endpoint",
            f"tcp://127.0.0.1:{server_port}",
            "--credentials",
            str(client_file),
        ]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True)

    def __enter__(self):
        if "is carried on to" not in self.process.stdout.readline():
            self.process.kill()
            raise AssertionError(self.process.communicate()[1])
        return self

    def __exit__(self, *error):
        self.process.kill()
        self.process.communicate()


CONNECT = {
    "instance": "0123456789abcdef",
    "inputs": {"current": "A", "force": "N"},
    "outputs": {"voltage": "V", "displacement": "m"},
    "time": 0.0,
}


def exchange(client, session, sequence, current):
    return client.ask(
        "exchange",
        session=session,
        sequence=sequence,
        sent=0.0,
        seen=0.0,
        time=0.0,
        step=0.1,
        values=[current, 0.0],
    )


def test_a_plain_client_reaches_a_server_with_keys(keys, plain):
    server_file, client_file = keys
    with SmallRig(keys=server_file) as rig, Carrying(rig.port, client_file) as bridge:
        client = plain(bridge.port)
        accepted = client.ask("connect", client="plain", **CONNECT)
        assert accepted["type"] == "accepted"
        for sequence in range(1, 30):
            sample = exchange(client, accepted["session"], sequence, 0.01 * sequence)
            assert (sample["type"], sample["sequence"], sample["refused"]) == (
                "sample",
                sequence,
                [],
            )
        assert client.ask("disconnect", session=accepted["session"]) == {
            "ppy": 2,
            "type": "disconnected",
        }
        assert [m["values"][0] for m in rig.of_type("exchange")] == [0.01 * k for k in range(1, 30)]


def test_who_does_not_know_the_bridges_key_may_watch_and_stop(keys, plain):
    with SmallRig(keys=keys[0]) as rig, Carrying(rig.port, keys[1]) as bridge:
        stranger, operator = plain(bridge.port), plain(bridge.port + 2)
        for key in ("", "guess"):
            stranger.key = operator.key = key
            assert "key" in stranger.ask("connect", client="plain", **CONNECT)["reason"]
            assert "key" in operator.ask("acknowledge", latch="")["reason"]
        stranger.key = operator.key = ""
        assert stranger.ask("status")["type"] == "status"
        assert operator.ask("stop", reason="smoke")["latch"] == rig.latch
        assert {message["type"] for message in rig.heard} == {"status", "stop"}


def test_without_the_bridge_it_gets_nothing(keys, plain):
    with SmallRig(keys=keys[0]) as rig:
        assert plain(rig.port).ask("status", 0.5) is None
        assert rig.heard == []


def test_a_key_that_the_server_does_not_know_gets_nothing(keys, plain, tmp_path):
    stranger = add_client(keys[0].parent, "stranger")
    old = tmp_path / "old.toml"  # the server's file without the stranger
    lines = keys[0].read_text().splitlines()
    old.write_text("\n".join(line for line in lines if "stranger" not in line))
    with SmallRig(keys=old) as rig, Carrying(rig.port, stranger) as bridge:
        assert plain(bridge.port).ask("status", 1.0) is None
        assert rig.heard == []
        assert "do not match" in bridge.process.stderr.readline()


def test_clients_are_told_apart(keys, plain):
    with SmallRig(keys=keys[0]) as rig, Carrying(rig.port, keys[1]) as bridge:
        clients = [plain(bridge.port) for _ in range(5)]
        accepted = clients[0].ask("connect", client="first", **CONNECT)
        for client in clients[1:]:
            client.send("status")
        sample = exchange(clients[0], accepted["session"], 1, 0.1)
        assert sample["type"] == "sample"
        assert [client.answer()["type"] for client in clients[1:]] == ["status"] * 4
        for client in clients:  # one answer each, and no more
            assert client.answer(0.05) is None


def test_an_operator_is_carried_to_the_operators_socket(keys):
    with SmallRig(keys=keys[0]) as rig, Carrying(rig.port, keys[1]) as bridge:
        remote = read_endpoint(f"tcp://127.0.0.1:{bridge.port}")
        latch = stop(remote, "smoke", PATIENCE)["latch"]
        assert latch == rig.latch
        assert acknowledge(remote, latch, PATIENCE)["state"] == "idle"


@pytest.mark.parametrize("offset", [0, 2], ids=["requests", "operators"])
def test_what_is_no_client_of_the_protocol_reaches_no_server(keys, plain, offset):
    """A page in a browser, peers of old versions, and a peer that has not said its name."""
    with SmallRig(keys=keys[0]) as rig, Carrying(rig.port, keys[1]) as bridge:
        port = bridge.port + offset
        for kind, fields in {
            "stop": {"reason": "page"},
            "acknowledge": {"latch": ""},
            "connect": {"client": "page", **CONNECT},
            "status": {},
        }.items():
            body = message(kind, **fields)
            for data in (post(body), version_1(b"ppy-1", body), version_2(b"ppy-1", body)):
                assert not say(port, data).endswith(b"<open>")
        with RawPeer(port, b"") as peer:
            peer.send(message("stop", reason="unnamed"))
            assert peer.receive(0.5) is None
        assert rig.heard == []
        assert plain(port).ask("status")["type"] == "status"


def test_telemetry_is_carried_too(keys):
    with (
        SmallRig(keys=keys[0]) as rig,
        Carrying(rig.port, keys[1]) as bridge,
        zmq.Context() as context,
    ):
        watcher = context.socket(zmq.SUB)
        watcher.linger = 0
        watcher.connect(f"tcp://127.0.0.1:{bridge.port + 1}")
        watcher.subscribe(b"")
        assert watcher.poll(1000 * PATIENCE)
        message = json.loads(watcher.recv())
        watcher.close()
    assert (message["type"], message["inputs"]) == ("telemetry", {"current": 0.0, "force": 0.0})


def test_frames_that_the_protocol_does_not_allow_are_dropped(keys, plain):
    with SmallRig(keys=keys[0]) as rig, Carrying(rig.port, keys[1]) as bridge:
        client, other = plain(bridge.port), plain(bridge.port)
        assert client.ask("status")["type"] == other.ask("status")["type"] == "status"
        padding = "x" * 65536
        client.send("stop", reason=padding)
        client.socket.send_multipart([b"{}", b'{"ppy": 2, "type": "stop", "reason": ""}'])
        assert other.ask("status")["type"] == "status"
        assert client.ask_until_answered("status")["type"] == "status"
        assert {message["type"] for message in rig.heard} == {"status"}


def test_a_server_that_dies_is_answered_by_nobody_and_found_again(keys, plain):
    port = free_port()
    with small_rig_process(port, keys[0]) as server, Carrying(port, keys[1]) as bridge:
        client = plain(bridge.port)
        assert client.ask("status")["type"] == "status"
        server.kill()
        server.wait()
        for _ in range(50):
            assert client.ask("stop", 0.01, reason="too late") is None
        time.sleep(1.2)  # longer than anything waits for a server
        with SmallRig(port, keys=keys[0]) as again:
            assert client.ask_until_answered("status")["state"] == "idle"
            assert again.of_type("stop") == []  # nothing old arrived


def test_more_clients_than_connections_only_cost_the_silent_ones(keys, plain):
    with SmallRig(keys=keys[0]) as rig, Carrying(rig.port, keys[1]) as bridge:
        clients = [plain(bridge.port) for _ in range(40)]
        for client in clients:
            assert client.ask("status")["type"] == "status"
            assert clients[-1].ask("status")["type"] == "status"
        assert clients[0].ask("status")["type"] == "status"  # its connection is made anew


@pytest.mark.skipif(os.name == "nt", reason="signals as POSIX has them")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("served", [True, False])
def test_it_ends_at_once(keys, plain, number, served):
    with (
        SmallRig(keys=keys[0]) as rig,
        Carrying(rig.port if served else free_port(), keys[1]) as bridge,
    ):
        client = plain(bridge.port)
        for _ in range(20):
            client.send("status")
        time.sleep(0.3)
        began = time.monotonic()
        bridge.process.send_signal(number)
        _, complaints = bridge.process.communicate(timeout=PATIENCE)
        assert (
            time.monotonic() - began < 3.0
        )  # at once, and what a loaded machine takes to end Python
        assert bridge.process.returncode == 0
        assert "Traceback" not in complaints


def test_a_port_that_is_taken(keys, tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        line = refused(
            tmp_path,
            "rig",
            "bridge",
            "--endpoint",
            "tcp://127.0.0.1:5999",
            "--credentials",
            keys[1],
            "--port",
            min(port, 65534),
        )
        assert str(port) in line
        assert "--port" in line


@pytest.mark.parametrize(
    "text",
    ["127.0.0.1:5570", "udp://127.0.0.1:5570", "tcp://127.0.0.1", "tcp://h:0", "tcp://h:65535"],
)
def test_endpoints_that_are_none(keys, tmp_path, text):
    line = refused(tmp_path, "rig", "bridge", "--endpoint", text, "--credentials", keys[1])
    assert text in line
    assert "tcp://HOST:PORT" in line


def test_only_the_loopback_address_listens(keys):
    """The kernel lists the sockets that listen."""
    port = free_port()
    bridge = Bridge(read_endpoint("tcp://127.0.0.1:5999", keys[1]), port)
    try:
        rows = [
            row.split()
            for table in ("tcp", "tcp6")
            for row in Path("/proc/net", table).read_text().splitlines()
        ]
    except FileNotFoundError:
        pytest.skip("no /proc/net/tcp here")
    finally:
        bridge.close()
    local = [row[1] for row in rows if row[3] == "0A"]
    ports = range(port, port + 3)
    ours = [address for address in local if int(address.rsplit(":")[1], 16) in ports]
    assert sorted(ours) == sorted(f"0100007F:{p:04X}" for p in ports)
