"""Platforms of FMUs, and programs that run theirs on this machine."""

from __future__ import annotations

import platform
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path

_ARM_LIBRARIES = Path("/usr/aarch64-linux-gnu")  # of Debian's libc6-arm64-cross


@dataclass(frozen=True)
class Machine:
    """A platform.

    Attributes
    ----------
    name : str
        As FMI 2.0 has it.
    tuple : str
        As FMI 3.0 has it.
    extension : str
        Of a shared library.
    target : str
        For ``zig cc``.
    runners : tuple of str
        Programs any of which runs a program of the platform here; empty if none is needed.
    options : tuple of str
        Of the runner.
    """

    name: str
    tuple: str
    extension: str
    target: str
    runners: tuple[str, ...] = ()
    options: tuple[str, ...] = ()

    @property
    def libraries(self) -> tuple[str, ...]:
        """Libraries that a program needs which loads another."""
        return () if self.name == "win64" else ("-ldl",)

    def runner(self) -> list[str]:
        """Return the beginning of a command that runs a program of the platform."""
        found = next(filter(None, map(shutil.which, self.runners)), None)
        return [] if found is None else [found, *self.options]

    def lacks(self) -> str:
        """Return the reason why nothing of the platform runs here; empty if it does."""
        if self.runners and not self.runner():
            return f"{self.runners[0]}, which runs programs for {self.name}, is not installed"
        if self.options and not _ARM_LIBRARIES.exists():
            return "libc6-arm64-cross, the C library for ARM, is not installed"
        if not self.runners and (sys.platform, platform.machine()) != ("linux", "x86_64"):
            return f"this is not {self.name}"
        return ""


MACHINES = {
    machine.name: machine
    for machine in (
        Machine("linux64", "x86_64-linux", ".so", "x86_64-linux-gnu.2.17"),
        Machine("win64", "x86_64-windows", ".dll", "x86_64-windows-gnu", ("wine",)),
        Machine(
            "aarch64-linux",
            "aarch64-linux",
            ".so",
            "aarch64-linux-gnu.2.17",
            ("qemu-aarch64", "qemu-aarch64-static"),
            ("-L", str(_ARM_LIBRARIES)),
        ),
    )
}
