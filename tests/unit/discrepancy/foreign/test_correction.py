"""Claims: the component that corrects an FMU has its signals, and hands its outputs on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit.record.compiled import CompiledModel
from orchestration.discrepancy.foreign.correction import input_correction, output_correction
from tests.support.hosts import build_one_state_fmu


@pytest.fixture(scope="module")
def lag(tmp_path_factory):
    """An FMU of one lag, whose equations nobody knows."""
    folder = tmp_path_factory.mktemp("foreign")
    return ppy.find_model(str(build_one_state_fmu(folder)))


def test_an_input_that_nobody_recorded_stays_as_the_fmu_starts(lag):
    started = replace(lag, inputs={"u": replace(lag.inputs["u"], start=0.7)})
    assert {
        v.name: v.start for v in output_correction(started, ["x"], [], 1.0, 0.1).cls.layout.inputs
    }["u"] == 0.7


def test_outputs_are_those_of_the_fmu_and_follow_its_parameter(lag):
    """To first order: the derivative is an input, by the size of which the parameter acts."""
    correction = output_correction(lag, ["x"], {"tau": 1.0}, 1.0, 0.1)
    time = 0.1 * np.arange(50)
    simulated = np.sin(time)
    slope = np.cos(time)
    inputs = {"u": 0.0 * time, "simulated_x": simulated, "x_by_tau": slope}
    model = CompiledModel(correction.cls)
    assert model.run(time, inputs).signals["x"] == pytest.approx(simulated)
    moved = model.run(time, inputs, {"tau": 1.2}).signals["x"]
    assert moved == pytest.approx(simulated + 0.2 * slope)


def test_inputs_are_handed_on(lag):
    time = 0.1 * np.arange(50)
    model = CompiledModel(input_correction(lag, ["u"], 1.0, 0.1))
    ran = model.run(time, {"u": np.sin(time)}).signals
    assert ran["u_in_fmu"] == pytest.approx(np.sin(time))


def test_names_and_descriptions_are_no_code(lag, tmp_path):
    run = f"__import__('pathlib').Path({str(tmp_path / 'ran')!r}).touch()"
    u, x, tau = f'u"); {run}; ("', f"'say \"{run}\"'", f'"""\n{run}\n\\'
    doc = f'"""\n    {run}\n    """'
    hostile = replace(
        lag,
        inputs={u: replace(lag.inputs["u"], name=u, doc=doc)},
        outputs={x: replace(lag.outputs["x"], name=x, doc=doc)},
        parameters={tau: replace(lag.parameters["tau"], name=tau, doc=doc)},
    )
    layout = output_correction(hostile, [x], {tau: 1.0}, 1.0, 0.1).cls.layout
    input_correction(hostile, [u], 1.0, 0.1)
    assert not (tmp_path / "ran").exists()
    assert f"{x} of the FMU" in {v.doc for v in layout.inputs}
    assert doc.replace("\n", "") in {v.doc for v in layout.parameters}
