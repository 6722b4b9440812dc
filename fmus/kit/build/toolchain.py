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
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fmus.kit.build import process
from fmus.kit.errors import UserError
from fmus.kit.storage import scratch

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
FLAGS = (
    "-std=c99",
    "-O2",
    "-ffp-contract=off",
    "-fPIC",
    "-shared",
    "-fvisibility=hidden",
    "-s",
    "-g0",
)
_LIMIT = 300.0  # s for a library, for all its targets together; the largest takes some seconds


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
    if name is None or (
        processor not in ("x86_64", "amd64") and not (name == "darwin64" and processor == "arm64")
    ):
        raise UserError(
            f"FMUs are built on {', '.join(_HOSTS.values())} (x86-64; macOS also arm64), not on {system} {processor}"
        )
    return name


def fmi_headers() -> Path:
    """Folder of the headers of FMI 2.0.1, as the standard has them."""
    return Path(__file__).parents[1] / "fmi2" / "standard"


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
        if self.targets:
            return f"zig {importlib.metadata.version('ziglang')}"
        try:
            about = os.stat(self.command[0])
        except OSError:
            return self.command[0]
        return _told_version(self.command, about.st_mtime_ns, about.st_size)

    def options(self, target: str, libraries: Sequence[str] = ()) -> list[list[str]]:
        """Options of each of its runs for a platform, but for paths.

        Parameters
        ----------
        target : str
            FMI platform.
        libraries : sequence of str
            Names for ``-l``.
        """
        own = [f"-l{library}" for library in libraries]
        if target == "darwin64":
            own.append("-Wl,-install_name,@rpath/library.dylib")
        return [[*(("-target", one) if one else ()), *FLAGS, *own] for one in self.targets or ("",)]


@functools.cache
def _told_version(command: tuple[str, ...], changed: int, size: int) -> str:
    """Path of a compiler and what it says of itself: another version may be installed under the same path.

    It is asked once, unless its file changes meanwhile (ns, bytes), which tell versions apart where it says nothing.
    """
    try:
        done = process.run([*command, "--version"], 10.0)
    except (OSError, subprocess.SubprocessError):
        return f"{command[0]}: {changed} {size}"
    return f"{command[0]}: {done.stdout.partition(chr(10))[0] or f'{changed} {size}'}"


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
        raise UserError(
            f"unknown platform {target!r}; FMI platforms built here: {', '.join(ZIG_TARGETS)}"
        )
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
        If there is no compiler, or it fails (with its first error line), or takes longer than `_LIMIT`.
    """
    compiler = find_compiler(target)
    until, built = time.monotonic() + _LIMIT, []
    for options in compiler.options(target, libraries):
        with scratch.folder("compiled") as folder:
            output = folder / f"library{EXTENSIONS[target]}"
            # libraries last: a linker takes from them what it misses by then
            named = [*(f"-I{place}" for place in include), *map(str, sources), "-o", str(output)]
            _compile(compiler, [*compiler.command, *named, *options], target, until)
            with scratch.written(folder):
                built.append(output.read_bytes())
    return built[0] if len(built) == 1 else _universal(built)


def _compile(compiler: Compiler, command: Sequence[str], target: str, until: float) -> None:
    """Run a compiler to its end; UserError if it fails, or is not done by then."""
    told = f"{compiler.label} failed for {target}"
    try:
        done = process.run(command, until - time.monotonic())
    except subprocess.TimeoutExpired as error:
        raise UserError(
            f"{told}: not done after {_LIMIT:g} s, and ended; try again with less beside it"
        ) from error
    except OSError as error:
        raise UserError(
            f"{told}: {compiler.command[0]} cannot be started ({error.strerror})"
        ) from error
    if done.returncode != 0:
        scratch.check_room(
            Path(command[command.index("-o") + 1]).parent
        )  # it says so in its own words, if at all
        lines = done.stderr.splitlines() or ["no message"]
        raise UserError(f"{told}: {next((line for line in lines if 'error' in line), lines[0])}")


def _universal(libraries: list[bytes]) -> bytes:
    """Join thin Mach-O libraries into a universal one (the format of ``<mach-o/fat.h>``)."""
    alignment = 14  # 2**14: the page size of arm64
    header = bytearray(b"".join(n.to_bytes(4, "big") for n in (0xCAFEBABE, len(libraries))))
    body = bytearray()
    offset = 1 << alignment
    for library in libraries:
        kind, subtype = (
            library[i : i + 4][::-1] for i in (4, 8)
        )  # little-endian in the thin header
        header += kind + subtype
        header += b"".join(n.to_bytes(4, "big") for n in (offset, len(library), alignment))
        padding = -len(library) % (1 << alignment)
        body += library + bytes(padding)
        offset += len(library) + padding
    return bytes(header) + bytes((1 << alignment) - len(header)) + bytes(body)
