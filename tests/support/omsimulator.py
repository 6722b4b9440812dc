"""OMSimulator, called as ``fmpy.simulate_fmu`` is.

Its package holds no binaries: ``PPY_OMSIMULATOR`` names its shared library. This module is run as a
program of its own, because the library keeps its models for all of a process.
"""

from __future__ import annotations

import ctypes
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

LIBRARY = os.environ.get("PPY_OMSIMULATOR", "")
MISSING = "PPY_OMSIMULATOR names no shared library of OMSimulator"
_WEAKLY_COUPLED, _STRONGLY_COUPLED = 1, 2  # systems of co-simulation, and of model exchange


def version() -> str:
    """Version of OMSimulator, without commit and platform."""
    words: str = _run({"version": True})
    return words.partition(" v")[2].partition("-")[0]


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
    """Outputs at the regular points; inputs are held between the times of their table.

    Raises
    ------
    RuntimeError
        Where it fails or complains, with its last line.
    """
    if solver != "CVode":
        raise RuntimeError(f"solver {solver} is not one of CVode")
    time = output_interval * np.arange(round(stop_time / output_interval) + 1)
    held = {}
    if input is not None:
        row = np.searchsorted(input["time"], time + 1e-9, side="right") - 1
        held = {
            name: input[name][row].tolist() for name in input.dtype.names or () if name != "time"
        }
    system = _WEAKLY_COUPLED if fmi_type == "CoSimulation" else _STRONGLY_COUPLED
    call = {"system": system, "prefix": "m.system.fmu", "relative_tolerance": relative_tolerance}
    found = _rows(filename, call, time, held, output, start_values or {})
    rows = np.zeros(time.size, [("time", float), *((name, float) for name in output)])
    rows["time"] = time
    for name in output:
        rows[name] = found[name]
    return rows


def run_ssp(
    path: Path, step: float, count: int, inputs: Mapping[str, float], outputs: Sequence[str]
) -> dict[str, np.ndarray]:
    """Outputs of a system's file, with constant inputs, as the hosts of other masters have it."""
    call = {"prefix": f"{path.stem}.{path.stem}"}
    return _rows(str(path), call, step * np.arange(count), {}, outputs, inputs)


def _rows(
    filename: str,
    call: dict[str, Any],
    time: np.ndarray,
    inputs: Mapping[str, list[float]],
    outputs: Sequence[str],
    start_values: Mapping[str, float],
) -> dict[str, np.ndarray]:
    """Outputs at each time."""
    call |= {
        "filename": filename,
        "time": time.tolist(),
        "inputs": inputs,
        "output": list(outputs),
        "start_values": dict(start_values),
    }
    return dict(zip(outputs, np.array(_run(call)).T, strict=True))


def _run(call: dict[str, Any]) -> Any:
    with tempfile.TemporaryDirectory() as folder:  # for the files that it leaves
        done = subprocess.run(
            [sys.executable, __file__],
            input=json.dumps(call),
            capture_output=True,
            text=True,
            timeout=300,
            cwd=folder,
        )
    lines = done.stdout.strip().splitlines()
    if done.returncode:
        raise RuntimeError((done.stderr.strip().splitlines() or lines or ["no message"])[-1])
    return json.loads(lines[-1])


class _Model:
    """A model of a system's file, or of one FMU."""

    def __init__(self, call: dict[str, Any]):
        self.library = ctypes.CDLL(LIBRARY)
        self._call = call
        self._step = call["time"][1] - call["time"][0]
        self._do("oms_setTempDirectory", os.getcwd().encode())
        if "system" in call:
            self._of_an_fmu()
        else:
            self._do("oms_importFile", call["filename"].encode(), ctypes.byref(ctypes.c_char_p()))
        self._model = call["prefix"].partition(".")[0].encode()
        self._do("oms_setResultFile", self._model, b"", 1)
        self._do("oms_setStopTime", self._model, ctypes.c_double(call["time"][-1] + self._step))

    def _of_an_fmu(self) -> None:
        call, step = self._call, self._step
        self._do("oms_newModel", b"m")
        self._do("oms_addSystem", b"m.system", call["system"])
        self._do("oms_addSubModel", b"m.system.fmu", call["filename"].encode())
        self._do("oms_setTolerance", b"m.system", ctypes.c_double(call["relative_tolerance"]))
        smallest = step if call["system"] == _WEAKLY_COUPLED else 1e-6 * step
        sizes = [ctypes.c_double(size) for size in (smallest, smallest, step)]
        self._do("oms_setVariableStepSize", b"m.system", *sizes)

    def simulate(self) -> list[list[float]]:
        """Outputs at each time."""
        call = self._call
        self._do("oms_instantiate", self._model)
        for name, value in call["start_values"].items():
            self._set(name, value)
        self._do("oms_initialize", self._model)
        rows = [self._outputs()]
        for row, time in enumerate(call["time"][1:]):
            for name, values in call["inputs"].items():
                self._set(name, values[row])
            within = time - self._step / 2.0  # it sums up its steps, and would make one more
            self._do("oms_stepUntil", self._model, ctypes.c_double(within))
            rows.append(self._outputs())
        return rows

    def _outputs(self) -> list[float]:
        value = ctypes.c_double()
        found = []
        for name in self._call["output"]:
            self._do("oms_getReal", f"{self._call['prefix']}.{name}".encode(), ctypes.byref(value))
            found.append(value.value)
        return found

    def _set(self, name: str, value: float) -> None:
        self._do("oms_setReal", f"{self._call['prefix']}.{name}".encode(), ctypes.c_double(value))

    def _do(self, function: str, *arguments: Any) -> None:
        if getattr(self.library, function)(*arguments):
            raise SystemExit(f"{function} {arguments[0].decode()}: failed")


def _version() -> str:
    library = ctypes.CDLL(LIBRARY)
    library.oms_getVersion.restype = ctypes.c_char_p
    return library.oms_getVersion().decode()


if __name__ == "__main__":
    asked = json.load(sys.stdin)
    answer = json.dumps(_version() if "version" in asked else _Model(asked).simulate())
    sys.stdout.write(f"\n{answer}\n")
    sys.stdout.flush()
    os._exit(0)  # before the library says on the same stream how it ended
