"""Building of FMUs: planning the contents of the archive, compiling, and caching the result."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from fmus.kit.build import archive, toolchain
from fmus.kit.build.documentation import documents
from fmus.kit.build.package import python_package
from fmus.kit.component import Component
from fmus.kit.errors import UserError
from fmus.kit.storage import cache

RUNTIMES = ("python", "native")  # behind our front-end
STOCK = "pythonfmu"  # for users of pythonfmu; it fulfils less of the contract, see `stock.LIMITS`


def version() -> str:
    """Return the version of this package."""
    return importlib.metadata.version("ppy-rig")


@dataclass(frozen=True)
class BuildPlan:
    """The contents of an archive before its binaries are compiled.

    Attributes
    ----------
    name, runtime, guid : str
    files : dict of str to bytes
        Path in the archive to contents.
    sources : dict of str to bytes
        C files and headers by name.
    libraries : Mapping of str to tuple of str
        Libraries they are linked with, by platform.
    """

    name: str
    runtime: str
    guid: str
    files: dict[str, bytes]
    sources: dict[str, bytes]
    libraries: Mapping[str, tuple[str, ...]]


def plan_build(cls: type[Component], runtime: str) -> BuildPlan:
    """Plan the contents of an FMU, and derive its GUID from them.

    Parameters
    ----------
    cls : type[Component]
        A component, possibly with effects stacked on it.
    runtime : {"python", "native"}
        Laws interpreted by Python, or compiled from C.

    Returns
    -------
    BuildPlan

    Raises
    ------
    UserError
        If there is no such runtime.
    """
    # CasADi takes a tenth of a second to load, and other parts of this package do not need it
    from fmus.kit.build.description import Capabilities, describe
    from fmus.kit.build.sources import UNIT, c_sources, engine_sources
    from fmus.kit.symbolic import trace

    _check(runtime, RUNTIMES)
    graph = trace(cls)
    native = runtime == "native"
    compiled_laws = native and cls.engine is None
    engine = engine_sources(cls, runtime)
    contents = documents(cls)
    if not native:
        contents |= python_package(cls)
    can = Capabilities(
        needs_execution_tool=not native,
        interpolates_inputs=compiled_laws,
        directional_derivatives=compiled_laws,
        model_exchange=compiled_laws,
        sources=(UNIT,) if native else (),
    )

    def described(guid: str) -> dict[str, bytes]:
        return {"modelDescription.xml": describe(cls, graph, can, version(), guid)}

    guid = archive.identity(
        contents | c_sources(graph, engine, archive.NO_GUID, 2) | described(archive.NO_GUID)
    )
    sources = c_sources(graph, engine, guid, 2)
    contents |= described(guid)
    if native:
        contents |= {f"sources/{name}": text for name, text in sources.items()}
    return BuildPlan(cls.name, runtime, guid, contents, sources, engine.libraries)


def build(
    cls: type[Component],
    runtime: str,
    platforms: Sequence[str] | None = None,
    progress: Callable[[str], None] = lambda text: None,
    failed: Callable[[str, UserError], None] | None = None,
) -> bytes:
    """Build an FMU.

    Parameters
    ----------
    cls : type[Component]
        A component, possibly with effects stacked on it.
    runtime : {"python", "native", "pythonfmu"}
        The first two as :func:`plan_build` has them; the last is a stock archive of pythonfmu
        (:mod:`.stock`).
    platforms : sequence of str, optional
        FMI platforms; default is every one that a compiler here, or pythonfmu, can serve.
    progress : callable
        Called with a short message at each step.
    failed : callable, optional
        Called with each platform that cannot be served, and why; the archive then has the others.

    Returns
    -------
    bytes
        The archive. The same sources give the same bytes.

    Raises
    ------
    UserError
        If no compiler is there, or pythonfmu is not; if a platform cannot be served and nobody is
        told that it failed, or none can be served.
    """
    _check(runtime, (*RUNTIMES, STOCK))
    if runtime == STOCK:
        from fmus.kit.build.stock import stock_archive

        return stock_archive(cls, version(), platforms, progress)
    targets = platforms or toolchain.available_platforms()
    return _packed(plan_build(cls, runtime), targets, progress, failed)


def build_cached(cls: type[Component], runtime: str) -> Path:
    """Return the path of a component's FMU for this machine, building it unless the cache has it.

    Parameters
    ----------
    cls, runtime
        See :func:`plan_build`.

    Returns
    -------
    Path
        In a folder that is named after the GUID and the key of its library, hence after everything
        in the FMU.

    Raises
    ------
    UserError
        See :func:`build`.
    """
    from fmus.kit.build.sources import library_key

    planned = plan_build(cls, runtime)
    target = toolchain.host_platform()
    key = library_key(planned.sources, planned.libraries.get(target, ()), target)
    name = f"{planned.guid.strip('{}')}-{key}/{cls.name}.fmu"
    return cache.cached_file(name, lambda: _packed(planned, [target], lambda text: None))


def _check(runtime: str, known: Sequence[str]) -> None:
    """Check that there is such a runtime."""
    if runtime not in known:
        raise UserError(f"unknown runtime {runtime!r}; there are: {', '.join(known)}")


def _packed(
    planned: BuildPlan,
    platforms: Sequence[str],
    progress: Callable[[str], None],
    failed: Callable[[str, UserError], None] | None = None,
) -> bytes:
    """Compile the binaries of a plan, and pack the archive; see :func:`build`."""
    binaries: dict[str, bytes] = {}
    for target in platforms:
        try:
            binaries |= _binary(planned, target, progress)
        except UserError as error:
            is_last_hope = target == platforms[-1] and not binaries
            if failed is None or is_last_hope:
                raise
            failed(target, error)
    return archive.pack(planned.files | binaries)


def _binary(planned: BuildPlan, target: str, progress: Callable[[str], None]) -> dict[str, bytes]:
    """Compile the binary of a plan for a platform; return its path in the archive with it."""
    from fmus.kit.build.sources import compiled

    compiler = toolchain.find_compiler(target).label
    progress(f"{planned.name}: {planned.runtime} for {target}, with {compiler}")
    path = f"binaries/{target}/{planned.name}{toolchain.EXTENSIONS[target]}"
    return {path: compiled(planned.sources, planned.libraries.get(target, ()), target)}
