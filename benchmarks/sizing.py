"""Size of the sweep that a cluster can run, computed from measurements on one machine."""

from __future__ import annotations

import pickle
import tempfile
import time
from pathlib import Path

import numpy as np

import orchestration as ppy
from orchestration.sweeps.chunking import LARGEST, SECONDS
from orchestration.sweeps.compiled import choose_equations
from orchestration.sweeps.storage.journal import SweepJournal
from orchestration.sweeps.task import CaseRunner, Task

from . import machine
from .tables import Cell, Table, Topic

PAGE = Path(__file__).resolve().parent.parent / "docs" / "sweep-sizing.md"
CASES = 1_000_000
NODES = 100
CORES = 32
# s for a part, as Dask's documentation has it: about a millisecond a task, whoever does it
SCHEDULER = 1e-3
NETWORK = 125e6  # bytes/s, of one gigabit a second


def measure(cases: int = 2000, points: int = 1001) -> Topic:
    """Measure a case on a worker and on the machine that asks for it; compute the rest."""
    clock = 0.01 * np.arange(points)
    model = ppy.find_model("ppy_actuator")
    rows: list[list[Cell]] = []
    told = []
    sizes = []
    for engine in ("compiled", "fmu"):
        task = Task(
            model.path,
            ("C",),
            {},
            clock,
            {"current": np.sin(clock)},
            ("displacement",),
            ("last", "smallest", "largest"),
            choose_equations(model, engine),
        )
        case, head, size, part = _measured(task, np.linspace(5.0, 10.0, cases)[:, np.newaxis])
        parts = sized(case, head, size, part)
        rows += [[f"{engine}: {what}", each, whole] for what, (each, whole) in parts.items()]
        sizes.append(f"{engine} {part}")
        slowest = max(parts, key=lambda what: parts[what][1])
        told.append(f"{engine}: {parts[slowest][1]:.3g} s, and the bottleneck is {slowest}")
    return Topic(
        f"A sweep of {CASES:,} cases on {NODES} nodes",
        [
            (
                f"Sized on paper, for {NODES} nodes of {CORES} cores such as those of the machine"
                f" below, and a case of {points - 1:,} steps of `ppy_actuator` of which three"
                " numbers are kept. Measured: a case on a worker; and what one costs the machine"
                " that asks for it, to read the answer and to write it to disk. Not measured:"
                f" {1e3 * SCHEDULER:g} ms of Dask's scheduler for a part, as its documentation has"
                f" it, and a network of one gigabit a second. Cases of a part: {', '.join(sizes)}."
            ),
            str(machine.describe()),
            Table(["engine and share", "a case, µs", f"{CASES:,} cases, s"], rows),
            (
                "The shares overlap, so that the largest is what the sweep takes:"
                f" {'; '.join(told)}. More nodes do not help where that is not the workers: larger"
                " parts, or reductions that keep less, do. With longer cases the workers come to"
                " be it, from the length on at which a case takes as long on all cores as its"
                " largest other share."
            ),
        ],
    )


def sized(case: float, head: float, size: float, part: int) -> dict[str, tuple[float, float]]:
    """Work out what a sweep takes.

    Parameters
    ----------
    case, head : float
        Seconds of a core of a worker, and of the machine that asks, for a case.
    size : float
        Bytes of its answer.
    part : int
        Cases that a worker is told at once.

    Returns
    -------
    dict of str to tuple of float
        Microseconds for a case and seconds for all of them, by who spends them.
    """
    shares = {
        "the workers": case / (NODES * CORES),
        "the machine that asks": head,
        "the scheduler": SCHEDULER / part,
        "the network": size / NETWORK,
    }
    return {who: (1e6 * share, CASES * share) for who, share in shares.items()}


def _measured(task: Task, cases: np.ndarray) -> tuple[float, float, float, int]:
    """Measure seconds for a case on both machines, bytes of its answer, and cases of a part."""
    with CaseRunner(task) as repeated:
        part = CASES // (2 * NODES * CORES)
        case = repeated.run(cases[:part]).seconds / len(cases[:part])
        part = max(1, min(LARGEST, part, int(SECONDS / case)))
        found = [repeated.run(cases[at : at + part]) for at in range(0, len(cases), part)]
    answers = [pickle.dumps(one) for one in found]
    case = sum(one.seconds for one in found) / len(cases)
    with tempfile.TemporaryDirectory() as folder:
        journal = SweepJournal(Path(folder), task, cases, "")
        begin = time.process_time()
        for row, answer in zip(range(0, len(cases), part), answers, strict=True):
            journal.write(range(row, min(row + part, len(cases))), pickle.loads(answer))
        head = (time.process_time() - begin) / len(cases)
        del journal
    return case, head, sum(map(len, answers)) / len(cases), part


if __name__ == "__main__":
    text = str(measure()).replace("## ", "# ", 1)
    PAGE.write_text(f"{text}\n\nWritten by `python -m benchmarks.sizing`.\n", encoding="utf-8")
    print(text)
