"""Hash chain over the lines of a log: what is changed, put in or taken out later breaks it.

Every line ends with a digest of the one before and of itself (Schneier and Kelsey, Secure audit
logs to support computer forensics, 1999, without their keys: who can write the file can write all
of it anew, or cut off its end).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from hashlib import sha256
from pathlib import Path

from fmus.kit import UserError

_DIGITS = 16
_SEALED = re.compile(rf"(.*) #([0-9a-f]{{{_DIGITS}}})")
_OPENED = re.compile(rf".* log opened, after ([0-9a-f]{{{_DIGITS}}})")
START = _DIGITS * "0"


def seal(before: str, line: str) -> str:
    """Return the digest of a line.

    Parameters
    ----------
    before : str
        Digest of the line before.
    line : str
    """
    return sha256(f"{before}\n{line}".encode()).hexdigest()[:_DIGITS]


def last_digest(lines: Iterable[str]) -> str:
    """Return the digest of the last line that has one."""
    digest = START
    for line in lines:
        sealed = _SEALED.fullmatch(line.rstrip("\n"))
        if sealed is not None:
            digest = sealed[2]
    return digest


def verify(paths: Sequence[Path]) -> int:
    """Check the chain of a log.

    Parameters
    ----------
    paths : sequence of Path
        Files of one log, the oldest first.

    Returns
    -------
    int
        Number of lines.

    Raises
    ------
    UserError
        If a file cannot be read, or at the first line that breaks the chain.
    """
    digest = ""
    count = 0
    for path in paths:
        for number, line in enumerate(_lines(path), start=1):
            sealed = _SEALED.fullmatch(line)
            opened = sealed and _OPENED.fullmatch(sealed[1])
            if opened and not digest:
                digest = opened[1]
            if sealed is None or seal(digest, sealed[1]) != sealed[2]:
                raise UserError(
                    f"{path}, line {number}: the chain is broken here: this line, or one before it,"
                    f" is not as it was written: {line[:80]!r}"
                )
            digest = sealed[2]
            count += 1
    return count


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: {getattr(error, 'strerror', error)}") from error
