"""Processes that this one has started."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from collections.abc import Iterator

import psutil


def children() -> set[int]:
    """Numbers of all, also of those that have ended and that nobody has asked how."""
    return {child.pid for child in psutil.Process().children()}


def of_fmus() -> list[psutil.Process]:
    """Those in which FMUs run."""
    found = []
    for child in psutil.Process().children():
        with contextlib.suppress(psutil.Error):  # it has ended, and nobody has asked how
            found += [child] if "isolation.child" in " ".join(child.cmdline()) else []
    return found


@contextlib.contextmanager
def busy(count: int, seconds: float) -> Iterator[None]:
    """Processes that do nothing but compute, for so long at most."""
    code = f"import time\nend = time.monotonic() + {seconds}\nwhile time.monotonic() < end: pass"
    beside = [subprocess.Popen([sys.executable, "-c", code]) for _ in range(count)]
    try:
        yield
    finally:
        for process in beside:
            process.kill()
            process.wait()
