"""Claims: the Reference FMUs of FMI 3.0 run here as in fmpy, and as their reference results say.

They are in no package index: ``PPY_REFERENCE_FMUS`` names the folder of an unpacked release, with
``3.0/NAME.fmu`` and, where there are any, ``NAME_ref.csv`` and ``NAME_in.csv`` anywhere in it.
"""

from __future__ import annotations

import os
from pathlib import Path

import fmpy
import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.fmu import Archive, Fmu, simulate_instance
from orchestration.fmu.signal import type_of

FOLDER = os.environ.get("PPY_REFERENCE_FMUS", "")
FMUS = sorted(Path(FOLDER).rglob("3.0/*.fmu")) if FOLDER else []
TOLERANCE = 1e-3  # of the range of a signal: the references were made with other steps
pytestmark = pytest.mark.skipif(
    not FMUS, reason="PPY_REFERENCE_FMUS names no folder with Reference FMUs of FMI 3.0"
)


def runs(path: Path) -> bool:
    """Return whether it is one that can be run here: for co-simulation, without clocks."""
    with Archive(path) as archive:
        try:
            archive.check_interfaces()
        except UserError:
            return False
    return True


def numbers(fmu: Fmu) -> list[str]:
    return [name for name in fmu.outputs if type_of(fmu.variables[name]) != "string"]


def simulated(path: Path, time: np.ndarray) -> dict[str, np.ndarray]:
    with Fmu(path) as fmu:
        fmu.start(float(time[0]))
        return simulate_instance(fmu, time, {}, numbers(fmu))


def flat(table: np.ndarray, names: list[str], points: int) -> dict[str, np.ndarray]:
    """The columns of fmpy's result by the names of elements."""
    columns = {}
    for variable in table.dtype.names[1:]:
        values = np.asarray(table[variable])[:points]
        for name in names:
            stem, bracket, index = name.rstrip("]").partition("[")
            if not bracket and name == variable:
                columns[name] = values.astype(float)
            elif stem == variable and values.ndim > 1:
                place = tuple(int(number) - 1 for number in index.split(","))
                columns[name] = values[(slice(None), *place)].astype(float)
    return columns


@pytest.mark.parametrize("path", FMUS, ids=lambda path: path.stem)
def test_it_gives_the_numbers_of_fmpy(path):
    if not runs(path):
        return
    usual = fmpy.read_model_description(str(path)).defaultExperiment
    step = float(getattr(usual, "stepSize", None) or 0.01)
    stop = float(getattr(usual, "stopTime", None) or 1.0)
    time = step * np.arange(round(stop / step) + 1)
    found = simulated(path, time)
    theirs = fmpy.simulate_fmu(
        str(path), fmi_type="CoSimulation", stop_time=time[-1], output_interval=step
    )
    expected = flat(theirs, list(found), time.size)
    assert expected
    for name, values in expected.items():
        np.testing.assert_allclose(found[name], values, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("path", FMUS, ids=lambda path: path.stem)
def test_it_gives_its_reference(path):
    references = sorted(Path(FOLDER).rglob(f"{path.stem}_ref.csv"))
    if not references or sorted(Path(FOLDER).rglob(f"{path.stem}_in.csv")) or not runs(path):
        pytest.skip("no reference result without inputs, or it cannot be run here")
    reference = np.genfromtxt(references[0], delimiter=",", names=True, deletechars="")
    found = simulated(path, reference["time"])
    for name in set(found) & set(reference.dtype.names):
        values = reference[name]
        limit = TOLERANCE * max(np.ptp(values), 1e-9)
        assert np.abs(found[name] - values).max() <= limit, name
