"""Compressed files: what is in them."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

from orchestration.records.record import refuse

PACKED = (".gz", ".bz2", ".xz", ".zip")
_STREAMS: dict[bytes, Callable[[IO[bytes]], Any]] = {
    b"\x1f\x8b": lambda file: gzip.GzipFile(fileobj=file),
    b"BZh": bz2.BZ2File,
    b"\xfd7zXZ\x00": lzma.LZMAFile,
    b"PK\x03\x04": lambda file: _only_member(file),
}
_LARGEST = 2**31  # bytes; a small file may unpack to any size


def unpacked(path: Path, content: bytes) -> bytes:
    """Return the content of a compressed file, or content that is not compressed as it is.

    Parameters
    ----------
    path : Path
        The file, for messages.
    content : bytes

    Returns
    -------
    bytes
        Also of a spreadsheet, which is a zip file with parts that only its reader knows.

    Raises
    ------
    UserError
        If it is damaged, unpacks to more than 2 GiB, or is a zip file of several files.
    """
    for signature, stream in _STREAMS.items():
        if content.startswith(signature) and not is_spreadsheet(content):
            try:
                with stream(io.BytesIO(content)) as file:
                    result = file.read(_LARGEST + 1)
            except _Several as error:
                raise refuse(path, f"this zip file has {error}; unpack it") from error
            except Exception as error:  # a damaged file may raise any exception
                raise refuse(path, f"the compressed file is damaged: {error}") from error
            if len(result) > _LARGEST:
                raise refuse(path, f"unpacks to more than {_LARGEST / 2**30:g} GiB")
            return result
    return content


class _Several(Exception):
    """A zip file without one file in it."""


def _only_member(file: IO[bytes]) -> IO[bytes]:
    """Return the file in a zip file; raise if there is not one."""
    archive = zipfile.ZipFile(file)
    names = [info.filename for info in archive.infolist() if not info.is_dir()]
    if len(names) != 1:
        raise _Several(f"{len(names)} files")
    return archive.open(names[0])


def is_spreadsheet(content: bytes) -> bool:
    """Return whether a file is a spreadsheet of Office or OpenDocument."""
    is_zip = content.startswith(b"PK\x03\x04")
    return is_zip and (b"[Content_Types].xml" in content or b"opendocument" in content[:200])
