"""Shared libraries of C sources, compiled once on a machine."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from fmus.kit import files
from fmus.kit.build import toolchain


def library(sources: Mapping[str, bytes], unit: str, target: str, libraries: Sequence[str] = ()) -> Path:
    """Compile sources, or find the library in the cache.

    Parameters
    ----------
    sources : Mapping of str to bytes
        C files and headers by name, FMI's headers among them.
    unit : str
        Name of the file to compile.
    target : str
        FMI platform.
    libraries : sequence of str
        Names for ``-l``.

    Returns
    -------
    Path
        Named after all that goes into it, the compiler and its options included.

    Raises
    ------
    UserError
        If there is no compiler for the platform, or it fails.
    """
    told = [toolchain.find_compiler(target).version, target, unit, *toolchain.FLAGS, *libraries]
    digest = hashlib.sha256("\0".join(told).encode())
    for name in sorted(sources):
        digest.update(b"\0" + name.encode() + b"\0" + hashlib.sha256(sources[name]).digest())
    path = toolchain.cache_folder() / f"library-{digest.hexdigest()[:32]}{toolchain.EXTENSIONS[target]}"
    if not path.exists():
        with tempfile.TemporaryDirectory(prefix="ppy-") as folder:
            for name, contents in sources.items():
                (Path(folder) / name).write_bytes(contents)
            made = toolchain.compile_library([Path(folder) / unit], [Path(folder)], target, libraries=libraries)
        files.write_once(path, made)
    return path
