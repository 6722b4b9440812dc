"""Compiled cases come to the numbers of the FMU, or are left to it.

Oracles: the FMU, and a closed form.
"""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit import Component, Input, Parameter, State, UserError, sqrt
from orchestration.fmu.simulation import FmuSource, RepeatedFmu
from orchestration.sweeps import compiled
from orchestration.sweeps.compiled import CompiledCases, choose_equations
from orchestration.sweeps.reductions import REDUCTIONS
from orchestration.sweeps.task import CaseRunner, Task
from tests.support.kernel import without_compiler
from tests.support.kit_samples import Mixed, Thermostat

TIME = 0.1 * np.arange(51)


ENGINES = ("fmu", "compiled")


class Draining(Component):
    """A vessel that drains, from which no law can be evaluated below a level of nothing."""

    name = "draining"
    outflow = Parameter(1.0, "1", min=0.0, doc="speed")
    period = Parameter(1.0, "s", doc="of nothing")
    inflow = Input("1", start=0.0, doc="into it")
    level = State("1", rate="falling", start=1.0, output=True, doc="of the water")

    def falling(self):
        return self.inflow - self.outflow * sqrt(self.level)


@pytest.mark.parametrize(
    ("model", "effects", "over", "inputs"),
    [
        (
            "ppy_actuator",
            [],
            {"R1": "0.3..0.7:3", "current": "-1..1:3"},
            {"force": 1.0 + np.sin(TIME)},
        ),
        (
            "ppy_actuator",
            ["strain_saturation", "sensor_lag(voltage)"],
            {"C": "5..10:3"},
            {"current": np.sin(TIME)},
        ),
        ("galvanostat", [], {"current_command": "-0.5..0.5:3"}, {}),
        ("voice_coil_dma", [], {"target": "0..1e-3:2"}, {}),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                ("degradation_estimator", [], {"voltage": "0.2..0.8:3"}, {}),
                ("foot_dynamic", [], {}, {}),
            )
        ),
        (
            Thermostat,
            [],
            {"loss": "0.2..0.8:3", "outside": "270..285:2"},
            {"boost": TIME % 2.0 < 1.0},
        ),
        (Mixed, [], {}, {}),
    ],
)
def test_both_engines_come_to_the_same_numbers(model, effects, over, inputs):
    subject = (
        ppy.find_model(model, effects=effects) if isinstance(model, str) else compiled_model(model)
    )
    known = {**subject.parameters, **subject.inputs}
    over = {name: values for name, values in over.items() if name in known} or start_values(subject)
    fmu, fast = (
        ppy.sweep(subject, over, inputs, time=TIME, keep=["last", "mean", "rms", "trace"], engine=e)
        for e in ENGINES
    )
    assert (fmu.attrs["engine"], fast.attrs["engine"]) == ENGINES
    for name in (n for n in fmu if n != "failure"):
        size = np.nanmax(np.abs(fmu[name].values))
        np.testing.assert_allclose(
            fast[name].values, fmu[name].values, rtol=1e-9, atol=1e-9 * size, err_msg=str(name)
        )
    assert fast.get("failure", fast).identical(fmu.get("failure", fmu)) or "failure" not in fmu


def compiled_model(cls):
    from orchestration.fmu.model import model_of

    return model_of(cls)


def start_values(model):
    """Two values around that of the first real parameter that has one."""
    name, signal = next(
        (n, s)
        for n, s in model.parameters.items()
        if s.type == "real" and s.default not in (0.0, "")
    )
    return {name: sorted([float(signal.default), 1.01 * float(signal.default)])}


