"""Line 11: promises of the model description are kept; anything else is refused cleanly."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Sequence
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from fmpy.fmi3 import FMU3Model
from scipy.linalg import expm

from fmus.kit import Component, Input, Output, Parameter, State, absolute, hypot, sqrt
from fmus.kit.build.building import build
from fmus.kit.build.toolchain import host_platform
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


class Cusps(Component):
    """Laws whose differentiation has 0 times infinity at zero, or a root of a negative number."""

    name = "cusps"

    head = Parameter(0.0, "1", min=0, max=9, doc="level from which it flows")
    u = Input("1", doc="first input")
    v = Input("1", doc="second input")
    x = State("1", rate="flow", start=0.0, output=True, doc="what has flown")

    def flow(self):
        return self.head * sqrt(self.head) - self.x * sqrt(self.x)

    @Output("1")
    def size(self):
        """Length of both inputs."""
        return hypot(self.u, self.v)

    @Output("1")
    def spread(self):
        """Root of the mean square."""
        return sqrt(self.u * self.u) + 3.0 * self.v

    @Output("1")
    def broken(self):
        """No number on either side."""
        return sqrt(-absolute(self.u))


@pytest.fixture
def cusps(built):
    with instance(built(Cusps, "native")) as one:
        yield one


def test_what_differentiation_gives_no_number_for_is_a_difference(cusps):
    """Against the limits of the difference quotient: of x^1.5 from the right, of |u| from both."""
    cusps.initialize()
    before = cusps.everything()
    near = {"abs": 2e-4, "rel": 1e-6}
    assert cusps.tangent(["der(x)"], ["x"], [1.0]) == pytest.approx([0.0], **near)
    assert cusps.tangent(["der(x)"], ["x"], [-1e6]) == pytest.approx([0.0], abs=2e2)
    assert cusps.tangent(
        ["spread", "size", "x"], ["u", "v", "x"], [2.0, 4.0, 5.0]
    ) == pytest.approx([12.0, 0.0, 5.0], **near)
    assert cusps.tangent(["spread"], ["u", "v"], [0.0, 0.0]) == [0.0]
    assert cusps.everything() == before
    cusps.set({"u": 3.0, "v": 4.0})
    assert cusps.tangent(["size", "spread"], ["u", "v"], [1.0, 0.5]) == pytest.approx(
        [1.0, 2.5], rel=1e-14
    )


def test_a_difference_stays_in_the_range_of_a_parameter(cusps):
    """Half a power beyond zero would be a number, and is outside."""
    cusps.do("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
    cusps.do("fmi2EnterInitializationMode")
    assert cusps.tangent(["der(x)"], ["head"], [1.0]) == pytest.approx([0.0], abs=2e-4)


def test_adjoint_derivatives_have_numbers_there_too(tmp_path):
    path = tmp_path / "cusps.fmu"
    path.write_bytes(build(Cusps, "native", [host_platform()], fmi=3))
    folder = fmpy.extract(str(path), str(tmp_path / "unzipped"))
    described = fmpy.read_model_description(folder)
    vr = {v.name: v.valueReference for v in described.modelVariables}
    one = FMU3Model(
        guid=described.guid, unzipDirectory=folder, modelIdentifier="cusps", instanceName="one"
    )
    one.instantiate()
    one.enterInitializationMode()
    one.exitInitializationMode()
    for unknowns, weights, expected in (
        (("der(x)", "size"), [1.0, 1.0], [0.0, 0.0]),
        (("spread", "size"), [2.0, 1.0], [0.0, 6.0]),
    ):
        knowns = ("x", "u") if unknowns[0] == "der(x)" else ("u", "v")
        found = one.getAdjointDerivative(
            [vr[name] for name in unknowns], [vr[name] for name in knowns], weights
        )
        assert found == pytest.approx(expected, abs=2e-4)
    one.freeInstance()


def test_a_derivative_that_is_not_there_is_an_error(cusps):
    cusps.initialize()
    vr, seed, result = cusps.references(["broken"]), doubles(1.0), doubles(0.0)
    cusps.set({"u": 1.0})
    function = "fmi2GetDirectionalDerivative"
    assert cusps.call(function, vr, 1, cusps.references(["u"]), 1, seed, result) == ERROR
    assert cusps.messages == [f"{function}: the derivative of 'broken' is not a finite number"]


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
