"""Compatibility of our FMUs: every tool is run on every component, and a page and badges show it.

``python -m tests.support.compatibility --out FOLDER`` writes ``tools.jsonl``, a line for each run
with the digest of the FMU, and ``badges/TOOL-fmiN.svg``; ``--page FILE`` draws the page.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from functools import partial
from hashlib import sha256
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from fmpy import read_model_description
from fmpy.validation import validate_fmu

from fmus import COMPONENTS, component
from fmus.kit.build import RUNTIMES, build, build_cached
from fmus.kit.storage import scratch
from tests.support import fmusim, hosts, omsimulator, pyfmi_host
from tests.support.compatibility_page import FAILED, NOT_RUN, PASSED, badges, page
from tests.support.exchange import BY_FMPY, both_ways, distance
from tests.support.machines import MACHINES, Machine
from tests.support.stimuli import STIMULI

POINTS = 50
SAME = 1e-9  # of an output's size: one FMU, stepped alike
PORTED = 1e-8  # by another C library, whose functions round otherwise in the last bit
ROUNDED = 1e-7  # by a master that counts time in nanoseconds, over steps of some milliseconds
SOLVED = 1e-5  # a solver of its own


class Tool(NamedTuple):
    """A tool, and one of the ways in which it runs FMUs.

    Attributes
    ----------
    name : str
    version : callable
    fmi : {2, 3}
        Version of FMI.
    interface : str
    runs : callable
        Runs a component, and returns how far its results are off, relative to their size.
    allowed : float
        Largest deviation.
    build : str
        Build of the component, and its platform where that is another.
    lacks : callable
        Returns the reason why it does not run here; empty if it does.
    """

    name: str
    version: Callable[[], str]
    fmi: int
    interface: str
    runs: Callable[[str], float]
    allowed: float
    build: str = "native"
    lacks: Callable[[], str] = str


def _signals(name: str) -> tuple[np.ndarray, dict[str, float], list[str]]:
    """Communication points, constant inputs and real outputs of a component."""
    stop, step, stimuli = STIMULI[name]
    path = build_cached(component(name), "native")
    outputs = [
        v.name
        for v in read_model_description(str(path)).modelVariables
        if v.causality == "output" and v.type == "Real"
    ]
    time = step * np.arange(min(POINTS, int(stop / step)))
    return time, {key: mean + size for key, (mean, size, _) in stimuli.items()}, outputs


def _largest(found: Any, expected: Any, outputs: Sequence[str]) -> float:
    """The largest deviation of all outputs, after the first point, which masters read apart."""
    return max(distance(found[key][1:], expected[key][1:]) for key in outputs)


def stepped_by(
    run: Callable[..., Any], build: str = "native", fmi: int = 2
) -> Callable[[str], float]:
    """Co-simulation by a master, beside the calls of FMI 2.0 through fmpy's bare functions."""

    def deviation(name: str) -> float:
        time, inputs, outputs = _signals(name)
        found = run(build_cached(component(name), build, fmi), time, inputs, outputs)
        native = build_cached(component(name), "native")
        expected = hosts.run_fmpy(native, time, inputs, outputs, feedthrough=False)
        return _largest(found, expected, outputs)

    return deviation


def emulated(machine: Machine, fmi: int) -> Callable[[str], float]:
    """Co-simulation of the binary for another platform, by a program in C, beside that of this."""

    def deviation(name: str) -> float:
        time, inputs, outputs = _signals(name)
        with scratch.folder("compatibility") as folder:
            path = folder / f"{name}.fmu"
            path.write_bytes(build(component(name), "native", (machine.name,), fmi=fmi))
            found = hosts.run_c_host(path, time, inputs, outputs, machine=machine)
        native = build_cached(component(name), "native")
        return _largest(found, hosts.run_fmpy(native, time, inputs, outputs), outputs)

    return deviation


def by_fmpy(path: str, **options: Any) -> Any:
    """Simulate what fmpy finds no fault with."""
    problems = validate_fmu(path)
    if problems:
        raise ValueError(problems[0])
    return BY_FMPY(path, **options)


