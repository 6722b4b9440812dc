"""Sweeps as TOML files. Oracles: ``tau dx/dt = u - x`` in closed form; the same sweep in Python."""

from __future__ import annotations

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit import UserError
from orchestration.sweeps.file import read_sweep
from orchestration.system import library
from tests.support.command import refused, works
from tests.support.hosts import build_one_state_fmu

LAG = """
title = "A lag"
keep = ["last", "mean"]

[experiment]
component = "one_state.fmu"
duration = "5 s"
step = "100 ms"
parameters.tau = 9
inputs.u = { kind = "constant", value = 2 }

[over]
tau = "0.5..2:4"
"""
SHIPPED = """
experiment = "fig_3_3"
design = "latin-hypercube"
samples = 5
seed = 3

[over]
R1 = "300 mohm..0.7"
C = "5..10"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("files")
    build_one_state_fmu(folder)
    return folder


def written(folder, text, name="sweep.toml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_an_experiment_is_made_at_every_value(folder):
    """Swept values replace those of the experiment; its FMU lies beside the file."""
    found = ppy.sweep_file(written(folder, LAG))
    taus, time = np.array([0.5, 1.0, 1.5, 2.0]), 0.1 * np.arange(51)
    exact = 2.0 * (1.0 - np.exp(-time / taus[:, None]))
    assert found["tau"].values.tolist() == taus.tolist()
    assert found["x_last"].values == pytest.approx(exact[:, -1], abs=1e-12)
    assert found["x_mean"].values == pytest.approx(exact.mean(axis=1), abs=1e-12)
    assert found.attrs["title"] == "A lag"


def test_inputs_can_be_swept_in_a_file(folder):
    text = LAG.replace("parameters.tau = 9", "parameters.tau = 1").replace(
        'tau = "0.5..2:4"', "u = [1.0, -3.0]"
    )
    found = ppy.sweep_file(written(folder, text))
    assert found["x_last"].values == pytest.approx(
        found["u"].values * (1.0 - np.exp(-5.0)), abs=1e-12
    )


def test_an_experiment_can_be_named(folder):
    """One that ships, with its preset, steps of the current and outputs; or a file beside."""
    found = ppy.sweep_file(written(folder, SHIPPED))
    asked = read_sweep(folder / "sweep.toml")
    assert sorted(asked.inputs) == ["current", "force"]
    assert found.attrs["design"] == "latin-hypercube"
    assert [n for n in found if n.endswith("_last")] == [
        "voltage_last",
        "displacement_last",
        "charge_last",
    ]
    for case in range(5):
        settings = asked.settings | {n: float(found[n][case]) for n in ("R1", "C")}
        alone = ppy.simulate("ppy_actuator", asked.inputs, time=asked.time, settings=settings)
        assert float(found["voltage_last"][case]) == pytest.approx(alone["voltage"][-1], rel=1e-9)
    inner = "\n".join(
        line.removeprefix("experiment.")
        for line in LAG.partition("[experiment]")[2].splitlines()[:6]
    )
    written(folder, inner, "inner.toml")
    beside = 'experiment = "inner.toml"\nover.tau = [1.0]\n'
    assert float(ppy.sweep_file(written(folder, beside))["x_last"][0]) == pytest.approx(
        2.0 * (1.0 - np.exp(-5.0))
    )


def test_what_stays_where_it_was_is_told_of_inputs_that_are_not_swept(folder):
    told = []
    text = LAG.replace('inputs.u = { kind = "constant", value = 2 }\n', "")
    read_sweep(written(folder, text), told.append)
    assert len(told) == 1
    assert "no values for the input u" in told[0]
    told.clear()
    read_sweep(written(folder, text.replace('tau = "0.5..2:4"', "u = [1.0]")), told.append)
    assert told == []


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('tau = "0.5..2:4"', 'tua = "0.5..2:4"', "tua"),
        ('tau = "0.5..2:4"', 'tau = "2..1:4"', "a range goes up"),
        ('tau = "0.5..2:4"', "", "over"),
        ('tau = "0.5..2:4"', "tau = true", "over.tau"),
        ('"last", "mean"', '"last", "median"', "no such reduction"),
        ("keep =", "keeep =", "did you mean keep"),
        ("duration", "durration", "did you mean duration"),
        ("one_state.fmu", "two_state.fmu", "two_state.fmu"),
        ("[over]", "[over", "line"),
        (
            'component = "one_state.fmu"',
            'system = "ageing_actuator"',
            "no system named 'ageing_actuator'",
        ),
        ("parameters.tau = 9", 'noise.x = { rms = "1e-3" }', "a sweep cannot have noise"),
        ('title = "A lag"', "samples = 0", "samples"),
        ('title = "A lag"', 'design = "random"', "one of grid"),
    ],
)
def test_what_is_wrong_is_told_in_a_line(folder, old, new, told):
    assert old in LAG
    with pytest.raises(UserError, match=told) as refused:
        ppy.sweep_file(written(folder, LAG.replace(old, new)))
    assert "\n" not in str(refused.value)


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(UserError, match=r"none.toml: no such file"):
        read_sweep(tmp_path / "none.toml")
    with pytest.raises(UserError, match="a folder"):
        read_sweep(tmp_path)


def test_on_the_command_line_the_file_says_what_is_run(folder):
    written(folder, LAG, "a.toml")
    assert "4 cases, FMU" in works(
        "sweep", "a.toml", "--engine", "fmu", "--out", "a.nc", cwd=folder
    )
    assert (folder / "a.nc").exists()
    refused(folder, "sweep", "a.toml", "--stop", "3s", parts=["--stop: the file says what is run"])


@pytest.mark.slow
def test_a_system_is_swept_at_the_step_of_its_experiment(tmp_path):
    path = tmp_path / "gains.toml"
    path.write_text(
        """
experiment = {system = "dma_bench", duration = 0.1, step = 1e-3, inputs = {force_reference = 1.0}}
keep = ["last"]

[over]
"bench.error_gain" = "0.3..1.2:3"
""",
        "utf-8",
    )
    swept = ppy.sweep_file(path)
    time = 1e-3 * np.arange(101)
    for gain in swept["bench.error_gain"].values:
        changed = library.system("dma_bench").given({"bench.error_gain": gain})
        single = ppy.run(changed, time, {"force_reference": np.ones(time.size)})
        last = swept["bench.force_measured_last"].sel({"bench.error_gain": gain})
        assert last == single.signals["bench.force_measured"][-1]
