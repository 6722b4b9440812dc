"""Claims: a temporary folder is removed with its process, or by the next one; others stay."""

import contextlib
import os
import signal
import subprocess
import sys

import pytest

from fmus.kit import UserError
from fmus.kit.storage import lock, scratch
from tests.support.small_disk import disk_of_64_kib
from tests.support.source import ROOT

posix = pytest.mark.skipif(sys.platform == "win32", reason="signals and owners as POSIX has them")
root = pytest.mark.skipif(
    sys.platform == "win32" or os.geteuid() != 0, reason="only root gives files away"
)
HOLDS = """
import sys, time
from fmus.kit.storage import scratch
folder = scratch.make("fmu")
(folder / "binaries").mkdir()
(folder / "binaries" / "large").write_bytes(bytes(1000))
print(folder, flush=True)
time.sleep(float(sys.argv[1]))
"""
MAKES = "from fmus.kit.storage import scratch\nwith scratch.folder('other'): pass"


@pytest.fixture
def place(tmp_path):
    (tmp_path / "temporary").mkdir()
    return tmp_path / "temporary"


def environment(place):
    return os.environ | {"TMPDIR": str(place), "PYTHONPATH": str(ROOT)}


def process(place, program, *arguments):
    command = [sys.executable, "-c", program, *map(str, arguments)]
    return subprocess.Popen(command, env=environment(place), stdout=subprocess.PIPE, text=True)


def names(place):
    return sorted(path.name for path in place.iterdir())


@posix
def test_of_a_process_that_was_killed_the_next_one_removes_the_folder(place):
    with process(place, HOLDS, 60) as killed, process(place, HOLDS, 60) as living:
        try:
            gone, stays = (one.stdout.readline().strip() for one in (killed, living))
            killed.send_signal(signal.SIGKILL)
            killed.wait()
            assert os.path.isfile(f"{gone}/binaries/large")
            with process(place, MAKES) as third:
                assert third.wait() == 0
            assert not os.path.exists(gone)
            assert os.path.isfile(f"{stays}/binaries/large")
            assert names(place) == sorted(
                [os.path.basename(stays), os.path.basename(stays) + ".lock"]
            )
        finally:
            living.kill()


def test_at_its_end_a_process_removes_what_it_did_not(place):
    with process(place, HOLDS, 0) as ends:
        assert str(place) in ends.stdout.readline()
        assert ends.wait() == 0
    assert names(place) == []


@posix
def test_a_copy_of_a_process_removes_nothing_of_it(place):
    program = (
        HOLDS.split("time.sleep")[0]
        + "import os\nif os.fork():\n    os.wait(); print(*os.listdir(folder))\n"
    )
    with process(place, program, 0) as parent:
        _, left = parent.stdout.read().splitlines()
    assert left == "binaries"
    assert names(place) == []


@posix
def test_what_another_holds_stays_whatever_the_number_of_its_process(place, monkeypatch):
    """A file with a process number would mislead: numbers are given again."""
    monkeypatch.setattr("tempfile.tempdir", str(place))
    scratch._sweep.cache_clear()
    (place / "ppy-fmu-old").mkdir()
    (place / "ppy-fmu-old.lock").write_text(f"{os.getpid()}\n")
    with process(place, HOLDS, 60) as living:
        try:
            held = os.path.basename(living.stdout.readline().strip())
            with scratch.folder("other") as own:
                assert names(place) == sorted([held, f"{held}.lock", own.name, f"{own.name}.lock"])
        finally:
            living.kill()


def test_folders_without_a_lock_and_files_of_others_stay(place, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(place))
    scratch._sweep.cache_clear()
    (place / "ppy-fmu-just_begun").mkdir()
    (place / "ppy-2026-record.nc").write_text("rescued")
    (place / "other.lock").touch()
    with scratch.folder("fmu"):
        pass
    assert names(place) == ["other.lock", "ppy-2026-record.nc", "ppy-fmu-just_begun"]


@root
def test_what_belongs_to_another_user_stays(place, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(place))
    scratch._sweep.cache_clear()
    for name in ("ppy-a", "ppy-b"):
        (place / name).mkdir()
        (place / f"{name}.lock").touch()
    os.chown(place / "ppy-a", 65534, -1)
    os.chown(place / "ppy-b.lock", 65534, -1)
    with scratch.folder("fmu"):
        pass
    assert names(place) == ["ppy-a", "ppy-a.lock", "ppy-b", "ppy-b.lock"]


