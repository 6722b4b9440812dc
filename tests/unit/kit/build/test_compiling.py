"""Claims: a compiler has limited time, and leaves nothing; its version is in a library's key.

Compilers here are shell scripts, which write down what they are asked.
"""

import importlib.util
import os
import signal
import subprocess
import sys
import time
import zipfile

import pytest

from fmus.kit import UserError
from fmus.kit.build import build_cached, toolchain
from fmus.kit.build.toolchain import cached_library, library_digest
from tests.support.kit_samples import Divider
from tests.support.small_disk import disk_of_64_kib
from tests.support.source import ROOT

pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="the compiler is a shell script here"
)
MAKES = """
case "$*" in *--version*) echo "cc 1.0"; exit;; esac
while [ "$1" != -o ]; do shift; done
echo library > "$2"
"""
# What it starts outlives it unless it is ended, too, and shows that by a file.
HANGS = """
case "$*" in *--version*) echo "cc 1.0"; exit;; esac
while [ "$1" != -o ]; do shift; done
echo part > "$2"
(sleep 2; touch survived) &
touch begun
sleep 60
"""
FILES = {"a.c": b"int a;\n"}
COMPILES = """
import sys
from fmus.kit.build import toolchain
from fmus.kit.build.toolchain import cached_library
toolchain.find_compiler = lambda target: toolchain.Compiler((sys.argv[1],))
cached_library({"a.c": b"int a;"}, "a.c", "linux64")
"""


