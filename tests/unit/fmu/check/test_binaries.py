"""Claims: a fault of a binary is found; the functions asked of it are those of the headers."""

from __future__ import annotations

import struct

import pytest

from tests.support.archive import LINUX_BINARY, on_linux
from tests.support.fmu_faults import Change, check_that_fault_is_found, drop, put


def cut_binary(files: dict[str, bytes]) -> None:
    files[LINUX_BINARY] = files[LINUX_BINARY][:900]


def hide_function(files: dict[str, bytes]) -> None:
    assert b"fmi2DoStep\0" in files[LINUX_BINARY]
    files[LINUX_BINARY] = files[LINUX_BINARY].replace(b"fmi2DoStep\0", b"fmi2DxStep\0")


def other_machine(files: dict[str, bytes]) -> None:
    files[LINUX_BINARY] = (
        files[LINUX_BINARY][:18] + struct.pack("<H", 0xB7) + files[LINUX_BINARY][20:]
    )


def no_library(files: dict[str, bytes]) -> None:
    files[LINUX_BINARY] = files[LINUX_BINARY][:16] + struct.pack("<H", 2) + files[LINUX_BINARY][18:]


def other_needs(files: dict[str, bytes]) -> None:
    assert b"libm.so.6\0" in files[LINUX_BINARY]
    files[LINUX_BINARY] = files[LINUX_BINARY].replace(b"libm.so.6\0", b"libx.so.6\0")


FAULTS: dict[str, tuple[Change, str]] = {
    "only sources": (drop("binaries/"), r"10 warning: no binaries, only sources"),
    "misnamed binary": (
        lambda files: files.update({"binaries/linux64/x.so": files.pop(LINUX_BINARY)}),
        r"10 error: binaries/linux64/ppy_actuator\.so is missing; .*'ppy_actuator'",
    ),
    "unknown platform": (
        put("binaries/x86_64-linux/ppy_actuator.so", b"x"),
        r"10 note: binaries/x86_64-linux is no",
    ),
    "text binary": (
        put(LINUX_BINARY, b"#!/bin/sh\n"),
        r"10 error: .*\.so: neither ELF nor PE nor Mach-O",
    ),
    "empty binary": (put(LINUX_BINARY, b""), r"10 error: .*neither ELF"),
    "cut binary": (cut_binary, r"10 error: .*damaged"),
    "program": (no_library, r"10 error: .*an ELF file, but not a shared library"),
    "wrong format": (
        lambda files: files.update({"binaries/win64/ppy_actuator.dll": files[LINUX_BINARY]}),
        r"10 error: binaries/win64/ppy_actuator\.dll is ELF, expected PE",
    ),
    "wrong machine": (other_machine, r"10 error: .* is for arm64, expected x86_64"),
    "missing function": (hide_function, r"4 error: .* lacks 1 functions of FMI 2.0: fmi2DoStep"),
    "unusual library": (other_needs, r"10 warning: .* not part of the system: libx\.so\.6"),
}


@on_linux
@pytest.mark.parametrize("fault", FAULTS)
def test_fault_is_found(fmu, tmp_path, fault):
    check_that_fault_is_found(fmu("ppy_actuator", "native"), tmp_path, *FAULTS[fault])
