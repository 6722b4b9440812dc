"""Key of a rig's server on this machine, which the server leaves in a file of its user's alone.

Needs the standard library alone: it is part of the Python FMU, and the server imports it.
"""

from __future__ import annotations

import os
import re
import socket
from pathlib import Path

_LONGEST = 100  # characters; a key has 32


def numeric(endpoint: str) -> str:
    """Return an endpoint with 127.0.0.1 in place of localhost.

    At another address of that name a stranger's process could listen and be told the key.
    """
    return endpoint.replace("//localhost:", "//127.0.0.1:")


def path(endpoint: str) -> Path:
    """Return the place of the key of the server at an endpoint, such as tcp://127.0.0.1:5570.

    The machine is part of the name, since machines may share their users' folders.
    """
    if os.name == "nt":
        base = os.environ.get("LOCALAPPDATA", "")
    else:
        base = os.environ.get("XDG_STATE_HOME") or os.path.expanduser("~/.local/state")
    address = re.sub(r"[^0-9A-Za-z.]", "_", numeric(endpoint).removeprefix("tcp://"))
    return Path(base, "ppy-rig", "keys", f"{socket.gethostname()}-{address}.key")


def read(endpoint: str) -> str:
    """Return the key of the server at an endpoint.

    Returns
    -------
    str
        Empty if there is no file with it, or one that others than this user could have written or
        can read.
    """
    try:
        flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0)
        with open(os.open(path(endpoint), flags), encoding="ascii") as file:
            about = os.fstat(file.fileno())
            key = file.read(_LONGEST).strip()
    except (OSError, ValueError):
        return ""
    # Windows has no such mode: there the folder is its user's by what it inherits
    is_ours = os.name == "nt" or (about.st_uid == os.geteuid() and not about.st_mode & 0o077)
    return key if is_ours else ""
