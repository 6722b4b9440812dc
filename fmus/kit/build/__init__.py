"""Building FMUs: everything that goes into the archive, for both runtimes."""

from __future__ import annotations

import hashlib
import importlib.metadata
import tempfile
import uuid
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from fmus.kit import files
from fmus.kit.build import archive, toolchain
from fmus.kit.build.bundle import RUNTIME_MODULES, bundle
from fmus.kit.build.contents import documents
from fmus.kit.build.description import Capabilities, describe
from fmus.kit.component import Component
from fmus.kit.errors import UserError
from fmus.kit.symbolic import codegen
from fmus.kit.symbolic.trace import Graph, trace

KIT = Path(__file__).parents[1]
_FRONT_END = ("lifecycle.c", "access.c", "snapshot.c", "step.c")
_ENGINES = {"native": ("native.c", "integrate.c"), "python": ("python.c", "library.c")}
_GENERATED = {"native": ("model.c", "laws.c"), "python": ("model.c",)}
_LIBRARIES = {"native": ("m",), "python": ("dl",)}
_HEADERS = {"native": ("engine.h", "instance.h", "native.h"), "python": ("engine.h", "instance.h", "python.h")}
_ALL = "all.c"
_FMI_HEADERS = ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h")
_NO_GUID = "{00000000-0000-0000-0000-000000000000}"
RUNTIMES = ("python", "native")


def version() -> str:
    """Version of this package."""
    return importlib.metadata.version("ppy-rig")


@dataclass(frozen=True)
class Plan:
    """What will be in the archive, but for the binaries.

    Attributes
    ----------
    name, runtime, guid : str
    files : dict of str to bytes
        Path in the archive to contents.
    sources : dict of str to bytes
        C files and headers by name.
    """

    name: str
    runtime: str
    guid: str
    files: dict[str, bytes]
    sources: dict[str, bytes]


def plan(cls: type[Component], runtime: str) -> Plan:
    """Collect everything that goes into an FMU and derive its GUID from it.

    Parameters
    ----------
    cls : type[Component]
        A component, possibly with effects stacked on it.
    runtime : {"python", "native"}
        Laws interpreted by Python, or compiled from C.

    Raises
    ------
    UserError
        If there is no such runtime.
    """
    if runtime not in RUNTIMES:
        raise UserError(f"unknown runtime {runtime!r}; there are: {', '.join(RUNTIMES)}")
    graph = trace(cls)
    files = documents(cls)
    files |= _python_package(cls) if runtime == "python" else {}
    native = runtime == "native"
    can = Capabilities(
        needs_execution_tool=not native,
        interpolates_inputs=native,
        directional_derivatives=native,
        sources=(_ALL,) if native else (),
    )
    unnamed = _sources(graph, runtime, _NO_GUID)
    guid = _guid(files | unnamed | {"modelDescription.xml": describe(cls, graph, can, version(), _NO_GUID)})
    sources = _sources(graph, runtime, guid)
    files["modelDescription.xml"] = describe(cls, graph, can, version(), guid)
    if native:
        files |= {f"sources/{name}": text for name, text in sources.items()}
    return Plan(cls.name, runtime, guid, files, sources)