def fed_constants(
    simulate: Callable[..., Any],
    fmi: int,
    interface: str = "CoSimulation",
    build: str = "native",
    **how: Any,
) -> Callable[[str], float]:
    """Constant inputs by a tool, beside co-simulation by fmpy's bare functions and FMI 2.0."""

    def deviation(name: str) -> float:
        time, inputs, outputs = _signals(name)
        path = build_cached(component(name), build, fmi)
        found = simulate(
            str(path),
            stop_time=time[-1],
            output_interval=time[1],
            start_values=inputs,
            output=outputs,
            fmi_type=interface,
            **how,
        )
        native = build_cached(component(name), "native")
        return _largest(found, hosts.run_fmpy(native, time, inputs, outputs), outputs)

    return deviation


def solved(simulate: Callable[..., Any], fmi: int) -> Callable[[str], float]:
    """Model exchange by a tool's CVode, beside co-simulation."""

    def deviation(name: str) -> float:
        fmu, native = (build_cached(component(name), "native", n) for n in (fmi, 2))
        how = {"simulate": simulate, "solver": "CVode", "relative_tolerance": 1e-9}
        found = both_ways(fmu, native, *STIMULI[name], **how)
        return max(distance(*pair) for pair in found.values())

    return deviation


def _all(
    name: str, version: Callable[[], str], simulate: Callable[..., Any], **more: Any
) -> list[Tool]:
    """Both interfaces of both versions of FMI."""
    interfaces = [("co-simulation", fed_constants, SAME), ("model exchange", solved, SOLVED)]
    return [
        Tool(name, version, fmi, interface, runs(simulate, fmi), allowed, **more)
        for fmi in (2, 3)
        for interface, runs, allowed in interfaces
    ]


def _masters() -> list[Tool]:
    """Masters of co-simulation that have packages."""
    libcosim = partial(metadata.version, "libcosimpy")
    ecos = partial(metadata.version, "ecospy")
    native = stepped_by(hosts.run_libcosim), stepped_by(hosts.run_ecos)
    python = stepped_by(hosts.run_libcosim, "python"), stepped_by(hosts.run_ecos, "python")
    of_3 = [(build, stepped_by(hosts.run_ecos, build, 3)) for build in RUNTIMES]
    crash = "any FMU of FMI 3.0 ends its process with a segmentation fault"
    return [
        Tool("libcosim", libcosim, 2, "co-simulation", native[0], ROUNDED),
        Tool("libcosim", libcosim, 2, "co-simulation", python[0], ROUNDED, "python"),
        Tool("libcosim", libcosim, 3, "co-simulation", _cannot, ROUNDED, lacks=lambda: crash),
        Tool("Ecos", ecos, 2, "co-simulation", native[1], SAME),
        Tool("Ecos", ecos, 2, "co-simulation", python[1], SAME, "python"),
        *(Tool("Ecos", ecos, 3, "co-simulation", run, SAME, build) for build, run in of_3),
    ]


def _on_other_platforms() -> list[Tool]:
    """A program in C, on platforms that are emulated here."""
    return [
        Tool(
            f"C under {machine.runners[0]}",
            lambda: "",
            fmi,
            "co-simulation",
            emulated(machine, fmi),
            PORTED,
            f"native, {machine.name}",
            machine.lacks,
        )
        for machine in MACHINES.values()
        if machine.runners
        for fmi in (2, 3)
    ]


def _by_fmusim() -> list[Tool]:
    """fmusim, with and without event mode; the Python build in FMI 3.0."""

    def lacks() -> str:
        return "" if fmusim.BINARY else fmusim.MISSING

    def stepped(interface: str, build: str, simulate: Callable[..., Any]) -> Tool:
        run = fed_constants(simulate, 3, build=build)
        return Tool("fmusim", fmusim.version, 3, interface, run, SAME, build, lacks)

    with_events = partial(fmusim.simulate_fmu, flags=fmusim.EVENT_MODE)
    return [
        *_all("fmusim", fmusim.version, fmusim.simulate_fmu, lacks=lacks),
        stepped("event mode", "native", with_events),
        stepped("co-simulation", "python", fmusim.simulate_fmu),
        stepped("event mode", "python", with_events),
    ]


def _cannot(name: str) -> float:
    """Fail: for a way in which a tool runs nothing."""
    raise NotImplementedError(name)


