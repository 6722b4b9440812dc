"""Claims: the cache gives only files that this user put there; others are made anew, or refused.

Digests are compared with those of ``sha256sum``; owners and modes are those of the file system.
"""

import ctypes
import os
import shutil
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from fmus.kit import UserError
from fmus.kit.build import toolchain
from fmus.kit.build.toolchain import find_compiler, host_platform
from fmus.kit.storage import cache
from tests.support.small_disk import disk_of_64_kib

posix = pytest.mark.skipif(sys.platform == "win32", reason="owners and modes as POSIX has them")
root = pytest.mark.skipif(
    sys.platform == "win32" or os.geteuid() != 0, reason="only root gives files away"
)
NOBODY = 65534
SOURCE = b'__attribute__((visibility("default"))) int answer(void) { return 42; }\n'


@pytest.fixture
def place(tmp_path, monkeypatch):
    """Return the path of a cache that is not there yet."""
    monkeypatch.setenv("PPY_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


class Maker:
    """Counts what it makes."""

    def __init__(self, contents=b"contents"):
        self.contents, self.made = contents, 0

    def __call__(self):
        self.made += 1
        return self.contents


def taken(make, name="entry"):
    return cache.cached_file(name, make).read_bytes()


def mode(path):
    return stat.S_IMODE(path.lstat().st_mode)


@posix
def test_a_user_without_a_home_has_it_among_the_temporary_files(tmp_path, monkeypatch):
    monkeypatch.delenv("PPY_CACHE", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    temporary = tmp_path / f"ppy-rig-{os.geteuid()}"
    monkeypatch.setenv("HOME", "/nobody")
    with monkeypatch.context() as locked:
        locked.setattr(os, "access", lambda place, mode: False)  # root may write anywhere
        assert cache.folder() == temporary
    monkeypatch.delenv("HOME")
    monkeypatch.setattr("pwd.getpwuid", {}.__getitem__)  # as of a user that the system lacks
    assert cache.folder() == temporary
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache.folder().is_relative_to(tmp_path)
    assert cache.folder() != temporary


def test_an_entry_is_made_once_with_a_digest_that_others_can_check(place):
    make = Maker()
    for name in ("entry", "folder/entry"):
        assert [taken(make, name) for _ in range(3)] == [make.contents] * 3
    assert make.made == 2
    if tool := shutil.which("sha256sum"):
        done = subprocess.run(
            [tool, "-c", "entry.sha256"], cwd=place / "folder", capture_output=True, text=True
        )
        assert done.stdout == "entry: OK\n"


DAMAGES = {
    "a bit": lambda path: path.write_bytes(b"contentt"),
    "cut off": lambda path: path.write_bytes(b"conte"),
    "empty": lambda path: path.write_bytes(b""),
    "longer": lambda path: path.write_bytes(b"contents and more"),
    "gone": Path.unlink,
    "no digest": lambda path: path.with_name("entry.sha256").unlink(),
    "empty digest": lambda path: path.with_name("entry.sha256").write_bytes(b""),
    "another entry": lambda path: [
        shutil.copy(path.with_name(f"other{ending}"), path.with_name(f"entry{ending}"))
        for ending in ("", ".sha256")
    ],
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_what_is_damaged_is_made_anew(place, damage):
    make, other = Maker(), Maker(b"another")
    path = cache.cached_file("entry", make)
    cache.cached_file("other", other)
    DAMAGES[damage](path)
    assert taken(make) == b"contents"
    assert make.made == 2
    assert taken(make) == b"contents"
    assert make.made == 2


STRANGE = {
    "writable by the group": lambda path: path.chmod(0o620),
    "writable by all": lambda path: path.chmod(0o602),
    "its digest writable by all": lambda path: path.with_name("entry.sha256").chmod(0o606),
}


@posix
@pytest.mark.parametrize("strange", STRANGE)
def test_what_others_can_have_written_is_made_anew(place, strange):
    make = Maker()
    STRANGE[strange](cache.cached_file("entry", make))
    assert taken(make) == b"contents"
    assert make.made == 2
    assert mode(place / "entry") == mode(place / "entry.sha256") == 0o600


@root
@pytest.mark.parametrize("name", ["entry", "entry.sha256"])
def test_what_belongs_to_another_user_is_made_anew(place, name):
    make = Maker()
    cache.cached_file("entry", make)
    os.chown(place / name, NOBODY, -1)
    assert taken(make) == b"contents"
    assert make.made == 2
    assert (place / name).stat().st_uid == 0


@posix
@pytest.mark.parametrize("name", ["entry", "entry.sha256"])
def test_links_are_not_followed(place, tmp_path, name):
    """Not even to what is right in every other way; and what they lead to is left alone."""
    make = Maker()
    cache.cached_file("entry", make)
    (place / name).rename(tmp_path / "elsewhere")
    (place / name).symlink_to(tmp_path / "elsewhere")
    before = (tmp_path / "elsewhere").read_bytes()
    assert taken(make) == b"contents"
    assert make.made == 2
    assert not (place / name).is_symlink()
    assert (tmp_path / "elsewhere").read_bytes() == before


@posix
def test_a_pipe_is_not_waited_for(place):
    make = Maker()
    cache.cached_file("entry", make).unlink()
    os.mkfifo(place / "entry", 0o600)
    assert taken(make) == b"contents"


@posix
def test_folders_are_for_this_user_alone(place):
    make, before = Maker(), os.umask(0o000)
    try:
        path = cache.cached_file("folder/entry", make)
    finally:
        os.umask(before)
    assert [mode(one) for one in (place, path.parent, path)] == [0o700, 0o700, 0o600]
    place.chmod(0o777)
    path.parent.chmod(0o775)
    assert cache.cached_file("folder/entry", make) == path
    assert [mode(one) for one in (place, path.parent)] == [0o700, 0o700]
    assert make.made == 1


@root
@pytest.mark.parametrize("name", [".", "folder"])
def test_a_folder_of_another_user_is_refused(place, name):
    make = Maker()
    cache.cached_file("folder/entry", make)
    os.chown(place / name, NOBODY, -1)
    with pytest.raises(
        UserError, match=r"the cache belongs to another user .*65534.*; name a folder.* PPY_CACHE"
    ) as told:
        cache.cached_file("folder/entry", make)
    assert str(told.value).startswith(str(place / name))
    assert "\n" not in str(told.value)
    assert make.made == 1


@root
def test_a_link_of_another_user_to_a_folder_of_ours_is_refused(place, tmp_path):
    (tmp_path / "ours").mkdir()
    place.symlink_to(tmp_path / "ours")
    assert taken(Maker()) == b"contents"  # our own may lead to where there is more room
    os.chown(place, NOBODY, -1, follow_symlinks=False)
    with pytest.raises(UserError, match="belongs to another user"):
        taken(Maker())


@root
def test_a_folder_whose_mode_stays_open_is_refused(place, monkeypatch):
    """As on a file system that has no modes."""
    place.mkdir()
    place.chmod(0o777)
    monkeypatch.setattr(Path, "chmod", lambda *given: None)
    with pytest.raises(
        UserError,
        match=r"can be written by other users, and its mode cannot be changed; name .*PPY_CACHE",
    ):
        taken(Maker())


def test_a_cache_that_is_full_is_told_in_one_line(tmp_path, monkeypatch):
    with disk_of_64_kib(tmp_path / "disk") as disk:
        monkeypatch.setenv("PPY_CACHE", str(disk / "cache"))
        with pytest.raises(
            UserError, match=r"disk/cache: the cache cannot be written \(No space left.*PPY_CACHE$"
        ):
            cache.cached_file("entry", lambda: bytes(100_000))
        assert list((disk / "cache").glob("*.part")) == []
        assert taken(Maker()) == b"contents"


def test_what_cannot_be_made_leaves_nothing(place):
    def fails():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cache.cached_file("entry", fails)
    assert list(place.iterdir()) == []


def test_an_interrupt_while_it_is_written_leaves_nothing_that_is_taken(place, monkeypatch):
    def interrupted(descriptor):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", interrupted)
        with pytest.raises(KeyboardInterrupt):
            taken(Maker())
    assert list(place.iterdir()) == []


@posix
def test_it_is_on_the_disk_before_it_has_its_name(place, monkeypatch):
    """File, then name, then folder: a power failure at any moment leaves a whole entry or none."""
    done, sync, replace = [], os.fsync, Path.replace

    def synced(descriptor):
        about = os.fstat(descriptor)
        done.append("folder" if stat.S_ISDIR(about.st_mode) else about.st_size)
        sync(descriptor)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(
        Path, "replace", lambda path, target: (done.append(target.name), replace(path, target))[1]
    )
    taken(Maker())
    digest = 64 + 2 + len("entry") + 1
    assert done == [digest, "entry.sha256", "folder", len(b"contents"), "entry", "folder"]


# --- libraries
# --------------------------------------------------------------------------------------------------


def library():
    try:
        find_compiler(host_platform())
    except UserError as error:
        pytest.skip(str(error))
    return toolchain.cached_library({"answer.c": SOURCE}, "answer.c", host_platform())


def test_a_damaged_library_is_compiled_anew_and_answers(place):
    """Cut off in the middle, it would end the process that loads it."""
    path = library()
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    assert library() == path
    assert toolchain.load_library(path).answer() == 42


def test_a_library_that_was_damaged_since_is_not_loaded(place, monkeypatch):
    path = library()
    loaded = []
    monkeypatch.setattr(ctypes, "CDLL", loaded.append)
    whole = path.read_bytes()
    path.write_bytes(bytes(len(whole)))
    with pytest.raises(UserError, match="was damaged since it was compiled"):
        toolchain.load_library(path)
    assert loaded == []
    path.write_bytes(whole)
    toolchain.load_library(path)
    assert loaded == [str(path)]


def test_what_cannot_be_loaded_is_told_in_one_line(tmp_path):
    (tmp_path / "library.so").write_bytes(b"no library")
    with pytest.raises(UserError, match=r"library\.so: cannot be loaded \(") as told:
        toolchain.load_library(tmp_path / "library.so")
    assert "\n" not in str(told.value)
