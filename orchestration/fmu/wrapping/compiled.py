"""Libraries that stand between this program and an FMU, compiled once and kept in the cache."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fmus.kit import UserError
from fmus.kit.build import cached_library, toolchain

LIBRARIES = {"linux64": ("dl",)}  # by platform


def compiled(sources: Sequence[str], versions: Sequence[int], purpose: str) -> Path:
    """Return the path of a library of this folder, which is compiled if it is not in the cache.

    Parameters
    ----------
    sources : sequence of str
        Names of C files and headers; the first one includes the others.
    versions : sequence of {2, 3}
        Versions of FMI whose headers it needs.
    purpose : str
        Subject of the error without a compiler.

    Raises
    ------
    UserError
        If it cannot be compiled.
    """
    here = Path(__file__).parent
    contents = {name: (here / name).read_bytes() for name in sources}
    for version in versions:
        for header in sorted(toolchain.fmi_headers(version).glob("*.h")):
            contents[header.name] = header.read_bytes()
    try:
        target = toolchain.host_platform()
        return cached_library(contents, sources[0], target, LIBRARIES.get(target, ()))
    except UserError as error:
        raise UserError(f"{purpose} needs a C compiler here: {error}") from error
