"""The C sources of an FMU: the front-end and an engine from ``fmi2``, the generated model, FMI's headers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from fmus.kit.build import library_cache, toolchain
from fmus.kit.component import Component
from fmus.kit.symbolic import codegen
from fmus.kit.symbolic.trace import Graph

FOLDER = Path(__file__).parents[1] / "fmi2"
UNIT = "all.c"  # includes every other
_FRONT_END = ("instance.c", "evaluate.c", "lifecycle.c", "access.c", "snapshot.c", "step.c")
_HEADERS = ("engine.h", "instance.h", "evaluate.h")
_FMI_HEADERS = ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h")


@dataclass(frozen=True)
class EngineSources:
    """Files of an engine (``fmi2/engine.h``), files that are generated for it, and what it is linked with.

    Attributes
    ----------
    headers, sources : tuple of Path
    generated : tuple of str
        What the unit includes of it, beside the tables that ``engine.h`` includes.
    libraries : Mapping of str to tuple of str
        By FMI platform.
    """

    headers: tuple[Path, ...]
    sources: tuple[Path, ...]
    generated: tuple[str, ...]
    libraries: Mapping[str, tuple[str, ...]]


def _unix(library: str) -> dict[str, tuple[str, ...]]:
    return dict.fromkeys(("linux64", "darwin64", "aarch64-linux"), (library,))


_NATIVE = EngineSources(
    (FOLDER / "native.h",),
    tuple(FOLDER / name for name in ("native.c", "integrate.c", "exchange.c")),
    ("laws.c",),
    _unix("m"),
)
_PYTHON = EngineSources(
    (FOLDER / "python.h",),
    tuple(FOLDER / name for name in ("python.c", "library.c", "interpreter.c", "resources.c")),
    (),
    _unix("dl"),
)


def engine_sources(cls: type[Component], runtime: str) -> EngineSources:
    """Find the C files of what computes a component.

    Parameters
    ----------
    cls : type[Component]
    runtime : {"python", "native"}

    Returns
    -------
    EngineSources
    """
    own = cls.engine
    if own is None or runtime == "python":
        return _PYTHON if runtime == "python" else _NATIVE
    folder = Path(next(iter(import_module(own.folder).__path__)))
    headers, sources = (
        tuple(folder / name for name in names) for names in (own.headers, own.sources)
    )
    return EngineSources(headers, sources, (), own.libraries)


def c_sources(graph: Graph, engine: EngineSources, guid: str) -> dict[str, bytes]:
    """Write every C file of a build, and the headers it needs.

    Parameters
    ----------
    graph : Graph
        The traced component.
    engine : EngineSources
    guid : str

    Returns
    -------
    dict of str to bytes
        Name to contents, :data:`UNIT` among them.
    """
    generate = codegen.native_sources if "laws.c" in engine.generated else codegen.lawless_sources
    generated = {name: text.encode() for name, text in generate(graph, guid).items()}
    own = (*(FOLDER / name for name in (*_HEADERS, *_FRONT_END)), *engine.headers, *engine.sources)
    sources = {path.name: path.read_bytes() for path in own}
    # an engine may have to say what it wants of the system before the first header is read
    sources[UNIT] = unit(*(path.name for path in engine.sources), *_FRONT_END, *engine.generated)
    return sources | fmi_headers() | generated


def fmi_headers() -> dict[str, bytes]:
    """Headers of FMI 2.0 by name."""
    return {name: (toolchain.fmi_headers() / name).read_bytes() for name in _FMI_HEADERS}


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


def compiled(sources: Mapping[str, bytes], libraries: Sequence[str], target: str) -> bytes:
    """Compile the sources of a build, unless the cache has their library.

    Parameters
    ----------
    sources : Mapping of str to bytes
        See :func:`c_sources`.
    libraries : sequence of str
        Names for ``-l``.
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
    return library_cache.library(sources, UNIT, target, libraries).read_bytes()


def library_key(sources: Mapping[str, bytes], libraries: Sequence[str], target: str) -> str:
    """Digest of all that goes into what :func:`compiled` returns."""
    return library_cache.key(sources, UNIT, target, libraries)
