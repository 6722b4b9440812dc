"""Key files of the rig's clients: TOML with CURVE keys, each forty characters of Z85.

Needs the standard library alone: it is part of the Python FMU, and ``ppy rig`` imports it.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..kit import UserError

_ALPHABET = "0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ.-:+=^!/*?&<>()[]{}@%$#"
_LENGTH = 40  # characters: 32 bytes, five characters for every four of them
_LARGEST = 64 * 1024  # bytes; a key file has a few hundred


@dataclass(frozen=True)
class ClientKeys:
    """Keys with which a client authenticates and encrypts; each is Z85.

    Attributes
    ----------
    server_key : str
        Public key of the server.
    public_key, secret_key : str
        Keys of the client.
    """

    server_key: str
    public_key: str
    secret_key: str

    def __repr__(self) -> str:
        return f"ClientKeys(public_key={self.public_key!r})"  # a secret has no place in a log

    def secure(self, socket: Any) -> None:
        """Make a ZeroMQ socket authenticate itself to the server with these keys, and encrypt.

        Parameters
        ----------
        socket : zmq.Socket
            Not connected yet.
        """
        socket.curve_serverkey = self.server_key.encode()
        socket.curve_publickey = self.public_key.encode()
        socket.curve_secretkey = self.secret_key.encode()


def read_client_keys(path: Path, warn: Callable[[str], None] = lambda text: None) -> ClientKeys:
    """Read a client's key file, as ``ppy rig keys`` writes it.

    Parameters
    ----------
    path : Path
    warn : callable
        Called with a line if the file can be read by others than its owner.

    Returns
    -------
    ClientKeys

    Raises
    ------
    UserError
        If there is no such file, it is not TOML, or a key is missing or not valid. The message is
        one line and shows no secret.
    """
    table = read_table(path, warn)
    if "clients" in table:
        raise UserError(
            f"{path}: this is the key file of a server; a client has server_key, public_key and"
            " secret_key"
        )
    keys = {name: key(table, name, path) for name in ("server_key", "public_key", "secret_key")}
    return ClientKeys(**keys)


def read_table(path: Path, warn: Callable[[str], None] = lambda text: None) -> dict[str, Any]:
    """Read the TOML table of a key file without checking its keys.

    Parameters are those of :func:`read_client_keys`.

    Raises
    ------
    UserError
        If there is no such file, or it is not TOML.
    """
    import tomllib

    try:
        with path.open("rb") as file:
            mode = os.fstat(file.fileno()).st_mode
            content = file.read(_LARGEST + 1)
    except FileNotFoundError as error:
        raise UserError(f"{path}: there is no such key file (ppy rig keys makes one)") from error
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror or error}") from error
    if len(content) > _LARGEST:
        raise UserError(f"{path}: more than {_LARGEST} bytes; this is no key file")
    try:
        table = tomllib.loads(content.decode())
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        # the text of the error may quote a secret and is not passed on
        raise UserError(f"{path}: no key file: not TOML") from error
    if os.name != "nt" and mode & (stat.S_IRGRP | stat.S_IROTH):
        warn(f"{path} holds a secret key and can be read by others: chmod 600 {path}")
    return table


def key(table: dict[str, Any], name: str, path: Path) -> str:
    """Return a key from the table of a key file.

    Raises
    ------
    UserError
        If the key is missing or not valid.
    """
    if name not in table:
        raise UserError(f"{path}: {name} is missing")
    return checked(table[name], f"{path}: {name}")


def checked(text: Any, where: str) -> str:
    """Return a text after checking that it is a key in Z85.

    Raises
    ------
    UserError
        If it is not; the message begins with ``where`` and does not show the text.
    """
    if not isinstance(text, str):
        raise UserError(f"{where} must be a text of {_LENGTH} characters (Z85)")
    if len(text) != _LENGTH:
        raise UserError(f"{where} has {len(text)} characters; a key has {_LENGTH} (Z85)")
    # every five characters are the digits to base 85 of an unsigned integer of four bytes
    for start in range(0, _LENGTH, 5):
        value = 0
        for character in text[start : start + 5]:
            digit = _ALPHABET.find(character)
            if digit < 0:
                raise UserError(
                    f"{where} is not Z85: one of characters {start + 1} to {start + 5} cannot be in"
                    " a key"
                )
            value = value * len(_ALPHABET) + digit
        if value >= 2**32:
            raise UserError(
                f"{where} is not Z85: characters {start + 1} to {start + 5} stand for no four bytes"
            )
    return text
