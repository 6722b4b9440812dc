"""Archives of a small rig whose values are a known function of their number."""

from __future__ import annotations

import math

from orchestration.rig.archive import ArchiveWriter, columns_of

INPUTS, OUTPUTS = {"current": "A"}, {"voltage": "V"}
COLUMNS = columns_of(INPUTS, OUTPUTS)
AHEAD = 1.8e9  # s, of wall time over the rig's clock
ABOUT = {
    "run": "0a0a",
    "host": "here",
    "backend": "emulator",
    "rate": 100.0,
    "watchdog": 0.2,
    "inputs": INPUTS,
    "outputs": OUTPUTS,
    "limits": {},
}


def voltage(number):
    return math.sin(0.37 * number) + (3.0 if number == 777 else 0.0)


def samples(numbers, pause=0.0):
    """Rows a hundredth of a second apart; `pause` before the last."""
    rows = []
    for k in numbers:
        late = pause if k == numbers[-1] else 0.0
        measured = math.nan if k % 10 == 0 else voltage(k)
        rows.append((k, 0.01 * k + late, 0.0, 0.5, math.nan, measured, 0.001))
    return rows


def writer(folder, size=1e9, **about):
    folder.mkdir(exist_ok=True)
    return ArchiveWriter(folder, size, ABOUT | about, COLUMNS)


def filled(folder, *batches, **about):
    archive = writer(folder, **about)
    for rows in batches:
        archive.add("samples", rows, AHEAD)
    return archive
