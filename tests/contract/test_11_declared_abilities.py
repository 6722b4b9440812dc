"""Line 11: promises of the model description are kept; anything else is refused cleanly."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Sequence
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.linalg import expm

from tests.contract import oracle
from tests.contract.models import Oscillator, Sampler
from tests.contract.raw import ERROR, OK, Instance, doubles, instance, integers
from tests.contract.subjects import actuators_only

STATES = ["charge", "kelvin_elongation", "maxwell_elongation"]


@pytest.fixture
def native(fmu, name):
    with instance(fmu(name, "native")) as created:
        yield created


def abilities(archive) -> dict[str, bool]:
    with zipfile.ZipFile(archive) as opened:
        node = ElementTree.fromstring(opened.read("modelDescription.xml")).find("CoSimulation")
    return {
        key: value == "true" for key, value in node.attrib.items() if value in ("true", "false")
    }


def test_declared_abilities(archive, runtime):
    native = runtime == "native"
    assert abilities(archive) == {
        "needsExecutionTool": not native,
        "canHandleVariableCommunicationStepSize": True,
        "canInterpolateInputs": native,
        "canNotUseMemoryManagementFunctions": True,
        "canGetAndSetFMUstate": True,
        "canSerializeFMUstate": True,
        "providesDirectionalDerivative": native,
    }


def test_python_build_refuses_what_it_does_not_declare(fmu, name, subject):
    with instance(fmu(name, "python")) as one:
        one.initialize()
        fed, cell = one.references([subject.first]), doubles(1.0)
        assert one.call("fmi2SetRealInputDerivatives", fed, 1, integers(1), cell) == ERROR
        arguments = (one.references([subject.output]), 1, fed, 1, cell, doubles(0.0))
        assert one.call("fmi2GetDirectionalDerivative", *arguments) == ERROR
        assert [m.split(" by this build")[0] for m in one.messages] == [
            "fmi2SetRealInputDerivatives is not supported",
            "fmi2GetDirectionalDerivative is not supported",
        ]
        one.step(0.1)


@actuators_only
def test_variable_communication_steps_are_handled(archive, one, name, load):
    assert abilities(archive)["canHandleVariableCommunicationStepSize"]
    steps = [0.1, 1e-4, 3.0, 0.1, 20.0, 1e-3]
    inputs = np.tile([0.5, 1e-3 if load == "length_change" else 1.0], (len(steps), 1))
    one.initialize({"current": 0.5, load: inputs[0, 1]})
    for size in steps:
        one.step(size)
    expected = oracle.solve(name, steps, inputs)[-1]
    assert one.get(*oracle.OUTPUTS[name]) == pytest.approx(expected, rel=1e-7)


# --- directional derivatives
# ----------------------------------------------------------------------------------------


def jacobian(one: Instance, unknowns: Sequence[str], knowns: Sequence[str]) -> np.ndarray:
    return np.array([one.tangent(unknowns, [known], [1.0]) for known in knowns]).T


@actuators_only
def test_derivatives_between_steps_are_the_matrices_of_the_model(native, name, load):
    native.initialize({"current": 0.9, load: 1e-3})
    native.step(0.7)
    a, b, c, d = oracle.matrices(name)
    outputs, inputs = list(oracle.OUTPUTS[name]), ["current", load]
    rates = [f"der({state})" for state in STATES]
    for unknowns, knowns, expected in (
        (rates, STATES, a),
        (rates, inputs, b),
        (outputs, STATES, c),
        (outputs, inputs, d),
    ):
        np.testing.assert_allclose(
            jacobian(native, unknowns, knowns), expected, rtol=1e-12, atol=1e-12
        )


@actuators_only
def test_a_direction_is_the_sum_of_its_parts(native, name, load):
    native.initialize({"current": 0.9, load: 1e-3})
    unknowns, knowns = [*oracle.OUTPUTS[name], "der(charge)"], ["current", load, *STATES]
    seeds = [0.3, -2.0, 1.1, 1e-4, -3e-5]
    together = native.tangent(unknowns, knowns, seeds)
    assert together == pytest.approx(jacobian(native, unknowns, knowns) @ seeds, rel=1e-12)
    assert native.tangent(unknowns, knowns, [0.0] * 5) == [0.0] * len(unknowns)


def test_slack_actuator_does_not_answer_to_its_length(fmu):
    with instance(fmu("ppy_actuator_length_driven", "native")) as one:
        one.initialize({"length_change": -1e-3})
        assert one.tangent(["tension"], ["length_change"], [1.0]) == [0.0]


def test_derivatives_in_initialization_are_finite_differences(native, subject):
    """With respect to every parameter and input; the states follow their start parameters."""
    causality, kinds = (
        native.library.causality,
        {n: kind for n, (_, kind) in native.variables.items()},
    )
    reals = [n for n in causality if kinds[n] == "Real"]
    unknowns = [n for n in reals if causality[n] in ("output", "local")]
    knowns = [n for n in reals if causality[n] in ("parameter", "input")]
    native.do("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
    native.do("fmi2EnterInitializationMode")
    native.set({**subject.parameters, **subject.inputs, **subject.started})
    for known in knowns:
        (value,) = native.get(known)
        h = 1e-5 * abs(value)
        if h == 0.0:
            continue  # at zero it would have no scale, and many are at their bound
        native.set({known: value + h})
        plus = np.array(native.get(*unknowns))
        native.set({known: value - h})
        minus = np.array(native.get(*unknowns))
        native.set({known: value})
        found = np.array(native.tangent(unknowns, [known], [1.0]))
        size = (np.abs(plus) + np.abs(minus)) / (
            2.0 * abs(value)
        )  # a derivative of this size would be proportionality
        np.testing.assert_array_less(
            np.abs(found - (plus - minus) / (2.0 * h)),
            1e-8 * size + 1e-7 * np.abs(found) + 1e-300,
            err_msg=known,
        )


def test_asking_for_derivatives_changes_nothing(native, subject):
    native.initialize(subject.inputs)
    native.step(0.3)
    before = native.serialize(native.save())
    native.tangent([subject.output], [subject.first], [1.0])
    assert native.serialize(native.save()) == before


# --- interpolation of inputs
# ----------------------------------------------------------------------------------------


def ramp_response(name: str, time: float, inputs: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Return outputs after ``time`` from rest; inputs are straight lines, more states."""
    a, b, c, d = oracle.matrices(name)
    zero = np.zeros
    whole = np.block([[a, b, zero((3, 2))], [zero((2, 5)), np.eye(2)], [zero((2, 7))]])
    end = expm(whole * time) @ np.concatenate([zero(3), inputs, slopes])
    return c @ end[:3] + d @ end[3:5]


