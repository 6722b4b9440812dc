"""The binaries of an FMU: there, of the right kind, offering FMI's functions, and needing nothing unusual."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from orchestration.fmu.archive import Archive
from orchestration.fmu.check.finding import Finding, listed
from orchestration.fmu.check.shared_library import Library, LibraryError, read_library


class _Platform(NamedTuple):
    format: str
    machine: str
    extension: str


_PLATFORMS = {
    "linux32": _Platform("ELF", "x86", ".so"),
    "linux64": _Platform("ELF", "x86_64", ".so"),
    "win32": _Platform("PE", "x86", ".dll"),
    "win64": _Platform("PE", "x86_64", ".dll"),
    "darwin32": _Platform("Mach-O", "x86", ".dylib"),
    "darwin64": _Platform("Mach-O", "x86_64", ".dylib"),
    "aarch64-linux": _Platform(
        "ELF", "arm64", ".so"
    ),  # a tuple of FMI 3.0, as FMI 2.0.4 has it for other processors
}
_EXPECTED = ("linux64", "win64", "darwin64")

_COMMON = (
    "GetTypesPlatform GetVersion SetDebugLogging Instantiate FreeInstance SetupExperiment EnterInitializationMode "
    "ExitInitializationMode Terminate Reset GetReal GetInteger GetBoolean GetString SetReal SetInteger SetBoolean "
    "SetString GetFMUstate SetFMUstate FreeFMUstate SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate "
    "GetDirectionalDerivative"
)
_FUNCTIONS = {
    "CoSimulation": f"{_COMMON} SetRealInputDerivatives GetRealOutputDerivatives DoStep CancelStep GetStatus "
    "GetRealStatus GetIntegerStatus GetBooleanStatus GetStringStatus",
    "ModelExchange": f"{_COMMON} EnterEventMode NewDiscreteStates EnterContinuousTimeMode CompletedIntegratorStep "
    "SetTime SetContinuousStates GetDerivatives GetEventIndicators GetContinuousStates "
    "GetNominalsOfContinuousStates",
}

# Libraries every system of a platform has. Those of the first group go without saying.
_LIBC = {"libc.so.6", "libm.so.6"}
_GLIBC = {
    "libdl.so.2",
    "libpthread.so.0",
    "librt.so.1",
    "ld-linux.so.2",
    "ld-linux-x86-64.so.2",
    "ld-linux-aarch64.so.1",
}
_VERSIONED = _LIBC | _GLIBC | {"libstdc++.so.6", "libgcc_s.so.1", "libgomp.so.1"}
_WINDOWS = {
    "kernel32.dll",
    "kernelbase.dll",
    "ntdll.dll",
    "user32.dll",
    "gdi32.dll",
    "advapi32.dll",
    "shell32.dll",
    "ole32.dll",
    "oleaut32.dll",
    "ws2_32.dll",
    "msvcrt.dll",
    "ucrtbase.dll",
    "bcrypt.dll",
    "shlwapi.dll",
    "rpcrt4.dll",
}


def check_binaries(archive: Archive) -> Iterator[Finding]:
    """Check what is in ``binaries/``.

    Yields
    ------
    Finding
    """
    folders = archive.platforms
    if not folders:
        compilable = any(
            element.find("SourceFiles") is not None for element in archive.interfaces()
        )
        yield Finding(
            10,
            "warning" if compilable else "error",
            "no binaries" + (", only sources" if compilable else ""),
        )
        return
    if absent := [folder for folder in _EXPECTED if folder not in folders]:
        yield Finding(10, "note", f"no binary for {listed(absent)}")
    for folder in folders:
        if folder not in _PLATFORMS:
            yield Finding(
                10,
                "note",
                f"binaries/{folder} is no platform of FMI 2.0; hosts will not look there",
            )
            continue
        functions: dict[str, set[str]] = {}
        for element in archive.interfaces():
            identifier = element.get("modelIdentifier", "")
            functions.setdefault(identifier, set()).update(
                "fmi2" + name for name in _FUNCTIONS[element.tag].split()
            )
        for identifier, required in functions.items():
            yield from _binary(archive, folder, identifier, required)


def _binary(
    archive: Archive, folder: str, identifier: str, required: set[str]
) -> Iterator[Finding]:
    platform = _PLATFORMS[folder]
    name = f"binaries/{folder}/{identifier}{platform.extension}"
    if name not in archive.names:
        yield Finding(10, "error", f"{name} is missing; the model identifier is {identifier!r}")
        return
    contents = archive.read(name)
    if contents is None:
        return
    try:
        library = read_library(contents)
    except LibraryError as error:
        yield Finding(10, "error", f"{name}: {error}")
        return
    if library.format != platform.format:
        yield Finding(10, "error", f"{name} is {library.format}, expected {platform.format}")
        return
    if platform.machine not in library.machines:
        yield Finding(
            10, "error", f"{name} is for {', '.join(library.machines)}, expected {platform.machine}"
        )
    if lacking := sorted(required - library.exports):
        yield Finding(
            4, "error", f"{name} lacks {len(lacking)} functions of FMI 2.0: {listed(lacking)}"
        )
    yield from _needs(name, folder, library, {entry.rsplit("/", 1)[-1] for entry in archive.names})
    if library.format == "ELF":
        others = sorted(symbol for symbol in library.exports if not symbol.startswith("fmi2"))
        if others:
            yield Finding(
                6,
                "note",
                f"{name} exports {len(others)} other symbols, which two FMUs may confuse: {listed(others)}",
            )


def _needs(name: str, folder: str, library: Library, inside: set[str]) -> Iterator[Finding]:
    usual, unusual = [], []
    for needed in library.needs:
        if library.format == "ELF":
            common, basic = needed in _GLIBC, needed in _LIBC
        elif folder.startswith("win"):
            basic = needed.lower() in _WINDOWS or needed.lower().startswith("api-ms-win-")
            common = False
        else:
            common, basic = False, needed.startswith(("/usr/lib/", "/System/Library/"))
        if common:
            usual.append(needed)
        elif not basic:
            unusual.append(
                needed
                + (" (which is in the archive)" if needed.rsplit("/", 1)[-1] in inside else "")
            )
    if usual:
        yield Finding(10, "note", f"{name} needs {listed(usual)} besides the C library")
    if unusual:
        yield Finding(
            10,
            "warning",
            f"{name} needs libraries that are not part of the system: {listed(unusual)}",
        )
    # Everything the usual libraries offer carries a version: what has none comes from nowhere in particular.
    if library.unsupplied and set(library.needs) <= _VERSIONED:
        yield Finding(
            4,
            "warning",
            f"{name} needs {len(library.unsupplied)} symbols no library of its own supplies; it does not load in a "
            f"host without them: {listed(library.unsupplied)}",
        )
