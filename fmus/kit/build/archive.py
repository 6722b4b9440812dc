"""The FMU as a zip whose bytes depend on nothing but its contents."""

from __future__ import annotations

import contextlib
import io
import uuid
import zipfile
from collections.abc import Mapping
from pathlib import Path

from fmus.kit.errors import UserError

_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest time a zip can tell


def pack(files: Mapping[str, bytes]) -> bytes:
    """Zip files reproducibly: sorted names, one fixed time, fixed permissions.

    Parameters
    ----------
    files : Mapping[str, bytes]
        Path inside the archive to contents.
    """
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
        # modelDescription.xml first: some tools look no further
        for name in sorted(files, key=lambda n: (n != "modelDescription.xml", n)):
            entry = zipfile.ZipInfo(name, _EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = (0o100755 if name.startswith("binaries/") else 0o100644) << 16
            entry.create_system = 3
            archive.writestr(entry, files[name])
    return buffer.getvalue()


def write(path: Path, contents: bytes) -> None:
    """Write a file whole or not at all, making its folder.

    Raises
    ------
    UserError
        If the folder or the file cannot be written.
    """
    # beside the target, so that replacing it is one step; of its own name, so that two writers do not mix
    temporary = path.with_name(f"{path.name}.{uuid.uuid4().hex}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_bytes(contents)
        temporary.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise UserError(f"cannot write {path}: {error.strerror}") from error


def write_once(path: Path, contents: bytes) -> None:
    """Write a file whose name tells its contents; if another process was faster, all is well.

    Raises
    ------
    UserError
        If it cannot be written and is not there.
    """
    try:
        write(path, contents)
    except UserError:
        if not path.exists():  # Windows refuses to replace a library that somebody has loaded
            raise
