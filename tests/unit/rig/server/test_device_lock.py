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
    "import sys, time; from orchestration.rig.server.device_lock import locked\n"
    "with locked(sys.argv[1:]):\n"
    "    print('there', flush=True); time.sleep(60)"
)
DEV0, DEV1, DEV2 = (f"Dev{number} of process {os.getpid()}" for number in range(3))


@pytest.fixture
def other():
    """A process that has two devices."""
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, DEV1, DEV2], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "there\n"
        yield process
        process.kill()


def test_another_server_of_the_same_device_is_refused_with_the_process_that_has_it(other):
    with (
        pytest.raises(UserError, match=f"^{DEV2} is served already, by process {other.pid} since "),
        locked([DEV0, DEV2]),
    ):
        pass
    with locked([DEV0]):  # was let go of
        pass
    with locked([]):  # nothing real
        pass


@posix
def test_it_ends_with_its_process_however_that_ends(other):
    other.send_signal(signal.SIGKILL)
    other.wait()
    with locked([DEV1, DEV2, DEV1]):
        pass


def test_it_is_free_again_afterwards():
    for _ in range(2):
        with (
            locked([DEV1]),
            pytest.raises(UserError, match=f"process {os.getpid()} "),
            locked([DEV1]),
        ):
            pass


@pytest.fixture
def as_elsewhere(tmp_path, monkeypatch):
    """A lock as on systems without names of the kernel's own."""
    monkeypatch.setattr(module, "_bound", module._locked_file)
    monkeypatch.setattr(module, "_folder", lambda: tmp_path)
    return tmp_path


def test_elsewhere_a_file_is_locked(as_elsewhere):
    for _ in range(2):
        with (
            locked([DEV1]),
            pytest.raises(UserError, match="is served already, by another process"),
            locked([DEV1]),
        ):
            pass


def test_a_place_that_cannot_be_written_is_refused(as_elsewhere, monkeypatch):
    monkeypatch.setattr(module, "_folder", lambda: as_elsewhere / ("x" * 300))
    with pytest.raises(UserError, match=f"{DEV1} cannot be locked"), locked([DEV1]):
        pass


@pytest.mark.skipif(sys.platform != "linux", reason="unix(7)")
def test_there_is_no_file_that_could_be_deleted(other):
    for number in os.listdir(f"/proc/{other.pid}/fd"):
        assert ".lock" not in os.readlink(f"/proc/{other.pid}/fd/{number}")
    with pytest.raises(UserError), locked([DEV1]):
        pass
