"""How long an FMU takes to build, and how big it is."""

from __future__ import annotations

import contextlib
import io
import os
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator

from fmus import component
from fmus.kit import build
from fmus.kit.build import toolchain
from fmus.kit.component import Component
from fmus.kit.errors import UserError

from . import c_code
from .tables import Cell, Table, Topic
from .timing import take_turns

NOTHING = "an empty C FMU, compiled only"
FIRST = "the same, with an empty compiler cache"
PLANNING = {runtime: f"{runtime}, all but the compiler" for runtime in build.RUNTIMES}
WHOLE = {runtime: f"{runtime}, all" for runtime in build.RUNTIMES}


def measure(quick: bool = False) -> Topic:
    """Time both builds for this machine, and weigh them for every platform."""
    cls = component("ppy_actuator")
    host = toolchain.host_platform()
    platforms = [host] if quick else build.available_platforms()

    def planning(runtime: str) -> Callable[[], object]:
        return lambda: build.plan_build(cls, runtime)

    def whole(runtime: str) -> Callable[[], object]:
        def action() -> None:
            with _empty("PPY_CACHE"):
                build.build(cls, runtime, [host])

        return action

    actions: dict[str, Callable[[], object]] = {NOTHING: c_code.empty_library}
    for runtime in build.RUNTIMES:
        actions |= {PLANNING[runtime]: planning(runtime), WHOLE[runtime]: whole(runtime)}
    times = take_turns(actions, 1 if quick else 5)
    seconds = {NOTHING: times.best(NOTHING)}
    if not quick:
        seconds[FIRST] = _first()
    seconds |= {name: times.best(name) for name in times.seconds}
    rows: list[list[Cell]] = [
        [name, spent, spent / seconds[NOTHING]] for name, spent in seconds.items()
    ]
    archives = {runtime: _archive(cls, runtime, platforms) for runtime in build.RUNTIMES}
    label = toolchain.find_compiler(host).label
    return Topic(
        "Building an FMU",
        [
            (
                f"`ppy_actuator` for this machine ({host}), with {label}. Sources lie in a new"
                " folder each time, so that the compiler remembers nothing of them."
            ),
            Table(["build", "best, s", f"of {NOTHING}"], rows),
            (
                "Bytes in the archive, compressed; in brackets the size of the library itself. The"
                " native build also brings its sources."
            ),
            sizes(archives, platforms),
        ],
    )


def _archive(cls: type[Component], runtime: str, platforms: list[str]) -> bytes:
    """Build for every platform that can be built for; name the others on standard error."""
    built = []
    for target in platforms:
        try:
            build.build(cls, runtime, [target])
        except UserError as error:
            print(f"{runtime} for {target} is left out: {error}", file=sys.stderr)
        else:
            built.append(target)
    return build.build(cls, runtime, built)


def sizes(archives: dict[str, bytes], platforms: list[str]) -> Table:
    """Weigh the parts of archives.

    Parameters
    ----------
    archives : dict of str to bytes
        FMU by runtime.
    platforms : list of str
        Platforms to look for in them.

    Returns
    -------
    Table
        A row for each runtime.
    """
    rows: list[list[Cell]] = []
    for runtime, contents in archives.items():
        with zipfile.ZipFile(io.BytesIO(contents)) as archive:
            entries = archive.infolist()
        binaries = {
            p: [e for e in entries if e.filename.startswith(f"binaries/{p}/")] for p in platforms
        }
        weights = [
            (
                f"{sum(e.compress_size for e in found):,} ({sum(e.file_size for e in found):,})"
                if found
                else "not built"
            )
            for found in binaries.values()
        ]
        rest = sum(e.compress_size for e in entries if not e.filename.startswith("binaries/"))
        rows.append([runtime, *weights, rest, len(contents)])
    return Table(["runtime", *platforms, "all but binaries", "archive"], rows)


@contextlib.contextmanager
def _empty(*caches: str) -> Iterator[None]:
    """Folders that these variables name are empty ones meanwhile."""
    before = {name: os.environ.get(name) for name in caches}
    with tempfile.TemporaryDirectory(prefix="benchmark_") as folder:
        os.environ.update(dict.fromkeys(caches, folder))
        try:
            yield
        finally:
            for name, value in before.items():
                if value is None:
                    os.environ.pop(name)
                else:
                    os.environ[name] = value


def _first() -> float:
    """Measure seconds for the first library, before zig has prepared anything (others never do)."""
    with _empty("ZIG_GLOBAL_CACHE_DIR", "ZIG_LOCAL_CACHE_DIR"):
        begin = time.perf_counter()
        c_code.empty_library()
        return time.perf_counter() - begin
