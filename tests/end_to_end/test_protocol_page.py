"""Claims: the client in C on the page of the protocol compiles without a warning, commands and
stops our server, and understands all that ZeroMQ may send it.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import threading
from pathlib import Path

import pytest
import zmq

from fmus.kit.build.toolchain import find_compiler, host_platform
from fmus.rig_proxy import local_key
from orchestration.rig.endpoint import read_endpoint
from orchestration.rig.operator import ask
from tests.support.rig.process import ROOT, Server

pytestmark = [
    pytest.mark.timeout(120),
    pytest.mark.real_time,
    pytest.mark.skipif(os.name == "nt", reason="the sample is for POSIX sockets"),
]

STRICT = ("-std=c99", "-D_POSIX_C_SOURCE=200809L", "-Wall", "-Wextra", "-Werror")
SANITIZED = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    """The program of the page."""
    page = (ROOT / "docs/reference/protocol.md").read_text(encoding="utf-8")
    (source,) = re.findall(r"```c\n(.*?)```", page, re.S)
    folder = tmp_path_factory.mktemp("client")
    (folder / "client.c").write_text(source)
    gcc = shutil.which("gcc")
    command = [gcc, *SANITIZED] if gcc else [*find_compiler(host_platform()).command, "-O1"]
    program = folder / "client"
    subprocess.run([*command, *STRICT, folder / "client.c", "-o", program], check=True)
    return program


def run(program: Path, port: int) -> subprocess.CompletedProcess[str]:
    key = local_key.path(f"tcp://127.0.0.1:{port}")
    command = [program, "127.0.0.1", str(port), *([key] if key.exists() else [])]
    return subprocess.run(command, capture_output=True, text=True, timeout=30)


@pytest.mark.slow
def test_it_commands_and_stops_our_server(client, tmp_path):
    with Server(tmp_path) as server:
        port = int(server.wait_ready().rpartition(":")[2])
        done = run(client, port)
        assert (done.returncode, done.stderr) == (0, "")
        sample, status = map(json.loads, done.stdout.splitlines())
        assert (sample["sequence"], sample["values"], sample["refused"]) == (50, [0.0], [])
        assert status["reason"] == "stopped: the end of the example"
        told = ask(read_endpoint(server.endpoint), "status")
        assert told["latch"] == status["latch"] != ""
        assert told["counts"]["malformed"] == told["counts"]["turned away"] == 0
        server.wait_line("client connected: C, ")
        assert "write 0.0 0.0" in {call.what for call in server.calls()}
        again = run(client, port)
        assert again.returncode == 1
        assert "stopped: the end of the example" in again.stderr


def test_messages_of_several_frames_and_questions_whether_it_is_there_do_not_confuse_it(client):
    """A server that sends three frames, a long frame and PINGs before each answer."""
    with zmq.Context() as context, context.socket(zmq.ROUTER) as router:
        router.linger = 0
        router.heartbeat_ivl, router.heartbeat_timeout = 5, 5000
        router.setsockopt(zmq.HEARTBEAT_TTL, 1000)
        port = router.bind_to_random_port("tcp://127.0.0.1")
        names = []

        def serve():
            for number in range(52):
                if not router.poll(10_000):
                    return
                name, _ = router.recv_multipart()
                names.append(name)
                kind = {0: "accepted", 51: "status"}.get(number, "sample")
                answer = {"ppy": 2, "type": kind, "session": "abc", "padding": "x" * 300}
                answer |= {"clock": 5.0, "state": "running", "sequence": number}
                router.send_multipart([name, b"one", b"{}", b"y" * 1000])
                router.send_multipart([name, json.dumps(answer).encode()])

        thread = threading.Thread(target=serve)
        thread.start()
        done = run(client, port)
        thread.join()
    assert (done.returncode, done.stderr) == (0, "")
    assert len(names) == 52
    assert len(set(names)) == 1
    assert re.fullmatch(rb"ppy-[0-9a-f]{16}", names[0])
    assert json.loads(done.stdout.splitlines()[1])["sequence"] == 51


def test_a_server_that_is_not_there_or_does_not_answer_is_told(client):
    with zmq.Context() as context, context.socket(zmq.ROUTER) as router:
        port = router.bind_to_random_port("tcp://127.0.0.1")
        silent = run(client, port)
        router.unbind(router.last_endpoint)
        gone = run(client, port)
    assert (silent.returncode, silent.stderr) == (1, "no answer\n")
    assert (gone.returncode, gone.stderr) == (1, "nobody there\n")
