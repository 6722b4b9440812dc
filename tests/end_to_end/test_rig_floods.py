"""Claims: beside any flood of hostile peers that was tried, a stop is answered soon, and stops.

`docs/decisions/0061-operators-port-and-access.md` has the figures of the measurement.
"""

from __future__ import annotations

import tomllib

import pytest

from orchestration.rig.endpoint import read_endpoint
from orchestration.rig.keys import make_keys
from orchestration.rig.operator import ask
from tests.support.rig.floods import FLOODS, flooded, stop_times
from tests.support.rig.process import Server

pytestmark = [pytest.mark.timeout(120), pytest.mark.real_time]

AIM = 0.05  # s, of half of the stops: on two cores the flood itself takes one
LONGEST = 0.5  # s, of any of them, where tests run beside each other
STOPS = 40


CASES = [(kind, offset) for kind in FLOODS for offset in (0, 2) if (kind, offset) != ("large", 2)]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "offset"), CASES)
def test_a_stop_beside_a_flood(tmp_path, kind, offset):
    server_file, client = make_keys(tmp_path / "keys")
    with_keys = kind == "strangers"
    arguments = ("--keys", server_file) if with_keys else ()
    with Server(tmp_path, "Logged", *arguments) as server:
        port = int(server.wait_ready().rpartition(":")[2])
        remote = read_endpoint(server.endpoint, client if with_keys else None)
        key = tomllib.loads(server_file.read_text())["public_key"] if with_keys else ""
        with flooded(kind, port + offset, key):
            times = stop_times(remote, STOPS)
            assert times[STOPS // 2] <= AIM
            assert times[-1] <= LONGEST
            assert ask(remote, "status")["state"] == "safe"
