"""Reading of shared libraries: format, processors, exports and required libraries.

Headers of ELF (Linux), PE (Windows) and Mach-O (macOS, thin or universal) are read, from which it
follows whether a host can load an FMU's binary. The layouts are those of ``elf.h``, of Microsoft's
PE specification and of ``mach-o/loader.h``.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
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
    if not 0 <= offset < len(contents):
        raise ValueError(offset)
    return contents[offset : contents.index(b"\0", offset)].decode("utf-8", "replace")


def _read_rows(contents: bytes, layout: str, offset: int, size: int) -> Iterator[tuple[int, ...]]:
    """Yield the rows of a table of `size` bytes; struct.error if it exceeds the file."""
    if offset < 0 or size < 0 or offset + size > len(contents):
        raise struct.error
    width = struct.calcsize(layout)
    yield from struct.iter_unpack(layout, contents[offset : offset + size - size % width])


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
# bindings of symbols
_GLOBAL = 1
_WEAK = 2
_VERSION_INDEX = 0x7FFF  # the highest bit of a version marks a hidden symbol
_NO_VERSION = 1  # largest version index that means no version: local or global


class _ElfSymbol(NamedTuple):
    name_offset: int
    binding: int
    section: int


class _ElfFile:
    """An ELF file of either word size and byte order."""

    def __init__(self, contents: bytes):
        self.contents = contents
        self.is_64_bit = contents[4] == 2
        self._order = {1: "<", 2: ">"}[contents[5]]
        self._word = "Q" if self.is_64_bit else "I"

    def unpack(self, layout: str, offset: int) -> tuple[int, ...]:
        """Unpack numbers at an offset."""
        return struct.unpack_from(self._order + layout, self.contents, offset)

    def rows(self, layout: str, offset: int, size: int) -> Iterator[tuple[int, ...]]:
        """Yield the rows of a table of `size` bytes in the byte order of the file."""
        return _read_rows(self.contents, self._order + layout, offset, size)

    def segments(self) -> tuple[list[_Section], list[tuple[int, ...]]]:
        """Return the loaded segments, and the tags and values of the table for dynamic loading."""
        table_offset = self.unpack(self._word, 32 if self.is_64_bit else 28)[0]  # e_phoff
        width, count = self.unpack("HH", 54 if self.is_64_bit else 42)  # e_phentsize, e_phnum
        loaded = []
        dynamic: list[tuple[int, ...]] = []
        for k in range(count):
            place = table_offset + k * width
            if self.is_64_bit:
                role, _, offset, address, _, size = self.unpack("IIQQQQ", place)
            else:
                role, offset, address, _, size = self.unpack("IIIII", place)
            if role == _LOADABLE:
                loaded.append(_Section(address, size, offset))
            elif role == _DYNAMIC:
                dynamic = list(self.rows(self._word * 2, offset, size))
        return loaded, dynamic

    def symbol_count(self, hash_offsets: Mapping[int, int]) -> int:
        """Return the number of dynamic symbols, from one of the hash tables."""
        if _SYSV_HASH in hash_offsets:
            return self.unpack("II", hash_offsets[_SYSV_HASH])[1]  # one chain for each symbol
        offset = hash_offsets[_GNU_HASH]
        # without a count: the end of the last chain is the last symbol
        bucket_count, first, bloom_size, _ = self.unpack("IIII", offset)
        buckets = offset + 16 + bloom_size * (8 if self.is_64_bit else 4)
        last = max((row[0] for row in self.rows("I", buckets, 4 * bucket_count)), default=0)
        if last < first:
            return first
        chains = buckets + 4 * bucket_count
        while not self.unpack("I", chains + 4 * (last - first))[0] & 1:  # set at the end of a chain
            last += 1
        return last + 1

    def symbols(self, offset: int, count: int) -> Iterator[_ElfSymbol]:
        """Yield the first `count` rows of the table of dynamic symbols."""
        layout = "IBBHQQ" if self.is_64_bit else "IIIBBH"
        size = count * struct.calcsize(self._order + layout)
        for row in self.rows(layout, offset, size):
            if self.is_64_bit:
                name_offset, info, _, section = row[:4]
            else:
                name_offset, _, _, info, _, section = row
            yield _ElfSymbol(name_offset, info >> 4, section)


def _read_elf(contents: bytes) -> Library:
    """Read an ELF library."""
    file = _ElfFile(contents)
    kind, machine = file.unpack("HH", 16)  # e_type, e_machine
    if kind != _SHARED_OBJECT:
        raise LibraryError("an ELF file, but not a shared library")
    loaded, dynamic = file.segments()
    if not dynamic:
        raise LibraryError("an ELF file without a table for dynamic loading")
    needed, tables = _dynamic_entries(dynamic)
    strings = _file_offset(loaded, tables[_STRINGS])
    symbols = _file_offset(loaded, tables[_SYMBOLS])
    hashes = {
        tag: _file_offset(loaded, tables[tag]) for tag in (_SYSV_HASH, _GNU_HASH) if tag in tables
    }
    exports = set()
    unsupplied = []
    for k, symbol in enumerate(file.symbols(symbols, file.symbol_count(hashes))):
        if not symbol.name_offset or symbol.binding not in (_GLOBAL, _WEAK):
            continue
        name = _read_text(contents, strings + symbol.name_offset)
        if symbol.section:
            exports.add(name)
        elif symbol.binding == _GLOBAL and not _has_version(file, loaded, tables, k):
            unsupplied.append(name)
    return Library(
        format="ELF",
        machines=(_ELF_MACHINES.get(machine, hex(machine)),),
        needs=tuple(_read_text(contents, strings + offset) for offset in needed),
        exports=frozenset(exports),
        unsupplied=tuple(sorted(unsupplied)),
    )


def _has_version(
    file: _ElfFile, loaded: Sequence[_Section], tables: Mapping[int, int], number: int
) -> bool:
    """Return whether a dynamic symbol, given by its number, has a version."""
    if _VERSIONS not in tables:
        return False
    version = file.unpack("H", _file_offset(loaded, tables[_VERSIONS]) + 2 * number)[0]
    return version & _VERSION_INDEX > _NO_VERSION


def _dynamic_entries(dynamic: Sequence[tuple[int, ...]]) -> tuple[list[int], dict[int, int]]:
    """Return the name offsets of required libraries, and the other entries by tag."""
    needed = []
    tables = {}
    for tag, value in dynamic:
        if tag == _END:
            break
        if tag == _NEEDED:
            needed.append(value)
        else:
            tables[tag] = value
    return needed, tables


# --- PE

_PE_MACHINES = {0x14C: "x86", 0x8664: "x86_64", 0xAA64: "arm64"}
_DLL = 0x2000  # flag of the COFF header
_PE32_PLUS = 0x20B  # format with addresses of 64 bits


def _read_pe(contents: bytes) -> Library:
    """Read a PE library."""
    start = struct.unpack_from("<I", contents, 60)[0]  # e_lfanew, where the PE signature is
    if contents[start : start + 4] != b"PE\0\0":
        raise LibraryError("an MS-DOS program, no Windows library")
    header = struct.unpack_from("<HHIIIHH", contents, start + 4)
    machine, section_count, _, _, _, optional_size, flags = header
    if not flags & _DLL:
        raise LibraryError("a Windows program, but no DLL")
    optional = start + 24  # header, after the signature and the COFF header
    is_64_bit = struct.unpack_from("<H", contents, optional)[0] == _PE32_PLUS
    # the directory of exports is the first one, that of imports follows after 8 bytes
    directories = optional + (112 if is_64_bit else 96)
    section_rows = _read_rows(contents, "<8xIIII16x", optional + optional_size, 40 * section_count)
    sections = [
        _Section(address, max(size, raw), offset) for size, address, raw, offset in section_rows
    ]
    return Library(
        format="PE",
        machines=(_PE_MACHINES.get(machine, hex(machine)),),
        exports=frozenset(_pe_exports(contents, sections, directories)),
        needs=tuple(_pe_imports(contents, sections, directories + 8)),
    )


def _pe_exports(contents: bytes, sections: Sequence[_Section], entry: int) -> Iterator[str]:
    """Yield the names in the export table to which a directory entry points."""
    address = struct.unpack_from("<I", contents, entry)[0]
    if not address:
        return
    table = _file_offset(sections, address)
    count, _, names = struct.unpack_from("<III", contents, table + 24)  # NumberOfNames, ...
    if not count:
        return
    for (name,) in _read_rows(contents, "<I", _file_offset(sections, names), 4 * count):
        yield _read_text(contents, _file_offset(sections, name))


def _pe_imports(contents: bytes, sections: Sequence[_Section], entry: int) -> Iterator[str]:
    """Yield the names of libraries in the import table to which a directory entry points."""
    address = struct.unpack_from("<I", contents, entry)[0]
    if not address:
        return
    row = _file_offset(sections, address)
    while name := struct.unpack_from("<IIIII", contents, row)[3]:
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
    for _, _, offset, size, _ in _read_rows(contents, ">IIIII", 8, 20 * count):
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
    machine, _, kind, count = struct.unpack_from("<IIII", contents, 4)
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
    symbols, count, strings, _ = struct.unpack_from("<IIII", contents, offset)
    layout = "<IBBHQ" if is_64_bit else "<IBBHI"
    for name, flags, *_ in _read_rows(contents, layout, symbols, count * struct.calcsize(layout)):
        # defined in a section, external, neither private nor for debuggers
        if flags & 0x0E == 0x0E and flags & 0x01 and not flags & 0xF0:
            yield _read_text(contents, strings + name).removeprefix("_")
