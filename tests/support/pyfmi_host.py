"""PyFMI, called as ``fmpy.simulate_fmu`` is.

It has no package with binaries: ``PPY_PYFMI`` names the Python interpreter of an environment that
has it. There this module is run as a program.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

INTERPRETER = os.environ.get("PPY_PYFMI", "")
MISSING = "PPY_PYFMI names no Python interpreter with PyFMI"
_KINDS = {"CoSimulation": "CS", "ModelExchange": "ME"}


def version() -> str:
    """Version of PyFMI."""
    return run("-c", "import pyfmi; print(pyfmi.__version__)").strip()


def simulate_fmu(
    filename: str,
    *,
    fmi_type: str,
    stop_time: float,
    output_interval: float,
    output: Sequence[str],
    input: np.ndarray | None = None,
    start_values: Mapping[str, float] | None = None,
    solver: str = "CVode",
    relative_tolerance: float = 1e-4,
) -> np.ndarray:
    """Outputs at the regular points, of each the last row: after events.

    Raises
    ------
    RuntimeError
        Where it fails, with its last line.
    """
    names = [] if input is None else [name for name in input.dtype.names or () if name != "time"]
    table = [] if input is None else [input[name].tolist() for name in ("time", *names)]
    points = round(stop_time / output_interval)
    call = {
        "filename": filename,
        "kind": _KINDS[fmi_type],
        "stop_time": stop_time,
        "points": points,
        "output": list(output),
        "names": names,
        "table": table,
        "start_values": dict(start_values or {}),
        "solver": solver,
        "relative_tolerance": relative_tolerance,
    }
    answer = json.loads(run(__file__, text=json.dumps(call)).splitlines()[-1])
    regular = output_interval * np.arange(points + 1)
    kept = np.searchsorted(answer["time"], regular + 1e-9, side="right") - 1
    rows = np.zeros(regular.size, [("time", float), *((name, float) for name in output)])
    for name in ("time", *output):
        rows[name] = np.asarray(answer[name])[kept]
    return rows


def run(*arguments: str, text: str = "") -> str:
    """Return the output of the interpreter that has PyFMI, given arguments and standard input."""
    with tempfile.TemporaryDirectory() as folder:  # for the files that it leaves
        done = subprocess.run(
            [INTERPRETER, *arguments],
            input=text,
            capture_output=True,
            text=True,
            timeout=300,
            cwd=folder,
            env={key: value for key, value in os.environ.items() if key != "PYTHONPATH"},
        )
    if done.returncode:
        raise RuntimeError((done.stderr.strip().splitlines() or ["no message"])[-1])
    return done.stdout


def _simulate(call: dict[str, Any]) -> dict[str, list[float]]:
    """Simulate, in the interpreter that has PyFMI."""
    import pyfmi  # type: ignore[import-not-found]

    model = pyfmi.load_fmu(call["filename"], kind=call["kind"], log_level=2)
    for name, value in call["start_values"].items():
        model.set(name, value)
    options = model.simulate_options()
    options["ncp"] = call["points"]
    options["result_handling"] = "binary"
    if call["kind"] == "ME":
        options["solver"] = call["solver"]
        options[f"{call['solver']}_options"]["rtol"] = call["relative_tolerance"]
    table = np.array(call["table"]).T
    inputs = {"input": (call["names"], table)} if call["names"] else {}
    result = model.simulate(final_time=call["stop_time"], options=options, **inputs)
    return {name: np.asarray(result[name]).tolist() for name in ("time", *call["output"])}


if __name__ == "__main__":
    print("\n" + json.dumps(_simulate(json.load(sys.stdin))))
