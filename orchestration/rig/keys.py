"""CURVE keys of a rig: key files of its server and of each client that may connect.

The file of the server has the public keys of all clients. The file of a client holds the server's
public key as well, so that it is all that a client needs.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from secrets import token_hex
from typing import Any, NamedTuple

from psutil import Process

from fmus.kit import UserError
from fmus.rig_proxy import checked, key, local_key, read_table

SERVER_FILE = "rig-server.toml"
CLIENT_FILE = "rig-client.toml"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,39}")
_NAME_RULE = "has to be 1 to 40 letters, digits, - and _, and begin with none of -_"
ROLES = ("watch", "command", "acknowledge")
"""Roles of keys: each has the permissions of those before it. Everybody may stop."""
_FIRST_CLIENT = "first-client"
_PRIVATE = 0o700  # mode of a folder


class KeyHolder(NamedTuple):
    """The holder of a client's key.

    Attributes
    ----------
    name : str
    role : str
        One of :data:`ROLES`.
    """

    name: str
    role: str

    def has_role(self, needed: str) -> bool:
        """Return True if the holder's role is the one that is needed, or a higher one."""
        return self.role in ROLES[ROLES.index(needed) :]


@dataclass(frozen=True)
class ServerKeys:
    """The keys of a server and of the clients that it lets in, each in Z85.

    Attributes
    ----------
    public_key, secret_key : str
        Keys of the server.
    clients : dict of str to KeyHolder
        Holders of the keys of clients that are let in, by public key.
    """

    public_key: str
    secret_key: str
    clients: dict[str, KeyHolder]

    def __repr__(self) -> str:
        return f"ServerKeys(public_key={self.public_key!r}, clients={self.clients!r})"


class KeyFile:
    """A server's key file, which is read again when it has changed.

    Parameters
    ----------
    path : Path
    tell : callable
        Called with a line on what was read.

    Attributes
    ----------
    keys : ServerKeys
        As they were last read without an error.

    Raises
    ------
    UserError
        If the file cannot be used, as :func:`read_server_keys` says.
    """

    def __init__(self, path: Path, tell: Callable[[str], None]) -> None:
        self._path = path
        self._tell = tell
        self._version = self._look()
        self.keys = read_server_keys(path, tell)

    def _look(self) -> tuple[int, ...]:
        """Return what changes with the contents of the file; nothing if there is none."""
        try:
            about = self._path.stat()
        except OSError:
            return ()
        return about.st_mtime_ns, about.st_ctime_ns, about.st_size, about.st_ino

    def clients(self) -> Mapping[str, KeyHolder]:
        """Return the holders of keys, read again if the file has changed.

        A file that cannot be used leaves them as they were, and is told once.
        """
        version = self._look()
        if version == self._version:
            return self.keys.clients
        self._version = version
        try:
            keys = read_server_keys(self._path, self._tell)
            if keys.secret_key != self.keys.secret_key:
                raise UserError(f"{self._path}: has the keys of another server")
        except UserError as error:
            self._tell(f"{error}; the keys read before hold on")
            return self.keys.clients
        self._tell(_describe_change(self.keys.clients, keys.clients))
        self.keys = keys
        return keys.clients


def _describe_change(before: Mapping[str, KeyHolder], now: Mapping[str, KeyHolder]) -> str:
    """Describe which holders of keys are new, and which have no key or role of theirs any more."""

    def names(holders: set[KeyHolder]) -> str:
        return ", ".join(sorted(f"{holder.name} ({holder.role})" for holder in holders)) or "nobody"

    known = set(before.values())
    present = set(now.values())
    return f"keys read again: let in {names(present - known)}; shut out {names(known - present)}"


