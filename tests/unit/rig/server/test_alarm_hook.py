"""Claims: a program or an address gets each alarm once, as JSON; what fails or hangs is said, and
delays nobody.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from orchestration.rig.server import alarm_hook as module
from orchestration.rig.server.alarm_hook import AlarmHook
from tests.support.command import posix

ALARM = {"source": "force", "severity": "MINOR", "text": "force 3 N is above 2.5 N"}


def wait(condition, patience=10.0):
    until = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.01)


@posix
def test_a_program_gets_each_alarm_as_its_argument(tmp_path):
    program = tmp_path / "hook"
    said = tmp_path / "said"
    body = f"import sys\nopen({str(said)!r}, 'a').write(sys.argv[1] + chr(10))"
    program.write_text(f"#!{sys.executable}\n{body}")
    program.chmod(0o755)
    told = []
    hook = AlarmHook(str(program), told.append)
    for number in range(3):
        hook.announce({**ALARM, "number": number})
    wait(lambda: said.exists() and len(said.read_text().splitlines()) == 3)
    assert [json.loads(line) for line in said.read_text().splitlines()] == [
        {**ALARM, "number": number} for number in range(3)
    ]
    assert told == []


def test_an_address_gets_each_alarm_as_a_post():
    bodies = []

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self):
            bodies.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(204)
            self.end_headers()

        def log_message(self, *arguments):
            pass

    server = HTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    try:
        AlarmHook(f"http://127.0.0.1:{server.server_port}/", print).announce(ALARM)
        wait(lambda: bodies)
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
    assert bodies == [ALARM]


@posix
def test_what_fails_or_hangs_is_said_and_the_next_alarm_is_told_all_the_same(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_LONGEST", 0.2)
    monkeypatch.setattr(module, "_MOST", 3)
    program = tmp_path / "hook"
    program.write_text(f"#!{sys.executable}\nimport time\ntime.sleep(60)")
    program.chmod(0o755)
    told = []
    hook = AlarmHook(str(program), told.append)
    begun = time.monotonic()
    for _ in range(1000):
        hook.announce(ALARM)
    assert time.monotonic() - begun < 1.0
    wait(lambda: len(told) >= 2)
    assert all("timed out after 0." in line for line in told[:2])
    missing = []
    AlarmHook(str(tmp_path / "none"), missing.append).announce(ALARM)
    wait(lambda: missing)
    assert "No such file" in missing[0]


@pytest.mark.parametrize("address", ["http://127.0.0.1:1/"])
def test_an_address_that_nobody_listens_at_is_said(address):
    told = []
    AlarmHook(address, told.append).announce(ALARM)
    wait(lambda: told)
    assert told[0].startswith(f"--alarm-hook {address}: ")
