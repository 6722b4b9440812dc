"""Diagnoses of records of an emulated rig: time and memory over the length of the record."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import orchestration as ppy
from demonstrations import draw, write

from .tables import Cell, Table
from .timing import in_a_process, verdict

_RATE = 10.0  # Hz


def causes(quick: bool) -> Iterator[str | Table]:
    """Diagnose ever longer records with a hidden saturation."""
    limits = {6_000: 5.0, 60_000: None, 180_000: 60.0}
    few = {"effects": ["strain_saturation", "quadratic_strain"]} if quick else {}
    yield _table({600: None, 1_200: None} if quick else limits, few)


def laws(quick: bool) -> Iterator[str | Table]:
    """Search the laws for the same saturation, without the catalogue."""
    limits = dict.fromkeys((300, 600) if quick else (3_000, 6_000, 12_000))
    yield _table(limits, {"effects": [], "laws": True})


def _table(limits: dict[int, float | None], options: dict[str, Any]) -> Table:
    rows: list[list[Cell]] = []
    with tempfile.TemporaryDirectory(prefix="benchmark_") as folder:
        for count, limit in limits.items():
            path = Path(folder, f"{count}.csv")
            write(draw("strain_saturation", 3, duration=count / _RATE, rate=_RATE), path)
            (seconds, found), peak = in_a_process(_diagnose, path, options)
            figures = [seconds, verdict(seconds, limit), 1e6 * seconds / count, peak]
            rows.append([count, *figures, found])
    return Table(["samples", "s", "target", "µs for a sample", "peak, GB", "verdict"], rows)


def _diagnose(path: Path, options: dict[str, Any]) -> tuple[float, str]:
    """Seconds of a diagnosis, and its verdict with its causes; the first of two compiles."""
    for _ in range(2):
        begin = time.perf_counter()
        found = ppy.diagnose(path, **options)
        seconds = time.perf_counter() - begin
    return seconds, " ".join([str(found.verdict), *found.causes])
