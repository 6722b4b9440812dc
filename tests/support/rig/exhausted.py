"""Processes that get no further thread, process or address space."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil
import pytest

_PIDS = Path("/sys/fs/cgroup/pids")  # version 1
_UNIFIED = Path("/sys/fs/cgroup")


@contextmanager
def no_threads(processes: Iterable[int]) -> Iterator[None]:
    """Let the kernel refuse every thread and process that some processes would start."""
    root = _PIDS if _PIDS.is_dir() else _UNIFIED
    group = root / "ppy-test-no-threads"
    try:
        group.mkdir(exist_ok=True)
        (group / "pids.max").write_text("1")
        members = [str(number) for number in processes]
        for member in members:
            (group / "cgroup.procs").write_text(member)
    except OSError as error:
        pytest.skip(f"a control group of processes is not permitted here: {error}")
    try:
        yield
    finally:
        (group / "pids.max").write_text("max")
        for member in (group / "cgroup.procs").read_text().split():
            with suppress(OSError):  # it has ended meanwhile
                (root / "cgroup.procs").write_text(member)
        with suppress(OSError):
            group.rmdir()


@contextmanager
def no_memory(processes: Iterable[int]) -> Iterator[None]:
    """Let the kernel refuse all further address space, which also every new thread needs."""
    for number in processes:
        with suppress(psutil.NoSuchProcess):
            process = psutil.Process(number)
            process.rlimit(psutil.RLIMIT_AS, (process.memory_info().vms, psutil.RLIM_INFINITY))
    yield


@contextmanager
def no_descriptors(processes: Iterable[int]) -> Iterator[None]:
    """Let the kernel refuse every further descriptor."""
    for number in processes:
        with suppress(psutil.NoSuchProcess):
            process = psutil.Process(number)
            most = process.rlimit(psutil.RLIMIT_NOFILE)[1]
            process.rlimit(psutil.RLIMIT_NOFILE, (_next_descriptor(number), most))
    yield


@contextmanager
def frozen(processes: Iterable[int]) -> Iterator[None]:
    """Let the kernel hold processes, which then do not even end when they are killed."""
    group = _UNIFIED / "freezer" / "ppy-test-frozen"
    try:
        group.mkdir(exist_ok=True)
        for number in processes:
            (group / "cgroup.procs").write_text(str(number))
        (group / "freezer.state").write_text("FROZEN")
    except OSError as error:
        pytest.skip(f"a control group that freezes is not permitted here: {error}")
    try:
        yield
    finally:
        (group / "freezer.state").write_text("THAWED")


def _next_descriptor(number: int) -> int:
    """Return the lowest descriptor that a process does not have."""
    there = {int(one.name) for one in Path(f"/proc/{number}/fd").iterdir()}
    return min(set(range(len(there) + 1)) - there)
