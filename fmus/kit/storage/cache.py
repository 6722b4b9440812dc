"""The cache: a folder of files that can be rebuilt.

A file is used only if it is undamaged, and if no other user could write it.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from fmus.kit import files
from fmus.kit.errors import UserError
from fmus.kit.storage.lock import NO_LINK

_DIGEST = ".sha256"  # of the digest of each entry, a file in the format of ``sha256sum``
_NO_WAIT = getattr(os, "O_NONBLOCK", 0)  # so that opening a pipe in place of a file does not block


def folder() -> Path:
    """Return the folder of the cache: ``PPY_CACHE`` of the environment, or the user's default.

    A user without a home, as in many containers, has it among the temporary files.
    """
    named = os.environ.get("PPY_CACHE")
    if named:
        return Path(named)
    return users_folder() or Path(tempfile.gettempdir(), f"ppy-rig-{os.geteuid()}")


def users_folder() -> Path | None:
    """Return the user's default folder of the cache; None if there is no home to write to."""
    import platformdirs

    try:
        usual = Path(platformdirs.user_cache_dir("ppy-rig"))
        nearest = next(place for place in (usual, *usual.parents) if place.exists())
    except (RuntimeError, PermissionError):  # no home is named, or it is another user's
        return None
    return usual if os.access(nearest, os.W_OK) else None


def cached_file(name: str, make: Callable[[], bytes], place: Path | None = None) -> Path:
    """Return the path of a file in the cache, making it if it is missing or damaged.

    Parameters
    ----------
    name : str
        Name that identifies the contents completely; it may contain folders.
    make : callable
        Returns the contents.
    place : Path, optional
        Folder of the cache; by default `folder`.

    Returns
    -------
    Path
        A complete regular file. It and its folders belong to this user, and no other user can write
        them.

    Raises
    ------
    UserError
        If the folder belongs to another user, or cannot be written.
    """
    root = place or folder()
    path = root / name
    with _write_errors(root):
        _make_private(root)
        for parent in reversed(path.parents):
            if root in parent.parents:  # a folder within the cache
                _make_private(parent)
    if not is_sound(path):
        contents = make()
        with _write_errors(root):
            _store(path, contents)
    return path


def _store(path: Path, contents: bytes) -> None:
    """Write an entry and its digest."""
    try:
        files.put(_digest_file(path), _digest_line(path, contents), 0o600)
        files.put(path, contents, 0o600)
    except OSError:
        if not is_sound(path):  # Windows does not replace a library that another process has loaded
            raise


@contextlib.contextmanager
def _write_errors(root: Path) -> Iterator[None]:
    """Replace errors of the file system by a UserError that proposes a remedy."""
    try:
        yield
    except OSError as error:
        reason = f"cannot be written ({error.strerror or error})"
        raise UserError(
            f"{root}: the cache {reason}; make room there, or name another folder in PPY_CACHE"
        ) from error


def is_sound(path: Path) -> bool:
    """Return whether an entry exists, is undamaged, and was written by this user."""
    try:
        return _read_private(_digest_file(path)) == _digest_line(path, _read_private(path))
    except OSError:
        return False


def _make_private(place: Path) -> None:
    """Make a folder that only this user can access, or remove the access of others.

    Raises
    ------
    OSError
        If it cannot be made.
    UserError
        If it belongs to another user, or others can still write it.
    """
    place.mkdir(mode=0o700, parents=True, exist_ok=True)
    if sys.platform == "win32":  # no modes; the folders of a user are private by default
        return
    target = place.stat()
    # the owner of a link may change its target
    for about in (place.lstat(), target):
        if about.st_uid != os.geteuid():
            raise _unusable(place, f"belongs to another user (number {about.st_uid})")
    if stat.S_IMODE(target.st_mode) & 0o077:
        with contextlib.suppress(OSError):
            place.chmod(0o700)
        if place.stat().st_mode & 0o022:
            raise _unusable(place, "can be written by other users, and its mode cannot be changed")


def _unusable(place: Path, why: str) -> UserError:
    """Return the error for a folder that cannot be the cache of this user."""
    return UserError(f"{place}: the cache {why}; name a folder of your own in PPY_CACHE")


def _read_private(path: Path) -> bytes:
    """Return the contents of a file of this user; raise OSError for any other file."""

    def opened(name: str, flags: int) -> int:
        return os.open(name, flags | NO_LINK | _NO_WAIT)

    with open(path, "rb", opener=opened) as file:
        about = os.fstat(file.fileno())
        private = sys.platform == "win32" or (
            about.st_uid == os.geteuid() and not about.st_mode & 0o022
        )
        if not stat.S_ISREG(about.st_mode) or not private:
            raise PermissionError(path)
        return file.read()


def _digest_file(path: Path) -> Path:
    """Return the path of the file with the digest of an entry."""
    return path.with_name(path.name + _DIGEST)


def _digest_line(path: Path, contents: bytes) -> bytes:
    """Return the digest file's line: the digest and the name, so that entries cannot be swapped."""
    return f"{hashlib.sha256(contents).hexdigest()}  {path.name}\n".encode()
