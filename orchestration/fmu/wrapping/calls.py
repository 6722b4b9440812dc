"""A log of the calls of an FMU: a library in the place of its own, which writes them."""

from __future__ import annotations

import os
from pathlib import Path

import fmpy

from fmus.kit import UserError
from fmus.kit.build import cached_library, toolchain
from fmus.kit.storage import scratch

_MOST_LINES = 1_000_000  # some 100 MB


def log_calls(binaries: Path, version: int, log: Path, label: str) -> None:
    """Put a library that logs calls in the place of each library of an unpacked FMU.

    Parameters
    ----------
    binaries : Path
        Folder of the libraries.
    version : {2, 3}
        Major version of FMI.
    log : Path
        File to which a line for each call is appended.
    label : str
        Name of the FMU in messages.

    Raises
    ------
    UserError
        If the library cannot be compiled.
    """
    unit = f"calls{version}.c"
    here = Path(__file__).parent
    try:
        target = toolchain.host_platform()
        sources = {name: (here / name).read_bytes() for name in ("calls.c", "platform.c", unit)}
        for header in sorted(toolchain.fmi_headers(version).glob("*.h")):
            sources[header.name] = header.read_bytes()
        libraries = ("dl",) if target == "linux64" else ()
        compiled = cached_library(sources, unit, target, libraries)
    except UserError as error:
        raise UserError(f"{label}: a log of calls needs a C compiler here: {error}") from error
    with scratch.written(binaries):
        for library in list(binaries.glob(f"*{fmpy.sharedLibraryExtension}")):
            own = library.rename(library.with_stem(f"{library.stem}_logged"))
            library.write_bytes(compiled.read_bytes())
            table = f"{own}\n{log.resolve()}\n{_MOST_LINES}\n"
            library.with_suffix(".table").write_bytes(os.fsencode(table))
