"""Claims: every result comes out of a pickle in a fresh process as it went in, and can go on."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

import ppy_rig as ppy
from demonstrations.records import draw, write
from orchestration.api import DiagnosisResult
from orchestration.api.system_results import SystemResult
from orchestration.diagnosis.changes import Changed
from orchestration.diagnosis.law_map import map_laws
from orchestration.fmu.model import declared_model_of
from orchestration.system import library
from tests.support.hosts import build_one_state_fmu
from tests.support.oscillator import CUBE, DRY, diagnosis_with, oscillator_record
from tests.support.oscillator_model import Oscillator
from tests.support.source import ROOT
from tests.support.system.judged import rubbing_system
from tests.support.travel import write_shown

RECORD = oscillator_record(1, dry=1.5, samples=300)
COLUMNS = {
    "time [s]": RECORD.time,
    "force [N]": RECORD.signals["force"],
    "position [m]": RECORD.signals["position"],
}
MADE = {
    "changed": lambda path: DiagnosisResult(_dry(), ["ppy"], Changed(_dry(), _dry(), ())),
    "comparison": lambda path: ppy.compare(COLUMNS, Oscillator, fit=["damping"]),
    "design": lambda path: ppy.design(
        Oscillator, command="force", measured="position", sample_period=0.01
    ),
    "diagnosis": lambda path: DiagnosisResult(_dry(), ["ppy", "diagnose", "a.csv"]),
    "evidence": lambda path: DiagnosisResult(_dry(), ["ppy"]).evidence,
    "findings": lambda path: ppy.check(build_one_state_fmu(path)),
    "fit": lambda path: ppy.fit(COLUMNS, Oscillator, ["damping"]),
    "foreign": lambda path: _of_an_fmu(path),
    "frequency": lambda path: ppy.frequency_response(
        {"time [s]": RECORD.time, "u [V]": COLUMNS["force [N]"], "y [V]": RECORD.time % 3.0},
        of=["y/u"],
    ),
    "laws": lambda path: DiagnosisResult(_dry(), ["ppy", "laws"], law_map=map_laws(_dry())),
    "linear": lambda path: ppy.linearise(Oscillator, inputs=["force"], outputs=["position"]),
    "loop": lambda path: ppy.linearise(
        "dma_bench", {"force_reference": 1.0}, at=1.0, cut="bench.force_filtered"
    ),
    "members": lambda path: SystemResult(rubbing_system(path), ["ppy", "diagnose"]),
    "model": lambda path: ppy.find_model(
        "ppy_actuator", effects=["strain_saturation", "sensor_lag(voltage)"]
    ),
    "optimum": lambda path: ppy.optimise(
        "foot_design", {"r_po": "30..45 mm"}, maximise=["toe_stroke"], starts=16
    ),
    "order": lambda path: _black_box(path),
    "record": lambda path: ppy.read_record(COLUMNS, declared_model_of(Oscillator)),
    "simulation": lambda path: ppy.simulate(Oscillator, {"force": 1.0}, stop=1.0),
    "sweep": lambda path: ppy.sweep(
        Oscillator, {"damping": "0.1, 0.2"}, {"force": 1.0}, stop=1.0, keep=["last", "trace"]
    ),
    "experiment": lambda path: ppy.run("fig_3_4", settings={"duration": "2 s"}),
    "system": lambda path: library.system("dma_bench"),
    "system_run": lambda path: ppy.run(library.system("dma_bench"), np.arange(0.0, 0.1, 0.001)),
}


def _dry():
    return diagnosis_with(RECORD, (DRY,), (CUBE,), (DRY, CUBE))


def _of_an_fmu(folder):
    """Return the diagnosis of a lag of 1 s by a record of one of 1.4 s that reads 0.1 more."""
    time = 0.05 * np.arange(400)
    driven = np.repeat(np.random.default_rng(3).normal(size=20), 20)
    state = np.zeros(400)
    for k in range(399):
        state[k + 1] = driven[k] + (state[k] - driven[k]) * np.exp(-0.05 / 1.4)
    measured = state + 0.1 + 1e-3 * np.random.default_rng(4).normal(size=400)
    columns = {"time [s]": time, "u []": driven, "x []": measured}
    return ppy.diagnose(columns, build_one_state_fmu(folder), fit=["tau"])


def _black_box(folder):
    table = np.column_stack([RECORD.time, *RECORD.signals.values()])
    path = folder / "steps.csv"
    header = "time [s],force [N],position [m]"
    np.savetxt(path, table, delimiter=",", header=header, comments="")
    return ppy.black_box(path, "position", path_orders=[1], noise_orders=[1])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with what all results show here, in copies, and in a fresh process."""
    folder = tmp_path_factory.mktemp("travel")
    for name, make in MADE.items():
        (folder / "of" / name).mkdir(parents=True)
        result = make(folder / "of" / name)
        # what is derived when it is shown must not be in its way
        write_shown(result, folder / "here" / name)
        (folder / f"{name}.pickle").write_bytes(pickle.dumps(result))
        write_shown(copy.deepcopy(result), folder / "copied" / name)
    command = [sys.executable, "-W", "error", "-m", "tests.support.travel", folder]
    subprocess.run(command, cwd=ROOT, check=True)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("name", MADE)
def test_a_result_shows_the_same_elsewhere(folder, name):
    files = {path.name: path.read_bytes() for path in (folder / "here" / name).iterdir()}
    assert "text" in files
    for place in ("copied", "there"):
        again = {path.name: path.read_bytes() for path in (folder / place / name).iterdir()}
        assert again.keys() == files.keys()
        assert [key for key in files if again[key] != files[key]] == []


@pytest.mark.slow
def test_a_result_that_travelled_goes_on(folder):
    """It fits what was asked for later, and gives the same."""
    there = pickle.loads((folder / "diagnosis.pickle").read_bytes())
    here = DiagnosisResult(_dry(), ["ppy", "diagnose", "a.csv"])
    asked = ("friction(elongation)", "nothing")
    assert str(there.explain(*asked)) == str(here.explain(*asked))
    paths = [result.fmu(folder / name / "x.fmu")[0] for result, name in ((here, "a"), (there, "b"))]
    runs = [ppy.simulate(path, {"force": 1.0}, stop=0.5)["position"] for path in paths]
    np.testing.assert_array_equal(*runs)


def _diagnosed(path):
    return ppy.diagnose(path, effects=[], laws=False)


@pytest.mark.slow
def test_processes_of_the_standard_library_return_diagnoses(tmp_path):
    write(draw(None, seed=1, duration=60.0), tmp_path / "clean.csv")
    path = str(tmp_path / "clean.csv")
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        there = pool.submit(_diagnosed, path).result()
    assert there.to_dict() == _diagnosed(path).to_dict()