def _by_pyfmi() -> list[Tool]:
    """PyFMI, by the interfaces that it imports."""

    def lacks() -> str:
        return "" if pyfmi_host.INTERPRETER else pyfmi_host.MISSING

    ways = _all("PyFMI", pyfmi_host.version, pyfmi_host.simulate_fmu, lacks=lacks)
    unknown = "PyFMI imports no co-simulation of FMI 3.0"
    return [
        way._replace(runs=_cannot, lacks=lambda: unknown)
        if (way.fmi, way.interface) == (3, "co-simulation")
        else way
        for way in ways
    ]


def _by_omsimulator() -> list[Tool]:
    """OMSimulator, which has no events where an input jumps, and so is fed constants."""

    def lacks() -> str:
        return "" if omsimulator.LIBRARY else omsimulator.MISSING

    simulate = omsimulator.simulate_fmu
    exchanged = fed_constants(simulate, 2, "ModelExchange", relative_tolerance=1e-9)
    ways = [
        (2, "co-simulation", fed_constants(simulate, 2), SAME),
        (2, "model exchange", exchanged, SOLVED),
        (3, "co-simulation", fed_constants(simulate, 3), SAME),
    ]
    unknown = "this version imports no model exchange of FMI 3.0"
    return [
        *(Tool("OMSimulator", omsimulator.version, *way, lacks=lacks) for way in ways),
        Tool("OMSimulator", str, 3, "model exchange", _cannot, SOLVED, lacks=lambda: unknown),
    ]


_FMPY = partial(metadata.version, "fmpy")
TOOLS = [
    *_all("fmpy", _FMPY, by_fmpy),
    Tool("fmpy", _FMPY, 2, "co-simulation", stepped_by(hosts.run_fmpy, "python"), SAME, "python"),
    Tool(
        "fmpy", _FMPY, 3, "co-simulation", fed_constants(by_fmpy, 3, build="python"), SAME, "python"
    ),
    *_masters(),
    *_on_other_platforms(),
    *_by_fmusim(),
    *_by_pyfmi(),
    *_by_omsimulator(),
]


def log(names: Sequence[str] = COMPONENTS, tools: Sequence[Tool] = TOOLS) -> list[dict[str, Any]]:
    """Run every tool on every component; an error is an outcome."""
    return [_entry(tool, name) for tool in tools for name in names]


def _entry(tool: Tool, name: str) -> dict[str, Any]:
    """Run a tool on a component."""
    lacking = tool.lacks()
    entry = {
        "tool": tool.name,
        "version": "" if lacking else tool.version(),
        "fmi": f"{tool.fmi}.0",
        "interface": tool.interface,
        "build": tool.build,
        "component": name,
        "allowed": tool.allowed,
    }
    if lacking:
        return entry | {"outcome": NOT_RUN, "reason": lacking}
    runtime = tool.build.partition(",")[0]
    fmu = build_cached(component(name), runtime, tool.fmi)
    entry["sha256"] = sha256(fmu.read_bytes()).hexdigest()
    try:
        deviation = float(tool.runs(name))
    except Exception as error:  # whatever a tool raises
        lines = str(error).splitlines() or [""]
        return entry | {"outcome": FAILED, "reason": f"{type(error).__name__}: {lines[0]}"}
    outcome = PASSED if deviation <= tool.allowed else FAILED
    return entry | {"outcome": outcome, "deviation": deviation}


def main() -> int:
    """Run all tools, write the log and the badges, and return 1 if a run failed, else 0."""
    parser = argparse.ArgumentParser(description="Run our FMUs in every tool that is here.")
    parser.add_argument("--out", type=Path, default=Path("dist/release"))
    parser.add_argument("--page", type=Path, help="page to write, such as docs/compatibility.md")
    chosen = parser.parse_args()
    entries = log()
    folder = chosen.out / "badges"
    folder.mkdir(parents=True, exist_ok=True)
    lines = "".join(json.dumps(entry) + "\n" for entry in entries)
    (chosen.out / "tools.jsonl").write_text(lines, encoding="utf-8")
    for file, text in badges(entries).items():
        (folder / file).write_text(text, encoding="utf-8")
    if chosen.page is not None:
        chosen.page.write_text(page(entries), encoding="utf-8")
    return int(any(entry["outcome"] == FAILED for entry in entries))


if __name__ == "__main__":
    sys.exit(main())
