"""The C sources of an FMU: the front-end and an engine of ``fmi``, the model, FMI's headers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from fmus.kit.build import toolchain
from fmus.kit.component import Component
from fmus.kit.symbolic import Graph, codegen, packing

FOLDER = Path(__file__).parents[1] / "fmi"
UNIT = "all.c"  # includes every other C file
_FRONT_END = (
    "any_model.h",
    "engine.h",
    "instance.h",
    "evaluate.h",
    "lifecycle.h",
    "values.h",
    "derivatives.h",
    "step.h",
    "instance.c",
    "evaluate.c",
    "lifecycle.c",
    "values.c",
    "derivatives.c",
    "snapshot.c",
    "step.c",
)
_RECORD_MODEL = (
    "engine.h",
    "any_model.h",
    "export.h",
    "this_model.h",
    "shared_model.c",
)
_RECORD_ENGINE = (
    "any_model.h",
    "any_model.c",
    "export.h",
    "native.h",
    "samples.h",
    "native.c",
    "integrate.c",
    "exponential.c",
    "record.c",
)


@dataclass(frozen=True)
class _Version:
    """The C files for a version of FMI.

    Attributes
    ----------
    standard : tuple of str
        Headers of the standard, in ``standard``.
    front_end : tuple of str
        Files of every build, in ``fmi``.
    laws, lawless : tuple of str
        Files of a build with laws in C, and of one without.
    """

    standard: tuple[str, ...]
    front_end: tuple[str, ...]
    laws: tuple[str, ...]
    lawless: tuple[str, ...]


_VERSIONS = {
    2: _Version(
        ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
        ("fmi2/host.h", "fmi2/common.c", "fmi2/co_simulation.c"),
        ("exchange.h", "exchange.c", "events.c", "fmi2/model_exchange.c"),
        ("no_laws.c",),
    ),
    3: _Version(
        ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
        (
            "fmi3/host.h",
            "fmi3/variables.h",
            "fmi3/arrays.h",
            "fmi3/extra_laws.h",
            "exchange.h",
            "samples.h",
            "fmi3/common.c",
            "fmi3/arrays.c",
            "fmi3/access.c",
            "fmi3/partials.c",
            "fmi3/clocks.c",
            "fmi3/co_simulation.c",
            "fmi3/unused.c",
            "exchange.c",
            "events.c",
            "fmi3/model_exchange.c",
        ),
        ("fmi3/extra_laws.c",),
        ("no_laws.c", "fmi3/no_extra_laws.c"),
    ),
}


@dataclass(frozen=True)
class EngineSources:
    """The files of an engine (``fmi/engine.h``) and the libraries it is linked with.

    Attributes
    ----------
    headers, sources : tuple of Path
        Files that are included, and files that are compiled.
    generated : tuple of str
        Generated files that are compiled; the generated tables that ``engine.h`` includes are not
        among them.
    libraries : Mapping of str to tuple of str
        Names for ``-l`` by FMI platform.
    """

    headers: tuple[Path, ...]
    sources: tuple[Path, ...]
    generated: tuple[str, ...]
    libraries: Mapping[str, tuple[str, ...]]


def _unix(*libraries: str) -> dict[str, tuple[str, ...]]:
    """Return libraries by platform, for every platform but Windows."""
    return dict.fromkeys(("linux64", "darwin64", "aarch64-linux"), libraries)


_NATIVE = EngineSources(
    tuple(FOLDER / name for name in ("native.h", "samples.h", "this_model.h")),
    tuple(FOLDER / name for name in ("native.c", "integrate.c", "hosted.c")),
    ("laws.c",),
    _unix("m"),
)
_PYTHON = EngineSources(
    tuple(FOLDER / name for name in ("python.h", "resources.h", "shared_library.h")),
    tuple(FOLDER / name for name in ("python.c", "library.c", "interpreter.c", "resources.c")),
    (),
    _unix("dl"),
)
PACKED = EngineSources(
    tuple(
        FOLDER / name
        for name in (
            "native.h",
            "samples.h",
            "resources.h",
            "shared_library.h",
            "native.c",
            "any_model.c",
            "integrate.c",
            "resources.c",
            "fmu_member.c",
        )
    ),
    (FOLDER / "packed.c",),
    (),
    _unix("m", "dl"),
)


def engine_sources(cls: type[Component], runtime: str) -> EngineSources:
    """Return the C files of the engine that computes a component.

    Parameters
    ----------
    cls : type[Component]
    runtime : {"python", "native"}

    Returns
    -------
    EngineSources
    """
    engine = cls.engine
    if engine is None or runtime == "python":
        return _PYTHON if runtime == "python" else _NATIVE
    folder = Path(next(iter(import_module(engine.folder).__path__)))
    headers = tuple(folder / name for name in engine.headers)
    sources = tuple(folder / name for name in engine.sources)
    return EngineSources(headers, sources, (), engine.libraries)


def c_sources(
    graph: Graph,
    engine: EngineSources,
    guid: str,
    fmi: int,
    packed: packing.PackedSystem | None = None,
) -> dict[str, bytes]:
    """Write every C file of a build, and the headers it needs.

    Parameters
    ----------
    graph : Graph
        The traced component.
    engine : EngineSources
    guid : str
    fmi : {2, 3}
        Version of FMI.
    packed : PackedSystem, optional
        The system whose graph that is, for the engine :data:`PACKED`.

    Returns
    -------
    dict of str to bytes
        Name to contents, :data:`UNIT` among them.
    """
    version = _VERSIONS[fmi]
    laws = version.lawless
    if packed is not None:
        texts = packing.packed_sources(packed, guid)
    elif "laws.c" in engine.generated:
        texts = codegen.native_sources(graph, guid, fmi=fmi)
        laws = version.laws
    else:
        texts = codegen.lawless_sources(graph, guid)
    files = (
        *engine.headers,
        *(toolchain.fmi_headers(fmi) / name for name in version.standard),
        # an engine may have to define feature macros of the system before the first header is read
        *engine.sources,
        *(FOLDER / name for name in (*_FRONT_END, *version.front_end, *laws)),
    )
    sources = {path.name: path.read_bytes() for path in files}
    # what an engine includes itself is among its headers
    included = {path.name for path in engine.headers}
    parts = (name for name in sources if name.endswith(".c") and name not in included)
    generated = {name: text.encode() for name, text in texts.items()}
    return sources | {UNIT: unit(*parts, *engine.generated)} | generated


def record_engine_sources() -> dict[str, bytes]:
    """Return the C files of the library that simulates any model over records (``fmi/record.c``).

    Returns
    -------
    dict of str to bytes
        Name to contents, :data:`UNIT` among them.
    """
    sources = {name: (FOLDER / name).read_bytes() for name in _RECORD_ENGINE}
    return sources | {UNIT: unit("record.c", "native.c", "any_model.c")}


def record_model_sources(graph: Graph) -> dict[str, bytes]:
    """Return the C files of the library of one model, which the record library simulates.

    Parameters
    ----------
    graph : Graph
        The traced component, possibly extended by sensitivities.

    Returns
    -------
    dict of str to bytes
        Name to contents, :data:`UNIT` among them.
    """
    sources = {name: (FOLDER / name).read_bytes() for name in _RECORD_MODEL}
    for name, text in codegen.native_sources(graph, "", hosted=False).items():
        sources[name] = text.encode()
    return sources | {UNIT: unit("shared_model.c", "laws.c")}


def record_sources(graph: Graph) -> dict[str, bytes]:
    """Return the C files of a library that contains one model and simulates it over records.

    Parameters
    ----------
    graph : Graph
        See :func:`record_model_sources`.

    Returns
    -------
    dict of str to bytes
        Name to contents, :data:`UNIT` among them.
    """
    both = record_engine_sources() | record_model_sources(graph)
    return both | {UNIT: unit("record.c", "native.c", "shared_model.c", "laws.c")}


def unit(*names: str) -> bytes:
    """Return a C file that includes others as one translation unit.

    The compiler can then inline calls between the files, and a tool has one file to compile.

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
    """Compile the sources of a build, or read their library from the cache.

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
    return toolchain.cached_library(sources, UNIT, target, libraries).read_bytes()


def library_key(sources: Mapping[str, bytes], libraries: Sequence[str], target: str) -> str:
    """Return the digest of everything that goes into the library of :func:`compiled`."""
    return toolchain.library_digest(sources, UNIT, target, libraries)
