"""Design from Python: what it takes, and what is refused."""

import json
from types import SimpleNamespace

import control
import numpy as np
import pytest

import ppy_rig as ppy
from orchestration.api import designing
from orchestration.api.results import DiagnosisResult

SIGNALS = {"command": "current", "measured": "displacement"}
AT = {"sample_period": "20ms", "crossover": "0.5Hz"}


def test_a_system_of_python_control_goes_in_and_comes_out():
    """P = 2 / (s + 1) held over 0.1 s: K (1 + h / (T_i (1 - 1/z))) 2 (1 - a) / (z - a)."""
    found = ppy.design(control.tf([2.0], [1.0, 1.0]), sample_period=0.1, crossover=0.3)
    z, decay = np.exp(2j * np.pi * 0.03), np.exp(-0.1)
    plant = 2.0 * (1.0 - decay) / (z - decay)
    assert found.plant.state_space(z) == pytest.approx(plant, rel=1e-9)
    loop = -found.law.state_space(z) * plant
    assert abs(loop) == pytest.approx(1.0, rel=1e-6)
    assert np.degrees(np.angle(-loop)) == pytest.approx(60.0, abs=1e-4)
    closed = control.feedback(found.loop.state_space, 1)
    assert np.abs(closed.poles()).max() < 1.0
    with pytest.raises(ppy.UserError, match="without an FMU: there is no system to join"):
        _ = found.system


@pytest.mark.parametrize("slower", [1.0, 600.0])
def test_a_controller_alone_runs_in_its_samples_until_its_loop_has_settled(slower):
    plant = control.tf([2.0], [slower, 1.0])
    found = ppy.design(plant, sample_period=0.1 * slower, crossover=0.3 / slower)
    stop, step = found.controller.experiment
    assert step == pytest.approx(0.1 * slower, rel=1e-12)
    closed = control.feedback(found.loop.state_space, 1)
    settled = 4.0 * found.plant.period / -np.log(np.abs(closed.poles()).max())  # to 2 %
    assert settled < stop < 20.0 * settled
    module = {}
    exec(found.designed.source, module)
    assert module["Controller"].experiment == (stop, step)


def test_intervals_of_a_diagnosis_are_its_band(monkeypatch):
    from fmus import component

    result = object.__new__(DiagnosisResult)
    result.model = component("ppy_actuator")
    result.parameters = {
        "R1": SimpleNamespace(interval=(0.40, 0.46)),
        "C": SimpleNamespace(interval=(-1.0, 3.0)),
        "alpha": SimpleNamespace(interval=(np.nan, np.nan)),
        "of_another": SimpleNamespace(interval=(1.0, 2.0)),
    }
    assert designing._intervals(result) == {"R1": "0.4..0.46", "C": "1e-09..3.0"}
    del result.parameters["C"]
    found = ppy.design(result, **SIGNALS, **AT, samples=3)
    drawn = [one.point.parameters["R1"] for one in found.plant.variations]
    assert len(drawn) == 3
    assert all(0.40 <= value <= 0.46 for value in drawn)


def test_a_design_is_at_the_values_of_a_fit(tmp_path):
    fitted = {
        "parameters": {"C": {"value": 3.0, "ci95": [2.9, 3.1], "unit": "F", "logarithmic": False}},
        "correlations": [],
    }
    (tmp_path / "fit.json").write_text(json.dumps({"set": {}, "fitted": fitted}))
    given = {**SIGNALS, **AT, "fitted": tmp_path / "fit.json", "samples": 3}
    found = ppy.design("ppy_actuator", **given)
    assert found.plant.point.parameters["C"] == pytest.approx(3.0, rel=1e-12)
    assert found.settings["C"] == pytest.approx(3.0, rel=1e-12)
    assert len(found.plant.variations) == 3


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"command": "curent"}, "no signal named 'curent' .did you mean current"),
        ({"measured": "x"}, "ppy_actuator has no signal named 'x'"),
        ({"command": None}, "command= names the input.*current, force"),
        ({"sample_period": None}, "ppy_actuator is continuous; give a time, such as 10ms"),
        ({"sample_period": 0.0}, "a time above 0 s"),
        ({"delay": -1.0}, "a delay of -1 s: from 0 to 50 sample periods"),
        ({"limits": "1"}, "write two commands"),
        ({"limits": "1..0"}, "first command must be below the second"),
        ({"limits": "0.1..1"}, "operating point, 0, within"),
        ({"limits": "0V..1V"}, "limits"),
        ({"phase_margin": 180.0}, "phase_margin=180.0: from 1 to 179"),
        ({"controller": "pd"}, "no kind of controller named 'pd'"),
        ({"crossover": "40Hz"}, "below half the sampling rate, 25 Hz"),
        ({"crossover": float("nan")}, "crossover = nan: 'nan' is not a number"),
        ({"controller": "feedforward"}, "named .feedforward. .there are: pid, pi, state_feedback"),
        ({"limits": 3}, "limits = 3: write two commands"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(changed, words):
    asked = {**SIGNALS, **AT, **changed}
    with pytest.raises(ppy.UserError, match=words) as refused:
        ppy.design("ppy_actuator", **asked)
    assert "\n" not in str(refused.value)


def test_a_sampled_system_of_python_control_needs_its_period():
    with pytest.raises(ppy.UserError, match="without a sample period"):
        ppy.design(control.tf([1.0], [1.0, -0.5], True), sample_period=0.1)
    silent = control.tf([0.0], [1.0, 1.0])
    with pytest.raises(ppy.UserError, match=r"y.0. does not answer u.0."):
        ppy.design(silent, sample_period=0.1)
    improper = control.tf([1.0, 0.0, 0.0], [1.0, 1.0])
    for system in (improper, control.frd([1.0, 2.0], [1.0, 2.0])):
        with pytest.raises(ppy.UserError, match="without a state space"):
            ppy.design(system, sample_period=0.1)