@actuators_only
@pytest.mark.parametrize("size", [0.01, 0.5, 10.0])
def test_inputs_with_slopes_follow_the_ramp_response(native, name, load, size):
    scale = np.array([0.9, 1e-3 if load == "length_change" else 1.0])
    slopes = np.array([0.3, 0.2]) * scale
    native.initialize({"current": scale[0], load: scale[1]})
    for k in range(6):
        native.do(
            "fmi2SetRealInputDerivatives",
            native.references(["current", load]),
            2,
            integers(1, 1),
            doubles(*slopes),
        )
        native.step(size)
        expected = ramp_response(name, (k + 1) * size, scale, slopes)
        assert native.get(*oracle.OUTPUTS[name]) == pytest.approx(expected, rel=1e-7)
        assert native.get("current", load) == pytest.approx(
            scale + slopes * (k + 1) * size, rel=1e-12
        )


def test_slopes_hold_for_one_step_only(native, subject):
    native.initialize(subject.inputs)
    slope = doubles(0.5 * subject.inputs[subject.first])
    native.do(
        "fmi2SetRealInputDerivatives", native.references([subject.first]), 1, integers(1), slope
    )
    native.step(0.1)
    native.step(0.1)
    assert native.get(subject.first) == [pytest.approx(1.05 * subject.inputs[subject.first])]


@actuators_only
def test_slope_of_one_input_leaves_the_other_alone(native, name, load):
    native.initialize({"current": 0.9, load: 1e-3})
    native.do(
        "fmi2SetRealInputDerivatives", native.references([load]), 1, integers(1), doubles(1e-3)
    )
    native.step(1.0)
    expected = ramp_response(name, 1.0, np.array([0.9, 1e-3]), np.array([0.0, 1e-3]))
    assert native.get(*oracle.OUTPUTS[name]) == pytest.approx(expected, rel=1e-7)


def test_sampled_laws_see_the_interpolated_input(built):
    """A lag driven by a ramp, sampled ten times within one step; closed form of the response."""
    rate, slope = 3.0, 0.4
    with instance(built(Sampler, "native")) as one:
        one.initialize({"x_start": 0.0})
        one.do("fmi2SetRealInputDerivatives", one.references(["u"]), 1, integers(1), doubles(slope))
        one.step(0.95)
        expected = slope * (0.9 - (1.0 - math.exp(-rate * 0.9)) / rate)
        assert one.get("last") == [pytest.approx(expected, rel=1e-7)]


@pytest.mark.parametrize("cls", [Sampler, Oscillator])
def test_other_models_declare_the_same(built, cls, runtime):
    native = runtime == "native"
    assert abilities(built(cls, runtime))["canInterpolateInputs"] == native
    with instance(built(cls, runtime)) as one:
        one.initialize()
        status = one.call(
            "fmi2SetRealInputDerivatives", one.references(["u"]), 1, integers(1), doubles(1.0)
        )
        assert status == (OK if native else ERROR)
