"""Claims: shared libraries are read as the tools of the platform do, and damaged ones never break
the reader.
"""

from __future__ import annotations

import contextlib
import re
import shutil
import subprocess
import sysconfig
from pathlib import Path

import fmpy
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from orchestration.fmu.check.shared_library import LibraryError, read_library
from tests.support.archive import LINUX_BINARY, contents, on_linux


def binutils(program: str, *arguments: str) -> str:
    if shutil.which(program) is None:
        pytest.skip(f"{program} is not installed")
    return subprocess.run([program, *arguments], check=True, capture_output=True, text=True).stdout


def system_libraries() -> list[Path]:
    found = [
        Path(sysconfig.get_config_var("LIBDIR") or "/", str(sysconfig.get_config_var("LDLIBRARY")))
    ]
    for folder in ("/lib/x86_64-linux-gnu", "/lib64", "/usr/lib"):
        found += [
            Path(folder, name) for name in ("libm.so.6", "libc.so.6", "libstdc++.so.6", "libz.so.1")
        ]
    return [path for path in found if path.is_file() and path.suffix != ".a"][:5]


@on_linux
def test_elf_is_read_as_readelf_does(fmu, tmp_path):
    paths = system_libraries()
    for runtime in ("native", "python"):
        path = tmp_path / f"{runtime}.so"
        path.write_bytes(contents(fmu("ppy_actuator", runtime))[LINUX_BINARY])
        paths.append(path)
    for path in paths:
        library = read_library(path.read_bytes())
        needed = re.findall(r"\(NEEDED\).*\[(.*)\]", binutils("readelf", "-dW", str(path)))
        assert list(library.needs) == needed
        rows = [
            row.split() for row in binutils("readelf", "--dyn-syms", "-W", str(path)).splitlines()
        ]
        rows = [row for row in rows if len(row) >= 8 and row[0].rstrip(":").isdecimal()]
        defined = {
            row[7].split("@")[0]
            for row in rows
            if row[4] in ("GLOBAL", "WEAK", "UNIQUE") and row[6] != "UND"
        }
        unbound = {
            row[7] for row in rows if row[4] == "GLOBAL" and row[6] == "UND" and "@" not in row[7]
        }
        # bindings beyond global and weak (GNU's "unique") are of no concern to an FMU
        unique = {row[7].split("@")[0] for row in rows if row[4] == "UNIQUE"}
        assert library.exports - unique == defined - unique, path
        assert set(library.unsupplied) == unbound, path


def test_pe_is_read_as_objdump_does():
    folder = Path(fmpy.__file__).parent / "sundials" / "x86_64-windows"
    for name in ("sundials_core.dll", "sundials_nvecserial.dll"):
        contents = (folder / name).read_bytes()
        library = read_library(contents)
        dump = binutils("objdump", "-p", str(folder / name))
        assert list(library.needs) == re.findall(r"DLL Name: (\S+)", dump)
        table = dump.partition("[Ordinal/Name Pointer] Table")[2]
        assert library.exports == set(re.findall(r"^\s+\[.*\]\s(?:\+base.*\s)?(\S+)$", table, re.M))
        assert library.machines == ("x86_64",)
        for share in (0.05, 0.5, 0.8):
            with pytest.raises(LibraryError, match="damaged"):
                read_library(contents[: int(share * len(contents))])


@on_linux
@pytest.mark.parametrize("runtime", ["native", "python"])
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_binary_never_breaks_the_reader(fmu, runtime, data):
    library = bytearray(contents(fmu("ppy_actuator", runtime))[LINUX_BINARY])
    for _ in range(data.draw(st.integers(1, 4))):
        # the tables are in the first and last few hundred bytes
        place = data.draw(st.integers(-400, 800))
        library[place] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(library)))
    with contextlib.suppress(LibraryError):
        read_library(bytes(library[: cut if data.draw(st.booleans()) else None]))


@pytest.mark.parametrize(
    ("start", "message"),
    [
        (b"", "neither"),
        (b"MZ", "damaged"),
        (b"MZ" + bytes(100), "MS-DOS"),
        (b"\x7fELF", "damaged"),
        (b"\x7fELF\x02\x01" + bytes(100), "not a shared library"),
        (b"\xca\xfe\xba\xbe\x00\x00\x00\x00", "nothing in it"),
        (b"\xca\xfe\xba\xbe\x00\x00\x00\x09", "damaged"),
        (b"\xcf\xfa\xed\xfe", "damaged"),
        (b"\xcf\xfa\xed\xfe" + bytes(40), "not a shared library"),
    ],
)
def test_reader_tells_what_is_wrong(start, message):
    with pytest.raises(LibraryError, match=message):
        read_library(start)
