"""Reading of shared libraries: format, processors, exports and required libraries.

Headers of ELF (Linux), PE (Windows) and Mach-O (macOS, thin or universal) are read, from which it
follows whether a host can load an FMU's binary. The layouts are those of ``elf.h``, of Microsoft's
PE specification and of ``mach-o/loader.h``.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import repeat, takewhile
from typing import NamedTuple


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
        hexadecimal; several for a universal library.
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
            except (struct.error, ValueError, KeyError, IndexError, OverflowError) as error:
                if isinstance(error, LibraryError):
                    raise
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


class _Section(NamedTuple):
    """A part of a file, and the address in memory at which it is loaded."""

    address: int
    size: int
    offset: int


def _file_offset(sections: Sequence[_Section], address: int) -> int:
    """Return the offset in the file of an address in memory; ValueError if there is none."""
    for section in sections:
        if section.address <= address < section.address + section.size:
            return address - section.address + section.offset
    raise ValueError(address)


# --- ELF


class _ElfLayouts(NamedTuple):
    """Layouts of what is read of an ELF file; the rest is skipped."""

    header: str  # type and machine; place, row size and number of segments
    segment: str  # role, offset, address, size
    entry: str  # for dynamic loading: tag, value
    symbol: str  # name, info, section
    number: str = "I"
    version: str = "H"


_ELF_LAYOUTS = {  # by EI_CLASS
    1: _ElfLayouts("16xHH8xI10xHH", "III4xI12x", "II", "I8xBxH"),
    2: _ElfLayouts("16xHH12xQ14xHH", "I4xQQ8xQ16x", "QQ", "IBxH16x"),
}
_ELF_ORDERS = {1: "<", 2: ">"}  # by EI_DATA
_ELF_MACHINES = {0x3: "x86", 0x3E: "x86_64", 0xB7: "arm64"}
_SHARED_OBJECT = 3  # type of file
_LOADABLE = 1  # types of segments
_DYNAMIC = 2
# tags of entries in the table for dynamic loading
_END = 0
_NEEDED = 1
_SYSV_HASH = 4
_STRINGS = 5
_SYMBOLS = 6
_GNU_HASH = 0x6FFFFEF5
_VERSIONS = 0x6FFFFFF0
_TABLES = (_SYSV_HASH, _STRINGS, _SYMBOLS, _GNU_HASH, _VERSIONS)
# bindings of symbols
_GLOBAL = 1
_WEAK = 2
_VERSION_INDEX = 0x7FFF  # the highest bit of a version marks a hidden symbol
_NO_VERSION = 1  # largest version index that means no version: local or global


class _ElfSymbol(NamedTuple):
    """A global or weak symbol for dynamic loading."""

    name: str
    is_defined: bool
    is_unsupplied: bool  # a strong one without a version


def _read_elf(contents: bytes) -> Library:
    """Read an ELF library of either word size and byte order."""
    order = _ELF_ORDERS[contents[5]]
    layouts = _ElfLayouts(*(order + layout for layout in _ELF_LAYOUTS[contents[4]]))
    kind, machine, place, size, count = struct.unpack_from(layouts.header, contents)
    if kind != _SHARED_OBJECT:
        raise LibraryError("an ELF file, but not a shared library")
    if size != struct.calcsize(layouts.segment):  # which loaders refuse
        raise ValueError(size)
    segments = [*_rows(contents, layouts.segment, place, count)]
    loaded = [_Section(row[2], row[3], row[1]) for row in segments if row[0] == _LOADABLE]
    entries = _dynamic_entries(contents, segments, layouts.entry)
    if not entries:
        raise LibraryError("an ELF file without a table for dynamic loading")
    tables = {tag: _file_offset(loaded, value) for tag, value in entries if tag in _TABLES}
    needed = [value for tag, value in entries if tag == _NEEDED]
    symbols = [*_elf_symbols(contents, layouts, tables)]
    return Library(
        format="ELF",
        machines=(_ELF_MACHINES.get(machine, hex(machine)),),
        needs=tuple(_read_text(contents, tables[_STRINGS] + offset) for offset in needed),
        exports=frozenset(one.name for one in symbols if one.is_defined),
        unsupplied=tuple(sorted(one.name for one in symbols if one.is_unsupplied)),
    )


def _dynamic_entries(
    contents: bytes, segments: Sequence[tuple[int, ...]], layout: str
) -> list[tuple[int, ...]]:
    """Return the tags and values of the table for dynamic loading; empty without one."""
    for role, offset, _, size in segments:
        if role == _DYNAMIC:
            rows = _rows(contents, layout, offset, size // struct.calcsize(layout))
            return [*takewhile(lambda row: row[0] != _END, rows)]
    return []


def _elf_symbols(
    contents: bytes, layouts: _ElfLayouts, tables: Mapping[int, int]
) -> Iterator[_ElfSymbol]:
    """Yield the global and weak symbols for dynamic loading."""
    count = _symbol_count(contents, layouts, tables)
    versions: Iterable[tuple[int, ...]] = repeat((0,), count)
    if _VERSIONS in tables:
        versions = _rows(contents, layouts.version, tables[_VERSIONS], count)
    symbols = _rows(contents, layouts.symbol, tables[_SYMBOLS], count)
    for (offset, info, section), (version,) in zip(symbols, versions, strict=True):
        binding = info >> 4
        if offset and binding in (_GLOBAL, _WEAK):
            has_version = version & _VERSION_INDEX > _NO_VERSION
            is_unsupplied = not section and binding == _GLOBAL and not has_version
            name = _read_text(contents, tables[_STRINGS] + offset)
            yield _ElfSymbol(name, section != 0, is_unsupplied)


def _symbol_count(contents: bytes, layouts: _ElfLayouts, tables: Mapping[int, int]) -> int:
    """Return the number of dynamic symbols, from one of the hash tables."""

    def number(offset: int) -> int:
        return int(struct.unpack_from(layouts.number, contents, offset)[0])

    if _SYSV_HASH in tables:
        return number(tables[_SYSV_HASH] + 4)  # one chain for each symbol
    # without a count: the end of the last chain is the last symbol
    offset = tables[_GNU_HASH]
    bucket_count, first, bloom_size = (number(offset + 4 * k) for k in range(3))
    buckets = offset + 16 + bloom_size * struct.calcsize(layouts.entry) // 2
    (last,) = max(_rows(contents, layouts.number, buckets, bucket_count), default=(0,))
    if last < first:
        return first
    chains = buckets + 4 * bucket_count
    while not number(chains + 4 * (last - first)) & 1:  # set at the end of a chain
        last += 1
    return last + 1


# --- PE

_PE_MACHINES = {0x14C: "x86", 0x8664: "x86_64", 0xAA64: "arm64"}
_DLL = 0x2000  # flag of the COFF header
_PE32_PLUS = 0x20B  # format with addresses of 64 bits


def _read_pe(contents: bytes) -> Library:
    """Read a PE library."""
    start = struct.unpack_from("<I", contents, 60)[0]  # e_lfanew, where the PE signature is
    if contents[start : start + 4] != b"PE\0\0":
        raise LibraryError("an MS-DOS program, no Windows library")
    header = struct.unpack_from("<HH12xHH", contents, start + 4)
    machine, section_count, optional_size, flags = header
    if not flags & _DLL:
        raise LibraryError("a Windows program, but no DLL")
    optional = start + 24  # header, after the signature and the COFF header
    is_64_bit = struct.unpack_from("<H", contents, optional)[0] == _PE32_PLUS
    directories = optional + (112 if is_64_bit else 96)
    exports, imports = struct.unpack_from("<I4xI", contents, directories)
    table = optional + optional_size
    sections = [
        _Section(address, max(size, raw), offset)
        for size, address, raw, offset in _rows(contents, "<8xIIII16x", table, section_count)
    ]
    return Library(
        format="PE",
        machines=(_PE_MACHINES.get(machine, hex(machine)),),
        exports=frozenset(_pe_exports(contents, sections, exports)),
        needs=tuple(_pe_imports(contents, sections, imports)),
    )


def _pe_exports(contents: bytes, sections: Sequence[_Section], address: int) -> Iterator[str]:
    """Yield the names in the export table at an address, which is 0 without one."""
    if not address:
        return
    table = _file_offset(sections, address)
    count, names = struct.unpack_from("<I4xI", contents, table + 24)  # NumberOfNames, ...
    if not count:
        return
    for (name,) in _rows(contents, "<I", _file_offset(sections, names), count):
        yield _read_text(contents, _file_offset(sections, name))


def _pe_imports(contents: bytes, sections: Sequence[_Section], address: int) -> Iterator[str]:
    """Yield the names of libraries in the import table at an address, which is 0 without one."""
    if not address:
        return
    row = _file_offset(sections, address)
    while name := struct.unpack_from("<12xI4x", contents, row)[0]:
        yield _read_text(contents, _file_offset(sections, name))
        row += 20


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