@posix
def test_links_lead_nowhere(place, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(place))
    scratch._sweep.cache_clear()
    (tmp_path / "precious").mkdir()
    (tmp_path / "precious" / "file").touch()
    (place / "ppy-a").symlink_to(tmp_path / "precious")
    (place / "ppy-a.lock").touch()
    (place / "ppy-b.lock").symlink_to(tmp_path / "precious" / "file")
    with scratch.folder("fmu"):
        pass
    assert (tmp_path / "precious" / "file").exists()


def test_a_folder_that_is_just_being_made_is_not_taken_for_left_behind(place, monkeypatch):
    """Another process sweeps after each thing that is done to make one."""
    monkeypatch.setattr("tempfile.tempdir", str(place))
    swept = []

    def sweeping(name, known):
        def call(*given, **more):
            done = known(*given, **more)
            if name not in swept:
                swept.append(name)
                with process(place, MAKES) as other:
                    assert other.wait() == 0
            return done

        return call

    scratch._sweep(str(place))  # before what it calls is patched
    with monkeypatch.context() as patched:
        for of, name in ((os, "open"), (lock, "_try_lock"), (lock, "take"), (os, "mkdir")):
            patched.setattr(of, name, sweeping(name, getattr(of, name)))
        folder = scratch.make("fmu")
    assert swept == ["open", "_try_lock", "take", "mkdir"]
    try:
        with process(place, MAKES) as other:
            assert other.wait() == 0
        assert names(place) == sorted([folder.name, f"{folder.name}.lock"])
    finally:
        scratch.remove(folder)
    assert names(place) == []


def test_processes_that_make_and_remove_at_once_do_not_disturb_each_other(place):
    program = """
import sys, time
from fmus.kit.storage import scratch
until = time.monotonic() + 1.0
while time.monotonic() < until:
    scratch._sweep.cache_clear()
    with scratch.folder("fmu") as folder:
        (folder / "file").write_text("mine")
        scratch._sweep.cache_clear(); scratch._sweep(str(folder.parent))
        assert (folder / "file").read_text() == "mine"
        assert folder.with_name(folder.name + ".lock").exists()
"""
    running = [process(place, program) for _ in range(3)]
    assert [one.wait() for one in running] == [0, 0, 0]
    for one in running:
        one.stdout.close()
    assert names(place) == []


def test_a_lock_is_held_once_and_goes_with_its_release(tmp_path):
    path = tmp_path / "lock"
    first = lock.take(path)
    assert first is not None
    assert lock.take(path) is None
    lock.release(path, first)
    assert not path.exists()
    second = lock.take(path)
    assert second is not None
    lock.release(path, second)


def test_only_what_this_process_made_is_removed(tmp_path):
    scratch.remove(tmp_path)
    assert tmp_path.is_dir()


# --- no room
# --------------------------------------------------------------------------------------------------


def test_where_nothing_can_be_written_is_told_in_one_line(monkeypatch):
    monkeypatch.setattr(
        "tempfile.tempdir", "/proc" if sys.platform == "linux" else "/no/such/folder"
    )
    with pytest.raises(
        UserError, match=r": temporary files cannot be written there \(.*; make room, or .* TMPDIR$"
    ):
        scratch.make("fmu")


def test_where_there_is_no_folder_at_all_is_told_in_one_line(monkeypatch):
    def none():
        raise FileNotFoundError(2, "No usable temporary directory found in ['/a', '/b']")

    monkeypatch.setattr("tempfile.gettempdir", none)
    with pytest.raises(
        UserError,
        match=r"^no folder .*'/a', '/b'\]\); make room in one of them, or name another in TMPDIR$",
    ):
        scratch.make("fmu")


def test_a_disk_without_room_is_told_in_one_line(tmp_path, monkeypatch):
    with disk_of_64_kib(tmp_path / "disk") as disk:
        monkeypatch.setattr("tempfile.tempdir", str(disk))
        with (
            pytest.raises(UserError, match=f"^{disk}: temporary files .*No space left"),
            scratch.folder("a") as folder,
        ):
            scratch.check_room(folder)
        assert names(disk) == []
        with (disk / "all").open("wb", buffering=0) as file, contextlib.suppress(OSError):
            while True:
                file.write(bytes(4096))
        with (
            pytest.raises(UserError, match="temporary files"),
            scratch.folder("a") as folder,
            scratch.written(folder),
        ):
            (folder / "more").write_bytes(bytes(4096))
        assert names(disk) == ["all"]
