"""Building of FMUs: plan the contents of the archive, compile, and cache the result."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fmus.kit.build import archive, toolchain
from fmus.kit.build.documentation import documents
from fmus.kit.build.package import python_package
from fmus.kit.component import Component
from fmus.kit.errors import UserError
from fmus.kit.storage import cache

if TYPE_CHECKING:
    from fmus.kit.symbolic.packing import PackedSystem

RUNTIMES = ("python", "native")  # with the project's own front-end in C
STOCK = "pythonfmu"  # with pythonfmu's binary; fulfils less of the contract, see `stock.LIMITS`


def version() -> str:
    """Return the version of this package."""
    return importlib.metadata.version("ppy-rig")


@dataclass(frozen=True)
class BuildPlan:
    """The contents of an archive before its binaries are compiled.

    Attributes
    ----------
    name, runtime : str
    fmi : int
        Version of FMI.
    guid : str
    files : dict of str to bytes
        Path in the archive to contents.
    sources : dict of str to bytes
        C files and headers by name.
    libraries : Mapping of str to tuple of str
        Libraries that the sources are linked with, by platform.
    """

    name: str
    runtime: str
    fmi: int
    guid: str
    files: dict[str, bytes]
    sources: dict[str, bytes]
    libraries: Mapping[str, tuple[str, ...]]


def plan_build(
    cls: type[Component],
    runtime: str,
    fmi: int = 2,
    packed: PackedSystem | None = None,
    clocks: bool = False,
) -> BuildPlan:
    """Plan the contents of an FMU, and derive its GUID from them.

    Parameters
    ----------
    cls : type[Component]
        A component, possibly with effects stacked on it.
    runtime : {"python", "native"}
        Laws interpreted by Python, or compiled from C.
    fmi : {2, 3}
        Version of FMI: 2.0 or 3.0.
    packed : PackedSystem, optional
        The members of the system that the class stands for; native, of FMI 2.0.
    clocks : bool
        Whether FMI 3.0 declares an output clock for each group of states that are sampled together.
        Hosts must use event mode then, and some fail with any clock.

    Returns
    -------
    BuildPlan

    Raises
    ------
    UserError
        If there is no such runtime or version, or clocks of FMI 2.0 are requested.
    """
    # CasADi takes a tenth of a second to load, and other parts of this package do not need it
    from fmus.kit.build import description
    from fmus.kit.build.sources import PACKED, UNIT, c_sources, engine_sources
    from fmus.kit.symbolic import trace

    _check_runtime(runtime, RUNTIMES)
    _check_version(cls, runtime, fmi, clocks)
    graph = packed.graph if packed else trace(cls)
    native = runtime == "native"
    compiled_laws = native and cls.engine is None and packed is None
    engine = PACKED if packed else engine_sources(cls, runtime)
    contents = documents(cls)
    describe = description.describe_fmi3 if fmi == 3 else description.describe_fmi2
    if fmi == 3:
        contents |= _fmi3_files(cls, contents.pop("model.png", None))
    if fmi == 3 and native:
        built = description.build_description(cls, UNIT, engine.libraries)
        contents["sources/buildDescription.xml"] = built
    if not native:
        contents |= python_package(cls)
    fmus = packed.fmus if packed else []
    contents |= packed.files if packed else {}
    capabilities = description.Capabilities(
        needs_execution_tool=not native or any(fmu.needs_execution_tool for fmu in fmus),
        interpolates_inputs=compiled_laws,
        directional_derivatives=compiled_laws,
        model_exchange=compiled_laws,
        sources=(UNIT,) if native else (),
        clocks=clocks,
        varies_step=all(fmu.varies_step for fmu in fmus),
        runs_once=any(fmu.runs_once for fmu in fmus),
    )

    def described(guid: str) -> dict[str, bytes]:
        return {"modelDescription.xml": describe(cls, graph, capabilities, version(), guid)}

    guid = archive.identity(
        contents
        | c_sources(graph, engine, archive.NO_GUID, fmi, packed)
        | described(archive.NO_GUID)
    )
    sources = c_sources(graph, engine, guid, fmi, packed)
    contents |= described(guid)
    if native:
        contents |= {f"sources/{name}": text for name, text in sources.items()}
    return BuildPlan(cls.name, runtime, fmi, guid, contents, sources, engine.libraries)


def _fmi3_files(cls: type[Component], icon: bytes | None) -> dict[str, bytes]:
    """Return the files of terminals and icons of FMI 3.0, by path in the archive."""
    from fmus.kit.build import description

    files = {}
    if cls.ports or icon is not None:
        declared = description.terminals(cls, with_icon=icon is not None)
        files["terminalsAndIcons/terminalsAndIcons.xml"] = declared
    if icon is not None:
        files["terminalsAndIcons/icon.png"] = icon
    return files


def build(
    cls: type[Component],
    runtime: str,
    platforms: Sequence[str] | None = None,
    progress: Callable[[str], None] = lambda text: None,
    failed: Callable[[str, UserError], None] | None = None,
    fmi: int = 2,
    *,
    packed: PackedSystem | None = None,
    clocks: bool = False,
) -> bytes:
    """Build an FMU.

    Parameters
    ----------
    cls : type[Component]
        A component, possibly with effects stacked on it.
    runtime : {"python", "native", "pythonfmu"}
        Runtimes of :func:`plan_build`, or a stock archive of pythonfmu (:mod:`.stock`).
    platforms : sequence of str, optional
        FMI platforms; by default all that an installed compiler, or pythonfmu, can serve.
    progress : callable
        Called with a short message at each step.
    failed : callable, optional
        Called with each platform that fails and its error; the archive then has the other
        platforms. By default the error is raised.
    fmi, packed, clocks
        See :func:`plan_build`.

    Returns
    -------
    bytes
        The archive. The same sources give the same bytes.

    Raises
    ------
    UserError
        If no compiler, or for a stock archive no pythonfmu, is installed; if a platform fails and
        `failed` is not given, or if every platform fails.
    """
    _check_runtime(runtime, (*RUNTIMES, STOCK))
    if runtime == STOCK:
        _check_version(cls, runtime, fmi, clocks)
        from fmus.kit.build.stock import stock_archive

        return stock_archive(cls, version(), platforms, progress)
    targets = platforms or toolchain.available_platforms()
    planned = plan_build(cls, runtime, fmi, packed, clocks)
    return _compile_and_pack(planned, targets, progress, failed)


def check_build(
    cls: type[Component],
    runtime: str,
    platforms: Sequence[str] | None = None,
    fmi: int = 2,
    clocks: bool = False,
) -> None:
    """Raise an error if an FMU cannot be built, before anything is made.

    Parameters
    ----------
    cls, runtime, platforms, fmi, clocks
        See :func:`build`.

    Raises
    ------
    UserError
        If there is no such runtime, version or platform, the component has no such build, or the
        compiler or pythonfmu is not installed.
    """
    _check_runtime(runtime, (*RUNTIMES, STOCK))
    _check_version(cls, runtime, fmi, clocks)
    if runtime == STOCK:
        from fmus.kit.build.stock import check_stock

        check_stock(cls, platforms)
        return
    for target in platforms or toolchain.available_platforms():
        toolchain.find_compiler(target)


def build_cached(cls: type[Component], runtime: str, fmi: int = 2, *, clocks: bool = False) -> Path:
    """Return the path of a component's FMU for this machine, building it unless the cache has it.

    Parameters
    ----------
    cls, runtime, fmi, clocks
        See :func:`plan_build`.

    Returns
    -------
    Path
        The folder is named after the GUID and the digest of the library, and thereby depends on
        everything in the FMU.

    Raises
    ------
    UserError
        See :func:`build`.
    """
    from fmus.kit.build.sources import library_key

    planned = plan_build(cls, runtime, fmi, clocks=clocks)
    target = toolchain.host_platform()
    key = library_key(planned.sources, planned.libraries.get(target, ()), target)
    name = f"{planned.guid.strip('{}')}-{key}/{cls.name}.fmu"
    return cache.cached_file(name, lambda: _compile_and_pack(planned, [target], lambda text: None))


def _check_runtime(runtime: str, known: Sequence[str]) -> None:
    """Raise an error unless a runtime is known."""
    if runtime not in known:
        raise UserError(f"unknown runtime {runtime!r}; there are: {', '.join(known)}")


def _check_version(cls: type[Component], runtime: str, fmi: int, clocks: bool = False) -> None:
    """Raise an error unless a version of FMI is known and there is such a build of it."""
    if fmi not in (2, 3):
        raise UserError(f"unknown version {fmi} of FMI; there are: 2, 3")
    if fmi == 3 and runtime == STOCK:
        raise UserError(f"{cls.name}: the build of {STOCK} is of FMI 2.0, not 3.0")
    if clocks and fmi == 2:
        raise UserError(f"{cls.name}: FMI 2.0 has no clocks; build FMI 3.0")


def _compile_and_pack(
    planned: BuildPlan,
    platforms: Sequence[str],
    progress: Callable[[str], None],
    failed: Callable[[str, UserError], None] | None = None,
) -> bytes:
    """Compile the binaries of a plan, and pack the archive; see :func:`build`."""
    binaries: dict[str, bytes] = {}
    for target in platforms:
        try:
            binaries |= _compile_binary(planned, target, progress)
        except UserError as error:
            all_failed = target == platforms[-1] and not binaries
            if failed is None or all_failed:
                raise
            failed(target, error)
    return archive.pack(planned.files | binaries)


def _compile_binary(
    planned: BuildPlan, target: str, progress: Callable[[str], None]
) -> dict[str, bytes]:
    """Compile the binary of a plan for a platform; return it by its paths in the archive."""
    from fmus.kit.build.sources import compiled

    compiler = toolchain.find_compiler(target).label
    progress(f"{planned.name}: {planned.runtime} for {target}, with {compiler}")
    library = compiled(planned.sources, planned.libraries.get(target, ()), target)
    folders = toolchain.FOLDERS_OF_FMI_3[target] if planned.fmi == 3 else (target,)
    name = f"{planned.name}{toolchain.EXTENSIONS[target]}"
    return {f"binaries/{folder}/{name}": library for folder in folders}
