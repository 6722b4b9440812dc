"""The C sources of the benchmarks, compiled with the compiler and the options of the components."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from fmus.kit.build import toolchain

SOURCES = Path(__file__).parent / "c"


def library(source: str, folder: str | Path) -> Path:
    """Compile one file of ``c/`` into a shared library for this machine.

    Parameters
    ----------
    source : str
        Name of the file.
    folder : path
        Where the library goes.

    Returns
    -------
    Path
    """
    target = toolchain.host_platform()
    copy = Path(folder) / source  # in a new place: zig would remember the old one
    shutil.copyfile(SOURCES / source, copy)
    path = copy.with_suffix(toolchain.EXTENSIONS[target])
    path.write_bytes(
        toolchain.compile_library(
            [copy], [*map(toolchain.fmi_headers, (2, 3))], target, libraries=("m",)
        )
    )
    return path


def empty_library() -> bytes:
    """Compile the empty FMU, the least that the compiler can be asked for."""
    with tempfile.TemporaryDirectory(prefix="benchmark_") as folder:
        return library("empty.c", folder).read_bytes()
