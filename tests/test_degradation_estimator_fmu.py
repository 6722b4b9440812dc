"""Both builds of the degradation estimator as FMUs: contract, reference result, and one behaviour."""

import csv
import itertools
import math
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

import fmus.degradation_estimator
from fmus import component
from fmus.kit.build import RUNTIMES
from orchestration.fmu import Fmu
from orchestration.rig.emulator import EmulatedRig, RigParameters
from orchestration.stimuli import square_wave
from tests import hosts
from tests.contract.raw import ERROR, OK, doubles, instance

FOLDER = Path(fmus.degradation_estimator.__file__).parent
NAME = "degradation_estimator"
FAST = {"settling_time": 10.0, "minimum_reversals": 3, "least_squares_time": 5.0, "forgetting_time": 30.0}


@pytest.fixture
def archive(fmu, runtime):
    return fmu(NAME, runtime)


def record(duration, seed=1, noise=4e-3):
    time = 0.1 * np.arange(round(duration / 0.1))
    current = square_wave(time, 0.9, 0.2)
    rig = EmulatedRig(RigParameters(), seed=seed, voltage_noise=noise)
    return time, current, rig.run(time, current, np.zeros_like(time))["voltage"]


# --- archive ----------------------------------------------------------------------------------------------------------


def test_fmpy_finds_no_problem(archive):
    assert validate_fmu(str(archive)) == []


def test_signals_units_and_types(archive):
    description = fmpy.read_model_description(str(archive), validate=True)
    about = {v.name: v for v in description.modelVariables}
    outputs = {v.name: v.unit for v in description.modelVariables if v.causality == "output"}
    assert outputs == {
        "R1": "ohm", "R2": "ohm", "C": "F", "impedance": "ohm", "impedance_change": "1", "voltage_limit": "V",
        "estimate_valid": None,
    }  # fmt: skip
    assert {n: about[n].unit for n in about if about[n].causality == "input"} == {"current": "A", "voltage": "V"}
    assert {n for n in about if about[n].type == "Boolean"} == {
        "instrumental_variable", "zero_order_hold", "estimate_valid", "estimate_valid_start",
    }  # fmt: skip
    assert all(len(v.description) > 8 for v in about.values())
    assert all(not u.dependencies for u in description.outputs)  # all through samples: no algebraic loop
    with zipfile.ZipFile(archive) as opened:
        root = ElementTree.fromstring(opened.read("modelDescription.xml"))
    units = {u.attrib["name"]: {k: int(p) for k, p in u.find("BaseUnit").attrib.items()} for u in root.iter("Unit")}
    ohm = {"kg": 1, "m": 2, "s": -3, "A": -2}
    assert units == {
        "1": {}, "s": {"s": 1}, "A": {"A": 1}, "V": {"kg": 1, "m": 2, "s": -3, "A": -1}, "ohm": ohm,
        "F": {"kg": -1, "m": -2, "s": 4, "A": 2}, "rad/s": {"rad": 1, "s": -1},
    }  # fmt: skip


def test_what_is_in_the_archive(archive, runtime):
    with zipfile.ZipFile(archive) as opened:
        names = opened.namelist()
        page = opened.read("documentation/index.html").decode()
        assert opened.read("model.png") == (FOLDER / "model.png").read_bytes()
        preset = ElementTree.fromstring(opened.read("resources/presets/thesis_10_hz.ssv"))
    for v in component(NAME).layout.variables:
        assert v.name in page
    values = {p.attrib["name"]: (p[0].tag.split("}")[1], p[0].attrib["value"]) for p in preset.iter() if len(p) == 1
              and p.tag.endswith("}Parameter")}  # fmt: skip
    assert values["instrumental_variable"] == ("Boolean", "false")
    assert values["reset_interval"] == ("Real", "10.0")
    packed = [name for name in names if name.endswith("degradation_estimator/recursion.py")]
    assert len(packed) == (1 if runtime == "python" else 0)


# --- results ----------------------------------------------------------------------------------------------------------


def rows(path):
    header, *body = csv.reader(path.read_text().splitlines())
    return header, np.array(body, dtype=float)


def test_fmu_reproduces_the_reference_result(archive):
    wanted, expected = rows(FOLDER / "reference" / f"{NAME}_ref.csv")
    fed, stimuli = rows(FOLDER / "reference" / f"{NAME}_in.csv")
    jumps = np.append(np.diff(stimuli[:, 0]) > 0.0, True)
    expected = expected[np.append(np.diff(expected[:, 0]) > 0.0, True)]  # one row of each jump
    times = expected[:, 0]
    held = np.searchsorted(stimuli[jumps, 0], times + 1e-9, side="right") - 1
    inputs = {signal: stimuli[jumps, i][held] for i, signal in enumerate(fed) if i}
    found = hosts.run_fmpy(archive, times, inputs, wanted[1:])
    for i, signal in enumerate(wanted[1:], 1):
        assert found[signal] == pytest.approx(expected[:, i], rel=1e-7, abs=1e-9), signal
        assert len(set(expected[:, i])) > 1, "the reference result shows something of each output"


