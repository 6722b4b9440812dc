"""Building FMUs: everything that goes into the archive, for both runtimes."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from fmus.kit.build import archive, toolchain
from fmus.kit.build.contents import documents
from fmus.kit.build.package import python_package
from fmus.kit.build.toolchain import available_platforms
from fmus.kit.component import Component
from fmus.kit.errors import UserError
from fmus.kit.storage import cache

__all__ = [
    "RUNTIMES",
    "STOCK",
    "Plan",
    "available_platforms",
    "build",
    "build_cached",
    "plan",
    "version",
]

RUNTIMES = ("python", "native")  # behind our front-end
STOCK = "pythonfmu"  # for users of that; it holds less of the contract, see ``stock.LIMITS``


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
    libraries : Mapping of str to tuple of str
        What they are linked with, by platform.
    """

    name: str
    runtime: str
    guid: str
    files: dict[str, bytes]
    sources: dict[str, bytes]
    libraries: Mapping[str, tuple[str, ...]]


def plan(cls: type[Component], runtime: str) -> Plan:
    """Collect everything that goes into an FMU and derive its GUID from it.

    Parameters
    ----------
    cls : type[Component]
        A component, possibly with effects stacked on it.
    runtime : {"python", "native"}
        Laws interpreted by Python, or compiled from C.

    Returns
    -------
    Plan

    Raises
    ------
    UserError
        If there is no such runtime.
    """
    # CasADi takes a tenth of a second to load; compilers, parameter files and pages, below this package, need none
    from fmus.kit.build.description import Capabilities, describe
    from fmus.kit.build.sources import UNIT, c_sources, engine_sources
    from fmus.kit.symbolic.trace import trace

    _check(runtime, RUNTIMES)
    graph = trace(cls)
    native, engine = runtime == "native", engine_sources(cls, runtime)
    contents = documents(cls) | ({} if native else python_package(cls))
    can = Capabilities(
        needs_execution_tool=not native,
        interpolates_inputs=native and cls.engine is None,
        directional_derivatives=native and cls.engine is None,
        model_exchange=native and cls.engine is None,
        sources=(UNIT,) if native else (),
    )

    def described(guid: str) -> dict[str, bytes]:
        return {"modelDescription.xml": describe(cls, graph, can, version(), guid)}

    guid = archive.identity(
        contents | c_sources(graph, engine, archive.NO_GUID) | described(archive.NO_GUID)
    )
    sources = c_sources(graph, engine, guid)
    contents |= described(guid)
    if native:
        contents |= {f"sources/{name}": text for name, text in sources.items()}
    return Plan(cls.name, runtime, guid, contents, sources, engine.libraries)


def build(
    cls: type[Component],
    runtime: str,
    platforms: Sequence[str] | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> bytes:
    """Build an FMU.

    Parameters
    ----------
    cls : type[Component]
        A component, possibly with effects stacked on it.
    runtime : {"python", "native", "pythonfmu"}
        The first two as :func:`plan` has them; the last is a stock archive of pythonfmu (:mod:`.stock`).
    platforms : sequence of str, optional
        FMI platforms; default is every one that a compiler here, or pythonfmu, can serve.
    progress : callable
        Gets a few words on what is being done.

    Returns
    -------
    bytes
        The archive. The same sources give the same bytes.

    Raises
    ------
    UserError
        If no compiler is there, or pythonfmu is not, or a platform cannot be served.
    """
    _check(runtime, (*RUNTIMES, STOCK))
    if runtime == STOCK:
        from fmus.kit.build.stock import stock_archive

        return stock_archive(cls, version(), platforms, progress)
    return _packed(plan(cls, runtime), platforms or available_platforms(), progress)


def build_cached(cls: type[Component], runtime: str) -> Path:
    """Path of a component's FMU for this machine, built unless the cache has it.

    Parameters
    ----------
    cls, runtime
        See :func:`plan`.

    Returns
    -------
    Path
        In a folder that is named after the GUID and how its library is compiled, hence after all that is in the FMU.

    Raises
    ------
    UserError
        See :func:`build`.
    """
    from fmus.kit.build.sources import library_key

    planned = plan(cls, runtime)
    target = toolchain.host_platform()
    key = library_key(planned.sources, planned.libraries.get(target, ()), target)
    name = f"{planned.guid.strip('{}')}-{key}/{cls.name}.fmu"
    return cache.entry(name, lambda: _packed(planned, [target], lambda text: None))


def _check(runtime: str, known: Sequence[str]) -> None:
    if runtime not in known:
        raise UserError(f"unknown runtime {runtime!r}; there are: {', '.join(known)}")


def _packed(planned: Plan, platforms: Sequence[str], progress: Callable[[str], None]) -> bytes:
    """Compile what is planned, and zip it."""
    from fmus.kit.build.sources import compiled

    binaries = {}
    for target in platforms:
        progress(
            f"{planned.name}: {planned.runtime} for {target}, with {toolchain.find_compiler(target).label}"
        )
        path = f"binaries/{target}/{planned.name}{toolchain.EXTENSIONS[target]}"
        binaries[path] = compiled(planned.sources, planned.libraries.get(target, ()), target)
    return archive.pack(planned.files | binaries)
