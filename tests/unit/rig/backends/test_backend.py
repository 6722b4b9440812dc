"""Claims: a backend that lacks a call is refused before it is opened; limits come from here too."""

from __future__ import annotations

from pathlib import Path

import pytest

from orchestration.rig import signals
from orchestration.rig.backends import device_names
from orchestration.rig.backends.backend import Backend, Limit, Steppable
from tests.support.rig import backends
from tests.support.rig.backends import Logged

CALLS = ("read", "write", "safe", "close")


def made(base: type[Backend], *calls: str) -> Backend:
    """Make a backend that has some of the calls."""
    return type("Own", (base,), {name: lambda self, *values: None for name in calls})()


@pytest.mark.parametrize("missing", CALLS)
def test_every_call_is_needed(missing):
    with pytest.raises(TypeError, match=rf"\b{missing}\b"):
        made(Backend, *(name for name in CALLS if name != missing))


def test_a_rig_in_lockstep_needs_advance_besides():
    assert isinstance(made(Backend, *CALLS), Backend)
    with pytest.raises(TypeError, match=r"\badvance\b"):
        made(Steppable, *CALLS)
    assert isinstance(made(Steppable, *CALLS, "advance"), Backend)


def test_a_device_is_by_default_the_class_and_the_options():
    (name,) = Logged.devices(rate="1", log="x")
    assert name == "Logged log=x rate=1"
    assert Logged.devices(log="x", rate="1") == [name]
    assert Logged.devices(log="y", rate="1") != [name]


def test_one_device_is_known_by_every_path_and_by_a_copy_of_the_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    place = tmp_path / "bus" / "port"
    place.parent.mkdir()
    place.touch()
    (tmp_path / "link").symlink_to(place)
    text = Path(backends.__file__).read_text()
    named = set()
    for copy in ("one.py", "two.py"):
        (tmp_path / copy).write_text(text)
        for path in ("bus/port", "bus//port", "link", str(place), "./bus/../link"):
            named |= {*device_names(f"{tmp_path / copy}:Logged", {"log": path})}
    assert len(named) == 1
    assert device_names("one.py:Logged", {"log": "/dev/null"}) != named
    (tmp_path / "null").symlink_to("/dev/null")
    assert Logged.devices(log="/dev/null") == Logged.devices(log="null") == ["Logged log=1:3"]


def test_a_file_of_ones_own_has_limits_from_here():
    assert Limit is signals.Limit
