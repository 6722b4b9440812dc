"""Both builds of the galvanostat as FMUs: contract, reference results, and no way from the voltage to the current."""

import csv
import math
import sys
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

import fmus.galvanostat
from fmus.kit.build import RUNTIMES
from orchestration.fmu import Fmu
from tests import hosts
from tests.contract.raw import ERROR, OK, doubles, instance, integers

FOLDER = Path(fmus.galvanostat.__file__).parent
NAME = "galvanostat"


@pytest.fixture
def archive(fmu, runtime):
    return fmu(NAME, runtime)


def test_fmpy_finds_no_problem(archive):
    assert validate_fmu(str(archive)) == []


def test_units_types_and_descriptions(archive):
    description = fmpy.read_model_description(str(archive), validate=True)
    types = {v.name: v.type for v in description.modelVariables}
    assert {n for n, t in types.items() if t == "Boolean"} == {"potentiostat", "saturated", "recovering"}
    for v in description.modelVariables:
        assert v.description
        assert v.type != "Real" or v.unit
    with zipfile.ZipFile(archive) as opened:
        root = ElementTree.fromstring(opened.read("modelDescription.xml"))
    units = {u.attrib["name"]: {k: int(p) for k, p in u.find("BaseUnit").attrib.items()} for u in root.iter("Unit")}
    assert units == {
        "1": {}, "s": {"s": 1}, "A": {"A": 1}, "A/s": {"A": 1, "s": -1}, "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
        "A/V": {"kg": -1, "m": -2, "s": 3, "A": 2}, "A/V/s": {"kg": -1, "m": -2, "s": 2, "A": 2},
    }  # fmt: skip


def test_the_voltage_reaches_the_current_through_samples_only(archive):
    """So no algebraic loop closes through an actuator."""
    description = fmpy.read_model_description(str(archive), validate=True)
    known = {u.variable.name: {k.name for k in u.dependencies} for u in description.outputs}
    assert known == {
        "current": {"current_command", "lagged_current"}, "saturated": {"current_command"}, "recovering": set(),
    }  # fmt: skip


def test_what_is_in_the_archive(archive, runtime):
    with zipfile.ZipFile(archive) as opened:
        names = opened.namelist()
        page = opened.read("documentation/index.html").decode()
        assert opened.read("model.png") == (FOLDER / "model.png").read_bytes()
    for v in fmus.component(NAME).layout.variables:
        assert v.name in page
    assert "resources/presets/ha_151.ssv" in names
    assert ("documentation/externalDependencies.txt" in names) == (runtime == "python")


# --- reference results ------------------------------------------------------------------------------------------------


def rows(path):
    header, *body = csv.reader(path.read_text().splitlines())
    return header, np.array(body, dtype=float)


def test_fmu_reproduces_the_reference_result(archive):
    wanted, expected = rows(FOLDER / "reference" / f"{NAME}_ref.csv")
    fed, stimuli = rows(FOLDER / "reference" / f"{NAME}_in.csv")
    after = np.append(np.diff(expected[:, 0]) > 0.0, True)  # the last row of a repeated time is that after a jump
    times = expected[after, 0]
    jumps = np.append(np.diff(stimuli[:, 0]) > 0.0, True)
    held = np.searchsorted(stimuli[jumps, 0], times + 1e-9, side="right") - 1
    inputs = {signal: stimuli[jumps, i][held] for i, signal in enumerate(fed) if i}
    found = hosts.run_fmpy(archive, times, inputs, wanted[1:])
    for i, signal in enumerate(wanted[1:], 1):
        assert found[signal] == pytest.approx(expected[after, i], rel=1e-7, abs=1e-9), signal
        assert len(set(expected[:, i])) > 1, "the reference result shows something of each output"


# --- two builds, one behaviour ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "parameters",
    [{}, {"potentiostat": True}, {"response_time": 5e-4, "control_tolerance": 1e-3}, {"protection_period": 0.037}],
    ids=["galvanostat", "potentiostat", "options", "period"],
)
def test_builds_agree(fmu, parameters):
    rng = np.random.default_rng(7)
    time = np.concatenate([[0.0], np.cumsum(rng.choice([0.001, 0.01, 0.0123, 0.1, 0.5], 1500))])
    n = len(time)
    inputs = {
        "current_command": rng.normal(size=n), "voltage": rng.normal(size=n) * np.where(time > 50.0, 15.0, 1.0),
        "voltage_limit": np.where(time > 50.0, 100.0, 2.0), "voltage_command": rng.normal(size=n),
    }  # fmt: skip
    results = {}
    for runtime in RUNTIMES:
        with Fmu(fmu(NAME, runtime), parameters) as one:
            one.start(0.0, float(time[-1]))
            results[runtime] = one.run(time, inputs)
    for name in ("current", "saturated", "recovering"):
        np.testing.assert_allclose(results["python"][name], results["native"][name], rtol=1e-9, atol=1e-12)
        assert len(set(results["native"][name].tolist())) > 1