@contextmanager
def left_key(endpoint: str) -> Iterator[dict[str, KeyHolder]]:
    """Leave a new key for clients of this user while the context lasts.

    Parameters
    ----------
    endpoint : str
        Where the server listens already, so that no other one of this name can be running.

    Yields
    ------
    dict of str to KeyHolder
        This user, who may do everything, by the key (:func:`fmus.rig_proxy.local_key.read`); and
        whoever has none, who may watch. The key is new at every start, so that one that a stranger
        heard at the port of a server that had ended is of no use.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    path = local_key.path(endpoint)
    made = token_hex(16)
    try:
        path.parent.mkdir(_PRIVATE, parents=True, exist_ok=True)
        path.parent.chmod(_PRIVATE)
        path.unlink(missing_ok=True)  # of a server that was killed
    except OSError as error:
        raise UserError(
            f"cannot leave the key in {path}: {error.strerror}; --no-keys serves without"
        ) from error
    _write_new(path, f"{made}\n")
    try:
        yield {"": KeyHolder("", ROLES[0]), made: KeyHolder(Process().username(), ROLES[-1])}
    finally:
        with suppress(OSError):
            path.unlink()


def read_server_keys(path: Path, warn: Callable[[str], None] = lambda text: None) -> ServerKeys:
    """Read a server's key file, as ``ppy rig keys`` writes it.

    Parameters
    ----------
    path : Path
    warn : callable
        Called with a line if the file can be read by others than its owner.

    Returns
    -------
    ServerKeys

    Raises
    ------
    UserError
        If there is no such file, it is no TOML, or a key is missing or malformed: one line, which
        shows no secret.
    """
    table = read_table(path, warn)
    if "server_key" in table:
        raise UserError(
            f"{path}: this is the key file of a client; a server has public_key, secret_key and"
            " clients"
        )
    clients = table.get("clients")
    if not isinstance(clients, list):
        raise UserError(f"{path}: clients must be a list of those who may connect")
    allowed = dict(_read_client(row, f"{path}: clients[{k}]") for k, row in enumerate(clients))
    return ServerKeys(key(table, "public_key", path), key(table, "secret_key", path), allowed)


def _read_client(row: Any, where: str) -> tuple[str, KeyHolder]:
    """Return the public key and its holder from a client's row in the server's file."""
    if not isinstance(row, dict):
        raise UserError(f"{where} must be {{ key = ..., name = ..., role = ... }}")
    name = row.get("name")
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise UserError(f"{where}: name {name!r} {_NAME_RULE}")
    role = row.get("role")
    if role not in ROLES:
        raise UserError(f"{where}: role {role!r}; there are {', '.join(ROLES)}")
    return checked(row.get("key"), f"{where}: key"), KeyHolder(name, role)


def make_keys(folder: Path) -> tuple[Path, Path]:
    """Make a key pair for a server and one for a first client.

    Parameters
    ----------
    folder : Path
        Folder of the two files; made if it does not exist.

    Returns
    -------
    tuple of Path
        The server's file and the client's; only their owner can read them.

    Raises
    ------
    UserError
        If one of them is there already or cannot be written; then none is left behind.
    """
    public, secret = _new_pair()
    server = folder / SERVER_FILE
    client = folder / CLIENT_FILE
    for path in (server, client):
        if path.exists():
            raise UserError(
                f"{path}: there are keys already; they are not overwritten (--client NAME adds a"
                " client)"
            )
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"cannot make {folder}: {error.strerror}") from error
    client_key = _write_client(client, public)
    keys = ServerKeys(public, secret, {client_key: KeyHolder(_FIRST_CLIENT, ROLES[-1])})
    try:
        _write_new(server, _encode_server_file(keys))
    except UserError:
        client.unlink(missing_ok=True)
        raise
    return server, client


def add_client(folder: Path, name: str, role: str = "command") -> Path:
    """Make a key pair for one more client, and let the server know it.

    Parameters
    ----------
    folder : Path
        Folder with the server's file.
    name : str
        Name of the client: letters, digits, ``-`` and ``_``.
    role : str
        One of :data:`ROLES`.

    Returns
    -------
    Path
        The client's file. A server that is running lets the client in within a second or two.

    Raises
    ------
    UserError
        If there are no keys of a server, the client is there already, or a file cannot be written;
        the server's file is then as it was.
    """
    if not _NAME.fullmatch(name):
        raise UserError(f"--client: name {name!r} {_NAME_RULE}")
    if role not in ROLES:
        raise UserError(f"--role {role!r}: there are {', '.join(ROLES)}")
    server = folder / SERVER_FILE
    client = folder / f"rig-client-{name}.toml"
    # Only one process can make it: it is the lock on the server's file as well as its replacement.
    replacement = server.with_name(f"{SERVER_FILE}.part")
    read_server_keys(server)
    _write_new(replacement, "")
    try:
        keys = read_server_keys(server)
        public = _write_client(client, keys.public_key)
        clients = {**keys.clients, public: KeyHolder(name, role)}
        extended = ServerKeys(keys.public_key, keys.secret_key, clients)
        try:
            replacement.write_text(_encode_server_file(extended), encoding="utf-8")
            replacement.replace(server)
        except OSError as error:
            client.unlink(missing_ok=True)
            raise UserError(f"cannot write {server}: {error.strerror}") from error
    finally:
        with suppress(OSError):
            replacement.unlink(missing_ok=True)
    return client


def _new_pair() -> tuple[str, str]:
    """Return a new public key and its secret key."""
    import zmq

    if not zmq.has("curve"):
        raise UserError(
            "this ZeroMQ was built without CURVE; install pyzmq from its wheels: pip install pyzmq"
        )
    public, secret = zmq.curve_keypair()
    return public.decode(), secret.decode()


def _write_client(path: Path, server: str) -> str:
    """Write the file of a new client; return its public key."""
    public, secret = _new_pair()
    _write_new(
        path,
        "# Keys of a client of the rig: pass this file on to that client alone, and let nobody else"
        " read it.\n"
        f'server_key = "{server}"\npublic_key = "{public}"\nsecret_key = "{secret}"\n',
    )
    return public


def _encode_server_file(keys: ServerKeys) -> str:
    """Return the contents of a server's key file."""
    clients = "".join(
        f'  {{ key = "{public}", name = "{holder.name}", role = "{holder.role}" }},\n'
        for public, holder in keys.clients.items()
    )
    return (
        "# Keys of the rig's server: this file stays on its machine, and nobody else may read it.\n"
        f'public_key = "{keys.public_key}"\nsecret_key = "{keys.secret_key}"\n'
        "# Who may connect, for what: watch (and stop), command, or acknowledge (all there is).\n"
        "# To shut somebody out, delete the line; a server that is running sees it.\n"
        f"clients = [\n{clients}]\n"
    )


def _write_new(path: Path, text: str) -> None:
    """Write a file that must not exist yet, readable by nobody but its owner from the start."""
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError as error:
        hint = "; if no other ppy rig keys is at work, delete it" if path.suffix == ".part" else ""
        raise UserError(f"{path}: is there already and is not overwritten{hint}") from error
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror}") from error
    try:
        with os.fdopen(descriptor, "w", encoding="utf-8", newline="\n") as file:
            file.write(text)
    except OSError as error:
        path.unlink(missing_ok=True)
        raise UserError(f"cannot write {path}: {error.strerror}") from error
