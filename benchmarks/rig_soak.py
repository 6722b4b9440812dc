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
from collections.abc import Mapping, Sequence
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

from . import machine
from .tables import Table, Topic

PAGE = Path(__file__).resolve().parent.parent / "docs" / "rig-soak.md"
RATE = 100.0  # Hz
# s: a machine that does other work may pause a process for longer than the usual 0.2 s
_WATCHDOG = 2.0
# s after which memory is looked at; allocators and caches have what they need by then
_SETTLED = 60.0
_EVERY = 5.0  # s between two looks
# MB that a process may have grown by at the end, of which pages of the system are a part
_ALLOWED = 1.0


def _settled(seconds: float) -> float:
    """Seconds after which memory is compared."""
    return min(_SETTLED, 0.3 * seconds)


@dataclass
class _Watched:
    """A process, and what was seen of it once settled: MB of memory, and open descriptors."""

    process: psutil.Process
    memory: list[float] = field(default_factory=list)
    descriptors: list[int] = field(default_factory=list)

    def cells(self, name: str) -> list[str]:
        """Return a row of the table."""
        memory = [f"{self.memory[0]:.1f}", f"{self.memory[-1]:.1f}", f"{self.growth:+.2f}"]
        return [name, *memory, f"{max(self.descriptors)}", f"{self.left_open:+d}"]

    def look(self) -> None:
        self.memory.append(self.process.memory_info().rss / 1e6)
        self.descriptors.append(self.process.num_fds())

    @property
    def growth(self) -> float:
        """Of memory, MB."""
        return self.memory[-1] - self.memory[0]

    @property
    def left_open(self) -> int:
        """Growth of descriptors; peers come and go, so the fewest of each half count."""
        half = (len(self.descriptors) + 1) // 2
        return min(self.descriptors[-half:]) - min(self.descriptors[:half])

    @property
    def is_flat(self) -> bool:
        return self.growth <= _ALLOWED and self.left_open <= 0


def _run(proxies: Sequence[Fmu], watched: Mapping[str, _Watched], seconds: float) -> None:
    """Step both proxies at the rate, and look at every process once settled."""
    setters = [fmu.writer(["current", "force"]) for fmu in proxies]
    for fmu in proxies:
        fmu.start()
    begin = looked = monotonic()
    settled = _settled(seconds)
    steps = round(seconds * RATE)
    for k in range(steps):
        values = np.array([0.5 * np.sin(0.01 * k), 1.0])
        for fmu, write in zip(proxies, setters, strict=True):
            write(values)
            fmu.step(k / RATE, 1.0 / RATE)
        now = monotonic()
        if now - looked < _EVERY and k + 1 < steps:
            continue
        looked = now
        if now - begin >= settled:
            for each in watched.values():
                each.look()
            progress = f"{(k + 1) / RATE:.0f} s of {seconds:.0f} s, in {now - begin:.0f} s"
            print(progress, end="\r", flush=True, file=sys.stderr)


def _attacked(opened: ExitStack, seconds: float) -> Server:
    """Start a server, and a hostile peer beside."""
    folder = Path(opened.enter_context(tempfile.TemporaryDirectory(prefix="ppy-soak-")))
    server = opened.enter_context(
        Server(folder, "emulator", "--rate", RATE, "--watchdog", _WATCHDOG)
    )
    hostile = [sys.executable, "-m", "tests.support.rig.hostile", server.wait_ready()]
    peer = opened.enter_context(subprocess.Popen([*hostile, str(seconds)], cwd=ROOT))
    opened.callback(peer.kill)
    return server


def measure(seconds: float) -> tuple[Topic, bool]:
    """Run for a while.

    Parameters
    ----------
    seconds : float

    Returns
    -------
    topic : Topic
    flat : bool
        Whether no process has grown by more than what is allowed.
    """
    proxies: dict[str, Fmu] = {}
    watched = {"the master with both proxies": _Watched(psutil.Process())}
    with ExitStack() as opened:
        for runtime in RUNTIMES:
            server = _attacked(opened, seconds)
            proxies[runtime] = _proxy_at(opened, server, runtime)
            watched |= _processes_of(server, runtime)
        _run(list(proxies.values()), watched, seconds)
        missed = {runtime: _missed(fmu) for runtime, fmu in proxies.items()}
    flat = all(each.is_flat for each in watched.values())
    return _describe(watched, missed, seconds), flat


def _proxy_at(opened: ExitStack, server: Server, runtime: str) -> Fmu:
    """Open a proxy of the server's rig."""
    endpoint = {"endpoint": server.endpoint}
    fmu = Fmu(build_cached(component("rig_proxy"), runtime), endpoint, runtime)
    return opened.enter_context(fmu)


def _processes_of(server: Server, runtime: str) -> dict[str, _Watched]:
    """Return the processes of a server by their names in the table."""
    return {
        f"server of the {runtime} proxy, process {number}": _Watched(psutil.Process(process))
        for number, process in enumerate(sorted(server.family()), 1)
    }


def _describe(
    watched: Mapping[str, _Watched], missed: Mapping[str, float], seconds: float
) -> Topic:
    """Return the text and the table of what was seen, with deadlines missed by runtime."""
    steps = round(seconds * RATE)
    told = ", ".join(
        f"{count:.0f} of {steps} by the {runtime} one" for runtime, count in missed.items()
    )
    columns = ["process", f"MB after {_settled(seconds):.0f} s", f"MB after {seconds:.0f} s"]
    columns += ["growth, MB", "descriptors at most", "growth of the fewest descriptors"]
    text = (
        f"{seconds:.0f} s at {RATE:g} Hz, beside a hostile peer at each server: malformed frames,"
        " connections under ever new names, HTTP, greetings that are not finished, floods."
        f" Deadlines missed: {told}. Allowed growth: {_ALLOWED:g} MB, and no descriptor."
    )
    table = Table(columns, [each.cells(name) for name, each in watched.items()])
    return Topic("Memory and descriptors of a long session", [text, table])


def _missed(fmu: Fmu) -> float:
    row = np.empty(1)
    fmu.reader(["missed_deadlines"])(row)
    return float(row[0])


def main() -> int:
    """Run the command line; the exit status tells whether memory stayed flat."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.rig_soak", description=__doc__)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument(
        "--out", type=Path, help="page to write; default docs/rig-soak.md after ten minutes"
    )
    chosen = parser.parse_args()
    topic, flat = measure(chosen.seconds)
    page = chosen.out or (PAGE if chosen.seconds >= 600.0 else None)
    text = f"# Soak\n\nWritten by `make soak`.\n\n{machine.describe()}\n\n{topic}\n"
    print(text)
    if page is not None:
        page.write_text(text, encoding="utf-8")
    return 0 if flat else 1


if __name__ == "__main__":
    sys.exit(main())
