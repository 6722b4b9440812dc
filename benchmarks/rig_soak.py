"""Memory of a long session at 100 Hz, which must stay flat: ``python -m benchmarks.rig_soak``.

The native and the Python proxy, each at a served rig of its own, step in this process in turns;
memory is that of this process and of all processes of both servers, read while they work.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from time import monotonic

import numpy as np

from fmus import component
from fmus.kit.build.building import RUNTIMES, build_cached
from orchestration.fmu.instance import Fmu
from tests.support.rig.process import Server

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


def _run(
    proxies: Sequence[Fmu], processes: Mapping[str, Path], seconds: float
) -> dict[str, list[float]]:
    """Step both proxies at the rate; memory of every process in MB, once settled."""
    seen: dict[str, list[float]] = {name: [] for name in processes}
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
            for name, path in processes.items():
                seen[name].append(int(path.read_text().split()[1]) * 4096 / 1e6)
            progress = f"{now - begin:.0f} s of {seconds:.0f} s"
            print(progress, end="\r", flush=True, file=sys.stderr)
    return seen


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
    steps = round(seconds * RATE)
    proxies: dict[str, Fmu] = {}
    processes = {"the master with both proxies": Path("/proc/self/statm")}
    with ExitStack() as opened:
        for runtime in RUNTIMES:
            folder = Path(opened.enter_context(tempfile.TemporaryDirectory(prefix="ppy-soak-")))
            server = opened.enter_context(
                Server(folder, "emulator", "--rate", RATE, "--watchdog", _WATCHDOG)
            )
            endpoint = {"endpoint": server.wait_ready()}
            fmu = Fmu(build_cached(component("rig_proxy"), runtime), endpoint, runtime)
            proxies[runtime] = opened.enter_context(fmu)
            for number, process in enumerate(sorted(server.family())):
                name = f"server of the {runtime} proxy, process {number + 1}"
                processes[name] = Path(f"/proc/{process}/statm")
        seen = _run(list(proxies.values()), processes, seconds)
        missed = {runtime: _missed(fmu) for runtime, fmu in proxies.items()}
    growth = {name: memory[-1] - memory[0] for name, memory in seen.items()}
    rows = [
        [name, f"{memory[0]:.1f}", f"{memory[-1]:.1f}", f"{growth[name]:+.2f}"]
        for name, memory in seen.items()
    ]
    told = ", ".join(
        f"{count:.0f} of {steps} by the {runtime} one" for runtime, count in missed.items()
    )
    table = Table(
        [
            "process",
            f"MB after {_settled(seconds):.0f} s",
            f"MB after {seconds:.0f} s",
            "growth, MB",
        ],
        rows,
    )
    text = [
        f"{seconds:.0f} s at {RATE:g} Hz. Deadlines missed: {told}. Allowed growth:"
        f" {_ALLOWED:g} MB."
    ]
    return Topic("Memory of a long session", [*text, table]), all(
        grown <= _ALLOWED for grown in growth.values()
    )


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
