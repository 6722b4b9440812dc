"""Which tools run our FMUs: each is run on every component, and badges are drawn from the log.

``python -m tests.support.compatibility --out FOLDER`` writes ``tools.jsonl``, a line for each run
with the digest of the FMU, and ``badges/TOOL-fmiN.svg``.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
from collections.abc import Callable, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

from fmus import COMPONENTS, component
from fmus.kit.build import build_cached
from tests.support import hosts
from tests.support.exchange import both_ways, distance
from tests.support.stimuli import STIMULI

POINTS = 50
SAME = 1e-9  # of an output's size: one FMU, stepped alike
ROUNDED = 1e-7  # by a master that counts time in nanoseconds, over steps of some milliseconds
SOLVED = 1e-5  # a solver of its own
GOOD, BAD = "#2e7d32", "#b3261e"
_Runs = Callable[[str], float]


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


def co_simulated_by_fmpy(fmi: int) -> _Runs:
    """Validation and co-simulation by fmpy, beside the bare functions of the build of FMI 2.0."""

    def deviation(name: str) -> float:
        time, inputs, outputs = _signals(name)
        path = build_cached(component(name), "native", fmi)
        problems = validate_fmu(str(path))
        if problems:
            raise ValueError(problems[0])
        found = simulate_fmu(
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


def solved_by_fmpy(fmi: int) -> _Runs:
    """Model exchange by CVode of fmpy, beside co-simulation."""

    def deviation(name: str) -> float:
        fmu, native = (build_cached(component(name), "native", n) for n in (fmi, 2))
        found = both_ways(fmu, native, *STIMULI[name], solver="CVode", relative_tolerance=1e-9)
        return max(distance(*pair) for pair in found.values())

    return deviation


# tool, package, version of FMI, interface, what runs it and how far it may be off
TOOLS = [
    ("fmpy", "fmpy", 2, "co-simulation", co_simulated_by_fmpy(2), SAME),
    ("fmpy", "fmpy", 2, "model exchange", solved_by_fmpy(2), SOLVED),
    ("fmpy", "fmpy", 3, "co-simulation", co_simulated_by_fmpy(3), SAME),
    ("fmpy", "fmpy", 3, "model exchange", solved_by_fmpy(3), SOLVED),
    ("libcosim", "libcosimpy", 2, "co-simulation", stepped_by(hosts.run_libcosim), ROUNDED),
    ("Ecos", "ecospy", 2, "co-simulation", stepped_by(hosts.run_ecos), SAME),
]


def log(names: Sequence[str] = COMPONENTS, tools: Sequence[Any] = TOOLS) -> list[dict[str, Any]]:
    """Run every tool on every component; an error is an outcome."""
    entries = []
    for tool, package, fmi, interface, run, allowed in tools:
        for name in names:
            entry = {
                "tool": tool,
                "version": importlib.metadata.version(package),
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


def main() -> None:
    """Run all tools and write the log and the badges."""
    parser = argparse.ArgumentParser(description="Run our FMUs in every tool that is here.")
    parser.add_argument("--out", type=Path, default=Path("dist/release"))
    out = parser.parse_args().out
    entries = log()
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
    print(f"{sum(e['outcome'] == 'passed' for e in entries)} of {len(entries)} runs passed")


if __name__ == "__main__":
    main()
