"""Reading shared libraries of any platform on any platform: format, machines, what they offer and what they need.

ELF (Linux), PE (Windows) and Mach-O (macOS, thin or universal), as far as the question goes whether a host can load an
FMU's binary. The layouts are those of ``elf.h``, of Microsoft's PE specification and of ``mach-o/loader.h``.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass


class LibraryError(ValueError):
    """The bytes are no shared library, or a damaged one; the text says which."""


@dataclass(frozen=True)
class Library:
    """What a shared library's headers say.

    Attributes
    ----------
    format : {"ELF", "PE", "Mach-O"}
    machines : tuple of str
        Processors it runs on: ``x86``, ``x86_64``, ``arm64``, or a number in hexadecimal; several if it is universal.
    needs : tuple of str
        Libraries the loader must find, as named in it.
    exports : frozenset of str
        Functions and data it offers (on every machine); C names, without the underscore of macOS.
    unsupplied : tuple of str
        ELF only: strong symbols it needs that are bound to no version of any library. The loading process must happen
        to have them.
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
        If the format is unknown, it is a program or an object file, or its tables point outside of it.
    """
    readers = {
        b"\x7fELF": _elf,
        b"MZ": _pe,
        _UNIVERSAL: _universal,
        _MACH_64: _mach,
        _MACH_32: _mach,
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


def _text(contents: bytes, offset: int) -> str:
    """Text at an offset, up to its closing zero; ValueError when there is none."""
    if not 0 <= offset < len(contents):
        raise ValueError(offset)
    return contents[offset : contents.index(b"\0", offset)].decode("utf-8", "replace")


def _rows(contents: bytes, layout: str, offset: int, size: int) -> Iterator[tuple[int, ...]]:
    """Rows of a table of ``size`` bytes; struct.error when it does not lie in the file."""
    if offset < 0 or size < 0 or offset + size > len(contents):
        raise struct.error
    width = struct.calcsize(layout)
    yield from struct.iter_unpack(layout, contents[offset : offset + size - size % width])


# --- ELF ------------------------------------------------------------------------------------------------------------

_ELF_MACHINES = {0x3: "x86", 0x3E: "x86_64", 0xB7: "arm64"}
_SHARED_OBJECT, _LOADABLE, _DYNAMIC = 3, 1, 2
_END, _NEEDED, _STRINGS, _VERSIONS, _SYSV_HASH, _GNU_HASH, _SYMBOLS = (
    0,
    1,
    5,
    0x6FFFFFF0,
    4,
    0x6FFFFEF5,
    6,
)


def _elf(contents: bytes) -> Library:
    wide = contents[4] == 2
    order = {1: "<", 2: ">"}[contents[5]]
    kind, machine = struct.unpack_from(order + "HH", contents, 16)
    if kind != _SHARED_OBJECT:
        raise LibraryError("an ELF file, but not a shared library")
    word = "Q" if wide else "I"
    segments_at = struct.unpack_from(order + word, contents, 32 if wide else 28)[0]
    width, count = struct.unpack_from(order + "HH", contents, 54 if wide else 42)
    loaded, dynamic = [], []
    for k in range(count):
        at = segments_at + k * width
        if wide:
            role, _, offset, address, _, size = struct.unpack_from(order + "IIQQQQ", contents, at)
        else:
            role, offset, address, _, size = struct.unpack_from(order + "IIIII", contents, at)
        if role == _LOADABLE:
            loaded.append((address, offset, size))
        elif role == _DYNAMIC:
            dynamic = list(_rows(contents, f"{order}{word}{word}", offset, size))
    if not dynamic:
        raise LibraryError("an ELF file without a table for dynamic loading")

    def place(address: int) -> int:
        for start, offset, size in loaded:
            if start <= address < start + size:
                return address - start + offset
        raise ValueError(address)

    needed = []
    tables: dict[int, int] = {}
    for tag, value in dynamic:
        if tag == _END:
            break
        if tag == _NEEDED:
            needed.append(value)
        else:
            tables[tag] = value
    strings = place(tables[_STRINGS])
    symbols = place(tables[_SYMBOLS])
    total = _elf_symbol_count(
        contents, order, wide, {tag: place(tables[tag]) for tag in _HASHES & tables.keys()}
    )
    layout = order + ("IBBHQQ" if wide else "IIIBBH")
    exports, unsupplied = set(), []
    for k, row in enumerate(_rows(contents, layout, symbols, total * struct.calcsize(layout))):
        name_at, info, section = (row[0], row[1], row[3]) if wide else (row[0], row[3], row[5])
        if not name_at or info >> 4 not in (1, 2):  # global or weak
            continue
        name = _text(contents, strings + name_at)
        if section:
            exports.add(name)
        elif info >> 4 == 1:
            version = 1
            if _VERSIONS in tables:
                version = struct.unpack_from(
                    order + "H", contents, place(tables[_VERSIONS]) + 2 * k
                )[0]
            if version & 0x7FFF <= 1:
                unsupplied.append(name)
    needs = tuple(_text(contents, strings + at) for at in needed)
    return Library(
        "ELF",
        (_ELF_MACHINES.get(machine, hex(machine)),),
        needs,
        frozenset(exports),
        tuple(sorted(unsupplied)),
    )


_HASHES = {_SYSV_HASH, _GNU_HASH}


def _elf_symbol_count(contents: bytes, order: str, wide: bool, places: dict[int, int]) -> int:
    """Number of dynamic symbols: ELF does not store it but in its hash tables."""
    if _SYSV_HASH in places:
        return struct.unpack_from(order + "II", contents, places[_SYSV_HASH])[1]
    at = places[_GNU_HASH]
    buckets, first, bloom, _ = struct.unpack_from(order + "IIII", contents, at)
    buckets_at = at + 16 + bloom * (8 if wide else 4)
    last = max((row[0] for row in _rows(contents, order + "I", buckets_at, 4 * buckets)), default=0)
    if last < first:
        return first
    chains_at = buckets_at + 4 * buckets
    while not struct.unpack_from(order + "I", contents, chains_at + 4 * (last - first))[0] & 1:
        last += 1
    return last + 1


# --- PE -------------------------------------------------------------------------------------------------------------

_PE_MACHINES = {0x14C: "x86", 0x8664: "x86_64", 0xAA64: "arm64"}
_DLL = 0x2000


def _pe(contents: bytes) -> Library:
    at = struct.unpack_from("<I", contents, 60)[0]
    if contents[at : at + 4] != b"PE\0\0":
        raise LibraryError("an MS-DOS program, no Windows library")
    machine, sections, _, _, _, optional, flags = struct.unpack_from("<HHIIIHH", contents, at + 4)
    if not flags & _DLL:
        raise LibraryError("a Windows program, but no DLL")
    header = at + 24
    wide = struct.unpack_from("<H", contents, header)[0] == 0x20B
    directories = header + (112 if wide else 96)
    table = [
        (address, max(size, raw), offset)
        for size, address, raw, offset in _rows(
            contents, "<8xIIII16x", header + optional, 40 * sections
        )
    ]

    def place(address: int) -> int:
        for start, size, offset in table:
            if start <= address < start + size:
                return address - start + offset
        raise ValueError(address)

    exports_at = struct.unpack_from("<I", contents, directories)[0]
    imports_at = struct.unpack_from("<I", contents, directories + 8)[0]
    exports, needs = set(), []
    if exports_at:
        count, _, names = struct.unpack_from("<III", contents, place(exports_at) + 24)
        for (name,) in _rows(contents, "<I", place(names), 4 * count) if count else ():
            exports.add(_text(contents, place(name)))
    entry = place(imports_at) if imports_at else 0
    while entry and (name := struct.unpack_from("<IIIII", contents, entry)[3]):
        needs.append(_text(contents, place(name)))
        entry += 20
    return Library(
        "PE", (_PE_MACHINES.get(machine, hex(machine)),), tuple(needs), frozenset(exports)
    )


# --- Mach-O ---------------------------------------------------------------------------------------------------------

_UNIVERSAL, _MACH_64, _MACH_32 = b"\xca\xfe\xba\xbe", b"\xcf\xfa\xed\xfe", b"\xce\xfa\xed\xfe"
_MACH_MACHINES = {7: "x86", 0x01000007: "x86_64", 0x0100000C: "arm64"}
_DYNAMIC_LIBRARY, _BUNDLE = 6, 8
_SYMBOL_TABLE = 0x2
_LOADS = {0xC, 0x80000018, 0x8000001F, 0x80000023}  # plain, weak, re-exported, upward


def _universal(contents: bytes) -> Library:
    count = struct.unpack_from(">I", contents, 4)[0]
    parts = []
    for _, _, offset, size, _ in _rows(contents, ">IIIII", 8, 20 * count):
        part = contents[offset : offset + size]
        if len(part) != size or part[:4] not in (_MACH_64, _MACH_32):
            raise LibraryError("damaged: a part of the universal library is not in it")
        parts.append(_mach(part))
    if not parts:
        raise LibraryError("a universal library with nothing in it")
    needs = dict.fromkeys(name for part in parts for name in part.needs)
    exports = frozenset.intersection(*(part.exports for part in parts))
    return Library("Mach-O", tuple(part.machines[0] for part in parts), tuple(needs), exports)


def _mach(contents: bytes) -> Library:
    wide = contents.startswith(_MACH_64)
    machine, _, kind, count = struct.unpack_from("<IIII", contents, 4)
    if kind not in (_DYNAMIC_LIBRARY, _BUNDLE):
        raise LibraryError("a Mach-O file, but not a shared library")
    at = 32 if wide else 28
    needs, exports = [], set()
    for _ in range(count):
        command, size = struct.unpack_from("<II", contents, at)
        if command in _LOADS:
            needs.append(_text(contents, at + struct.unpack_from("<I", contents, at + 8)[0]))
        elif command == _SYMBOL_TABLE:
            symbols, total, strings, _ = struct.unpack_from("<IIII", contents, at + 8)
            layout = "<IBBHQ" if wide else "<IBBHI"
            for name, flags, *_ in _rows(
                contents, layout, symbols, total * struct.calcsize(layout)
            ):
                # defined in a section, external, neither private nor for debuggers
                if flags & 0x0E == 0x0E and flags & 0x01 and not flags & 0xF0:
                    exports.add(_text(contents, strings + name).removeprefix("_"))
        if size < 8:
            raise ValueError(size)
        at += size
    return Library(
        "Mach-O", (_MACH_MACHINES.get(machine, hex(machine)),), tuple(needs), frozenset(exports)
    )
