"""Claims: ``ppy linearise`` prints, writes and draws what it finds, and refuses in a line."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.io import loadmat

from tests.support.command import refused, works

CALL = ["linearise", "ppy_actuator", "--inputs", "current", "--outputs", "voltage"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("linearise")


def test_everything_is_written(folder):
    files = ["--json", "m.json", "--mat", "m.mat", "--plot", "m.svg"]
    said = works(*CALL, "--at", "0s,1s", "--over", "C=2..4:3", *files, cwd=folder)
    assert "Jacobians of the laws" in said
    told = json.loads((folder / "m.json").read_text(encoding="utf-8"))
    pole = -1.0 / ((0.43 + 2.35) * 2.70)
    assert told["poles"][0][0] == pytest.approx(pole, rel=1e-12)
    assert told["further"][0]["operating_point"]["time"] == 1.0
    assert loadmat(folder / "m.mat")["A"] == pytest.approx(np.array([[pole]]), rel=1e-12)
    assert (folder / "m.svg").stat().st_size > 10_000


def test_json_alone_goes_to_standard_output(folder):
    assert json.loads(works(*CALL, "--json", "-", cwd=folder))["method"] == "Jacobians of the laws"


def test_a_record_leads_to_the_operating_point(folder):
    rows = [f"{t},{0.5 if t < 2 else 0.0}" for t in range(5)]
    (folder / "r.csv").write_text("\n".join(["time [s],I [A]", *rows]))
    record = ["--input", "r.csv", "--map", "I=current", "--at", "3s", "--json", "-"]
    told = json.loads(works(*CALL, *record, cwd=folder))
    tau = (0.43 + 2.35) * 2.70
    charge = 0.5 * 2.35 * 2.70 * (1.0 - np.exp(-2.0 / tau)) * np.exp(-1.0 / tau)
    assert told["operating_point"]["values"]["charge"] == pytest.approx(charge, rel=1e-6)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--trim", "--fix", "force=1"], "no equilibrium found; the rate of maxwell_elongation"),
        (["--trim", "--free", "current"], "--free current: for each of these a state or an output"),
        (["--inputs", "curent"], "--inputs curent: no input or state of this name (did you mean"),
        (["--cut", "voltge"], "--cut voltge: no state and no connection of this name"),
        (["--fix", "force=1"], "--fix is of an equilibrium: add --trim"),
        (["--at", "-1"], "--at -1: a time from 0 s on"),
        (["--plot", "m.txt"], "--plot m.txt: its name must end in"),
        (["--over", "C"], "--over 'C': write name=from..to:count"),
        (["--map", "a=current"], "--map is about a record"),
    ],
)
def test_bad_input_is_one_line(folder, words, said):
    assert said in refused(folder, "linearise", "ppy_actuator", *words)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["dma_bench", "--cut", "bench.tensoin"], "did you mean bench.tension"),
        (["hil_bench"], "proxy is computed by an engine"),
        (["rig_proxy"], "is computed by an engine"),
        (["dma_bench", "--with", "slack"], "--with is of one model; dma_bench is a system"),
        (["nothing"], "no component named 'nothing'"),
    ],
)
def test_bad_models_are_one_line(folder, words, said):
    assert said in refused(folder, "linearise", *words)
