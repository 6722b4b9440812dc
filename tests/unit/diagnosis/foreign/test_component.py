"""Claims: the component that corrects an FMU has its signals, and hands its outputs on."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np
import pytest

from fmus.kit.record.compiled import CompiledModel
from orchestration.diagnosis.foreign.component import (
    Fitted,
    Names,
    input_correction,
    output_correction,
)
from orchestration.diagnosis.foreign.response import FmuResponse
from orchestration.fmu import Model, Signal

STEP = 0.1
TIME = STEP * np.arange(50)
EXPERIMENT = (1.0, STEP)


def test_an_input_that_nobody_recorded_stays_as_the_fmu_starts(lag):
    started = replace(lag, inputs={"u": replace(lag.inputs["u"], start=0.7)})
    names = Names.of(started, [])
    cls = output_correction(started, names, ["u"], ["x"], EXPERIMENT)
    assert {v.name: v.start for v in cls.layout.inputs}["u"] == 0.7


def test_outputs_are_those_of_the_fmu_and_follow_its_parameter(lag):
    """To first order about the value with which the FMU was simulated."""
    names = Names.of(lag, ["tau"])
    cls = output_correction(lag, names, ["u"], ["x"], EXPERIMENT, fit={"tau": Fitted(0.9, 1.0)})
    simulated, slope = np.sin(TIME), np.cos(TIME)
    at = np.full(len(TIME), 1.0)
    given = {"u": 0.0 * TIME, "x_run": simulated, "x_by_tau": slope}
    inputs = given | {"tau_simulated_with": at}
    model = CompiledModel(cls)
    assert model.run(TIME, inputs, {"tau": 1.0}).signals["x"] == pytest.approx(simulated)
    moved = model.run(TIME, inputs, {"tau": 1.2}).signals["x"]
    assert moved == pytest.approx(simulated + 0.2 * slope)
    assert {p.name: p.start for p in cls.layout.parameters} == {"tau": 0.9}


def test_an_output_follows_what_the_fmu_gets_beside_what_was_recorded(lag):
    """By its response: a lag of 0.5 s, of which one sample of the input is another."""
    rate = np.array([[-2.0]])
    response = FmuResponse(rate, np.array([2.0]), np.array([1.0]), 0.0, 100.0)
    names = Names.of(lag, [])
    cls = output_correction(lag, names, ["u"], ["x"], EXPERIMENT, responses={("x", "u"): response})
    recorded = np.zeros(len(TIME))
    u = np.where(TIME < STEP / 2.0, 1.0, 0.0)
    inputs = {"u": u, "u_recorded": recorded, "x_run": recorded}
    x = CompiledModel(cls).run(TIME, inputs).signals["x"]
    assert x[1:] == pytest.approx(
        (1.0 - np.exp(-2.0 * STEP)) * np.exp(-2.0 * (TIME[1:] - STEP)), abs=1e-5
    )


def test_inputs_are_handed_on(lag):
    cls = input_correction(lag, Names.of(lag, []), ["u"], [], EXPERIMENT)
    ran = CompiledModel(cls).run(TIME, {"u": np.sin(TIME)}).signals
    assert ran["u_in_fmu"] == pytest.approx(np.sin(TIME))


def test_names_of_an_fmu_that_are_those_of_a_correction_stay_apart(lag):
    outputs = {name: replace(lag.outputs["x"], name=name) for name in ("x", "x_simulated")}
    names = Names.of(replace(lag, outputs=outputs), [])
    made = [*names.variables.values(), *names.simulated.values()]
    assert len(set(made)) == len(made) == 5


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
    names = Names.of(hostile, [tau])
    layout = output_correction(
        hostile, names, [u], [x], EXPERIMENT, fit={tau: Fitted(1.0, 1.0)}
    ).layout
    input_correction(hostile, names, [u], [x], EXPERIMENT)
    assert not (tmp_path / "ran").exists()
    assert f"{x} of the FMU" in {v.doc for v in layout.inputs}
    assert " ".join(doc.split()) in {v.doc for v in layout.parameters}


def test_messages_name_variables_as_the_fmu_does():
    output = Signal("w 1", "real", "1", "1", 0.0, -inf, inf)
    names = Names.of(Model("x.fmu", Path("x.fmu"), None, {}, {"w 1": output}, {}), [])
    made = names.variables["w 1"]
    assert made != "w 1"
    assert names.in_words_of_fmu(f"{made}: no sample of {made}") == "w 1: no sample of w 1"