def build(
    cls: type[Component],
    runtime: str,
    platforms: Sequence[str] | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> bytes:
    """Build an FMU.

    Parameters
    ----------
    cls, runtime
        See :func:`plan`.
    platforms : sequence of str, optional
        FMI platforms to compile for; default is every platform that a compiler here can serve.
    progress : callable
        Told what is being done, in a few words.

    Returns
    -------
    bytes
        The archive. The same sources give the same bytes.

    Raises
    ------
    UserError
        If no compiler is there, or a platform cannot be served.
    """
    planned = plan(cls, runtime)
    return archive.pack(planned.files | _binaries(planned, platforms or available_platforms(), progress))


def build_cached(cls: type[Component], runtime: str) -> Path:
    """Path of a component's FMU for this machine, built unless the cache has it.

    Raises
    ------
    UserError
        See :func:`build`.
    """
    planned = plan(cls, runtime)
    target = toolchain.host_platform()
    path = toolchain.cache_folder() / f"{planned.guid.strip('{}')}-{target}" / f"{cls.name}.fmu"
    if not path.exists():
        files.write_once(path, archive.pack(planned.files | _binaries(planned, [target], lambda text: None)))
    return path


def _binaries(planned: Plan, platforms: Sequence[str], progress: Callable[[str], None]) -> dict[str, bytes]:
    files = {}
    with tempfile.TemporaryDirectory(prefix="ppy-") as folder:
        for name, contents in planned.sources.items():
            (Path(folder) / name).write_bytes(contents)
        for target in platforms:
            progress(f"{planned.name}: {planned.runtime} for {target}, with {toolchain.find_compiler(target).label}")
            library = toolchain.compile_library(
                [Path(folder) / _ALL], [Path(folder)], target, libraries=_LIBRARIES[planned.runtime]
            )
            files[f"binaries/{target}/{planned.name}{toolchain.EXTENSIONS[target]}"] = library
    return files


def available_platforms() -> list[str]:
    """Platforms that a compiler on this machine can serve.

    Raises
    ------
    UserError
        If there is none, saying what to install.
    """
    found = []
    for target in toolchain.ZIG_TARGETS:
        try:
            toolchain.find_compiler(target)
        except UserError:
            continue
        found.append(target)
    if not found:
        toolchain.find_compiler(toolchain.host_platform())  # raises, with the hint
    return found


def _guid(files: dict[str, bytes]) -> str:
    """Identify the contents: the same files give the same GUID."""
    digest = hashlib.sha256()
    for name in sorted(files):
        digest.update(name.encode() + b"\0" + hashlib.sha256(files[name]).digest())
    return f"{{{uuid.UUID(bytes=digest.digest()[:16], version=5)}}}"


def _sources(graph: Graph, runtime: str, guid: str) -> dict[str, bytes]:
    """Every C file of the build, and the headers it needs."""
    generated = codegen.native_sources(graph, guid) if runtime == "native" else codegen.python_sources(graph, guid)
    files = (*_HEADERS[runtime], *_FRONT_END, *_ENGINES[runtime])
    own = {name: (KIT / "fmi2" / name).read_bytes() for name in files}
    # one translation unit: the compiler sees through the calls between the parts, and a tool has one file to compile
    parts = (*_FRONT_END, *_ENGINES[runtime], *_GENERATED[runtime])
    own[_ALL] = "".join(f'#include "{name}"\n' for name in parts).encode()
    own |= {name: (toolchain.fmi_headers() / name).read_bytes() for name in _FMI_HEADERS}
    return own | {name: text.encode() for name, text in generated.items()}


def _python_package(cls: type[Component]) -> dict[str, bytes]:
    """Return what Python needs at run time: the kit's light modules and the component's."""
    base, effects = vars(cls).get("stacked", (cls, ()))
    files = {f"kit/{name}.py": (KIT / f"{name}.py").read_bytes() for name in RUNTIME_MODULES}
    modules, places = bundle((base, *effects))
    files |= modules
    imports = ["from .kit import stack", "from .kit.slave import Slave"]
    # classes of different modules may share a name
    parts = {used: f"Part{n}" for n, used in enumerate(places)}
    imports += [f"from .{place} import {name} as {parts[used]}" for used, (place, name) in places.items()]
    stacked = ", ".join(_part(c, parts) for c in (base, *effects))
    others = f", defaults={values!r}" if (values := vars(cls).get("stacked_with")) else ""
    model = parts[base] if cls is base else f"stack({stacked}, name={cls.name!r}{others})"
    entry = '"""The component of this FMU; laws are in the folder beside."""\n\n' + "\n".join(sorted(imports))
    entry += f"\n\nMODEL = {model}\n\n\ndef create(memory):\n    return Slave(MODEL, memory)\n"
    files["__init__.py"] = entry.encode()
    needs = "Python 3.11 or newer (shared library or host process); no packages beyond the standard library.\n"
    packed = {f"resources/python/{name}": contents for name, contents in files.items()}
    return packed | {"documentation/externalDependencies.txt": needs.encode()}


def _part(cls: type[Component], parts: dict[type[Component], str]) -> str:
    """Text of a class in the FMU's package; one that is made for an output or a law is made for it again."""
    if "made_by" not in vars(cls):
        return parts[cls]
    arguments = vars(cls)["made_with"]
    owner = next(name for part, name in parts.items() if hasattr(part, arguments[0]))
    return f"{parts[cls]}({', '.join([owner, *map(repr, arguments)])})"
