"""State feedback, adaptive gain and impedance by ``ppy.design``, against closed forms and SciPy."""

import control
import numpy as np
import pytest
from scipy.linalg import expm

import ppy_rig as ppy
from fmus.controllers.state_feedback import GAINS
from fmus.kit.declare import summary
from fmus.kit.effects import stack
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from tests.support.displacement_loop import drive

ACTUATOR = {"command": "current", "measured": "displacement", "sample_period": 0.02}
LAGGING = stack(PpyActuator, EFFECTS["strain_lag"])
LAGGING_TIME = EFFECTS["strain_lag"].neutral
OTHER = {"R1": 1.32, "R2": 2.72, "C": 0.46, "alpha": 1e-4}


def feedback(model="ppy_actuator", **changed):
    return ppy.design(model, **{**ACTUATOR, "controller": "state_feedback", **changed})


def test_the_defaults_are_the_design_of_the_actuator():
    found = feedback().designed.arguments
    assert {name: found[name] for name in GAINS} == pytest.approx(GAINS, rel=1e-7, abs=1e-15)


def test_the_sampled_model_is_that_of_the_circuit():
    found = feedback(settings=OTHER, sample_period="50ms").parameters
    tau = (1.32 + 2.72) * 0.46
    assert found["charge_pole"] == pytest.approx(np.exp(-0.05 / tau), rel=1e-12)
    final = 2.72 * 0.46  # charge per current that is held
    assert found["charge_per_current"] == pytest.approx(final * -np.expm1(-0.05 / tau), rel=1e-12)
    assert found["sample_period"] == 0.05


def test_another_actuator_follows_its_own_design_by_the_pole_that_was_asked_for():
    """The loop of Python FMUs' laws, and the step of the design: 1 - exp(-t / 0.4 s)."""
    found = feedback(settings=OTHER, crossover=0.5 / np.pi / 0.4)
    made = found.controller
    expected = 1e-5 * (1.0 - np.exp(-0.02 * np.arange(200) / 0.4))
    driven = drive(made(current_limit=100.0), PpyActuator(**OTHER), np.full(200, 1e-5))
    assert driven["displacement"] == pytest.approx(expected, rel=1e-6, abs=1e-11)
    assert found.step(1e-5).measured[:200] == pytest.approx(expected, rel=1e-6, abs=1e-11)
    assert f"charge_gain {made().charge_gain:.6g}" in made.remark
    assert summary(made)


def test_the_poles_of_the_loop_are_those_of_feedback_and_observer():
    """By SciPy's exponential: the charge's two poles, and the three of the filter."""
    p = {**OTHER, "k1": 6300.0, "b1": 1.7e6, "k2": 1.0e4, "b2": 2.0e6}
    found = feedback(settings=OTHER)
    A = expm(0.02 * np.diag([-1.0 / (p["C"] * (p["R1"] + p["R2"])), -p["k2"] / p["b2"], 0.0]))
    measured = np.array([[p["alpha"], 1.0, 1.0], [p["R2"] / (p["C"] * (p["R1"] + p["R2"])), 0, 0]])
    names = [
        f"{x}_by_{y}" for x in ("charge", "kelvin", "maxwell") for y in ("displacement", "voltage")
    ]
    L = np.array([found.parameters[name] for name in names]).reshape(3, 2)
    expected = [
        *np.linalg.eigvals((np.eye(3) - L @ measured) @ A),
        *np.exp(-0.02 / np.array([0.5, 1.5])),
    ]
    closed = np.sort_complex(found.loop.closed_poles())
    for pole in expected:
        assert np.abs(closed - pole).min() < 1e-6, (pole, closed)
    assert np.abs(closed).max() < 1.0 + 1e-9


