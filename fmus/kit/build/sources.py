"""The C sources of an FMU: the front-end and an engine from ``fmi2``, the generated model, FMI's headers."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from fmus.kit.build import toolchain
from fmus.kit.symbolic import codegen
from fmus.kit.symbolic.trace import Graph

FOLDER = Path(__file__).parents[1] / "fmi2"
UNIT = "all.c"  # includes every other
_FRONT_END = ("instance.c", "evaluate.c", "lifecycle.c", "access.c", "snapshot.c", "step.c")
_HEADERS = ("engine.h", "instance.h", "evaluate.h")
_FMI_HEADERS = ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h")


@dataclass(frozen=True)
class _Engine:
    """Files of an engine (``fmi2/engine.h``), files that are generated for it, and what it is linked with."""

    header: str
    sources: tuple[str, ...]
    generated: tuple[str, ...]
    libraries: tuple[str, ...]


_ENGINES = {
    "native": _Engine("native.h", ("native.c", "integrate.c"), ("model.c", "laws.c"), ("m",)),
    "python": _Engine("python.h", ("python.c", "library.c"), ("model.c",), ("dl",)),
}


def c_sources(graph: Graph, runtime: str, guid: str) -> dict[str, bytes]:
    """Write every C file of a build, and the headers it needs.

    Parameters
    ----------
    graph : Graph
        The traced component.
    runtime : {"python", "native"}
    guid : str

    Returns
    -------
    dict of str to bytes
        Name to contents, :data:`UNIT` among them.
    """
    engine = _ENGINES[runtime]
    generate = codegen.native_sources if runtime == "native" else codegen.python_sources
    generated = {name: text.encode() for name, text in generate(graph, guid).items()}
    own = (*_HEADERS, engine.header, *_FRONT_END, *engine.sources)
    sources = {name: (FOLDER / name).read_bytes() for name in own}
    sources[UNIT] = unit(*_FRONT_END, *engine.sources, *engine.generated)
    sources |= {name: (toolchain.fmi_headers() / name).read_bytes() for name in _FMI_HEADERS}
    return sources | generated


def unit(*names: str) -> bytes:
    """Make one translation unit of C files.

    The compiler sees through the calls between the parts, and a tool has one file to compile.

    Parameters
    ----------
    *names : str
        Files to include.

    Returns
    -------
    bytes
    """
    return "".join(f'#include "{name}"\n' for name in names).encode()


def compiled(sources: Mapping[str, bytes], runtime: str, target: str) -> bytes:
    """Compile the sources of a build.

    Parameters
    ----------
    sources : Mapping of str to bytes
        See :func:`c_sources`.
    runtime : {"python", "native"}
    target : str
        FMI platform.

    Returns
    -------
    bytes
        The shared library.

    Raises
    ------
    UserError
        If there is no compiler for the platform, or it fails.
    """
    with tempfile.TemporaryDirectory(prefix="ppy-") as folder:
        for name, contents in sources.items():
            (Path(folder) / name).write_bytes(contents)
        libraries = _ENGINES[runtime].libraries
        return toolchain.compile_library([Path(folder) / UNIT], [Path(folder)], target, libraries=libraries)
