"""A folder of things that can be made again.

Nothing is taken from it that is damaged, or that anybody but this user can have written.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from fmus.kit import files
from fmus.kit.errors import UserError
from fmus.kit.storage.lock import NO_LINK

_DIGEST = ".sha256"  # beside each entry, as ``sha256sum`` writes it
_AT_ONCE = getattr(os, "O_NONBLOCK", 0)  # a pipe in place of a file is not waited for


def folder() -> Path:
    """Folder of the cache; ``PPY_CACHE`` in the environment moves it."""
    import platformdirs

    return Path(os.environ.get("PPY_CACHE") or platformdirs.user_cache_dir("ppy-rig"))


def entry(name: str, make: Callable[[], bytes], place: Path | None = None) -> Path:
    """Path of a file in the cache, which is made unless it is there and sound.

    Parameters
    ----------
    name : str
        Says all that goes into it; with a slash it is in a folder of the cache.
    make : callable
        Returns the contents.
    place : Path, optional
        Default is `folder`.

    Returns
    -------
    Path
        A regular file, whole, this user's, and writable by nobody else; so are the folders it is in.

    Raises
    ------
    UserError
        If the folder is another user's, or cannot be written.
    """
    root = place or folder()
    path = root / name
    with _told(root):
        for one in (root, *(parent for parent in reversed(path.parents) if root in parent.parents)):
            _make_private(one)
    if not is_sound(path):
        contents = make()
        with _told(root):
            _keep(path, contents)
    return path


def _keep(path: Path, contents: bytes) -> None:
    try:
        files.put(_beside(path), _line(path, contents), 0o600)
        files.put(path, contents, 0o600)
    except OSError:
        if not is_sound(path):  # Windows does not replace a library that another process has loaded
            raise


@contextlib.contextmanager
def _told(root: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        reason = f"cannot be written ({error.strerror or error})"
        raise UserError(
            f"{root}: the cache {reason}; make room there, or name another folder in PPY_CACHE"
        ) from error


def is_sound(path: Path) -> bool:
    """Whether an entry is there, is what was written, and can have been written by this user only."""
    try:
        return _read(_beside(path)) == _line(path, _read(path))
    except OSError:
        return False


def _make_private(one: Path) -> None:
    """Make a folder for this user alone, or make it so.

    Raises
    ------
    OSError
        If it cannot be made.
    UserError
        If it is another user's, or stays open to others.
    """
    one.mkdir(mode=0o700, parents=True, exist_ok=True)
    if sys.platform == "win32":  # folders of a user are the user's, and there is no mode
        return
    for about in (
        one.lstat(),
        one.stat(),
    ):  # of a link both: where it leads may be changed by whoever has it
        if about.st_uid != os.geteuid():
            raise _unusable(one, f"belongs to another user (number {about.st_uid})")
    if stat.S_IMODE(about.st_mode) & 0o077:
        with contextlib.suppress(OSError):
            one.chmod(0o700)
        if one.stat().st_mode & 0o022:
            raise _unusable(one, "can be written by other users, and its mode cannot be changed")


def _unusable(one: Path, why: str) -> UserError:
    return UserError(f"{one}: the cache {why}; name a folder of your own in PPY_CACHE")


def _read(path: Path) -> bytes:
    """Contents of a file that is this user's; OSError if it is anything else."""
    with open(
        path, "rb", opener=lambda name, flags: os.open(name, flags | NO_LINK | _AT_ONCE)
    ) as file:
        about = os.fstat(file.fileno())
        private = sys.platform == "win32" or (
            about.st_uid == os.geteuid() and not about.st_mode & 0o022
        )
        if not stat.S_ISREG(about.st_mode) or not private:
            raise PermissionError(path)
        return file.read()


def _beside(path: Path) -> Path:
    return path.with_name(path.name + _DIGEST)


def _line(path: Path, contents: bytes) -> bytes:
    """What is beside an entry; its name too, so that no other can be put in its place."""
    return f"{hashlib.sha256(contents).hexdigest()}  {path.name}\n".encode()
