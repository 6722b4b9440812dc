"""Claims: the commands of the rig answer in a line or as JSON, and refuse what makes no sense
before they speak to anybody.
"""

from __future__ import annotations

import json
import re

import pytest

from fmus.rig_proxy import PORT
from orchestration.rig.keys import make_keys
from tests.support.command import refused, works
from tests.support.rig.driver import INPUTS
from tests.support.rig.process import Server

pytestmark = pytest.mark.timeout(60)


@pytest.mark.real_time
def test_nobody_there_is_a_line_within_the_timeout(tmp_path):
    for command in ("stop", "acknowledge", "status"):
        line = refused(
            tmp_path, "rig", command, "--endpoint", "tcp://127.0.0.1:9", "--timeout", "0.2"
        )
        assert "no answer within 0.2 s" in line
        assert "without keys" in line


@pytest.mark.slow
@pytest.mark.real_time
def test_status_as_a_line_and_as_json(tmp_path):
    with Server(tmp_path) as server:
        server.wait_ready()
        line = works("rig", "status", "--endpoint", server.endpoint, cwd=tmp_path)
        # a busy machine misses periods, and then the line says how many
        described = r"idle; real-time, period 0\.03333 s, watchdog 0\.2 s(; \d+ missed)?\n"
        assert re.fullmatch(described, line), line
        told = json.loads(
            works("rig", "status", "--json", "-", "--endpoint", server.endpoint, cwd=tmp_path)
        )
        assert told["inputs"] == INPUTS


def test_a_bridge_to_itself_is_refused(tmp_path):
    _, client = make_keys(tmp_path / "keys")
    endpoint = f"tcp://127.0.0.1:{PORT}"
    said = [f"--endpoint {endpoint}", "this is the bridge itself; --port chooses another"]
    refused(tmp_path, "rig", "bridge", "--endpoint", endpoint, "--credentials", client, parts=said)


def test_keys_are_written_for_server_and_client_and_for_one_more(tmp_path):
    said = works("rig", "keys", "keys", cwd=tmp_path).splitlines()
    assert [line.partition("(")[2] for line in said] == [
        "stays with the server)",
        "keys of the client; let nobody else read it)",
    ]
    more = works("rig", "keys", "keys", "--client", "lab", cwd=tmp_path)
    (name,) = [path.name for path in (tmp_path / "keys").iterdir() if "lab" in path.name]
    assert name in more
