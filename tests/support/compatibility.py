"""Compatibility of our FMUs: every tool is run on every component, and badges show the log.

``python -m tests.support.compatibility --out FOLDER`` writes ``tools.jsonl``, a line for each run
with the digest of the FMU, and ``badges/TOOL-fmiN.svg``.
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
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
from fmpy import read_model_description
from fmpy.validation import validate_fmu

from fmus import COMPONENTS, component
from fmus.kit.build import build_cached
from tests.support import fmusim, hosts
from tests.support.exchange import BY_FMPY, both_ways, distance
from tests.support.stimuli import STIMULI

POINTS = 50
SAME = 1e-9  # of an output's size: one FMU, stepped alike
ROUNDED = 1e-7  # by a master that counts time in nanoseconds, over steps of some milliseconds
SOLVED = 1e-5  # a solver of its own
GOOD, BAD = "#2e7d32", "#b3261e"
_Runs = Callable[[str], float]
_Version = Callable[[], str]
_Tool = tuple[str, _Version, int, str, _Runs, float]


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


def stepped_by(run: Callable[..., Any]) -> _Runs:
    """Co-simulation of FMI 2.0 by a master, beside the same calls through fmpy's bare functions."""

    def deviation(name: str) -> float:
        time, inputs, outputs = _signals(name)
        path = build_cached(component(name), "native")
        found = run(path, time, inputs, outputs)
        return _largest(
            found, hosts.run_fmpy(path, time, inputs, outputs, feedthrough=False), outputs
        )

    return deviation


def by_fmpy(path: str, **options: Any) -> Any:
    """Simulate what fmpy finds no fault with."""
    problems = validate_fmu(path)
    if problems:
        raise ValueError(problems[0])
    return BY_FMPY(path, **options)


def co_simulated(simulate: Callable[..., Any], fmi: int) -> _Runs:
    """Co-simulation by a tool, beside fmpy's bare functions and the build of FMI 2.0."""

    def deviation(name: str) -> float:
        time, inputs, outputs = _signals(name)
        path = build_cached(component(name), "native", fmi)
        found = simulate(
            str(path),
            stop_time=time[-1],
            output_interval=time[1],
            start_values=inputs,
            output=outputs,
            fmi_type="CoSimulation",
        )
        native = build_cached(component(name), "native")
        return _largest(found, hosts.run_fmpy(native, time, inputs, outputs), outputs)

    return deviation


def solved(simulate: Callable[..., Any], fmi: int) -> _Runs:
    """Model exchange by a tool's CVode, beside co-simulation."""

    def deviation(name: str) -> float:
        fmu, native = (build_cached(component(name), "native", n) for n in (fmi, 2))
        how = {"simulate": simulate, "solver": "CVode", "relative_tolerance": 1e-9}
        found = both_ways(fmu, native, *STIMULI[name], **how)
        return max(distance(*pair) for pair in found.values())

    return deviation


def _all(tool: str, version: _Version, simulate: Callable[..., Any]) -> list[_Tool]:
    """Both interfaces of both versions of FMI."""
    interfaces = [("co-simulation", co_simulated, SAME), ("model exchange", solved, SOLVED)]
    return [
        (tool, version, fmi, interface, runs(simulate, fmi), allowed)
        for fmi in (2, 3)
        for interface, runs, allowed in interfaces
    ]


_with_events = partial(fmusim.simulate_fmu, flags=fmusim.EVENT_MODE)
_libcosim, _ecos = stepped_by(hosts.run_libcosim), stepped_by(hosts.run_ecos)
# tool, its version, version of FMI, interface, what runs it and how far it may be off
TOOLS = [
    *_all("fmpy", partial(metadata.version, "fmpy"), by_fmpy),
    ("libcosim", partial(metadata.version, "libcosimpy"), 2, "co-simulation", _libcosim, ROUNDED),
    ("Ecos", partial(metadata.version, "ecospy"), 2, "co-simulation", _ecos, SAME),
]
FMUSIM = [
    *_all("fmusim", fmusim.version, fmusim.simulate_fmu),
    ("fmusim", fmusim.version, 3, "event mode", co_simulated(_with_events, 3), SAME),
]


