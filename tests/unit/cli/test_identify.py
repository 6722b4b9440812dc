"""Claims: ``ppy identify`` finds parameters of any FMU, and writes them as a set that a system binds."""

from __future__ import annotations

import json
from xml.etree import ElementTree

import numpy as np
import pytest

from tests.support.command import refused, works
from tests.support.hosts import build_one_state_fmu

SSV = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("identify")
    build_one_state_fmu(folder)
    time = 0.1 * np.arange(101)
    x = 1.0 - np.exp(-time / 0.73) + np.random.default_rng(1).normal(0.0, 0.01, 101)
    np.savetxt(
        folder / "r.csv", np.column_stack([time, np.ones(101), x]), delimiter=",", header="time,u,x", comments=""
    )
    return folder


@pytest.mark.parametrize("workers", [1, 2])
def test_parameters_of_any_fmu(folder, workers):
    call = ["r.csv", "--model", "one_state.fmu", "--fit", "tau", "--workers", workers]
    said = works("identify", *call, "--ssv", "tau.ssv", "--json", "tau.json", "--plot", "tau.png", cwd=folder)
    assert "tau" in said
    found = json.loads((folder / "tau.json").read_text())["fitted"]["parameters"]["tau"]
    low, high = found["ci95"]
    assert low < 0.73 < high
    bound = ElementTree.parse(folder / "tau.ssv").getroot()
    (parameter,) = bound.iter(f"{SSV}Parameter")
    assert parameter.get("name") == "tau"
    assert float(parameter[0].get("value")) == found["value"]
    assert parameter[0].get("unit") == "s"


def test_a_comparison_of_any_fmu_can_be_recalibrated(folder):
    said = works("compare", "r.csv", "--model", "one_state.fmu", "--fit", "tau", cwd=folder)
    assert "95 % interval" in said


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["--fit", ","], ["--fit ','"]),
        (["--fit", "taw"], ["no parameter named 'taw' (did you mean tau"]),
        (["--fit", "tau,tau"], ["tau is named twice"]),
        (["--fit", "tau", "--workers", "0"], ["--workers"]),
        (["--fit", "tau", "--ssv", "a.xml"], [".ssv"]),
        (["--fit", "tau", "--set", "tau=-1"], ["tau=-1", "out of range"]),
    ],
    ids=lambda value: " ".join(value),
)
def test_what_cannot_be_is_refused_in_a_line(folder, arguments, parts):
    refused(folder, "identify", "r.csv", "--model", "one_state.fmu", *arguments, parts=parts)
