"""The bench as an FMU in both builds: one behaviour, sample instants, dependencies and
derivatives.
"""

import math
import sys

import fmpy
import numpy as np
import pytest

from tests.contract.raw import doubles, instance, integers

NAME = "voice_coil_dma"
SIGNALS = (
    "position",
    "velocity",
    "coil_current",
    "coil_voltage",
    "force_measured",
    "position_measured",
)
T = 1.0 / 30.0

pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="an FMU in use cannot be removed there"
)


@pytest.fixture
def archive(fmu, runtime):
    return fmu(NAME, runtime)


@pytest.fixture
def one(archive):
    with instance(archive) as created:
        yield created


def drive(one, count, size, shift=0):
    """Outputs after each of some steps with inputs that move."""
    found = []
    for k in range(shift, shift + count):
        one.set(
            {"force_reference": 1.0 + math.sin(0.7 * k), "tension": 1.0 + 0.5 * math.sin(0.31 * k)}
        )
        one.step(size)
        found.append(one.get(*SIGNALS))
    return np.array(found)


@pytest.mark.parametrize(
    "values", [{}, {"converters_on": 1}, {"controller_on": 0}, {"anti_windup": 0}], ids=str
)
def test_builds_agree(fmu, values):
    runs = []
    for runtime in ("python", "native"):
        with instance(fmu(NAME, runtime)) as one:
            one.initialize(values)
            runs.append(
                np.concatenate(
                    [drive(one, 60, 0.007), drive(one, 20, 0.1, 60), drive(one, 40, T / 3, 80)]
                )
            )
    assert np.abs(runs[0] - runs[1]).max(axis=0) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("size", [1e-3, 0.004, T, T / 7, 0.1])
@pytest.mark.parametrize("start", [0.0, 3600.0])
def test_samples_are_at_their_instants_whatever_the_step(one, size, start):
    """Open loop, the command being the number of the step: the output shows in which step it was
    sampled.
    """
    one.initialize({"controller_on": 0, "voltage_max": 100.0}, start=start)
    seen = []
    for k in range(60):
        one.set({"force_reference": float(k)})
        one.step(size)
        seen.append(one.get("coil_voltage")[0])
    # the latest instant before the end of step k; an instant at that end belongs to the next step
    latest = [math.ceil((k + 1) * size / T - 1e-6) - 1 for k in range(60)]
    sampled_in = [math.floor(n * T / size + 1e-6) for n in latest]
    assert seen == [float(n) for n in sampled_in]


def test_declared_dependencies_are_those_of_the_equations(archive, runtime):
    """A build in Python, of which no host can derive by a state, names none."""
    description = fmpy.read_model_description(str(archive), validate=True)

    def told(unknowns):
        return {u.variable.name: {k.name for k in u.dependencies} for u in unknowns}

    outputs = {
        "coil_current": {"coil_current"},
        "position": {"position"},
        "velocity": {"velocity"},
        "coil_voltage": set(),
        "force_measured": {"force_filtered"},
        "position_measured": {"position_filtered"},
    }
    if runtime == "python":
        assert told(description.outputs) == {name: set() for name in outputs}
        assert told(description.derivatives) == {}
        return
    assert told(description.outputs) == outputs
    assert told(description.derivatives) == {
        "der(coil_current)": {"coil_current", "velocity"},
        "der(position)": {"velocity"},
        "der(velocity)": {"coil_current", "velocity", "tension"},
        "der(force_filtered)": {"force_filtered", "tension"},
        "der(position_filtered)": {"position", "position_filtered"},
    }


def test_directional_derivatives_are_the_matrices_of_the_equations(fmu):
    states = ["coil_current", "position", "velocity", "force_filtered", "position_filtered"]
    corner = 2 * np.pi * 100.0
    a = np.array(
        [
            [-3000.0, 0, -3900.0, 0, 0],
            [0, 0, 1, 0, 0],
            [130.0, 0, -200.0, 0, 0],
            [0, 0, 0, -corner, 0],
            [0, corner, 0, 0, -corner],
        ]
    )
    with instance(fmu(NAME, "native")) as one:
        one.initialize({"force_reference": 1.0, "tension": 0.5})
        one.step(0.05)
        rates = [f"der({s})" for s in states]
        found = np.array([one.tangent(rates, [s], [1.0]) for s in states]).T
        np.testing.assert_allclose(found, a, rtol=1e-12)
        assert one.tangent(rates, ["tension"], [1.0]) == pytest.approx(
            [0, 0, -1 / 0.03, corner, 0], rel=1e-12
        )
        assert one.tangent(rates, ["force_reference"], [1.0]) == [0.0] * 5


def test_a_tension_with_a_slope_is_followed(fmu):
    """Open loop at 0 V: the filter's answer to a ramp is the ramp less slope / corner, once
    settled.
    """
    corner, slope = 2 * np.pi * 100.0, 0.4
    with instance(fmu(NAME, "native")) as one:
        one.initialize({"controller_on": 0})
        one.do(
            "fmi2SetRealInputDerivatives",
            one.references(["tension"]),
            1,
            integers(1),
            doubles(slope),
        )
        one.step(0.05)
        exact = slope * (0.05 - (1 - math.exp(-corner * 0.05)) / corner)
        assert one.get("force_measured") == [pytest.approx(exact, rel=1e-7)]
