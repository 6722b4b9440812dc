"""Settings: values that are out of range, or would let strangers command a rig, are refused."""

from __future__ import annotations

from math import inf, nan
from pathlib import Path

import pytest

from fmus.kit.errors import UserError
from orchestration.rig.server.settings import ServerSettings, is_loopback, read_options

pytestmark = pytest.mark.real_time


@pytest.mark.parametrize(
    ("given", "part"),
    [
        ({"rate": 0.0}, "--rate 0: allowed are 0.1 to 1000 Hz"),
        ({"rate": 1001.0}, "--rate 1001"),
        ({"rate": nan}, "--rate nan"),
        ({"watchdog": 0.0}, "--watchdog 0: allowed are 0.02 to 60 s"),
        ({"watchdog": inf}, "--watchdog inf"),
        ({"port": -1}, "--port -1"),
        ({"port": 65535}, "--port 65535"),
        ({"priority": 0}, "--device-priority 0: allowed are 1 to 99"),
        ({"cpu": -1}, "--device-cpu -1"),
        ({"stuck_after": -1}, "--stuck-after -1: allowed are 0, never, and more"),
        (
            {"host": "0.0.0.0"},
            "--bind 0.0.0.0: beyond this machine the rig is served with keys only",
        ),
        ({"host": "*"}, "with keys only"),
        ({"host": "0.0.0.0", "no_keys": True}, "with keys only"),
        ({"keys": Path("k.toml"), "no_keys": True}, "--keys k.toml and --no-keys exclude"),
        ({"host": "::"}, "with keys only"),
        ({"host": "192.168.0.7"}, "with keys only"),
        ({"host": "rig.example"}, "with keys only"),
    ],
)
def test_refused(given, part):
    with pytest.raises(UserError, match=part.replace("*", r"\*")):
        ServerSettings("emulator", **given)


def test_with_keys_it_may_be_anywhere():
    assert ServerSettings("emulator", host="0.0.0.0", keys=Path("keys.toml")).host == "0.0.0.0"


@pytest.mark.parametrize(
    ("host", "is_it"),
    [
        ("127.0.0.1", True),
        ("127.9.9.9", True),
        ("localhost", True),
        ("[::1]", True),
        ("::1", True),
        ("", False),
        ("10.0.0.1", False),
        ("127.0.0.1.example.org", False),
        ("localhost.example.org", False),
    ],
)
def test_loopback(host, is_it):
    assert is_loopback(host) is is_it


def test_options():
    assert read_options(["seed=3", "file=a=b", "empty="]) == {
        "seed": "3",
        "file": "a=b",
        "empty": "",
    }
    for texts, part in (
        (["seed"], "write KEY=VALUE"),
        (["=3"], "write KEY=VALUE"),
        (["a=1", "a=2"], "given twice"),
    ):
        with pytest.raises(UserError, match=part):
            read_options(texts)


def test_the_others_hold_a_process_to_hang_before_the_watchdog_time_is_over():
    assert 0.0 < ServerSettings("emulator", watchdog=0.2).silence < 0.2