@pytest.mark.parametrize(
    "parameters",
    [{}, FAST, FAST | {"instrumental_variable": False, "zero_order_hold": False, "reset_interval": 3.0},
     FAST | {"sample_period": 0.037, "maximum_trace": 10.0}],
    ids=["default", "fast", "thesis", "bounded"],
)  # fmt: skip
def test_builds_agree(fmu, parameters):
    steps = np.random.default_rng(7).choice([0.01, 0.1, 0.123, 0.5], 800)
    time = np.concatenate([[0.0], np.cumsum(steps)])
    current = square_wave(time, 0.9, 0.2)
    voltage = EmulatedRig(RigParameters(), seed=3).run(time, current, np.zeros_like(time))["voltage"]
    results = {}
    for runtime in RUNTIMES:
        with Fmu(fmu(NAME, runtime), parameters) as one:
            one.start(0.0, float(time[-1]))
            results[runtime] = one.run(time, {"current": current, "voltage": voltage})
    for name, expected in results["native"].items():
        np.testing.assert_allclose(results["python"][name], expected, rtol=1e-9, atol=1e-12, err_msg=name)
    assert results["native"]["R2"][-1] > 0.0
    assert results["native"]["estimate_valid"].any()


def test_any_communication_step_takes_the_same_samples(archive):
    """Inputs held for whole sample periods: smaller or larger communication steps change nothing."""
    _, current, voltage = record(30.0)
    results = []
    for parts in (1, 3, 7):
        with instance(archive) as one:
            one.initialize(FAST)
            trail = []
            for i, v in zip(current, voltage, strict=True):
                one.set({"current": i, "voltage": v})
                for _ in range(parts):
                    one.step(0.1 / parts)
                trail.append(one.get("R1", "R2", "C", "impedance", "estimate_valid", "voltage_limit"))
            results.append(trail)
    assert results[0][-1][4] == 1
    for other in results[1:]:
        assert other == results[0]
    with instance(archive) as one:  # steps over many samples
        one.initialize({"current": 0.9, "voltage": 0.3})
        one.step(1000.0)
        assert one.get("samples") == [10000.0]


# --- contract ---------------------------------------------------------------------------------------------------------


def test_saved_states_and_resets_give_the_same_bits(archive):
    _, current, voltage = record(40.0)
    pairs = list(zip(current.tolist(), voltage.tolist(), strict=True))

    def go(one, part):
        trail = []
        for i, v in part:
            one.set({"current": i, "voltage": v})
            one.step(0.1)
            trail += one.everything()
        return trail

    with instance(archive) as one, instance(archive) as two:
        one.initialize(FAST)
        first = go(one, pairs[:200])
        state, time = one.save(), one.time
        block = one.serialize(state)
        rest = go(one, pairs[200:])
        one.restore(state)
        one.time = time
        assert go(one, pairs[200:]) == rest
        one.forget(state)
        assert one.get("estimate_valid") == [1]
        one.do("fmi2Reset")
        one.initialize(FAST)
        assert go(one, pairs[:200]) == first
        two.initialize(FAST)
        two.restore(two.deserialize(block))
        two.time = time
        assert go(two, pairs[200:]) == rest


def bounds():
    parameters = component(NAME).layout.parameters
    return [(p, v) for p in parameters for v in (p.min, p.max) if math.isfinite(v) and p.type != "boolean"]


def test_every_bound_holds_and_is_allowed(archive):
    with instance(archive) as one:
        for p, bound in bounds():
            beyond = (bound - max(1.0, abs(bound))) if bound == p.min else (bound + max(1.0, abs(bound)))
            one.do("fmi2Reset")
            one.messages.clear()
            one.do("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
            one.set({p.name: beyond})
            one.do("fmi2EnterInitializationMode")
            assert one.call("fmi2ExitInitializationMode") == ERROR, p.name
            assert f"parameter '{p.name}'" in one.messages[0]
            one.set({p.name: bound, "current": 0.9, "voltage": 0.4})
            one.do("fmi2ExitInitializationMode")
            one.time = 0.0
            for _ in range(3):
                one.step(0.1)
            assert all(math.isfinite(value) for value in one.everything()), p.name


@pytest.mark.parametrize("name", ["current", "voltage"])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_inputs_that_are_no_numbers_are_refused(archive, name, value):
    with instance(archive) as one:
        one.initialize()
        assert one.call("fmi2SetReal", one.references([name]), 1, doubles(value)) == ERROR
        assert f"'{name}' = " in one.messages[0]
        one.step(0.1)


def test_absurd_readings_leave_numbers_and_are_forgotten(archive):
    _, current, voltage = record(200.0, noise=0.0)
    with instance(archive) as one:
        one.initialize(FAST)
        for i, v in itertools.product((1e308, -1e308, 0.5), (1e308, -1e308, 0.5)):
            one.set({"current": i, "voltage": v})
            assert one.call("fmi2DoStep", one.time, 0.1, 1) == OK
            one.time += 0.1
        for i, v in zip(current, voltage, strict=True):
            one.set({"current": i, "voltage": v})
            one.step(0.1)
        assert all(math.isfinite(value) for value in one.everything())
        assert one.get("R1", "R2", "C") == pytest.approx([0.43, 2.35, 2.70], rel=1e-3)
