"""Binaries for every platform, on whatever platform they are built: the right formats, and nothing
to install.
"""

from __future__ import annotations

import importlib.util
import re
import shutil
import struct
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest

from fmus import COMPONENTS, component
from fmus.kit.build.building import build
from orchestration.fmu.check import check_fmu
from orchestration.fmu.check.shared_library import read_library
from tests.support import hosts
from tests.support.compatibility import PORTED
from tests.support.machines import MACHINES
from tests.support.pace import FREE_FEET
from tests.support.stimuli import STIMULI

pytestmark = [
    pytest.mark.slow,  # on a new machine the compiler builds the libraries of every platform first
    pytest.mark.skipif(
        importlib.util.find_spec("ziglang") is None,
        reason="ziglang, which compiles for all platforms, is not installed",
    ),
]
NAME = "ppy_actuator"
FUNCTIONS = set(
    re.findall(
        r"^#define (fmi2\w+)\s+fmi2FullName\(",
        (hosts.HEADERS / "fmi2Functions.h").read_text(),
        re.M,
    )
)
EXCHANGE = {
    "fmi2EnterEventMode",
    "fmi2NewDiscreteStates",
    "fmi2EnterContinuousTimeMode",
    "fmi2CompletedIntegratorStep",
    "fmi2SetTime",
    "fmi2SetContinuousStates",
    "fmi2GetDerivatives",
    "fmi2GetEventIndicators",
    "fmi2GetContinuousStates",
    "fmi2GetNominalsOfContinuousStates",
}


LINUX = {
    "linux64": "Advanced Micro Devices X86-64",
    "aarch64-linux": "AArch64",
}  # as readelf calls processors
# feet that move grow the last bit, in which functions of another C library differ
AMPLIFIED = {("win64", name): PORTED for name in ("foot_dynamic", *FREE_FEET)}
PLATFORMS = (*LINUX, "win64", "darwin64")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """An FMU for given platforms, built once; the first time on a machine, zig builds its own
    libraries (a minute).
    """
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
        extension = {"win64": ".dll", "darwin64": ".dylib"}.get(platform, ".so")
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
def test_binary_offers_the_functions_of_fmi_and_no_others(built, binary, runtime, platform):
    """Those of model exchange where the description declares it."""
    description = fmpy.read_model_description(str(built(runtime, platform)))
    expected = FUNCTIONS if description.modelExchange else FUNCTIONS - EXCHANGE
    exports = read_library(binary(platform).read_bytes()).exports
    # what every Mach-O library has, whoever made it
    assert exports - {"__dso_handle", "_mh_dylib_header"} == expected
    assert bool(description.modelExchange) == (runtime == "native")


# --- Linux
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("linux", LINUX)
def test_linux_binary_needs_the_c_library_only(binary, linux, runtime):
    dynamic = binutils("readelf", "-dW", str(binary(linux)))
    needed = set(re.findall(r"\(NEEDED\).*\[(.*)\]", dynamic))
    # libdl is glibc's own; the Python build looks for Python through it
    assert needed <= {"libc.so.6", "libm.so.6"} | ({"libdl.so.2"} if runtime == "python" else set())
    assert "RPATH" not in dynamic
    assert "RUNPATH" not in dynamic
    assert "TEXTREL" not in dynamic


@pytest.mark.parametrize("linux", LINUX)
def test_linux_binary_runs_on_any_glibc_since_2_17(binary, linux):
    wanted = re.findall(r"GLIBC_([\d.]+)", binutils("readelf", "-VW", str(binary(linux))))
    assert wanted
    assert max(tuple(map(int, version.split("."))) for version in wanted) <= (2, 17)


@pytest.mark.parametrize("linux", LINUX)
def test_linux_binary_has_no_symbol_of_python(binary, linux):
    symbols = binutils("readelf", "--dyn-syms", "-W", str(binary(linux)))
    assert "fmi2DoStep" in symbols
    assert not re.search(r"\b_?Py", symbols)


@pytest.mark.parametrize("linux", LINUX)
def test_linux_binary_has_no_executable_stack(binary, linux):
    segments = binutils("readelf", "-lW", str(binary(linux)))
    assert re.search(r"GNU_STACK.*\bRW\s", segments)


@pytest.mark.parametrize("linux", LINUX)
def test_linux_binary_is_for_its_processor(binary, linux):
    header = binutils("readelf", "-hW", str(binary(linux)))
    assert re.search(rf"Machine:\s+{LINUX[linux]}$", header, re.M)
    assert re.search(r"Type:\s+DYN", header)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", COMPONENTS)
@pytest.mark.parametrize(
    "machine", [m for m in MACHINES.values() if m.runners], ids=lambda m: m.name
)
def test_binary_of_another_platform_gives_the_numbers_of_this_one(machine, name, fmi, tmp_path):
    if machine.lacks():
        pytest.skip(machine.lacks())
    archive = tmp_path / f"{name}.fmu"
    archive.write_bytes(build(component(name), "native", ("linux64", machine.name), fmi=fmi))
    stop, step, stimuli = STIMULI[name]
    time = step * np.arange(min(50, int(stop / step)))
    inputs = {
        key: mean + size * np.sin(speed * time) for key, (mean, size, speed) in stimuli.items()
    }
    outputs = [
        variable.name
        for variable in fmpy.read_model_description(str(archive)).modelVariables
        if variable.causality == "output"
    ]
    expected = hosts.run_c_host(archive, time, inputs, outputs)
    found = hosts.run_c_host(archive, time, inputs, outputs, machine=machine)
    for output in outputs:
        size = np.abs(expected[output]).max()
        allowed = AMPLIFIED.get((machine.name, name), 1e-12)
        assert np.abs(found[output] - expected[output]).max() <= allowed * size, output


# --- Windows
# --------------------------------------------------------------------------------------------------


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


# --- macOS
# --------------------------------------------------------------------------------------------------


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


def test_macos_binary_asks_for_no_newer_system_than_it_needs(binary):
    """macOS 11 is the first on ARM; on x86-64, 10.13 of 2017 has every function that is called."""
    data = binary("darwin64").read_bytes()
    wanted = {}
    for k in range(2):
        kind, _, offset, _, _ = struct.unpack_from(">5I", data, 8 + 20 * k)
        at = offset + 32
        for _ in range(struct.unpack_from("<I", data, offset + 16)[0]):
            command, size = struct.unpack_from("<II", data, at)
            if command == 0x24:  # LC_VERSION_MIN_MACOSX
                wanted[kind] = struct.unpack_from("<I", data, at + 8)[0]
            elif command == 0x32:  # LC_BUILD_VERSION
                wanted[kind] = struct.unpack_from("<I", data, at + 12)[0]
            at += size
    assert wanted == {0x01000007: 10 << 16 | 13 << 8, 0x0100000C: 11 << 16}


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


# --- reproducible
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("platform", PLATFORMS)
def test_second_build_is_the_same_bytes(built, runtime, platform):
    assert build(component(NAME), runtime, [platform]) == built(runtime, platform).read_bytes()
