"""The archive of an FMU: a zip file whose bytes depend on its contents only; GUID and folder."""

from __future__ import annotations

import hashlib
import io
import uuid
import zipfile
from collections.abc import Mapping

# placeholder in a description whose GUID is not derived yet
NO_GUID = "{00000000-0000-0000-0000-000000000000}"
_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest time that a zip can hold


def pack(files: Mapping[str, bytes]) -> bytes:
    """Zip files reproducibly: with sorted names, one fixed time and fixed permissions.

    Parameters
    ----------
    files : Mapping[str, bytes]
        Path inside the archive to contents.

    Returns
    -------
    bytes
        The archive.
    """
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
        # modelDescription.xml first: some tools look no further
        for name in sorted(files, key=lambda n: (n != "modelDescription.xml", n)):
            entry = zipfile.ZipInfo(name, _EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            # type and permissions of a file of Unix, the system 3
            entry.external_attr = (0o100755 if name.startswith("binaries/") else 0o100644) << 16
            entry.create_system = 3
            archive.writestr(entry, files[name])
    return buffer.getvalue()


def identity(files: Mapping[str, bytes]) -> str:
    """Return a GUID for files: the same files have the same GUID.

    Parameters
    ----------
    files : Mapping[str, bytes]
        Path to contents.

    Returns
    -------
    str
        In braces.
    """
    digest = hashlib.sha256()
    for name in sorted(files):
        digest.update(name.encode() + b"\0" + hashlib.sha256(files[name]).digest())
    return f"{{{uuid.UUID(bytes=digest.digest()[:16], version=5)}}}"


def folder_of(runtime: str, fmi: int) -> str:
    """Return the name of the folder that builds of one kind are written to.

    Parameters
    ----------
    runtime : {"python", "native", "pythonfmu"}
    fmi : {2, 3}
        Version of FMI.

    Returns
    -------
    str
    """
    return runtime if fmi == 2 else {"native": "fmi3"}.get(runtime, f"fmi3-{runtime}")