@pytest.mark.slow  # builds two FMUs
def test_the_loop_of_state_feedback_runs_from_an_equilibrium_within_its_limit():
    """The current of the equilibrium is 0.05 mm / (alpha R2 C), by the circuit."""
    held = {"trim": True, "fix": {"displacement": "0.05mm"}, "free": ["current"]}
    found = feedback(**held, drift=["maxwell_elongation"], limits=(-0.5, 0.5))
    size = 5e-5
    step = found.step(size)
    run = ppy.run(found.system, found.time, {"reference": np.full(found.time.size, 5e-5 + size)})
    np.testing.assert_allclose(run.signals["plant.displacement"], step.measured, atol=1e-13)
    assert step.measured[0] == pytest.approx(5e-5, rel=1e-9)
    assert step.command.max() == 0.5, "the limit acts"
    rest = found.step()
    np.testing.assert_allclose(rest.command, 5e-5 / (6.8e-5 * 2.35 * 2.70), rtol=1e-6)


@pytest.mark.parametrize(
    ("plant", "changed"),
    [
        ("ppy_actuator_length_driven", {"measured": "tension"}),
        (LAGGING, {"settings": {LAGGING_TIME: 1.0}}),
        (control.tf([1.0], [1.0, 1.0]), {"command": None, "measured": None}),
    ],
)
def test_an_actuator_with_other_signals_or_states_is_refused_in_a_line(plant, changed):
    with pytest.raises(ppy.UserError, match=r"^state_feedback: ") as caught:
        feedback(plant, **changed)
    assert "\n" not in str(caught.value)


def test_the_adaptive_loop_is_that_of_the_model_it_follows():
    """y = 1 - exp(-t / T_m) of a plant of one lag."""
    tank = control.tf([2.0], [30.0, 1.0])
    found = ppy.design(tank, controller="adaptive", sample_period=1.0, crossover=0.5 / np.pi / 8.0)
    expected = 1.0 - np.exp(-found.time / 8.0)
    np.testing.assert_allclose(found.step(1.0).measured, expected, atol=1e-9)
    slowest = np.abs(found.loop.closed_poles()).max()
    assert slowest == pytest.approx(np.exp(-1.0 / 8.0), rel=1e-9)
    assert {one.unit for one in found.controller.layout.inputs} == {"1"}


@pytest.mark.parametrize(
    "plant",
    [
        control.tf([1.0], [1.0, 0.0]),
        control.tf([-1.0], [1.0, 1.0]),
        control.tf([1.0], [1.0, 0.1, 1.0]),
    ],
    ids=["integral", "falls", "swings"],
)
def test_what_is_no_lag_is_refused_to_adapt(plant):
    with pytest.raises(ppy.UserError, match=r"^adaptive: of a lag") as caught:
        ppy.design(plant, controller="adaptive", sample_period=0.1)
    assert "\n" not in str(caught.value)


def test_the_law_of_an_impedance_is_its_spring_and_damper():
    """K + B s / (T_f s + 1) by the backward difference, in the units that were given."""
    found = ppy.design(
        "dma_bench",
        command="force_reference",
        measured="bench.position",
        settings={"force_reference": 1.0},
        at=["1s"],
        controller="impedance",
        controller_settings={"stiffness": "-0.5N/mm", "damping": -30.0},
    )
    h = found.plant.period
    frequencies = np.geomspace(0.01, 14.0, 30)
    s = (1.0 - np.exp(-2j * np.pi * frequencies * h)) / h
    expected = -500.0 - 30.0 * s / (2.5 * h * s + 1.0)
    np.testing.assert_allclose(found.law.response(frequencies), expected, rtol=1e-9)
    rest = found.step()
    np.testing.assert_allclose(rest.command, 1.0, rtol=1e-9)
    with pytest.raises(ppy.UserError, match="mass"):
        feedback(controller="pi", controller_settings={"mass": 1.0})
    with pytest.raises(
        ppy.UserError, match=r"^impedance: from a force in N to a length in m, not from A"
    ):
        feedback(controller="impedance")