def log(names: Sequence[str] = COMPONENTS, tools: Sequence[_Tool] = TOOLS) -> list[dict[str, Any]]:
    """Run every tool on every component; an error is an outcome."""
    entries = []
    for tool, version_of, fmi, interface, run, allowed in tools:
        for name in names:
            entry = {
                "tool": tool,
                "version": version_of(),
                "fmi": f"{fmi}.0",
                "interface": interface,
                "component": name,
                "sha256": sha256(
                    build_cached(component(name), "native", fmi).read_bytes()
                ).hexdigest(),
            }
            try:
                deviation = float(run(name))
                outcome = "passed" if deviation <= allowed else "failed"
                entry |= {"outcome": outcome, "deviation": deviation}
            except Exception as error:  # whatever a tool raises
                lines = str(error).splitlines() or [""]
                entry |= {"outcome": "failed", "error": f"{type(error).__name__}: {lines[0]}"}
            entries.append(entry)
    return entries


def badges(entries: Sequence[dict[str, Any]]) -> dict[str, str]:
    """Draw a badge for each tool and version of FMI, by file name."""
    drawn = {}
    for tool, version, fmi in sorted({(e["tool"], e["version"], e["fmi"]) for e in entries}):
        of_it = [e["outcome"] for e in entries if (e["tool"], e["fmi"]) == (tool, fmi)]
        passed = of_it.count("passed")
        text = f"FMI {fmi}: {passed} of {len(of_it)}"
        colour = GOOD if passed == len(of_it) else BAD
        drawn[f"{tool.lower()}-fmi{fmi[0]}.svg"] = _svg(f"{tool} {version}", text, colour)
    return drawn


def _svg(left: str, right: str, colour: str) -> str:
    """Draw two fields beside each other."""
    a, b = (14 + 7 * len(text) for text in (left, right))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{a + b}" height="20" role="img"'
        f' aria-label="{escape(left)}: {escape(right)}">'
        f'<rect width="{a}" height="20" fill="#444"/>'
        f'<rect x="{a}" width="{b}" height="20" fill="{colour}"/>'
        '<g fill="#fff" font-family="Verdana,DejaVu Sans,sans-serif" font-size="11"'
        ' text-anchor="middle">'
        f'<text x="{a / 2}" y="14">{escape(left)}</text>'
        f'<text x="{a + b / 2}" y="14">{escape(right)}</text></g></svg>\n'
    )


def main() -> int:
    """Run all tools, write the log and the badges, and return 1 if a run failed, else 0."""
    parser = argparse.ArgumentParser(description="Run our FMUs in every tool that is here.")
    parser.add_argument("--out", type=Path, default=Path("dist/release"))
    out = parser.parse_args().out
    entries = log() + (log(tools=FMUSIM) if fmusim.BINARY else [])
    folder = out / "badges"
    folder.mkdir(parents=True, exist_ok=True)
    lines = "".join(json.dumps(entry) + "\n" for entry in entries)
    (out / "tools.jsonl").write_text(lines, encoding="utf-8")
    for file, text in badges(entries).items():
        (folder / file).write_text(text, encoding="utf-8")
    for entry in entries:
        if entry["outcome"] != "passed":
            print(*(entry.get(k, "") for k in ("tool", "fmi", "interface", "component")), end=": ")
            print(entry.get("error", entry.get("deviation")))
    passed = sum(entry["outcome"] == "passed" for entry in entries)
    print(f"{passed} of {len(entries)} runs passed")
    if not fmusim.BINARY:
        print(f"fmusim is left out: {fmusim.MISSING}")
    return int(passed < len(entries))


if __name__ == "__main__":
    sys.exit(main())
