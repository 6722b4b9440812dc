"""Claims: the Reference FMUs run here as in fmpy, and as their reference results say.

They are in no package index: ``PPY_REFERENCE_FMUS`` names the folder of an unpacked release, with
``2.0/NAME.fmu``, ``3.0/NAME.fmu`` and, where there are any, ``NAME_ref.csv`` or ``NAME_out.csv``,
and ``NAME_in.csv`` anywhere in it.

A fit of their parameters finds those of solutions on paper or by SciPy.
"""

from __future__ import annotations

import csv
import os
from pathlib import Path

import fmpy
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ppy_rig as ppy
from orchestration.fmu import Archive, Fmu
from orchestration.fmu.signal import type_of
from orchestration.fmu.simulation import EndedSimulation, simulate_instance
from tests.support.command import works

FOLDER = os.environ.get("PPY_REFERENCE_FMUS", "")
FMUS = sorted(Path(FOLDER).rglob("[23].0/*.fmu")) if FOLDER else []
TOLERANCE = 1e-3  # of the range of a signal: the references were made with other steps
TRUTH = {"true": "1", "false": "0"}
pytestmark = pytest.mark.skipif(
    not FMUS, reason="PPY_REFERENCE_FMUS names no folder with Reference FMUs"
)


def runs(path: Path) -> bool:
    """Return whether its co-simulation ends: Robertson's problem would make 1e11 steps."""
    with Archive(path) as archive:
        has_solver = any(node.tag == "CoSimulation" for node in archive.interfaces())
    return has_solver and path.stem != "Roberts"


def numbers(fmu: Fmu) -> list[str]:
    return [name for name in fmu.outputs if type_of(fmu.variables[name]) != "string"]


def simulated(path: Path, time: np.ndarray) -> dict[str, np.ndarray]:
    with Fmu(path) as fmu:
        fmu.start(float(time[0]))
        try:
            return simulate_instance(fmu, time, {}, numbers(fmu))
        except EndedSimulation as ended:
            return ended.outputs


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


@pytest.mark.parametrize("path", FMUS, ids=lambda path: f"{path.stem}-{path.parent.name}")
def test_it_gives_the_numbers_of_fmpy(path):
    if not runs(path):
        pytest.skip("it cannot be run here")
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


def columns(file: Path) -> dict[str, np.ndarray]:
    """The columns of numbers of a result; of rows of one time, between which values jump, the last.

    An array is one column, its elements apart by spaces.
    """
    with file.open(newline="") as text:
        header, *rows = csv.reader(text)
    found = {}
    for title, *cells in zip(header, *rows, strict=True):
        name = title.split(" [")[0]
        try:
            values = np.array([[TRUTH.get(w, w) for w in cell.split()] for cell in cells], float)
        except ValueError:
            continue  # a text
        names = [f"{name}[{k + 1}]" for k in range(values.shape[1])]
        found |= dict(zip(names if len(names) > 1 else [name], values.T, strict=True))
    time = found["time"]
    is_last = np.append(np.diff(time) > 0, True)
    return {name: values[is_last] for name, values in found.items()}


@pytest.mark.parametrize("path", FMUS, ids=lambda path: f"{path.stem}-{path.parent.name}")
def test_it_gives_its_reference(path, tmp_path):
    """As the command line has it, which holds the inputs that a reference may interpolate."""
    references = [
        found
        for ending in ("ref", "out")
        for found in sorted(Path(FOLDER).rglob(f"{path.stem}_{ending}.csv"))
    ]
    inputs = sorted(Path(FOLDER).rglob(f"{path.stem}_in.csv"))
    if not references or not runs(path):
        pytest.skip("no reference result, or it cannot be run here")
    if inputs and str(2**63 - 1) in inputs[0].read_text():
        pytest.skip("its integers go beyond 2^53, up to which they are exact here")
    stimulus = ("--input", inputs[0]) if inputs else ()
    works("simulate", path, *stimulus, "--out", "found.csv", cwd=tmp_path)
    reference = columns(references[0])
    found = columns(tmp_path / "found.csv")
    places = np.searchsorted(found["time"][:-1], reference["time"] - 1e-9)
    common = np.isclose(found["time"][places], reference["time"], rtol=0, atol=1e-9)
    assert common.all() or inputs
    assert common.sum() > 1
    for name in set(found) & set(reference) - {"time"}:
        values = reference[name][common]
        limit = TOLERANCE * max(np.ptp(values), 1e-9)
        assert np.abs(found[name][places[common]] - values).max() <= limit, name


