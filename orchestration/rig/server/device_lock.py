"""Lock of a device: of all servers of all users on a machine, one has it.

The front has it, not the process that has the device open at the moment: when a device's process
fails, the guard opens the device in its place. The operating system holds the lock, which therefore
ends with the front, however that ends.
"""

from __future__ import annotations

import os
import socket
import struct
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from datetime import datetime
from pathlib import Path

import psutil
from filelock import FileLock, Timeout

from fmus.kit import UserError
from orchestration.rig.server.latch_file import digest

_CREDENTIALS = struct.Struct("3i")  # process, user, group (unix(7), SO_PEERCRED)
_PATIENCE = 1.0  # s for the process that has a device


@contextmanager
def locked(devices: Sequence[str]) -> Iterator[None]:
    """Lock devices for this process while the context lasts.

    Parameters
    ----------
    devices : sequence of str

    Raises
    ------
    UserError
        If another process has locked one of them, which the text names.
    """
    with ExitStack() as stack:
        for device in sorted(set(devices)):
            stack.enter_context(_locked(device))
        yield


@contextmanager
def _locked(device: str) -> Iterator[None]:
    """Lock one device while the context lasts."""
    name = f"ppy-rig-{digest(device)}"
    with _bound(device, name) if sys.platform == "linux" else _locked_file(device, name):
        yield


@contextmanager
def _bound(device: str, name: str) -> Iterator[None]:
    """Hold a name of the kernel's own, which nobody can delete as one could a file (unix(7))."""
    address = f"\0{name}"
    with socket.socket(socket.AF_UNIX) as held:
        try:
            held.bind(address)
        except OSError as error:
            raise _taken(device, _owner(address)) from error
        held.listen()
        yield


def _owner(address: str) -> str:
    """Return the process that holds a name, and since when, in words; empty if it is unknown."""
    with suppress(OSError, psutil.Error), socket.socket(socket.AF_UNIX) as asking:
        asking.settimeout(_PATIENCE)
        asking.connect(address)
        credentials = asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
        number, *_ = _CREDENTIALS.unpack(credentials)
        begun = datetime.fromtimestamp(psutil.Process(number).create_time())
        return f"process {number} since {begun.isoformat(' ', 'seconds')}"
    return ""


@contextmanager
def _locked_file(device: str, name: str) -> Iterator[None]:
    """Lock a file that all users of this machine share."""
    path = _folder() / f"{name}.lock"
    lock = FileLock(path, timeout=0, mode=0o666)
    try:
        lock.acquire()
    except Timeout as error:
        raise _taken(device, "") from error
    except OSError as error:
        raise UserError(
            f"{device} cannot be locked: {path}: {error.strerror or error}; it may be of a server"
            " that another user has started"
        ) from error
    try:
        yield
    finally:
        lock.release()


def _taken(device: str, owner: str) -> UserError:
    return UserError(f"{device} is served already, by {owner or 'another process'}; end that first")


def _folder() -> Path:
    if sys.platform == "win32":
        return Path(os.environ.get("PROGRAMDATA", r"C:\ProgramData"))
    return Path("/tmp")
