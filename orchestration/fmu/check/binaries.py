"""Checks of an FMU's binaries: platform, exported FMI functions and required libraries."""

from __future__ import annotations

from collections.abc import Iterator

from orchestration.fmu.archive import Archive
from orchestration.fmu.check.finding import Finding, listed
from orchestration.fmu.check.shared_library import Library, LibraryError, read_library
from orchestration.fmu.check.standards import STANDARDS, Platform, Standard

# Libraries of every system of a platform. Those of `_LIBC` and `_WINDOWS` are not reported.
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
    """Check the binaries of all platforms.

    Yields
    ------
    Finding
    """
    folders = archive.platforms
    standard = STANDARDS[archive.version]
    if not folders:
        compilable = "sources/buildDescription.xml" in archive.names or any(
            element.find("SourceFiles") is not None for element in archive.interfaces()
        )
        yield Finding(
            "sources-only" if compilable else "no-binaries",
            "no binaries" + (", only sources" if compilable else ""),
        )
        return
    absent = [folder for folder in standard.expected if folder not in folders]
    if absent:
        yield Finding("missing-platform", f"no binary for {listed(absent)}")
    for folder in folders:
        platform = standard.platform(folder)
        if platform is None:
            yield Finding(
                "unknown-platform",
                f"binaries/{folder} is no platform of FMI {standard.version}; hosts will not look"
                " there",
            )
            continue
        for identifier, required in _required_functions(archive, standard).items():
            name = f"binaries/{folder}/{identifier}{platform.extension}"
            if name in archive.names:
                yield from _check_binary(archive, name, platform, standard, required)
            else:
                yield Finding(
                    "missing-binary", f"{name} is missing; the model identifier is {identifier!r}"
                )


def _required_functions(archive: Archive, standard: Standard) -> dict[str, set[str]]:
    """Return the FMI functions that a binary must export, by model identifier."""
    functions: dict[str, set[str]] = {}
    for element in archive.description:
        if element.tag in standard.functions:
            identifier = element.get("modelIdentifier", "")
            required = standard.required_functions(element.tag)
            functions.setdefault(identifier, set()).update(required)
    return functions


def _check_binary(
    archive: Archive, name: str, platform: Platform, standard: Standard, required: set[str]
) -> Iterator[Finding]:
    """Check a binary.

    Parameters
    ----------
    archive : Archive
    name : str
        Name of its file.
    platform : Platform
        Platform of its folder.
    standard : Standard
    required : set of str
        Functions that it must export.
    """
    contents = archive.read(name)
    if contents is None:
        return
    try:
        library = read_library(contents)
    except LibraryError as error:
        yield Finding("binary-format", f"{name}: {error}")
        return
    if library.format != platform.format:
        yield Finding("binary-format", f"{name} is {library.format}, expected {platform.format}")
        return
    if platform.machine and platform.machine not in library.machines:
        yield Finding(
            "binary-format",
            f"{name} is for {', '.join(library.machines)}, expected {platform.machine}",
        )
    missing = sorted(required - library.exports)
    if missing:
        yield Finding(
            "missing-functions",
            f"{name} lacks {len(missing)} functions of FMI {standard.version}: {listed(missing)}",
        )
    files = {entry.rsplit("/", 1)[-1] for entry in archive.names}
    yield from _report_required_libraries(name, library, files)
    if library.format == "ELF":
        others = sorted(
            symbol for symbol in library.exports if not symbol.startswith(standard.prefix)
        )
        if others:
            yield Finding(
                "exported-symbols",
                f"{name} exports {len(others)} other symbols, which two FMUs may confuse:"
                f" {listed(others)}",
            )


def _report_required_libraries(name: str, library: Library, files: set[str]) -> Iterator[Finding]:
    """Report required libraries and symbols that not every system has.

    Parameters
    ----------
    name : str
        Name of the binary.
    library : Library
    files : set of str
        Names of the files in the archive, without their folders.
    """
    usual = []
    unusual = []
    for needed in library.needs:
        if library.format == "ELF" and needed in _GLIBC:
            usual.append(needed)
        elif not _is_basic(needed, library.format):
            in_archive = needed.rsplit("/", 1)[-1] in files
            unusual.append(needed + (" (which is in the archive)" if in_archive else ""))
    if usual:
        yield Finding("system-libraries", f"{name} needs {listed(usual)} besides the C library")
    if unusual:
        yield Finding(
            "foreign-libraries",
            f"{name} needs libraries that are not part of the system: {listed(unusual)}",
        )
    # all symbols of these libraries have versions: one without a version is in none of them
    if library.unsupplied and set(library.needs) <= _VERSIONED:
        yield Finding(
            "unsupplied-symbols",
            f"{name} needs {len(library.unsupplied)} symbols no library of its own supplies; it"
            f" does not load in a host without them: {listed(library.unsupplied)}",
        )


def _is_basic(needed: str, binary_format: str) -> bool:
    """Return whether every system of a binary format has a library, so that it is not reported."""
    if binary_format == "ELF":
        return needed in _LIBC
    if binary_format == "PE":
        return needed.lower() in _WINDOWS or needed.lower().startswith("api-ms-win-")
    return needed.startswith(("/usr/lib/", "/System/Library/"))