def test_clocks_tick_as_the_description_says():
    """Its comment: the first every second, the third at 4 s; nothing triggers the second here. The
    output clock is active at every fifth of all ticks, at 4 s before the sixth.
    """
    clocks = [path for path in FMUS if path.stem == "Clocks"]
    if not clocks:
        pytest.skip("there is no FMU with clocks")
    found = simulated(clocks[0], np.arange(10.0))
    assert found["inClock1Ticks"].tolist() == [*range(1, 11)]
    assert found["inClock2Ticks"].tolist() == [0] * 10
    assert found["inClock3Ticks"].tolist() == [0] * 4 + [1] * 6
    assert found["totalInClockTicks"].tolist() == [1, 2, 3, 4, 6, 7, 8, 9, 10, 11]
    assert found["outClock"].tolist() == [0] * 4 + [1] * 4 + [2] * 2
    assert found["output3"].tolist() == [0] * 4 + [1000] * 6


def test_robertsons_problem_is_solved_by_model_exchange(tmp_path):
    """Oracle: SciPy's Radau at a tolerance of 1e-10."""
    problems = [path for path in FMUS if path.stem == "Roberts"]
    if not problems:
        pytest.skip("there is no FMU of Robertson's problem")
    works("simulate", problems[0], "--model-exchange", "--out", "found.csv", cwd=tmp_path)
    found = columns(tmp_path / "found.csv")
    truth = solve_ivp(
        lambda _, y: [
            1e4 * y[1] * y[2] - 0.04 * y[0],
            0.04 * y[0] - 1e4 * y[1] * y[2] - 3e7 * y[1] ** 2,
            3e7 * y[1] ** 2,
        ],
        (1e-5, 1e8),
        [1.0, 0.0, 0.0],
        method="Radau",
        rtol=1e-10,
        atol=[1e-14, 1e-18, 1e-14],
    ).y[:, -1]
    assert [found[f"y{k}"][-1] for k in (1, 2, 3)] == pytest.approx(truth, rel=1e-4)


def decay() -> tuple[np.ndarray, dict[str, np.ndarray]]:
    time = np.linspace(0.0, 10.0, 101)
    return time, {"x": np.exp(-0.8 * time)}


def oscillation() -> tuple[np.ndarray, dict[str, np.ndarray]]:
    time = np.linspace(0.0, 20.0, 401)
    x0, x1 = solve_ivp(
        lambda _, x: [x[1], 1.7 * (1.0 - x[0] ** 2) * x[1] - x[0]],
        (0.0, 20.0),
        [2.0, 0.0],
        t_eval=time,
        rtol=1e-11,
        atol=1e-12,
    ).y
    return time, {"x0": x0, "x1": x1}


def bounces() -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Parabolas, from a metre on; each bounce keeps 0.8 of the speed."""
    time = np.linspace(0.0, 1.5, 151)
    h = 1.0 - 9.2 * time**2 / 2.0
    begin = np.sqrt(2.0 / 9.2)
    speed = 0.8 * 9.2 * begin
    while begin < time[-1]:
        flown = time[time >= begin] - begin
        h[time >= begin] = speed * flown - 9.2 * flown**2 / 2.0
        begin += 2.0 * speed / 9.2
        speed *= 0.8
    return time, {"h": h}


KNOWN = {
    "Dahlquist": (decay, {"k": 0.8}),
    "VanDerPol": (oscillation, {"mu": 1.7}),
    "BouncingBall": (bounces, {"g": -9.2, "e": 0.8}),
}


@pytest.mark.slow
@pytest.mark.parametrize("path", FMUS, ids=lambda path: f"{path.stem}-{path.parent.name}")
def test_a_fit_finds_the_parameters_of_a_known_solution(path):
    """To six digits without noise, and else within the interval; integrated here.

    Their own solver is Euler's method of a step so long that a parameter would be percents away.
    """
    if path.stem not in KNOWN:
        pytest.skip("no parameter is fitted, or no solution is known")
    solution, true = KNOWN[path.stem]
    time, exact = solution()
    options = {"model_exchange": True, "tolerance": 1e-9}
    found = ppy.fit({"time": time, **exact}, path, list(true), **options)
    assert found.values == pytest.approx(true, rel=5e-7)
    random = np.random.default_rng(1)
    noisy = {name: y + random.normal(0.0, 0.01, y.size) for name, y in exact.items()}
    found = ppy.fit({"time": time, **noisy}, path, list(true), **options)
    for name, value in true.items():
        low, high = found.intervals[name]
        assert low <= value <= high, name
        assert high - low < 0.05 * abs(value), name
    assert found.warnings == []