@pytest.fixture
def compiler(tmp_path, monkeypatch, scratch):
    """Write a compiler, and empty the cache: ``compiler(script)`` returns its path."""
    path = tmp_path / "cc"

    def write(script):
        path.write_text(
            f'#!/bin/sh\necho "$*" >> "{tmp_path}/asked"\ncd "{tmp_path}"\n{script}',
            encoding="utf-8",
        )
        path.chmod(0o755)
        return path

    monkeypatch.setenv("PPY_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(toolchain, "find_compiler", lambda target: toolchain.Compiler((str(path),)))
    toolchain._printed_version.cache_clear()
    return write


def asked(tmp_path):
    lines = (tmp_path / "asked").read_text(encoding="utf-8").splitlines()
    versions = lines.count("--version")
    return versions, len(lines) - versions


def compiled():
    return cached_library(FILES, "a.c", "linux64")


# --- time and interrupts
# ----------------------------------------------------------------------------------------------


def test_a_compiler_that_hangs_is_ended_with_all_that_it_started(
    compiler, tmp_path, scratch, monkeypatch
):
    compiler(HANGS)
    monkeypatch.setattr(toolchain, "_LIMIT", 1.0)
    begun = time.monotonic()
    with pytest.raises(
        UserError, match=r"^cc failed for linux64: not done after 1 s, and ended; "
    ) as told:
        compiled()
    assert 1.0 <= time.monotonic() - begun < 1.9
    assert "\n" not in str(told.value)
    assert (tmp_path / "begun").exists()
    assert list(scratch.iterdir()) == []
    assert list((tmp_path / "cache").iterdir()) == []
    time.sleep(2.5 - (time.monotonic() - begun - 1.0))
    assert not (tmp_path / "survived").exists()


def test_all_targets_of_a_library_have_one_time(compiler, tmp_path, monkeypatch):
    path = compiler("sleep 0.7\n" + MAKES)
    monkeypatch.setattr(toolchain, "_FIRST_LIMIT", 1.0)
    monkeypatch.setattr(toolchain, "_compiled_platforms", set())
    monkeypatch.setattr(
        toolchain, "find_compiler", lambda target: toolchain.Compiler((str(path),), ("one", "two"))
    )
    with pytest.raises(UserError, match="not done after 1 s"):
        cached_library(FILES, "a.c", "darwin64")
    assert asked(tmp_path) == (0, 2)


def test_the_first_library_of_a_platform_has_more_time(compiler, monkeypatch):
    """zig makes a C library first; of win64 that took 108 s on two processors with nothing else."""
    path = compiler("sleep 0.5\n" + MAKES)
    monkeypatch.setattr(toolchain, "_LIMIT", 0.2)
    monkeypatch.setattr(toolchain, "_FIRST_LIMIT", 20.0)
    monkeypatch.setattr(toolchain, "_compiled_platforms", set())
    monkeypatch.setattr(
        toolchain, "find_compiler", lambda target: toolchain.Compiler((str(path),), ("one",))
    )
    cached_library(FILES, "a.c", "win64")
    with pytest.raises(UserError, match=r"not done after 0\.2 s"):
        cached_library({"a.c": b"int b;"}, "a.c", "win64")
    cached_library(FILES, "a.c", "linux64")


def test_five_minutes_are_given_and_half_an_hour_for_the_first():
    assert (toolchain._LIMIT, toolchain._FIRST_LIMIT) == (300.0, 1800.0)


@pytest.mark.parametrize(
    "to_group", [False, True], ids=["from another process", "from the terminal"]
)
def test_an_interrupt_leaves_no_compiler_and_nothing_partial(compiler, tmp_path, scratch, to_group):
    path = compiler(HANGS)
    environment = os.environ | {"TMPDIR": str(scratch), "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        [sys.executable, "-c", COMPILES, path],
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as running:
        until = time.monotonic() + 20.0
        while not (tmp_path / "begun").exists() and time.monotonic() < until:
            time.sleep(0.01)
        (os.killpg if to_group else os.kill)(running.pid, signal.SIGINT)
        begun = time.monotonic()
        _, told = running.communicate(timeout=20)
    assert time.monotonic() - begun < 1.5
    assert "KeyboardInterrupt" in told
    assert running.returncode != 0
    assert list(scratch.iterdir()) == []
    assert list((tmp_path / "cache").iterdir()) == []
    time.sleep(2.5)
    assert not (tmp_path / "survived").exists()


def test_a_compiler_that_is_gone_is_told_in_one_line(compiler):
    with pytest.raises(
        UserError, match=r"^cc failed for linux64: .*/cc cannot be started \(No such file"
    ):
        compiled()


def test_a_program_that_is_done_gives_what_it_printed(tmp_path):
    done = toolchain.run_program(["sh", "-c", "echo one; echo two >&2; exit 3"], 10.0)
    assert (done.returncode, done.stdout, done.stderr) == (3, "one\n", "two\n")


def test_a_full_disk_is_told_whatever_the_compiler_says(compiler, tmp_path, monkeypatch):
    compiler("echo some error of mine >&2; exit 1")
    with disk_of_64_kib(tmp_path / "disk") as disk:
        monkeypatch.setattr("tempfile.tempdir", str(disk))
        with pytest.raises(
            UserError, match=f"^{disk}: temporary files cannot be written there .*TMPDIR$"
        ):
            compiled()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with pytest.raises(UserError, match=r"^cc failed for linux64: some error of mine$"):
        compiled()


# --- what a library is known by
# ---------------------------------------------------------------------------------------


def test_the_version_is_asked_once_and_not_when_modules_are_imported(compiler, tmp_path):
    path = compiler(MAKES)
    program = "import fmus.kit.build.toolchain, fmus.kit.record.compiled, orchestration.fmu.model"
    done = subprocess.run(
        [sys.executable, "-c", program], env=os.environ | {"CC": str(path), "PYTHONPATH": str(ROOT)}
    )
    assert done.returncode == 0
    assert not (tmp_path / "asked").exists()
    assert [
        cached_library({"a.c": bytes([n])}, "a.c", "linux64").read_text() for n in (1, 1, 2, 2)
    ] == ["library\n"] * 4
    assert asked(tmp_path) == (1, 2)


def test_another_version_under_the_same_path_compiles_anew(compiler, tmp_path):
    compiler(MAKES)
    before = compiled()
    compiler(MAKES.replace("1.0", "1.0.1"))
    assert compiled() != before
    assert asked(tmp_path) == (2, 2)
    compiler("case $* in --version) exit 1;; esac" + MAKES)  # one that does not say
    third = compiled()
    compiler("case $* in --version) exit 1;; esac; :" + MAKES)
    assert len({before, third, compiled()}) == 3


@pytest.mark.parametrize("target", toolchain.ZIG_TARGETS)
def test_every_option_is_in_the_key(monkeypatch, target):
    def made(**options):
        zig = toolchain.Compiler(
            ("zig", "cc"), options.pop("targets", toolchain.ZIG_TARGETS[target])
        )
        monkeypatch.setattr(toolchain, "find_compiler", lambda target: zig)
        return library_digest(FILES, "a.c", target, **options)

    monkeypatch.setattr("importlib.metadata.version", lambda name: "1")
    keys = [made(), made(libraries=["m"]), made(targets=("x86_64-linux-gnu.2.31",)), made()]
    assert keys[0] == keys[3]
    for option in toolchain.FLAGS:
        with monkeypatch.context() as patched:
            patched.setattr(toolchain, "FLAGS", tuple(o for o in toolchain.FLAGS if o != option))
            keys.append(made())
    monkeypatch.setattr("importlib.metadata.version", lambda name: "2")
    keys.append(made())
    assert len(set(keys)) == len(keys) - 1


@pytest.mark.parametrize("runtime", ["native", "python"])
def test_an_fmu_is_built_anew_by_another_compiler_and_if_it_is_damaged(compiler, tmp_path, runtime):
    compiler(MAKES)
    path = build_cached(Divider, runtime)
    whole = path.read_bytes()
    assert build_cached(Divider, runtime) == path
    path.write_bytes(whole[:-100])
    assert build_cached(Divider, runtime) == path
    assert path.read_bytes() == whole
    assert asked(tmp_path) == (1, 1), "its library was sound"
    compiler(MAKES.replace("1.0", "1.1").replace("echo library", "echo other"))
    other = build_cached(Divider, runtime)
    assert other != path
    assert other.name == path.name
    with zipfile.ZipFile(other) as archive:
        (binary,) = (name for name in archive.namelist() if name.startswith("binaries/"))
        assert archive.read(binary) == b"other\n"


def test_zig_is_asked_nothing(monkeypatch):
    if importlib.util.find_spec("ziglang") is None:
        pytest.skip("zig is not installed")
    monkeypatch.setattr(
        toolchain, "run_program", lambda *given: pytest.fail("a process was started")
    )
    assert toolchain.find_compiler("linux64").version.startswith("zig ")
