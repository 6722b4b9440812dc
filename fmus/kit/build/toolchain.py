"""C compilers: find and run zig or the system's compiler, and cache the libraries they make.

zig compiles for every platform, offline; the system's compiler only for this platform.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import hashlib
import importlib.metadata
import importlib.util
import os
import platform
import shutil
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from fmus.kit.errors import UserError
from fmus.kit.extras import install_command
from fmus.kit.storage import cache, scratch

# FMI 2 platform -> zig targets. The two targets of darwin64 become one universal library. The
# versions are the oldest possible ones: of glibc; of macOS the first for arm64, and for x86-64 the
# first with all functions that are called.
ZIG_TARGETS = {
    "linux64": ("x86_64-linux-gnu.2.17",),
    "win64": ("x86_64-windows-gnu",),
    "darwin64": ("x86_64-macos.10.13", "aarch64-macos.11.0"),
    "aarch64-linux": ("aarch64-linux-gnu.2.17",),
}
EXTENSIONS = {"linux64": ".so", "win64": ".dll", "darwin64": ".dylib", "aarch64-linux": ".so"}
# FMI 3.0 has a folder for each architecture (section 2.5.1.4.1); that of macOS is for both
FOLDERS_OF_FMI_3 = {
    "linux64": ("x86_64-linux",),
    "win64": ("x86_64-windows",),
    "darwin64": ("x86_64-darwin", "aarch64-darwin"),
    "aarch64-linux": ("aarch64-linux",),
}
_HOSTS = {"Linux": "linux64", "Windows": "win64", "Darwin": "darwin64"}

# No contraction of a*b+c, so that both builds and all platforms round alike. zig keeps frame
# pointers by default, which cost a twelfth of the step of a small component.
FLAGS = (
    "-std=c99",
    "-O2",
    "-fomit-frame-pointer",
    "-ffp-contract=off",
    "-fPIC",
    "-shared",
    "-fvisibility=hidden",
    "-s",
    "-g0",
)
# Time limits, in s, for a library with all its targets. The largest takes some seconds; the first
# one of a platform takes minutes, because zig then builds the C library of that platform.
_LIMIT = 300.0
_FIRST_LIMIT = 1800.0
_compiled_platforms: set[str] = set()  # platforms for which this process has compiled with zig


def host_platform() -> str:
    """Return the FMI 2.0 name of this machine's platform, e.g. ``linux64``.

    Returns
    -------
    str

    Raises
    ------
    UserError
        If FMUs cannot be built on this platform.
    """
    system = platform.system()
    processor = platform.machine().lower()
    name = _HOSTS.get(system)
    known = processor in ("x86_64", "amd64") or (name == "darwin64" and processor == "arm64")
    if name is None or not known:
        raise UserError(
            f"FMUs are built on {', '.join(_HOSTS.values())} (x86-64; macOS also arm64), not on"
            f" {system} {processor}"
        )
    return name


def fmi_headers(version: int) -> Path:
    """Return the folder of the standard's headers of FMI 2.0 or 3.0."""
    return Path(__file__).parents[1] / "fmi" / f"fmi{version}" / "standard"


@dataclass(frozen=True)
class Compiler:
    """A C compiler for one platform.

    Attributes
    ----------
    command : tuple of str
        Command line up to its options.
    targets : tuple of str
        zig targets; empty for the system's compiler.
    """

    command: tuple[str, ...]
    targets: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """The name of the compiler, for people."""
        return "zig" if self.targets else Path(self.command[0]).name

    @property
    def version(self) -> str:
        """The version of the compiler, which is part of the digest of a library."""
        if self.targets:
            return f"zig {importlib.metadata.version('ziglang')}"
        try:
            about = os.stat(self.command[0])
        except OSError:
            return self.command[0]
        return _printed_version(self.command, about.st_mtime_ns, about.st_size)

    def options(self, target: str, libraries: Sequence[str] = ()) -> list[list[str]]:
        """Return the options, without paths, of each run of the compiler for a platform.

        Parameters
        ----------
        target : str
            FMI platform.
        libraries : sequence of str
            Names for ``-l``.
        """
        shared = [*FLAGS, *(f"-l{library}" for library in libraries)]
        if target == "darwin64":
            shared.append("-Wl,-install_name,@rpath/library.dylib")
        if not self.targets:
            return [shared]
        return [["-target", one, *shared] for one in self.targets]


