"""A log of the calls of an FMU: a library in the place of its own, which writes them."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from fmus.kit.storage import scratch
from orchestration.fmu.wrapping.compiled import compiled

_MOST_LINES = 1_000_000  # some 100 MB


def log_calls(libraries: Iterable[Path], version: int, log: Path, label: str) -> None:
    """Put a library that logs calls in the place of each library of an unpacked FMU.

    Parameters
    ----------
    libraries : iterable of Path
        Those with functions of FMI.
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
    sources = (f"calls{version}.c", "calls.c", "platform.c")
    logging = compiled(sources, [version], f"{label}: a log of calls").read_bytes()
    for library in libraries:
        with scratch.written(library.parent):
            own = library.rename(library.with_stem(f"{library.stem}_logged"))
            library.write_bytes(logging)
            table = f"{own}\n{log.resolve()}\n{_MOST_LINES}\n"
            library.with_suffix(".table").write_bytes(os.fsencode(table))
