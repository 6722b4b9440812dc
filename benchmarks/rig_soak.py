"""Memory and descriptors of a long session at 100 Hz, which must stay flat.

``python -m benchmarks.rig_soak``: the native and the Python proxy, each at a served rig of its own,
step in this process in turns, while a hostile peer of its own does to each server what it can.
Looked at are this process and all processes of both servers, while they work.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic

import numpy as np
import psutil

from fmus import component
from fmus.kit.build.building import RUNTIMES, build_cached
from orchestration.fmu.instance import Fmu
from tests.support.rig.process import ROOT, Server

from .tables import DOCS, Cell, Table, Topic, publish

PAGE = DOCS / "rig-soak.md"
RATE = 100.0  # Hz
# s: a machine that does other work may pause a process for longer than the usual 0.2 s
_WATCHDOG = 2.0
_EVERY = 5.0  # s between two samples
# MB that a process may have grown by at the end, of which pages of the system are a part
_ALLOWED = 1.0


def _warm_up(seconds: float) -> float:
    """Seconds after which memory is sampled: allocators and caches have what they need by then."""
    return min(60.0, 0.3 * seconds)


@dataclass
class _Usage:
    """Memory of a process, MB, and its open descriptors, sampled after the warm-up."""

    process: psutil.Process
    memory: list[float] = field(default_factory=list)
    descriptors: list[int] = field(default_factory=list)

    def sample(self) -> None:
        self.memory.append(self.process.memory_info().rss / 1e6)
        self.descriptors.append(self.process.num_fds())

    @property
    def growth(self) -> float:
        """Growth of memory, MB."""
        return self.memory[-1] - self.memory[0]

    @property
    def leaked(self) -> int:
        """Growth of descriptors; peers come and go, so the fewest of each half count."""
        half = (len(self.descriptors) + 1) // 2
        return min(self.descriptors[-half:]) - min(self.descriptors[:half])

    @property
    def cells(self) -> list[Cell]:
        """The figures in a row of the table."""
        memory = [f"{self.memory[0]:.1f}", f"{self.memory[-1]:.1f}", f"{self.growth:+.2f}"]
        return [*memory, max(self.descriptors), f"{self.leaked:+d}"]


def _run(proxies: Sequence[Fmu], usages: Iterable[_Usage], seconds: float) -> None:
    """Step both proxies at the rate, and sample every process after the warm-up."""
    setters = [fmu.writer(["current", "force"]) for fmu in proxies]
    for fmu in proxies:
        fmu.start()
    begin = sampled = monotonic()
    steps = round(seconds * RATE)
    for k in range(steps):
        values = np.array([0.5 * np.sin(0.01 * k), 1.0])
        for fmu, write in zip(proxies, setters, strict=True):
            write(values)
            fmu.step(k / RATE, 1.0 / RATE)
        now = monotonic()
        if now - sampled < _EVERY and k + 1 < steps:
            continue
        sampled = now
        if now - begin >= _warm_up(seconds):
            for usage in usages:
                usage.sample()
            progress = f"{(k + 1) / RATE:.0f} s of {seconds:.0f} s, in {now - begin:.0f} s"
            print(progress, end="\r", flush=True, file=sys.stderr)


def _attacked(opened: ExitStack, seconds: float) -> Server:
    """Start a server, and a hostile peer of it."""
    folder = Path(opened.enter_context(tempfile.TemporaryDirectory(prefix="ppy-soak-")))
    server = opened.enter_context(
        Server(folder, "emulator", "--rate", RATE, "--watchdog", _WATCHDOG)
    )
    hostile = [sys.executable, "-m", "tests.support.rig.hostile", server.wait_ready()]
    peer = opened.enter_context(subprocess.Popen([*hostile, str(seconds)], cwd=ROOT))
    opened.callback(peer.kill)
    return server


def measure(seconds: float) -> tuple[Topic, bool]:
    """Run for some seconds.

    Returns
    -------
    topic : Topic
    flat : bool
        Whether no process has grown by more than is allowed.
    """
    proxies: dict[str, Fmu] = {}
    usages = {"the master with both proxies": _Usage(psutil.Process())}
    with ExitStack() as opened:
        for runtime in RUNTIMES:
            server = _attacked(opened, seconds)
            endpoint = {"endpoint": server.endpoint}
            fmu = Fmu(build_cached(component("rig_proxy"), runtime), endpoint, runtime)
            proxies[runtime] = opened.enter_context(fmu)
            for number, process in enumerate(sorted(server.family()), 1):
                name = f"server of the {runtime} proxy, process {number}"
                usages[name] = _Usage(psutil.Process(process))
        _run(list(proxies.values()), usages.values(), seconds)
        missed = ", ".join(f"{_missed(fmu):.0f} by the {name} one" for name, fmu in proxies.items())
    text = (
        f"{seconds:.0f} s at {RATE:g} Hz, with a hostile peer of each server: malformed frames,"
        " connections under ever new names, HTTP, greetings that are not finished, floods."
        f" Deadlines missed, of {round(seconds * RATE)}: {missed}. Allowed growth: {_ALLOWED:g} MB,"
        " and no descriptor."
    )
    columns = ["process", f"MB after {_warm_up(seconds):.0f} s", f"MB after {seconds:.0f} s"]
    columns += ["growth, MB", "descriptors at most", "growth of the fewest descriptors"]
    table = Table(columns, [[name, *usage.cells] for name, usage in usages.items()])
    flat = all(usage.growth <= _ALLOWED and usage.leaked <= 0 for usage in usages.values())
    return Topic("Memory and descriptors of a long session", [text, table]), flat


def _missed(fmu: Fmu) -> float:
    row = np.empty(1)
    fmu.reader(["missed_deadlines"])(row)
    return float(row[0])


def main() -> int:
    """Run the command line; the exit status is 1 if memory grew."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.rig_soak", description=__doc__)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument(
        "--out", type=Path, help="page to write; default docs/rig-soak.md after ten minutes"
    )
    chosen = parser.parse_args()
    topic, flat = measure(chosen.seconds)
    page = chosen.out or (PAGE if chosen.seconds >= 600.0 else None)
    publish("# Soak\n\nWritten by `make soak`.", [topic], page)
    return 0 if flat else 1


if __name__ == "__main__":
    sys.exit(main())
