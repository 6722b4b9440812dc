"""Finding and running a C compiler: zig (every platform, offline) or the system's (this platform only)."""

from __future__ import annotations

import functools
import importlib.metadata
import importlib.util
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fmus.kit.errors import UserError

# FMI 2 platform -> zig targets. Two targets of darwin64 become one universal library. The versions are the oldest that
# will do: of glibc; of macOS the first on arm64, and on x86-64 one with all functions that are called.
ZIG_TARGETS = {
    "linux64": ("x86_64-linux-gnu.2.17",),
    "win64": ("x86_64-windows-gnu",),
    "darwin64": ("x86_64-macos.10.13", "aarch64-macos.11.0"),
    "aarch64-linux": ("aarch64-linux-gnu.2.17",),
}
EXTENSIONS = {"linux64": ".so", "win64": ".dll", "darwin64": ".dylib", "aarch64-linux": ".so"}
_HOSTS = {"Linux": "linux64", "Windows": "win64", "Darwin": "darwin64"}
INSTALL_HINT = "pip install 'ppy-rig[native]' brings one (zig), for every platform"

# No contraction of a*b+c: the two builds, and every platform, shall round alike.
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden", "-s", "-g0")


def host_platform() -> str:
    """FMI 2.0 name of this machine's platform, e.g. ``linux64``.

    Returns
    -------
    str

    Raises
    ------
    UserError
        If FMI 2.0 has no name for it, or it is not built here.
    """
    system, processor = platform.system(), platform.machine().lower()
    name = _HOSTS.get(system)
    if name is None or (processor not in ("x86_64", "amd64") and not (name == "darwin64" and processor == "arm64")):
        raise UserError(
            f"FMUs are built on {', '.join(_HOSTS.values())} (x86-64; macOS also arm64), not on {system} {processor}"
        )
    return name


def fmi_headers() -> Path:
    """Folder of the headers of FMI 2.0.1, as the standard has them."""
    return Path(__file__).parents[1] / "fmi2" / "standard"


def cache_folder() -> Path:
    """Folder for compiled things that can be made again; ``PPY_CACHE`` in the environment moves it."""
    import platformdirs

    return Path(os.environ.get("PPY_CACHE") or platformdirs.user_cache_dir("ppy-rig"))


@dataclass(frozen=True)
class Compiler:
    """A C compiler for one platform.

    Attributes
    ----------
    command : tuple of str
        How it is called.
    targets : tuple of str
        zig targets; empty for the system's compiler.
    """

    command: tuple[str, ...]
    targets: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """For people: which compiler this is."""
        return "zig" if self.targets else Path(self.command[0]).name

    @property
    def version(self) -> str:
        """What tells its libraries from another's."""
        return f"zig {importlib.metadata.version('ziglang')}" if self.targets else _told_version(self.command)


@functools.cache
def _told_version(command: tuple[str, ...]) -> str:
    """Path of a compiler and what it says of itself: another version may be installed under the same path."""
    try:
        done = subprocess.run(
            [*command, "--version"], capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=10.0
        )
    except (OSError, subprocess.SubprocessError):
        return command[0]
    return f"{command[0]}: {done.stdout.partition(chr(10))[0]}"


def find_compiler(target: str) -> Compiler:
    """Find a compiler for a platform.

    ``CC`` in the environment names the system's compiler; without it ``cc``, ``gcc`` and ``clang`` are tried. zig is
    preferred: its libraries run on any glibc since 2.17 and are the same bytes wherever they are built.

    Parameters
    ----------
    target : str
        ``linux64``, ``win64``, ``darwin64`` or ``aarch64-linux``.

    Returns
    -------
    Compiler

    Raises
    ------
    UserError
        If there is none, saying what to install.
    """
    if target not in ZIG_TARGETS:
        raise UserError(f"unknown platform {target!r}; FMI platforms built here: {', '.join(ZIG_TARGETS)}")
    if importlib.util.find_spec("ziglang") is not None:
        return Compiler((sys.executable, "-m", "ziglang", "cc"), ZIG_TARGETS[target])
    if target == host_platform() and target != "win64":
        for name in filter(None, (os.environ.get("CC"), "cc", "gcc", "clang")):
            if path := shutil.which(name):
                return Compiler((path,))
    raise UserError(f"no C compiler for {target} on this machine; {INSTALL_HINT}")


def available_platforms() -> list[str]:
    """Platforms that a compiler on this machine can serve.

    Returns
    -------
    list of str
        FMI 2.0 names.

    Raises
    ------
    UserError
        If there is none, saying what to install.
    """
    platforms = []
    for target in ZIG_TARGETS:
        try:
            find_compiler(target)
        except UserError:
            continue
        platforms.append(target)
    if not platforms:
        find_compiler(host_platform())  # raises, with the hint
    return platforms


def compile_library(
    sources: Sequence[Path],
    include: Sequence[Path],
    target: str,
    *,
    libraries: Sequence[str] = (),
) -> bytes:
    """Compile C sources into a shared library.

    Parameters
    ----------
    sources : sequence of Path
        C files.
    include : sequence of Path
        Header folders.
    target : str
        FMI 2 platform.
    libraries : sequence of str
        Names for ``-l``.

    Returns
    -------
    bytes
        The library; on darwin64 a universal one for x86-64 and arm64 when zig made it.

    Raises
    ------
    UserError
        If there is no compiler, or it fails (with its first error line).
    """
    compiler = find_compiler(target)
    built = []
    for zig_target in compiler.targets or ("",):
        with tempfile.TemporaryDirectory(prefix="ppy-") as folder:
            output = Path(folder) / f"library{EXTENSIONS[target]}"
            command = [*compiler.command, *(("-target", zig_target) if zig_target else ()), *FLAGS]
            command += [f"-I{folder}" for folder in include]
            command += [*map(str, sources), "-o", str(output)]
            command += [f"-l{library}" for library in libraries]
            if target == "darwin64":
                command += ["-Wl,-install_name,@rpath/library.dylib"]
            done = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL)
            if done.returncode != 0:
                lines = (
                    [line for line in done.stderr.splitlines() if "error" in line]
                    or done.stderr.splitlines()
                    or ["no message"]
                )
                raise UserError(f"{compiler.label} failed for {zig_target or target}: {lines[0]}")
            built.append(output.read_bytes())
    return built[0] if len(built) == 1 else _universal(built)


def _universal(libraries: list[bytes]) -> bytes:
    """Join thin Mach-O libraries into a universal one (the format of ``<mach-o/fat.h>``)."""
    alignment = 14  # 2**14: the page size of arm64
    header = bytearray(b"".join(n.to_bytes(4, "big") for n in (0xCAFEBABE, len(libraries))))
    body = bytearray()
    offset = 1 << alignment
    for library in libraries:
        kind, subtype = (library[i : i + 4][::-1] for i in (4, 8))  # little-endian in the thin header
        header += kind + subtype
        header += b"".join(n.to_bytes(4, "big") for n in (offset, len(library), alignment))
        padding = -len(library) % (1 << alignment)
        body += library + bytes(padding)
        offset += len(library) + padding
    return bytes(header) + bytes((1 << alignment) - len(header)) + bytes(body)
