"""The program ``fmusim`` of the Reference FMUs, called as ``fmpy.simulate_fmu`` is.

It is in no package index: ``PPY_FMUSIM`` names its binary.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path

import numpy as np

from tests.support import hosts

BINARY = os.environ.get("PPY_FMUSIM", "")
MISSING = "PPY_FMUSIM names no binary of fmusim"
EVENT_MODE = ("--event-mode-used", "--early-return-allowed", "--record-intermediate-values")
_KINDS = {"CoSimulation": "cs", "ModelExchange": "me"}


def version() -> str:
    """The beginning of the binary's digest: it does not say its version."""
    return sha256(Path(BINARY).read_bytes()).hexdigest()[:12]


def simulate_fmu(
    filename: str,
    *,
    fmi_type: str,
    stop_time: float,
    output_interval: float,
    output: Sequence[str],
    input: np.ndarray | None = None,
    start_values: Mapping[str, float | str] | None = None,
    solver: str = "CVode",
    relative_tolerance: float = 1e-4,
    flags: Sequence[str] = (),
) -> np.ndarray:
    """Outputs at the regular points, of each the last row: after events.

    Raises
    ------
    RuntimeError
        Where it fails or complains, with its last line.
    """
    with tempfile.TemporaryDirectory() as folder:
        table, result = Path(folder, "input.csv"), Path(folder, "result.csv")
        command = [BINARY, "--interface-type", _KINDS[fmi_type], "--solver", solver.lower(), *flags]
        command += ["--tolerance", repr(relative_tolerance), "--stop-time", repr(float(stop_time))]
        command += ["--output-interval", repr(float(output_interval)), "--output-file", str(result)]
        for name in output:
            command += ["--output-variable", name]
        for name, value in (start_values or {}).items():
            command += ["--start-value", name, str(value)]
        if input is not None:
            columns = ",".join(input.dtype.names or ())
            np.savetxt(table, input, "%.17g", delimiter=",", header=columns, comments="")
            command += ["--input-file", str(table)]
        done = subprocess.run(
            [*command, filename],
            capture_output=True,
            text=True,
            timeout=300,
            env=os.environ | {"PPY_LIBPYTHON": hosts.shared_python()},
        )
        messages = (done.stdout + done.stderr).splitlines()
        if done.returncode or messages:
            raise RuntimeError(
                messages[-1] if messages else f"fmusim: exit status {done.returncode}"
            )
        rows = _read(result)
    regular = output_interval * np.arange(round(stop_time / output_interval) + 1)
    return rows[np.searchsorted(rows["time"], regular + 1e-9, side="right") - 1]


def _read(path: Path) -> np.ndarray:
    """Results by name; the elements of an array ``x`` are ``x[0]``, ``x[1]`` and so on."""
    header, *lines = path.read_text().splitlines()
    names = []
    for name, cell in zip(header.split(","), lines[0].split(","), strict=True):
        size = len(cell.split())
        plain = name.strip('"')
        names += [plain] if size == 1 else [f"{plain}[{k}]" for k in range(size)]
    columns = np.array([line.replace(",", " ").split() for line in lines], float).T
    return np.rec.fromarrays(columns, names=names)