@functools.cache
def _printed_version(command: tuple[str, ...], changed: int, size: int) -> str:
    """Return the path of a compiler and the version that it prints.

    The arguments `changed` (time of change of its file, ns) and `size` (bytes) make the cache run a
    compiler again that was replaced. They stand for the version if it prints none.
    """
    try:
        printed = run_program([*command, "--version"], 10.0).stdout
    except (OSError, subprocess.SubprocessError):
        printed = ""
    version = printed.partition("\n")[0] or f"{changed} {size}"
    return f"{command[0]}: {version}"


def find_compiler(target: str) -> Compiler:
    """Find a compiler for a platform.

    ``CC`` in the environment names the system's compiler; without it ``cc``, ``gcc`` and ``clang``
    are tried. zig is preferred: its libraries run on any glibc since 2.17 and are the same bytes
    wherever they are built.

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
        If there is none; the message says how to install one.
    """
    if target not in ZIG_TARGETS:
        raise UserError(
            f"unknown platform {target!r}; FMI platforms built here: {', '.join(ZIG_TARGETS)}"
        )
    if importlib.util.find_spec("ziglang") is not None:
        return Compiler((sys.executable, "-m", "ziglang", "cc"), ZIG_TARGETS[target])
    if target == host_platform() and target != "win64":
        for name in (os.environ.get("CC"), "cc", "gcc", "clang"):
            path = shutil.which(name) if name else None
            if path:
                return Compiler((path,))
    raise UserError(
        f"no C compiler for {target} on this machine; {install_command('ziglang')} brings one"
        " (zig), for every platform"
    )


def available_platforms() -> list[str]:
    """Return the platforms for which a compiler is installed.

    Returns
    -------
    list of str
        FMI 2.0 names.

    Raises
    ------
    UserError
        If there is none; the message says how to install a compiler.
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
        The library; for darwin64 zig makes a universal one, for x86-64 and arm64.

    Raises
    ------
    UserError
        If there is no compiler, or it fails (with its first error line), or takes longer than
        `_LIMIT`, or `_FIRST_LIMIT` for zig's first library of a platform.
    """
    compiler = find_compiler(target)
    is_first = compiler.targets and target not in _compiled_platforms
    limit = _FIRST_LIMIT if is_first else _LIMIT
    until = time.monotonic() + limit
    binaries = []
    for options in compiler.options(target, libraries):
        with scratch.folder("compiled") as folder:
            output = folder / "library"
            # libraries last: a linker takes from them the symbols that are still missing
            paths = [*(f"-I{place}" for place in include), *map(str, sources), "-o", str(output)]
            command = [*compiler.command, *paths, *options]
            try:
                _run_compiler(compiler, command, target, until - time.monotonic())
            except subprocess.TimeoutExpired as error:
                raise UserError(
                    f"{compiler.label} failed for {target}: not done after {limit:g} s, and ended;"
                    " try again with less load on the machine"
                ) from error
            with scratch.written(folder):
                binaries.append(output.read_bytes())
    _compiled_platforms.add(target)
    return binaries[0] if len(binaries) == 1 else _universal(binaries)


def _run_compiler(compiler: Compiler, command: Sequence[str], target: str, limit: float) -> None:
    """Run a compiler; raise UserError if it fails, TimeoutExpired after `limit` s."""
    failure = f"{compiler.label} failed for {target}"
    try:
        done = run_program(command, limit)
    except OSError as error:
        raise UserError(
            f"{failure}: {compiler.command[0]} cannot be started ({error.strerror})"
        ) from error
    if done.returncode != 0:
        # compilers report a full disk in various words, or not at all
        scratch.check_room(Path(command[command.index("-o") + 1]).parent)
        lines = done.stderr.splitlines() or ["no message"]
        first_error = next((line for line in lines if "error" in line), lines[0])
        raise UserError(f"{failure}: {first_error}")


