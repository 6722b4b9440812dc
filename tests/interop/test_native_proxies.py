"""The native rig proxy as a file: every platform compiles it without a warning, and has what it
needs.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import zipfile
from io import BytesIO

import pytest

from fmus import component
from fmus.kit.build.building import build, plan_build
from fmus.kit.build.toolchain import ZIG_TARGETS
from orchestration.fmu.check.shared_library import read_library

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("ziglang") is None,
    reason="ziglang, which compiles for all platforms, is not installed",
)
# What every machine with the system has: glibc, the Windows API with Winsock and its timers,
# libSystem.
OF_THE_SYSTEM = {
    "linux64": {"libm.so.6", "libc.so.6", "libpthread.so.0", "ld-linux-x86-64.so.2", "libdl.so.2"},
    "aarch64-linux": {
        "libm.so.6",
        "libc.so.6",
        "libpthread.so.0",
        "ld-linux-aarch64.so.1",
        "libdl.so.2",
    },
    "win64": {"kernel32.dll", "ws2_32.dll", "winmm.dll", "msvcrt.dll"},
    "darwin64": {"/usr/lib/libsystem.b.dylib"},
}


@pytest.mark.slow
@pytest.mark.parametrize("target", [name for targets in ZIG_TARGETS.values() for name in targets])
@pytest.mark.parametrize("standard", ["c99", "c11"])
@pytest.mark.parametrize("fmi", [2, 3])
def test_every_compiler_is_content(tmp_path, target, standard, fmi):
    planned = plan_build(component("rig_proxy"), "native", fmi)
    for name, content in planned.sources.items():
        (tmp_path / name).write_bytes(content)
    command = [
        sys.executable,
        "-m",
        "ziglang",
        "cc",
        "-target",
        target,
        f"-std={standard}",
        "-O1",
        "-c",
        "all.c",
    ]
    strict = ["-Wall", "-Wextra", "-Werror", "-o", "all.o"]
    done = subprocess.run([*command, *strict], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow  # compilers of all platforms
def test_every_platform_finds_what_the_proxy_needs():
    """No ZeroMQ, no libsodium, no C++ runtime."""
    with zipfile.ZipFile(
        BytesIO(build(component("rig_proxy"), "native", list(OF_THE_SYSTEM)))
    ) as archive:
        for platform, system in OF_THE_SYSTEM.items():
            (path,) = (n for n in archive.namelist() if n.startswith(f"binaries/{platform}/"))
            content = archive.read(path)
            needs = {name.lower() for name in read_library(content).needs}
            assert {name for name in needs if not name.startswith("api-ms-win-crt-")} <= system
            assert len(content) < 300_000
