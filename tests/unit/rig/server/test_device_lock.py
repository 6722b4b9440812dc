"""Lock of a device: of all servers on a machine one has it, and the others say who does."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

from fmus.kit.errors import UserError
from orchestration.rig.server import device_lock as module
from orchestration.rig.server.device_lock import locked
from tests.support.command import posix

HOLD = (
    "import sys, time; from pathlib import Path\n"
    "from orchestration.rig.server import device_lock as module\n"
    "module._folder = lambda: Path(sys.argv[1])\n"
    "with module.locked(sys.argv[2:]):\n"
    "    print('there', flush=True); time.sleep(60)"
)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_folder", lambda: tmp_path)
    return tmp_path


@pytest.fixture
def other(folder):
    """A process that has two devices."""
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, folder, "Dev1", "Dev2"], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "there\n"
        yield process
        process.kill()


def test_another_server_of_the_same_device_is_refused_with_the_process_that_has_it(other):
    with (
        pytest.raises(UserError, match=rf"^Dev2 is served already, by process {other.pid} since "),
        locked(["Dev0", "Dev2"]),
    ):
        pass
    with locked(["Dev0"]):  # was let go of
        pass
    with locked([]):  # nothing real
        pass


@posix
def test_it_ends_with_its_process_however_that_ends(other):
    other.send_signal(signal.SIGKILL)
    other.wait()
    with locked(["Dev1", "Dev2", "Dev1"]):
        pass


def test_it_is_free_again_afterwards(folder):
    for _ in range(2):
        with (
            locked(["Dev1"]),
            pytest.raises(UserError, match=f"process {os.getpid()} "),
            locked(["Dev1"]),
        ):
            pass


def test_a_place_that_cannot_be_written_is_refused(folder, monkeypatch):
    monkeypatch.setattr(module, "_folder", lambda: folder / ("x" * 300))
    with pytest.raises(UserError, match="Dev1 cannot be locked"), locked(["Dev1"]):
        pass


@posix
def test_the_place_is_that_of_all_users(monkeypatch):
    monkeypatch.undo()
    assert str(module._folder()) in ("/run/lock", "/tmp")