# --- contract ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parameter", "value"),
    [("current_limit", 0.0), ("compliance_voltage", -1.0), ("response_time", -1.0), ("recovery_time", -1e-3),
     ("protection_period", 0.0), ("control_period", 0.0), ("control_tolerance", -1.0), ("integral_gain", 1e10)],
)  # fmt: skip
def test_impossible_parameters_are_refused_with_a_sentence(archive, parameter, value):
    with instance(archive) as one:
        one.do("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
        one.set({parameter: value})
        one.do("fmi2EnterInitializationMode")
        assert one.call("fmi2ExitInitializationMode") == ERROR
        assert f"parameter '{parameter}'" in one.messages[0]
        assert "is outside its range" in one.messages[0]


@pytest.mark.parametrize("name", ["current_command", "voltage", "voltage_limit", "voltage_command"])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_inputs_that_are_no_numbers_are_refused(archive, name, value):
    with instance(archive) as one:
        one.initialize()
        assert one.call("fmi2SetReal", one.references([name]), 1, doubles(value)) == ERROR
        assert f"'{name}' = " in one.messages[0]
        one.step(0.1)


@pytest.mark.parametrize("name", ["current_command", "voltage", "voltage_limit", "voltage_command"])
@pytest.mark.parametrize("potentiostat", [0.0, 1.0])
def test_enormous_inputs_give_a_finite_current(archive, name, potentiostat):
    with instance(archive) as one:
        one.initialize({"potentiostat": potentiostat})
        for value in (1e300, -1e300, 0.0, 1.0):
            assert one.call("fmi2SetReal", one.references([name]), 1, doubles(value)) == OK
            one.step(0.1)
            assert abs(one.get("current")[0]) <= 1.3
            assert all(math.isfinite(v) for v in one.everything())


def test_a_recovery_goes_on_from_a_saved_state(archive):
    with instance(archive) as one:
        one.initialize({"voltage_limit": 1.0, "current_command": 0.7})
        one.set({"voltage": 2.0})
        one.step(0.025)
        one.set({"voltage": 0.0})
        one.step(0.1)
        state, time = one.save(), one.time

        def rest():
            one.time = time
            trail = []
            for _ in range(60):
                one.step(0.0123)
                trail += one.everything()
            return trail

        first = rest()
        one.restore(state)
        assert rest() == first
        one.forget(state)
        assert one.get("current", "recovering") == [0.7, 0]


def test_any_communication_step_ends_the_recovery_at_the_same_instant(archive):
    """Begun by the sample at 0 s, over at 0.5 s: seen after the step that begins there."""
    for size in (0.0013, 0.01, 0.07, 0.3):
        with instance(archive) as one:
            one.initialize({"voltage_limit": 1.0, "current_command": 0.7, "voltage": 2.0})
            one.step(min(size, 0.004))
            one.set({"voltage": 0.0})
            while one.time < 1.0:
                recovering, current = one.get("recovering", "current")
                assert bool(recovering) == (one.time < 0.5 + 1e-9), (size, one.time)
                assert current == (0.0 if recovering else 0.7)
                one.step(size)


def test_directional_derivatives(fmu):
    with instance(fmu(NAME, "native")) as one:
        one.initialize({"current_command": 0.5})
        assert one.tangent(["current"], ["current_command"], [1.0]) == [1.0]
        one.set({"current_command": 2.0})
        assert one.tangent(["current"], ["current_command"], [1.0]) == [0.0]
        one.set({"current_command": 0.5, "voltage": 9.0, "voltage_limit": 1.0})
        one.step(0.1)
        assert one.tangent(["current"], ["current_command"], [1.0]) == [0.0]


def test_reset_then_run_is_a_fresh_run(archive):
    def run(one):
        trail = []
        one.initialize({"voltage_limit": 1.0, "response_time": 1e-3})
        for k in range(100):
            one.set({"current_command": math.sin(k), "voltage": 1.5 * math.sin(0.2 * k)})
            one.step(0.013)
            trail += one.everything()
        return trail

    with instance(archive) as one:
        first = run(one)
        one.do("fmi2Reset")
        assert run(one) == first
    with instance(archive) as other:
        assert run(other) == first


def test_start_time_moves_the_sample_instants_along(archive):
    trails = []
    for start in (0.0, 3.7, 1000.0):
        with instance(archive) as one:
            one.initialize({"voltage_limit": 1.0, "current_command": 0.7, "voltage": 2.0}, start=start)
            one.step(0.004)
            one.set({"voltage": 0.0})
            trail = []
            for _ in range(100):
                one.step(0.007)
                trail += one.get("current", "recovering")
            trails.append(trail)
    assert trails[0] == trails[1] == trails[2]
    assert {0.0, 0.7} <= set(trails[0])


@pytest.mark.parametrize("response", [0.0, 0.05])
def test_current_follows_a_command_with_a_slope(fmu, response):
    """Native build: ramp response of the lag, in closed form."""
    with instance(fmu(NAME, "native")) as one:
        one.initialize({"response_time": response})
        for k in range(10):
            one.do("fmi2SetRealInputDerivatives", one.references(["current_command"]), 1, integers(1), doubles(0.8))
            one.step(0.033)
            time = (k + 1) * 0.033
            lag = response * -math.expm1(-time / response) if response else 0.0
            assert one.get("current")[0] == pytest.approx(0.8 * (time - lag), rel=1e-7, abs=1e-8)


@pytest.mark.skipif(sys.platform != "linux", reason="the hosts of the tests run on Linux")
@pytest.mark.parametrize("master", ["run_libcosim", "run_ecos"])
def test_both_builds_run_in_real_masters(archive, master):
    time = 0.125 * np.arange(81)
    inputs = {
        "current_command": np.sin(time) * 2.0, "voltage": 1.2 * np.sin(0.9 * time), "voltage_limit": np.full(81, 1.0),
    }  # fmt: skip
    expected = hosts.run_fmpy(archive, time, inputs, ["current"], {"recovery_time": 0.3}, feedthrough=False)
    found = getattr(hosts, master)(archive, time, inputs, ["current"], {"recovery_time": 0.3})
    assert found["current"][1:] == pytest.approx(expected["current"][1:], rel=1e-9, abs=1e-12)
    assert len(set(np.sign(expected["current"]))) == 3
