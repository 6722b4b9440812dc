"""Latch on disk: it holds over a restart, and a server that did not end in order leaves a mark."""

from __future__ import annotations

import os
import shutil
import signal
import stat
import subprocess
import sys
import time

import pytest

from fmus.kit.errors import UserError
from orchestration.rig.server.latch_file import LatchRecord, digest, make_latch_keeper
from tests.support.command import posix
from tests.support.small_disk import disk_of_64_kib

pytestmark = pytest.mark.real_time

DEVICES = ("VISA resource USB0", "VISA resource GPIB0")
SMOKE = LatchRecord("0123456789abcdef", "stopped: smoke", "", "2026-01-02 03:04:05")


def keeper(folder, tell=lambda line: None):
    return make_latch_keeper(DEVICES, folder, tell)


def test_a_latch_is_there_at_the_next_start_and_an_open_one_is_not(tmp_path):
    first = keeper(tmp_path / "new" / "state")
    assert first.held is None
    first.keep(SMOKE)
    first.end()
    second = keeper(tmp_path / "new" / "state")
    assert second.held == SMOKE
    second.keep(None)
    second.end()
    assert keeper(tmp_path / "new" / "state").held is None


def test_of_the_states_that_follow_each_other_fast_the_newest_is_kept(tmp_path):
    first = keeper(tmp_path)
    for k in range(2000):
        first.keep(SMOKE._replace(reason=f"stopped: {k}"))
    first.end()
    held = keeper(tmp_path).held
    assert held is not None
    assert held.reason == "stopped: 1999"


def test_files_that_somebody_deletes_while_the_server_runs_are_written_again(tmp_path):
    first = keeper(tmp_path)
    for held in (None, SMOKE):
        first.keep(held)
        time.sleep(0.1)
        for path in tmp_path.iterdir():
            path.unlink()
        until = time.monotonic() + 10.0
        while len(list(tmp_path.glob("*.json"))) < 2:
            assert time.monotonic() < until
            time.sleep(0.01)
    assert keeper(tmp_path).held == SMOKE
    first.end()


def test_there_is_a_file_for_each_device_which_only_its_owner_reads(tmp_path):
    keeper(tmp_path).end()
    files = sorted(tmp_path.iterdir())
    assert sorted({path.stem for path in files}) == sorted(map(digest, DEVICES))
    if os.name == "posix":
        assert {stat.S_IMODE(path.stat().st_mode) for path in files} == {0o600}
    assert make_latch_keeper(("another",), tmp_path, print).held is None


def test_a_latch_of_one_of_several_devices_counts(tmp_path):
    one = make_latch_keeper(DEVICES[:1], tmp_path, print)
    one.keep(SMOKE)
    one.end()
    assert keeper(tmp_path).held == SMOKE


@posix
def test_a_server_that_was_killed_is_told_with_its_process(tmp_path):
    script = (
        "import sys, time; from pathlib import Path\n"
        "from orchestration.rig.server.latch_file import make_latch_keeper\n"
        f"make_latch_keeper({DEVICES!r}, Path(sys.argv[1]), print); print('there', flush=True)\n"
        "time.sleep(60)"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script, tmp_path], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "there\n"
        process.send_signal(signal.SIGKILL)
    held = keeper(tmp_path).held
    assert held is not None
    assert f"process {process.pid}" in held.reason
    assert "did not end in order" in held.reason


@pytest.mark.parametrize("text", ["", "{", "[]", '{"latch": {"name": 1}, "server": ""}', "\0" * 50])
def test_a_damaged_file_is_a_latch(tmp_path, text):
    keeper(tmp_path).end()
    for path in tmp_path.iterdir():
        path.write_text(text)
    held = keeper(tmp_path).held
    assert held is not None
    assert "is damaged" in held.reason


def test_a_folder_that_cannot_be_used_is_refused_before_anything_is_opened(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match=r"--state .*file/state: "):
        keeper(tmp_path / "file" / "state")


def test_a_full_disk_is_told_and_latches_the_next_one(tmp_path):
    lines: list[str] = []
    with disk_of_64_kib(tmp_path / "disk") as disk:
        first = keeper(disk, lines.append)
        with pytest.raises(OSError):
            (disk / "filling").write_bytes(b"x" * 1_000_000)
        first.keep(SMOKE)
        first.end()
        assert lines
        assert "THE LATCH IS NOT KEPT" in lines[0]
        assert "No space left" in lines[0]
        (disk / "filling").unlink()
        held = keeper(disk).held
        assert held is not None
        assert "did not end in order" in held.reason


def test_a_rig_without_a_device_keeps_nothing(tmp_path):
    first = make_latch_keeper((), tmp_path, print)
    first.keep(SMOKE)
    first.end()
    assert make_latch_keeper((), tmp_path, print).held is None
    assert list(tmp_path.iterdir()) == []


def test_the_folder_is_the_users_where_none_is_given(tmp_path, monkeypatch):
    monkeypatch.setattr("platformdirs.user_state_dir", lambda name, appauthor: str(tmp_path / name))
    make_latch_keeper(DEVICES, None, print).end()
    assert len(list((tmp_path / "ppy-rig").glob("*.json"))) == 2


def test_a_write_is_on_the_disk_before_it_counts(tmp_path, monkeypatch):
    """The file is synchronised before it gets its name, and the folder after that."""
    steps = []
    sync, replace = os.fsync, os.replace

    def synced(descriptor):
        kind = "folder" if stat.S_ISDIR(os.fstat(descriptor).st_mode) else "file"
        steps.append(kind)
        sync(descriptor)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(
        "pathlib.Path.replace", lambda self, to: (steps.append("rename"), replace(self, to))
    )
    make_latch_keeper(DEVICES[:1], tmp_path, print)
    assert steps == ["file", "rename", "folder"]


def test_a_folder_that_somebody_deletes_is_made_again(tmp_path):
    keeper = make_latch_keeper(DEVICES[:1], tmp_path / "state", print)
    shutil.rmtree(tmp_path / "state")
    keeper.keep(LatchRecord("name", "stopped: smoke", "", "now"))
    until = time.monotonic() + 10.0
    while not (tmp_path / "state").exists() and time.monotonic() < until:
        time.sleep(0.01)
    keeper.end()
    assert make_latch_keeper(DEVICES[:1], tmp_path / "state", print).held.reason == "stopped: smoke"


@pytest.mark.parametrize("name", ['""', "5", "null"])
def test_a_latch_without_a_name_is_closed_all_the_same(tmp_path, name):
    text = '{"server": "", "latch": {"name": NAME, "reason": "", "alarm": "", "since": ""}}'
    for device in DEVICES:
        (tmp_path / f"{digest(device)}.json").write_text(text.replace("NAME", name))
    held = keeper(tmp_path).held
    assert held is not None
    assert held.name
    assert "damaged" in held.reason


@posix
def test_a_file_that_somebody_deletes_while_nobody_serves_is_a_latch(tmp_path):
    before = keeper(tmp_path)
    before.keep(LatchRecord("name", "reason", "", "now"))
    before.end()
    (tmp_path / f"{digest(DEVICES[0])}.json").unlink()
    (tmp_path / f"{digest(DEVICES[1])}.json").unlink()
    held = keeper(tmp_path).held
    assert held is not None
    assert "was deleted" in held.reason
    assert held.name


def test_a_pipe_in_place_of_a_latch_is_a_closed_one_and_nothing_waits_for_it(tmp_path):
    for device in DEVICES:
        os.mkfifo(tmp_path / f"{digest(device)}.json")
    held = keeper(tmp_path).held
    assert held is not None
    assert "damaged" in held.reason
