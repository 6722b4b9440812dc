"""Reading of shared libraries: format, processors, exports and required libraries.

Headers of ELF (Linux), PE (Windows) and Mach-O (macOS, thin or universal) are read, from which it
follows whether a host can load an FMU's binary. ELF is read by pyelftools and PE by pefile; the
layout of Mach-O is that of ``mach-o/loader.h``.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from elftools.elf.elffile import ELFFile
from pefile import DIRECTORY_ENTRY, PE


class LibraryError(ValueError):
    """Raised for bytes that are no shared library or a damaged one."""


@dataclass(frozen=True)
class Library:
    """The contents of a shared library's headers.

    Attributes
    ----------
    format : {"ELF", "PE", "Mach-O"}
    machines : tuple of str
        Processors that it runs on: ``x86``, ``x86_64``, ``arm64``, or the code of another one in
        hexadecimal, for ELF its name in ``elf.h``; several for a universal library.
    needs : tuple of str
        Names of the libraries that the loader must find.
    exports : frozenset of str
        Functions and data that it exports for every processor; names in C, without the underscore
        of macOS.
    unsupplied : tuple of str
        For ELF, undefined strong symbols without a version, which the loading process must define.
    """

    format: str
    machines: tuple[str, ...]
    needs: tuple[str, ...]
    exports: frozenset[str]
    unsupplied: tuple[str, ...] = ()


def read_library(contents: bytes) -> Library:
    """Read a shared library.

    Parameters
    ----------
    contents : bytes
        The whole file.

    Returns
    -------
    Library

    Raises
    ------
    LibraryError
        If the format is unknown, the file is a program or an object file, or a table in it points
        outside of it.
    """
    readers = {
        b"\x7fELF": _read_elf,
        b"MZ": _read_pe,
        _UNIVERSAL: _read_universal,
        _MACH_64: _read_mach,
        _MACH_32: _read_mach,
    }
    for magic, reader in readers.items():
        if contents.startswith(magic):
            try:
                return reader(contents)
            except LibraryError:
                raise
            except Exception as error:  # the two libraries raise any: they also assert
                raise LibraryError("damaged: a table in it points outside of the file") from error
    raise LibraryError("neither ELF nor PE nor Mach-O")


def _read_text(contents: bytes, offset: int) -> str:
    """Return the zero-terminated text at an offset; ValueError if there is none."""
    return contents[offset : contents.index(b"\0", offset)].decode("utf-8", "replace")


def _rows(contents: bytes, layout: str, offset: int, count: int) -> Iterator[tuple[int, ...]]:
    """Return the rows of a table; struct.error if it exceeds the file."""
    end = offset + count * struct.calcsize(layout)
    if end > len(contents):
        raise struct.error
    return struct.iter_unpack(layout, contents[offset:end])


# --- ELF

_ELF_MACHINES = {"EM_386": "x86", "EM_X86_64": "x86_64", "EM_AARCH64": "arm64"}
_VERSION_INDEX = 0x7FFF  # the highest bit of a version marks a hidden symbol
_NO_VERSION = 1  # largest version index that means no version: local or global


def _read_elf(contents: bytes) -> Library:
    """Read an ELF library of either word size and byte order."""
    elf = ELFFile(io.BytesIO(contents))
    if elf["e_type"] != "ET_DYN":
        raise LibraryError("an ELF file, but not a shared library")
    dynamic: Any = next(elf.iter_segments("PT_DYNAMIC"), None)
    if dynamic is None:
        raise LibraryError("an ELF file without a table for dynamic loading")
    symbols = list(dynamic.iter_symbols())
    versions = _elf_versions(contents, elf, dynamic, len(symbols))
    exports = set()
    unsupplied = []
    for symbol, version in zip(symbols, versions, strict=True):
        binding = symbol["st_info"]["bind"]
        if not symbol.name or binding not in ("STB_GLOBAL", "STB_WEAK"):
            continue
        if symbol["st_shndx"] != "SHN_UNDEF":
            exports.add(symbol.name)
        elif binding == "STB_GLOBAL" and version & _VERSION_INDEX <= _NO_VERSION:
            unsupplied.append(symbol.name)
    machine = elf["e_machine"]
    return Library(
        format="ELF",
        machines=(_ELF_MACHINES.get(machine, str(machine)),),
        needs=tuple(tag.needed for tag in dynamic.iter_tags("DT_NEEDED")),
        exports=frozenset(exports),
        unsupplied=tuple(sorted(unsupplied)),
    )


def _elf_versions(contents: bytes, elf: ELFFile, dynamic: Any, count: int) -> Sequence[int]:
    """Return the version of each symbol for dynamic loading; 0 if there are no versions."""
    _, offset = dynamic.get_table_offset("DT_VERSYM")
    if offset is None:
        return [0] * count
    order = "<" if elf.little_endian else ">"
    return struct.unpack_from(f"{order}{count}H", contents, offset)


# --- PE

_PE_MACHINES = {0x14C: "x86", 0x8664: "x86_64", 0xAA64: "arm64"}
_PE_TABLES = ("IMAGE_DIRECTORY_ENTRY_EXPORT", "IMAGE_DIRECTORY_ENTRY_IMPORT")


def _read_pe(contents: bytes) -> Library:
    """Read a PE library."""
    start = struct.unpack_from("<I", contents, 60)[0]  # e_lfanew, where the PE signature is
    if contents[start : start + 4] != b"PE\0\0":
        raise LibraryError("an MS-DOS program, no Windows library")
    pe: Any = PE(data=contents, fast_load=True, max_symbol_exports=len(contents))
    if not pe.is_dll():
        raise LibraryError("a Windows program, but no DLL")
    pe.parse_data_directories([DIRECTORY_ENTRY[name] for name in _PE_TABLES])
    # pefile leaves out what it cannot read; of packed code it has suspicions
    damage = [text for text in pe.get_warnings() if not text.startswith("Suspicious")]
    if damage:
        raise ValueError(damage[0])
    exported = pe.DIRECTORY_ENTRY_EXPORT.symbols if hasattr(pe, "DIRECTORY_ENTRY_EXPORT") else []
    machine = pe.FILE_HEADER.Machine
    return Library(
        format="PE",
        machines=(_PE_MACHINES.get(machine, hex(machine)),),
        exports=frozenset(one.name.decode() for one in exported if one.name),
        needs=tuple(one.dll.decode() for one in getattr(pe, "DIRECTORY_ENTRY_IMPORT", [])),
    )


# --- Mach-O

_UNIVERSAL = b"\xca\xfe\xba\xbe"
_MACH_64 = b"\xcf\xfa\xed\xfe"
_MACH_32 = b"\xce\xfa\xed\xfe"
_MACH_MACHINES = {7: "x86", 0x01000007: "x86_64", 0x0100000C: "arm64"}
_DYNAMIC_LIBRARY = 6  # types of files
_BUNDLE = 8
_SYMBOL_TABLE = 0x2  # commands
_LOADS = {0xC, 0x80000018, 0x8000001F, 0x80000023}  # plain, weak, re-exported, upward


def _read_universal(contents: bytes) -> Library:
    """Read a Mach-O library with a part for each of several processors."""
    count = struct.unpack_from(">I", contents, 4)[0]
    parts = []
    for offset, size in _rows(contents, ">8xII4x", 8, count):
        part = contents[offset : offset + size]
        if len(part) != size or part[:4] not in (_MACH_64, _MACH_32):
            raise LibraryError("damaged: a part of the universal library is not in it")
        parts.append(_read_mach(part))
    if not parts:
        raise LibraryError("a universal library with nothing in it")
    needs = dict.fromkeys(name for part in parts for name in part.needs)
    exports = frozenset.intersection(*(part.exports for part in parts))
    return Library("Mach-O", tuple(part.machines[0] for part in parts), tuple(needs), exports)


def _read_mach(contents: bytes) -> Library:
    """Read a Mach-O library for one processor."""
    is_64_bit = contents.startswith(_MACH_64)
    machine, kind, count = struct.unpack_from("<I4xII", contents, 4)
    if kind not in (_DYNAMIC_LIBRARY, _BUNDLE):
        raise LibraryError("a Mach-O file, but not a shared library")
    command_offset = 32 if is_64_bit else 28
    needs = []
    exports: set[str] = set()
    for _ in range(count):
        command, size = struct.unpack_from("<II", contents, command_offset)
        if command in _LOADS:
            name_offset = struct.unpack_from("<I", contents, command_offset + 8)[0]
            needs.append(_read_text(contents, command_offset + name_offset))
        elif command == _SYMBOL_TABLE:
            exports.update(_mach_exports(contents, command_offset + 8, is_64_bit))
        if size < 8:  # a command has at least its kind and size; with 0 the loop would not advance
            raise ValueError(size)
        command_offset += size
    return Library(
        "Mach-O", (_MACH_MACHINES.get(machine, hex(machine)),), tuple(needs), frozenset(exports)
    )


def _mach_exports(contents: bytes, offset: int, is_64_bit: bool) -> Iterator[str]:
    """Yield the exported names in the symbol table of a load command at an offset."""
    symbols, count, strings = struct.unpack_from("<III", contents, offset)
    layout = "<IB11x" if is_64_bit else "<IB7x"
    for name, flags in _rows(contents, layout, symbols, count):
        # defined in a section, external, neither private nor for debuggers
        if flags & 0x0E == 0x0E and flags & 0x01 and not flags & 0xF0:
            yield _read_text(contents, strings + name).removeprefix("_")
