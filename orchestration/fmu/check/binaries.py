"""Checks of the binaries of an FMU: platform, exported FMI functions, and required libraries."""

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
    # a platform tuple of FMI 3.0, as FMI 2.0.4 has it for other processors
    "aarch64-linux": _Platform("ELF", "arm64", ".so"),
}
_EXPECTED = ("linux64", "win64", "darwin64")

_COMMON = (
    "GetTypesPlatform GetVersion SetDebugLogging Instantiate FreeInstance SetupExperiment"
    " EnterInitializationMode ExitInitializationMode Terminate Reset GetReal GetInteger GetBoolean"
    " GetString SetReal SetInteger SetBoolean SetString GetFMUstate SetFMUstate FreeFMUstate"
    " SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate GetDirectionalDerivative"
)
_FUNCTIONS = {
    "CoSimulation": (
        f"{_COMMON} SetRealInputDerivatives GetRealOutputDerivatives DoStep CancelStep GetStatus "
        "GetRealStatus GetIntegerStatus GetBooleanStatus GetStringStatus"
    ),
    "ModelExchange": (
        f"{_COMMON} EnterEventMode NewDiscreteStates EnterContinuousTimeMode"
        " CompletedIntegratorStep SetTime SetContinuousStates GetDerivatives GetEventIndicators"
        " GetContinuousStates GetNominalsOfContinuousStates"
    ),
}

# Libraries that every system of a platform has. Those of the first group are not reported.
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
    """Check the folder ``binaries/``.

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
    absent = [folder for folder in _EXPECTED if folder not in folders]
    if absent:
        yield Finding(10, "note", f"no binary for {listed(absent)}")
    for folder in folders:
        if folder not in _PLATFORMS:
            yield Finding(
                10,
                "note",
                f"binaries/{folder} is no platform of FMI 2.0; hosts will not look there",
            )
            continue
        for identifier, required in _required_functions(archive).items():
            yield from _binary(archive, folder, identifier, required)


def _required_functions(archive: Archive) -> dict[str, set[str]]:
    """Return the FMI functions that a binary must export, by model identifier."""
    functions: dict[str, set[str]] = {}
    for element in archive.interfaces():
        identifier = element.get("modelIdentifier", "")
        names = {"fmi2" + name for name in _FUNCTIONS[element.tag].split()}
        functions.setdefault(identifier, set()).update(names)
    return functions


def _binary(
    archive: Archive, folder: str, identifier: str, required: set[str]
) -> Iterator[Finding]:
    """Check the binary of a model identifier for one platform."""
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
    lacking = sorted(required - library.exports)
    if lacking:
        yield Finding(
            4, "error", f"{name} lacks {len(lacking)} functions of FMI 2.0: {listed(lacking)}"
        )
    inside = {entry.rsplit("/", 1)[-1] for entry in archive.names}
    yield from _needs(name, folder, library, inside)
    if library.format == "ELF":
        others = sorted(symbol for symbol in library.exports if not symbol.startswith("fmi2"))
        if others:
            yield Finding(
                6,
                "note",
                f"{name} exports {len(others)} other symbols, which two FMUs may confuse:"
                f" {listed(others)}",
            )


def _needs(name: str, folder: str, library: Library, inside: set[str]) -> Iterator[Finding]:
    """Report the libraries and symbols that a binary needs besides those of every system.

    Parameters
    ----------
    name, folder : str
        Of the binary, and of its platform.
    library : Library
    inside : set of str
        Names of the files in the archive, without their folders.
    """
    usual = []
    unusual = []
    for needed in library.needs:
        if library.format == "ELF" and needed in _GLIBC:
            usual.append(needed)
        elif not _is_basic(needed, library.format, folder):
            in_archive = needed.rsplit("/", 1)[-1] in inside
            unusual.append(needed + (" (which is in the archive)" if in_archive else ""))
    if usual:
        yield Finding(10, "note", f"{name} needs {listed(usual)} besides the C library")
    if unusual:
        yield Finding(
            10,
            "warning",
            f"{name} needs libraries that are not part of the system: {listed(unusual)}",
        )
    # All symbols of the usual libraries carry a version: one without is from none of them.
    if library.unsupplied and set(library.needs) <= _VERSIONED:
        yield Finding(
            4,
            "warning",
            f"{name} needs {len(library.unsupplied)} symbols no library of its own supplies; it"
            f" does not load in a host without them: {listed(library.unsupplied)}",
        )


def _is_basic(needed: str, binary_format: str, folder: str) -> bool:
    """Return whether every system of a platform has a library, so that it is not reported."""
    if binary_format == "ELF":
        return needed in _LIBC
    if folder.startswith("win"):
        return needed.lower() in _WINDOWS or needed.lower().startswith("api-ms-win-")
    return needed.startswith(("/usr/lib/", "/System/Library/"))
