"""Claims: no room for temporary files, or in the cache, is one line on where and what to do.

Nothing is compiled yet in any of these: that is when most is written.
"""

import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.command import posix, ppy
from tests.support.pace import slow_but
from tests.support.small_disk import disk_of_64_kib

pytestmark = posix
COMMANDS = {
    "build": ["build", "ppy_actuator", "--out", "fmus"],
    "simulate": ["simulate", "ppy_actuator", "--out", "out.csv"],
    "sweep": ["sweep", "ppy_actuator", "--over", "R1=10,20", "--stop", "5", "--out", "sweep.nc"],
    "sweep by workers": [
        "sweep",
        "ppy_actuator",
        "--over",
        "R1=10,20",
        "--stop",
        "5",
        "--out",
        "s.nc",
        "--workers",
        2,
    ],
}


def line_of(done):
    """Return the one line of a command that was refused."""
    assert done.returncode == 2, (done.stdout, done.stderr)
    lines = done.stderr.splitlines()
    assert [line for line in lines if "error" in line] == lines[-1:], done.stderr
    assert "internal error" not in lines[-1]
    assert "Traceback" not in done.stderr
    return lines[-1]


@pytest.fixture
def work(tmp_path):
    (tmp_path / "work").mkdir()
    return tmp_path / "work"


@pytest.mark.parametrize("command", slow_but(COMMANDS, "build"))
def test_no_room_for_temporary_files(command, tmp_path, work):
    with disk_of_64_kib(tmp_path / "disk") as disk:
        environment = {"TMPDIR": str(disk), "PPY_CACHE": str(tmp_path / "cache")}
        told = line_of(ppy(*COMMANDS[command], cwd=work, environment=environment))
        assert told.startswith(
            f"error: {disk}: temporary files cannot be written there (No space left on device); "
        )
        assert "TMPDIR" in told
        assert list(disk.iterdir()) == []
    assert list(work.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("command", slow_but(["simulate", "sweep"], "simulate"))
def test_no_room_to_unpack_what_is_built(command, tmp_path, work):
    """The same with a warm cache, where only the FMU is unpacked."""
    environment = {"PPY_CACHE": str(tmp_path / "cache")}
    assert ppy(*COMMANDS["simulate"], cwd=work, environment=environment).returncode == 0
    with disk_of_64_kib(tmp_path / "disk") as disk:
        (disk / "other").write_bytes(bytes(20_000))
        done = ppy(*COMMANDS[command], cwd=work, environment=environment | {"TMPDIR": str(disk)})
        if done.returncode:  # a sweep that is compiled unpacks nothing
            assert line_of(done).startswith(
                f"error: {disk}: temporary files cannot be written there (No space left"
            )
        else:
            assert command == "sweep"
        assert [path.name for path in disk.iterdir()] == ["other"]


@pytest.mark.slow
@pytest.mark.parametrize("command", slow_but(COMMANDS, "build", "sweep by workers"))
def test_no_room_in_the_cache(command, tmp_path, work):
    with disk_of_64_kib(tmp_path / "disk") as disk:
        told = line_of(
            ppy(*COMMANDS[command], cwd=work, environment={"PPY_CACHE": str(disk / "cache")})
        )
        assert told.startswith(
            f"error: {disk}/cache: the cache cannot be written (No space left on device); make room"
        )
        assert "PPY_CACHE" in told
        assert list((disk / "cache").glob("**/*.part")) == []


@pytest.mark.slow
@pytest.mark.parametrize("largest", [1_000, 90_000])
@pytest.mark.parametrize("command", slow_but(["simulate", "sweep"], "simulate"))
def test_files_that_may_not_be_as_large(command, largest, tmp_path, work):
    """``ulimit -f``: too small for a source file, and for an FMU.

    Its library was compiled before: what a compiler writes meanwhile may be larger than an FMU.
    """
    ppy("simulate", "ppy_actuator", cwd=work, environment={"PPY_CACHE": str(tmp_path / "other")})
    done = subprocess.run(
        [sys.executable, "-B", "-m", "orchestration.cli", *map(str, COMMANDS[command])],
        cwd=work,
        text=True,
        capture_output=True,
        env=os.environ | {"PPY_CACHE": str(tmp_path / "cache")},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest)),
    )
    told = line_of(done)
    assert "written" in told
    assert "(File too large); make room" in told
    assert "PPY_CACHE" in told if largest > 1_000 else "TMPDIR" in told


@pytest.mark.parametrize("command", slow_but(["build", "simulate", "sweep"], "build"))
def test_a_cache_that_is_a_file(command, tmp_path, work):
    (tmp_path / "cache").touch()
    told = line_of(
        ppy(*COMMANDS[command], cwd=work, environment={"PPY_CACHE": str(tmp_path / "cache")})
    )
    assert told.startswith(f"error: {tmp_path}/cache: the cache cannot be written (")


def test_a_cache_of_another_user(tmp_path, work):
    if os.geteuid() != 0:
        pytest.skip("only root gives files away")
    (tmp_path / "cache").mkdir()
    os.chown(tmp_path / "cache", 65534, -1)
    told = line_of(
        ppy(*COMMANDS["simulate"], cwd=work, environment={"PPY_CACHE": str(tmp_path / "cache")})
    )
    assert told.startswith(f"error: {tmp_path}/cache: the cache belongs to another user")


@pytest.mark.slow
def test_a_run_that_was_killed_leaves_nothing_to_the_next(tmp_path, work):
    """By SIGKILL, with an FMU unpacked."""
    (tmp_path / "scratch").mkdir()
    environment = os.environ | {"TMPDIR": str(tmp_path / "scratch")}
    command = [sys.executable, "-m", "orchestration.cli", "simulate", "ppy_actuator"]
    with subprocess.Popen(
        [*command, "--stop", "3e5", "--out", "long.csv"],
        cwd=work,
        env=environment,
        stderr=subprocess.PIPE,
    ) as killed:
        while (
            not list((tmp_path / "scratch").glob("ppy-fmu-*/modelDescription.xml"))
            and killed.poll() is None
        ):
            pass
        killed.kill()
    assert len(folders(tmp_path)) == 1
    assert (
        subprocess.run(
            [*command, "--stop", "1"], cwd=work, env=environment, capture_output=True
        ).returncode
        == 0
    )
    assert folders(tmp_path) == []


def folders(tmp_path: Path) -> list[str]:
    return [path.name for path in (tmp_path / "scratch").iterdir() if path.is_dir()]