def _universal(libraries: list[bytes]) -> bytes:
    """Join Mach-O libraries of single architectures into a universal one (``<mach-o/fat.h>``)."""
    alignment = 14  # 2**14: the page size of arm64
    page = 1 << alignment
    magic = 0xCAFEBABE
    header = struct.pack(">II", magic, len(libraries))
    body = b""
    for library in libraries:
        # type and subtype of the processor, little-endian in the thin header
        header += library[4:8][::-1] + library[8:12][::-1]
        header += struct.pack(">III", page + len(body), len(library), alignment)
        body += library + bytes(-len(library) % page)
    return header + bytes(page - len(header)) + body


def run_program(command: Sequence[str], limit: float) -> subprocess.CompletedProcess[str]:
    """Run a program without standard input, and wait for its end.

    Parameters
    ----------
    command : sequence of str
    limit : float
        Time limit, s.

    Returns
    -------
    subprocess.CompletedProcess
        With the texts that it printed.

    Raises
    ------
    OSError
        If it cannot be started.
    subprocess.TimeoutExpired
        If it takes longer than the limit. It is then killed with all its child processes, as after
        an interrupt.
    """
    environment = dict(os.environ)
    if cache.users_folder() is None:  # zig keeps what it compiled in the home
        environment.setdefault("ZIG_GLOBAL_CACHE_DIR", str(cache.folder() / "zig"))
    # A process group can be killed as a whole. Ctrl-C does not reach it, but interrupts the wait.
    with subprocess.Popen(
        command,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        start_new_session=True,
    ) as process:
        try:
            output, errors = process.communicate(timeout=limit)
        except BaseException:
            _kill(process)
            raise
    return subprocess.CompletedProcess(command, process.returncode, output, errors)


def _kill(process: subprocess.Popen[str]) -> None:
    """Kill a program with all its child processes."""
    if sys.platform == "win32":
        subprocess.run(["taskkill", "/F", "/T", "/PID", str(process.pid)], capture_output=True)
        process.kill()
    else:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def cached_library(
    sources: Mapping[str, bytes], unit: str, target: str, libraries: Sequence[str] = ()
) -> Path:
    """Compile sources to a shared library, or return the library from the cache.

    Parameters
    ----------
    sources : Mapping of str to bytes
        C files and headers by name, FMI's headers among them.
    unit : str
        Name of the file to compile.
    target : str
        FMI platform.
    libraries : sequence of str
        Names for ``-l``.

    Returns
    -------
    Path
        Named after the digest of :func:`library_digest`, and undamaged; see :func:`load_library`.

    Raises
    ------
    UserError
        If there is no compiler for the platform, or it fails.
    """

    def compiled() -> bytes:
        with scratch.folder("sources") as folder:
            with scratch.written(folder):
                for name, contents in sources.items():
                    (folder / name).write_bytes(contents)
            return compile_library([folder / unit], [folder], target, libraries=libraries)

    name = f"library-{library_digest(sources, unit, target, libraries)}{EXTENSIONS[target]}"
    return cache.cached_file(name, compiled)


def library_digest(
    sources: Mapping[str, bytes], unit: str, target: str, libraries: Sequence[str] = ()
) -> str:
    """Return the digest of a library's sources, compiler, compiler version and options.

    Parameters
    ----------
    sources, unit, target, libraries
        See :func:`cached_library`.

    Returns
    -------
    str

    Raises
    ------
    UserError
        If there is no compiler for the platform.
    """
    compiler = find_compiler(target)
    options = map(repr, compiler.options(target, libraries))
    digest = hashlib.sha256("\0".join([compiler.version, target, unit, *options]).encode())
    for name in sorted(sources):
        digest.update(b"\0" + name.encode() + b"\0" + hashlib.sha256(sources[name]).digest())
    return digest.hexdigest()[:32]


def load_library(path: Path) -> ctypes.CDLL:
    """Load a shared library, after checking one from the cache against its digest.

    Raises
    ------
    UserError
        If it is damaged, or cannot be loaded.
    """
    if path.parent == cache.folder() and not cache.is_sound(path):
        raise UserError(
            f"{path}: was damaged since it was compiled; begin again, and it is compiled anew"
        )
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        raise UserError(f"{path}: cannot be loaded ({error})") from error
