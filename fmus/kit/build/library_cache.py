"""Shared libraries of C sources, compiled once on a machine."""

from __future__ import annotations

import ctypes
import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path

from fmus.kit.build import toolchain
from fmus.kit.errors import UserError
from fmus.kit.storage import cache, scratch


def library(
    sources: Mapping[str, bytes], unit: str, target: str, libraries: Sequence[str] = ()
) -> Path:
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
        Named after all that goes into it, and sound; see :func:`load`.

    Raises
    ------
    UserError
        If there is no compiler for the platform, or it fails.
    """

    def made() -> bytes:
        with scratch.folder("sources") as folder:
            with scratch.written(folder):
                for name, contents in sources.items():
                    (folder / name).write_bytes(contents)
            return toolchain.compile_library([folder / unit], [folder], target, libraries=libraries)

    name = f"library-{key(sources, unit, target, libraries)}{toolchain.EXTENSIONS[target]}"
    return cache.entry(name, made)


def key(sources: Mapping[str, bytes], unit: str, target: str, libraries: Sequence[str] = ()) -> str:
    """Digest of all that goes into a library: the sources, the compiler, its version and its options.

    Parameters
    ----------
    sources, unit, target, libraries
        See :func:`library`.

    Returns
    -------
    str

    Raises
    ------
    UserError
        If there is no compiler for the platform.
    """
    compiler = toolchain.find_compiler(target)
    told = [compiler.version, target, unit, *map(repr, compiler.options(target, libraries))]
    digest = hashlib.sha256("\0".join(told).encode())
    for name in sorted(sources):
        digest.update(b"\0" + name.encode() + b"\0" + hashlib.sha256(sources[name]).digest())
    return digest.hexdigest()[:32]


def load(path: Path) -> ctypes.CDLL:
    """Load a library; one from the cache only if it is still what was written there.

    Raises
    ------
    UserError
        If it is not, or cannot be loaded.
    """
    if path.parent == cache.folder() and not cache.is_sound(path):
        raise UserError(
            f"{path}: was damaged since it was compiled; begin again, and it is compiled anew"
        )
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        raise UserError(f"{path}: cannot be loaded ({error})") from error
