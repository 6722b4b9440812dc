"""A bench with a load cell, whose volts stand in a file, and its server."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.support.rig.process import Server

FILE = """\
[rig]
rate = 100
watchdog = 0.5

[inputs.current]
channel = "ao0"
gain = 1
unit = "A"
range = [-1, 1]
date = 2026-05-01

[inputs.force]
channel = "ao1"
gain = 1
unit = "N"
range = [-1, 1]
date = 2026-05-01

[outputs.load]  # to be adjusted
channel = "ai0"
gain = 2.0
offset = 0.5
uncertainty = 0.25
unit = "kgf"
si = "N"
range = [-10, 10]
date = 2026-05-01

[limits.load]
warn = [-9, 9]
unit = "kgf"
"""


@contextmanager
def served(folder: Path, volts: float = 1.0) -> Iterator[str]:
    """Serve the bench by ``bench.toml`` in a folder, and yield its address."""
    file = folder / "bench.toml"
    if not file.exists():
        file.write_text(FILE)
    (folder / "volts").write_text(str(volts))
    with Server(folder, "Calibrated", options={"calibration": file}) as server:
        yield server.wait_ready()
