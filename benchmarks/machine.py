"""The machine that the figures were measured on."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import re
import subprocess
from pathlib import Path

from fmus.kit.build import toolchain

from .tables import Table

_PACKAGES = ("fmpy", "casadi", "numpy", "pythonfmu", "ziglang")


def describe() -> Table:
    """Processor, operating system, Python, compiler and the packages that the figures depend on."""
    rows = [
        ["processor", f"{_processor()}, {platform.machine()}"],
        ["cores for this process", str(_cores())],
        ["operating system", _system()],
        ["Python", f"{platform.python_version()} ({platform.python_implementation()})"],
        ["C compiler", toolchain.find_compiler(toolchain.host_platform()).label],
        *([name, version] for name in _PACKAGES if (version := _version(name))),
    ]
    return Table(["", "measured on"], rows)


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        found = re.search(r"^model name\s*:\s*(.+)$", cpuinfo.read_text(), re.M)
        if found:
            return found[1].strip()
    if platform.system() == "Darwin":
        command = ["sysctl", "-n", "machdep.cpu.brand_string"]
        return (
            subprocess.run(command, capture_output=True, text=True).stdout.strip()
            or platform.processor()
        )
    return platform.processor() or "unknown"


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _system() -> str:
    try:
        return platform.freedesktop_os_release()["PRETTY_NAME"]
    except (OSError, KeyError):
        return f"{platform.system()} {platform.release()}"


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None
