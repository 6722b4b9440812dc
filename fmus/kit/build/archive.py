"""The FMU as a zip whose bytes depend on nothing but its contents."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping

_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest time that a zip can hold


def pack(files: Mapping[str, bytes]) -> bytes:
    """Zip files reproducibly: sorted names, one fixed time, fixed permissions.

    Parameters
    ----------
    files : Mapping[str, bytes]
        Path inside the archive to contents.

    Returns
    -------
    bytes
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
