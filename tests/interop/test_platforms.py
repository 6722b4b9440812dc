"""Binaries for every platform, on whatever platform they are built: the right formats, and nothing to install."""

from __future__ import annotations

import importlib.util
import re
import shutil
import struct
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from fmus import component
from fmus.kit.build import build
from orchestration.fmu.check import check_fmu
from orchestration.fmu.check.shared_library import read_library
from tests.support import hosts

pytestmark = [
    pytest.mark.slow,  # on a new machine the compiler builds the libraries of every platform first
    pytest.mark.skipif(
        importlib.util.find_spec("ziglang") is None,
        reason="ziglang, which compiles for all platforms, is not installed",
    ),
]
NAME = "ppy_actuator"
FUNCTIONS = set(
    re.findall(r"^#define (fmi2\w+)\s+fmi2FullName\(", (hosts.HEADERS / "fmi2Functions.h").read_text(), re.M)
)
EXCHANGE_ONLY = {
    "fmi2EnterEventMode", "fmi2NewDiscreteStates", "fmi2EnterContinuousTimeMode", "fmi2CompletedIntegratorStep",
    "fmi2SetTime", "fmi2SetContinuousStates", "fmi2GetDerivatives", "fmi2GetEventIndicators",
    "fmi2GetContinuousStates", "fmi2GetNominalsOfContinuousStates",
}  # fmt: skip


PLATFORMS = ("linux64", "win64", "darwin64")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """An FMU for given platforms, built once; the first time on a machine, zig builds its own libraries (a minute)."""
    folder = tmp_path_factory.mktemp("built")

    def path(runtime: str, *platforms: str) -> Path:
        file = folder / f"{runtime}-{'-'.join(platforms)}.fmu"
        if not file.exists():
            file.write_bytes(build(component(NAME), runtime, platforms))
        return file

    return path


@pytest.fixture
def binary(built, tmp_path, runtime) -> Callable[[str], Path]:
    """File of the binary for a platform."""

    def path(platform: str) -> Path:
        extension = {"linux64": ".so", "win64": ".dll", "darwin64": ".dylib"}[platform]
        with zipfile.ZipFile(built(runtime, platform)) as archive:
            return Path(archive.extract(f"binaries/{platform}/{NAME}{extension}", tmp_path))

    return path


def binutils(program: str, *arguments: str) -> str:
    if shutil.which(program) is None:
        pytest.skip(f"{program} is not installed")
    return subprocess.run([program, *arguments], check=True, capture_output=True, text=True).stdout


def test_check_finds_nothing_wrong_and_no_platform_missing(built, runtime):
    findings = check_fmu(built(runtime, *PLATFORMS))
    assert [f.message for f in findings if f.severity != "note" or "no binary" in f.message] == []


@pytest.mark.parametrize("platform", PLATFORMS)
def test_binary_offers_the_functions_of_fmi_and_no_others(binary, platform):
    exports = read_library(binary(platform).read_bytes()).exports
    # what every Mach-O library has, whoever made it
    assert exports - {"__dso_handle", "_mh_dylib_header"} == FUNCTIONS - EXCHANGE_ONLY


# --- Linux ----------------------------------------------------------------------------------------------------------


def test_linux_binary_needs_the_c_library_only(binary, runtime):
    dynamic = binutils("readelf", "-dW", str(binary("linux64")))
    needed = set(re.findall(r"\(NEEDED\).*\[(.*)\]", dynamic))
    # libdl is glibc's own; the Python build looks for Python through it
    assert needed <= {"libc.so.6", "libm.so.6"} | ({"libdl.so.2"} if runtime == "python" else set())
    assert "RPATH" not in dynamic
    assert "RUNPATH" not in dynamic
    assert "TEXTREL" not in dynamic


def test_linux_binary_runs_on_any_glibc_since_2_17(binary):
    wanted = re.findall(r"GLIBC_([\d.]+)", binutils("readelf", "-VW", str(binary("linux64"))))
    assert wanted
    assert max(tuple(map(int, version.split("."))) for version in wanted) <= (2, 17)


def test_linux_binary_has_no_symbol_of_python(binary):
    symbols = binutils("readelf", "--dyn-syms", "-W", str(binary("linux64")))
    assert "fmi2DoStep" in symbols
    assert not re.search(r"\b_?Py", symbols)


def test_linux_binary_has_no_executable_stack(binary):
    segments = binutils("readelf", "-lW", str(binary("linux64")))
    assert re.search(r"GNU_STACK.*\bRW\s", segments)


# --- Windows --------------------------------------------------------------------------------------------------------


def test_windows_binary_needs_system_libraries_only(binary):
    path = binary("win64")
    needs = read_library(path.read_bytes()).needs
    assert "KERNEL32.dll" in needs
    for name in needs:
        # the universal C runtime is a part of Windows 10 and newer
        assert name == "KERNEL32.dll" or name.startswith("api-ms-win-crt-"), name


def test_windows_binary_is_read_as_objdump_does(binary):
    path = binary("win64")
    listing = binutils("objdump", "-p", str(path))
    if "DLL Name" not in listing:
        pytest.skip("this objdump does not know PE")
    library = read_library(path.read_bytes())
    assert sorted(library.needs) == sorted(re.findall(r"DLL Name: (\S+)", listing))
    table = listing[listing.index("[Ordinal/Name Pointer] Table") :].split("\n\n")[0]
    assert library.exports == set(re.findall(r"\[\s*\d+\].*\s(\w+)$", table, re.M))
    assert library.machines == ("x86_64",)


# --- macOS ----------------------------------------------------------------------------------------------------------


def test_macos_binary_is_universal(binary):
    data = binary("darwin64").read_bytes()
    magic, count = struct.unpack_from(">II", data)
    assert (magic, count) == (0xCAFEBABE, 2)  # FAT_MAGIC of <mach-o/fat.h>
    machines = {}
    for k in range(count):
        kind, _, offset, size, alignment = struct.unpack_from(">5I", data, 8 + 20 * k)
        assert offset % 2**alignment == 0
        assert offset + size <= len(data)
        thin_magic, thin_kind, _, file_type = struct.unpack_from("<4I", data, offset)
        # MH_MAGIC_64, MH_DYLIB
        assert (thin_magic, thin_kind, file_type) == (0xFEEDFACF, kind, 6)
        machines[kind] = (offset, size)
    assert set(machines) == {0x01000007, 0x0100000C}  # CPU_TYPE_X86_64, CPU_TYPE_ARM64
    assert read_library(data).machines == ("x86_64", "arm64")
    assert read_library(data).needs == ("/usr/lib/libSystem.B.dylib",)


def test_arm_part_of_the_macos_binary_is_signed(binary):
    # macOS on ARM kills a process that loads an unsigned library; an ad-hoc signature is enough.
    data = binary("darwin64").read_bytes()
    code_signature = 0x1D  # LC_CODE_SIGNATURE
    for k in range(2):
        kind, _, offset, _, _ = struct.unpack_from(">5I", data, 8 + 20 * k)
        if kind != 0x0100000C:
            continue
        count = struct.unpack_from("<I", data, offset + 16)[0]
        at, commands = offset + 32, set()
        for _ in range(count):
            command, size = struct.unpack_from("<II", data, at)
            commands.add(command)
            at += size
        assert code_signature in commands


# --- reproducible ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("platform", PLATFORMS)
def test_second_build_is_the_same_bytes(built, runtime, platform):
    assert build(component(NAME), runtime, [platform]) == built(runtime, platform).read_bytes()
