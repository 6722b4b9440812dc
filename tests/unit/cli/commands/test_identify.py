"""Claims: ``ppy identify`` finds parameters of any FMU, and writes them for a system to bind."""

from __future__ import annotations

import json
import re
from xml.etree import ElementTree

import numpy as np
import pytest

from orchestration.records import write_record
from tests.support.closed_loop import TIME, closed_loop, references
from tests.support.command import PNG, on_terminal, posix, refused, works
from tests.support.hosts import build_one_state_fmu

SSV = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("identify")
    build_one_state_fmu(folder)
    time = 0.1 * np.arange(101)
    x = 1.0 - np.exp(-time / 0.73) + np.random.default_rng(1).normal(0.0, 0.01, 101)
    np.savetxt(
        folder / "r.csv",
        np.column_stack([time, np.ones(101), x]),
        delimiter=",",
        header="time,u,x",
        comments="",
    )
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_parameters_of_any_fmu(folder, workers):
    call = ["r.csv", "--model", "one_state.fmu", "--fit", "tau", "--workers", workers]
    said = works(
        "identify", *call, "--ssv", "tau.ssv", "--json", "tau.json", "--plot", "tau.png", cwd=folder
    )
    assert "tau" in said
    found = json.loads((folder / "tau.json").read_text())["fitted"]["parameters"]["tau"]
    low, high = found["ci95"]
    assert low < 0.73 < high
    bound = ElementTree.parse(folder / "tau.ssv").getroot()
    (parameter,) = bound.iter(f"{SSV}Parameter")
    assert parameter.get("name") == "tau"
    assert float(parameter[0].get("value")) == found["value"]
    assert parameter[0].get("unit") == "s"


@pytest.mark.slow
def test_a_page_is_written_beside_the_rest(folder):
    call = ["identify", "r.csv", "--model", "one_state.fmu", "--fit", "tau", "--report", "t.html"]
    assert "wrote t.html" in works(*call, cwd=folder)
    text = (folder / "t.html").read_text(encoding="utf-8")
    assert "<h1>What fits best: tau 7" in text
    assert "--report t.txt" in refused(folder, *call[:-1], "t.txt")


@pytest.mark.slow
def test_profiles_stand_beside_the_ellipse(folder):
    call = ["identify", "r.csv", "--model", "one_state.fmu", "--fit", "tau", "--profile", "tau"]
    said = works(*call, "--profile-plot", "profile.png", "--json", "p.json", cwd=folder)
    assert "95 % by profile" in said
    assert (folder / "profile.png").read_bytes().startswith(PNG)
    told = json.loads((folder / "p.json").read_text())["fitted"]
    assert told["profiles"]["tau"]["ci95_of_ellipse"] == told["parameters"]["tau"]["ci95"]
    assert told["profiles"]["tau"]["ci95"] == pytest.approx(
        told["parameters"]["tau"]["ci95"], rel=0.01
    )


@pytest.mark.slow
@posix
def test_an_interrupted_profile_leaves_nothing(folder):
    (folder / "scratch").mkdir()
    time = 1e-4 * np.arange(100_001)  # enough for seconds of work
    x = 1.0 - np.exp(-time / 0.73) + np.random.default_rng(1).normal(0.0, 0.01, time.size)
    columns = np.column_stack([time, np.ones_like(time), x])
    np.savetxt(folder / "long.csv", columns, "%.6g", ",", header="time,u,x", comments="")
    call = [
        "identify",
        "long.csv",
        "--model",
        "one_state.fmu",
        "--fit",
        "tau",
        "--profile",
        "tau",
        "--json",
        "not.json",
    ]
    code, said, _ = on_terminal(*call, cwd=folder, interrupt_at=re.compile("profile of tau"))
    assert code == 130
    assert "Traceback" not in said
    assert list((folder / "scratch").iterdir()) == []
    assert not (folder / "not.json").exists()


@pytest.mark.slow
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
        (["--fit", "tau", "--profile", ","], ["--profile ','"]),
        (["--fit", "tau", "--profile", "u"], ["--profile: u is not fitted", "tau"]),
        (["--fit", "tau", "--profile-plot", "p.png"], ["--profile-plot", "without --profile"]),
        (["--fit", "tau", "--profile", "tau", "--profile-plot", "p.gif"], ["--profile-plot p.gif"]),
        (["--fit", "tau", "--set", "tau=-1"], ["tau=-1", "out of range"]),
    ],
    ids=lambda value: " ".join(value),
)
def test_what_cannot_be_is_refused_in_a_line(folder, arguments, parts):
    refused(folder, "identify", "r.csv", "--model", "one_state.fmu", *arguments, parts=parts)


def test_parameters_of_two_members_are_identified_from_a_record_of_the_loop(tmp_path):
    wanted = references()
    position, tension = closed_loop(wanted)
    random = np.random.default_rng(2)
    noisy = {
        "force_reference": wanted,
        "bench.position": position + 1e-6 * random.standard_normal(TIME.size),
        "actuator.tension": tension + 5e-3 * random.standard_normal(TIME.size),
    }
    units = {"force_reference": "N", "bench.position": "m", "actuator.tension": "N"}
    write_record(tmp_path / "loop.csv", TIME, noisy, units)
    about = ("loop.csv", "--model", "dma_bench", "--set", "current=0")
    fit = ("--fit", "actuator.k1,bench.b_vc", "--set", "bench.b_vc=8")
    works("identify", *about, *fit, "--json", "fit.json", cwd=tmp_path)
    found = json.loads((tmp_path / "fit.json").read_text("utf-8"))["fitted"]["parameters"]
    for name, truth in (("actuator.k1", 6300.0), ("bench.b_vc", 6.0)):
        assert found[name]["value"] == pytest.approx(truth, rel=0.03)
    refused(
        tmp_path,
        "identify",
        *about,
        "--fit",
        "bench.b_v",
        parts=["--fit bench.b_v: dma_bench has no parameter", "did you mean bench.b_vc?"],
    )
    refused(
        tmp_path, "identify", *about, *fit, "--with", "leak", parts=["dma_bench is a system; leak"]
    )


@pytest.mark.slow
def test_several_records_have_one_set_of_parameters(folder):
    """The second record rises to twice as much; its gain is the input, which is of each."""
    time = 0.1 * np.arange(101)
    x = 2.0 * (1.0 - np.exp(-time / 0.73)) + np.random.default_rng(2).normal(0.0, 0.01, 101)
    rows = np.column_stack([time, np.full(101, 2.0), x])
    np.savetxt(folder / "s.csv", rows, delimiter=",", header="time,u,x", comments="")
    call = ["r.csv", "s.csv", "--model", "one_state.fmu", "--fit", "tau", "--bounds", "tau=0.1..5s"]
    files = ["--json", "b.json", "--plot", "b.png", "--report", "b.html"]
    said = works("identify", *call, "--prior", "tau=0.7+-0.5s", *files, cwd=folder)
    assert said.count("against") == 2
    found = json.loads((folder / "b.json").read_text())
    low, high = found["fitted"]["parameters"]["tau"]["ci95"]
    assert low < 0.73 < high
    assert [one["label"] for one in found["records"]] == ["r", "s"]
    assert (folder / "b.png").read_bytes().startswith(PNG)
    assert "--corner" in refused(folder, "identify", *call, "--corner", "d.png")