def test_the_course_is_that_of_the_closed_form():
    """The root of the level falls evenly: sqrt(y) = 1 - a t / 2, until the vessel is empty."""
    time = 0.01 * np.arange(101)
    found = ppy.sweep(
        Draining, {"outflow": [0.2, 0.5, 1.0]}, time=time, keep=["trace"], engine="compiled"
    )
    exact = (1.0 - 0.5 * found["outflow"].values[:, None] * time) ** 2
    assert found["level"].values == pytest.approx(exact, abs=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_a_case_that_fails_says_what_the_fmu_says(workers):
    """With 4 the vessel is empty after half a second."""
    call = {"over": {"outflow": [0.2, 4.0, 0.5]}, "time": TIME[:11], "workers": workers}
    fmu, fast = (ppy.sweep(Draining, **call, engine=engine) for engine in ENGINES)
    assert "level" in str(fast["failure"].values[1])
    assert fast.drop_attrs().identical(fmu.drop_attrs())
    assert np.isfinite(fast["level_last"].values).tolist() == [True, False, True]


@pytest.mark.parametrize("bad", [-1.0, np.nan, np.inf])
def test_a_value_that_the_fmu_refuses_is_refused(bad):
    model = compiled_model(Draining)
    task = Task(
        FmuSource(model.path),
        ("outflow",),
        {},
        TIME[:6],
        {},
        ("level",),
        ("last",),
        choose_equations(model, "compiled"),
    )
    told = []
    for one in (task, replace(task, equations=None)):
        with CaseRunner(one) as case:
            found = case.run(np.array([[bad], [0.2]]))
        assert np.isnan(found.numbers[0]).all()
        assert np.isfinite(found.numbers[1]).all()
        told.append((found.undecided, [*found.failures]))
    assert told == [((0,), []), ((), [0])], "compiled code leaves it to the FMU, which refuses"


def test_what_is_too_long_for_an_uninterruptible_call_is_run_by_the_fmu(monkeypatch):
    call = {"over": {"R1": [0.3, 0.5]}, "inputs": {"current": 0.5}, "time": TIME, "keep": ["trace"]}
    expected = ppy.sweep("ppy_actuator", **call, engine="fmu")
    monkeypatch.setattr(compiled, "_MOST_STEPS", 10.0)
    ran = []
    monkeypatch.setattr(
        RepeatedFmu,
        "run",
        lambda *given, known=RepeatedFmu.run: ran.append(1) or known(*given),
    )
    found = ppy.sweep("ppy_actuator", **call, engine="compiled")
    assert ran == [1, 1]
    assert found["voltage"].values.tolist() == expected["voltage"].values.tolist()


def test_workers_come_to_the_same_bits():
    call = {
        "over": {"R1": "0.3..0.7:37"},
        "inputs": {"current": np.sin(TIME)},
        "keep": [*REDUCTIONS, "trace"],
    }
    one, two = (
        ppy.sweep("ppy_actuator", **call, time=TIME, workers=n, engine="compiled") for n in (1, 2)
    )
    assert one.identical(two)


def test_the_engine_is_chosen_by_what_is_known(lag, tmp_path):
    ours = ppy.find_model("ppy_actuator")
    copy = tmp_path / "copy.fmu"
    shutil.copy(ours.path, copy)
    assert choose_equations(ours, "auto") is not None
    assert choose_equations(ppy.find_model(str(copy)), "auto") is None, "a file is run as it is"
    assert choose_equations(ours, "fmu") is None
    assert choose_equations(ppy.find_model(lag), "auto") is None
    assert choose_equations(ppy.find_model("ppy_actuator", runtime="python"), "auto") is None
    assert choose_equations(ppy.find_model("rig_proxy"), "auto") is None, (
        "it stands for something outside"
    )
    with without_compiler():
        assert choose_equations(ours, "auto") is None


@pytest.mark.parametrize(
    ("name", "engine", "told"),
    [
        (None, "compiled", "engine='compiled': one_state.fmu is run as an FMU"),
        ("rig_proxy", "compiled", "engine='compiled': rig_proxy has no equations"),
        ("ppy_actuator", "gpu", "engine='gpu': it is one of auto, fmu, compiled"),
    ],
)
def test_what_cannot_be_compiled_is_told_in_a_line(lag, name, engine, told):
    with pytest.raises(UserError, match=told) as refused:
        choose_equations(ppy.find_model(name or lag), engine)
    assert "\n" not in str(refused.value)


def test_a_library_that_is_gone_is_told_in_a_line(tmp_path):
    equations = choose_equations(ppy.find_model("ppy_actuator"), "compiled")
    gone = replace(equations, library=tmp_path / "gone.so")
    with pytest.raises(UserError, match=r"gone.so: cannot be loaded"):
        CompiledCases(gone)
