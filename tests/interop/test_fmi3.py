"""Claims: the build of FMI 3.0 computes in fmpy what that of FMI 2.0 does, to the same bits in
co-simulation; its solvers reach closed forms; its derivatives and its states are right.
"""

from __future__ import annotations

import contextlib
import ctypes
import shutil
import zipfile
from fractions import Fraction
from math import prod
from xml.etree import ElementTree

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.build import build_platform_binary
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmpy.validation import validate_fmu

import fmus
from fmus import component, effects
from fmus.kit import Component, Input, Output, State, maximum, sqrt, stack
from fmus.kit.build.building import RUNTIMES, build, build_cached
from fmus.kit.build.toolchain import host_platform
from tests.support.exchange import both_ways, distance
from tests.support.stimuli import STIMULI

# of every build all that it can
KINDS = [("native", "CoSimulation"), ("native", "ModelExchange"), ("python", "CoSimulation")]
SAMPLED = [name for name in STIMULI if component(name).layout.sampled]


def table_of(stop, step, stimuli):
    """A sine for each input, at communication points."""
    time = np.arange(0.0, stop, step)
    table = np.zeros(time.size, [("time", float), *((name, float) for name in stimuli)])
    table["time"] = time
    for name, (mean, size, speed) in stimuli.items():
        table[name] = mean + size * np.sin(speed * time)
    return table


def simulated(path, name, **options):
    """Simulate a component over its stimuli by fmpy."""
    stop, step, stimuli = STIMULI[name]
    table = table_of(stop, step, stimuli)
    return simulate_fmu(
        str(path), stop_time=table["time"][-1], output_interval=step, input=table, **options
    )


@contextlib.contextmanager
def opened(path, folder, exchange=False, **given):
    """Open an instance in fmpy, before its initialization."""
    description = read_model_description(str(path))
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    kind = FMU3Model if exchange else FMU3Slave
    interface = description.modelExchange if exchange else description.coSimulation
    one = kind(
        guid=description.guid,
        modelIdentifier=interface.modelIdentifier,
        unzipDirectory=str(folder),
        instanceName="one",
    )
    one.instantiate(**given)
    try:
        yield one, {v.name: v.valueReference for v in description.modelVariables}, description
    finally:
        one.freeInstance()


def initialized(one):
    one.enterInitializationMode()
    one.exitInitializationMode()


@pytest.mark.filterwarnings("ignore:.*missing input")
@pytest.mark.parametrize("name", STIMULI)
def test_co_simulation_gives_the_bits_of_fmi_2(fmu, name, runtime):
    of_2, of_3 = (
        simulated(fmu(name, runtime, fmi), name, fmi_type="CoSimulation") for fmi in (2, 3)
    )
    assert of_2.dtype.names == of_3.dtype.names
    assert of_2.tobytes() == of_3.tobytes()
    assert max(np.ptp(of_3[output].astype(float)) for output in of_3.dtype.names[1:]) > 0.0


@pytest.mark.filterwarnings("ignore:.*missing input")
@pytest.mark.parametrize("name", STIMULI)
def test_cvode_computes_what_co_simulation_of_fmi_2_does(fmu, name):
    moved = 0
    for output, (found, expected) in both_ways(
        *(fmu(name, "native", 3), fmu(name, "native")),
        *STIMULI[name],
        solver="CVode",
        relative_tolerance=1e-9,
    ).items():
        assert distance(found, expected) <= 5e-6, output
        moved += np.ptp(expected) > 0.0
    assert moved, "nothing moved"


@pytest.mark.filterwarnings("ignore:.*missing input")
@pytest.mark.parametrize("name", STIMULI)
def test_builds_agree_in_event_mode(fmu, name):
    """Within what builds of FMI 2.0 are allowed."""
    handled = {"use_event_mode": True, "early_return_allowed": True}
    native, python = (
        simulated(fmu(name, build, 3), name, fmi_type="CoSimulation", **handled)
        for build in RUNTIMES
    )
    assert native["time"].tobytes() == python["time"].tobytes()
    for output in native.dtype.names[1:]:
        assert distance(python[output], native[output]) <= 1e-9, output


@pytest.mark.parametrize(("runtime", "kind"), KINDS)
def test_charge_and_displacement_follow_their_closed_forms(fmu, runtime, kind):
    """Under constant current and load: eq. 3.9 for the charge, a Burgers body for the creep."""
    current, force = 0.25, 0.4
    found = simulate_fmu(
        str(fmu("ppy_actuator", runtime, 3)),
        stop_time=30.0,
        output_interval=0.5,
        start_values={"current": current, "force": force},
        output=["charge", "kelvin_elongation", "maxwell_elongation"],
        fmi_type=kind,
        relative_tolerance=1e-9,
    )
    p = {p.name: p.start for p in component("ppy_actuator").layout.parameters}
    t = found["time"]
    expected = {
        "charge": p["R2"] * p["C"] * current * -np.expm1(-t / ((p["R1"] + p["R2"]) * p["C"])),
        "kelvin_elongation": force / p["k2"] * -np.expm1(-t * p["k2"] / p["b2"]),
        "maxwell_elongation": force / p["b1"] * t,
    }
    for output, values in expected.items():
        np.testing.assert_allclose(found[output], values, rtol=0, atol=1e-6 * values.max())


@pytest.mark.parametrize("name", SAMPLED)
def test_a_host_that_handles_events_gets_what_one_without_does(fmu, name, runtime):
    """In event mode, steps end early at samples; between them nothing else happens."""
    stop, step, stimuli = STIMULI[name]
    held = {key: mean for key, (mean, _, _) in stimuli.items()}
    path = str(fmu(name, runtime, 3))

    def run(**options):
        return simulate_fmu(
            path,
            stop_time=min(stop, 40 * step),
            output_interval=step,
            start_values=held,
            fmi_type="CoSimulation",
            record_events=False,
            **options,
        )

    plain = run()[1:]  # the first row of one who handles events is after that at the start
    handled = run(use_event_mode=True, early_return_allowed=True)
    # of the rows at one time, the first is before the event
    first = np.searchsorted(handled["time"], plain["time"] - 1e-9)
    np.testing.assert_allclose(handled["time"][first], plain["time"], rtol=0, atol=1e-9)
    for output in plain.dtype.names[1:]:
        size = np.abs(plain[output].astype(float)).max() or 1.0
        difference = np.abs(handled[output][first].astype(float) - plain[output].astype(float))
        assert difference.max() <= 1e-6 * size, output


@pytest.mark.parametrize("name", ["ppy_actuator", "galvanostat"])
def test_start_values_are_read_before_initialization(fmu, tmp_path, name, runtime):
    """Of parameters and inputs, as they are declared or set; of outputs there are none yet."""
    with opened(fmu(name, runtime, 3), tmp_path) as (one, names, described):
        starts = {
            v.name: float(v.start)
            for v in described.modelVariables
            if v.type == "Float64" and v.start is not None
        }
        references = [names[name] for name in starts]
        assert one.getFloat64(references) == list(starts.values())
        one.setFloat64(references[:1], [0.25])
        assert one.getFloat64(references[:1]) == [0.25]
        for output in (described.outputs[0].variable.name, "time"):
            with pytest.raises(FMICallException):
                one.getFloat64([names[output]])
        initialized(one)
        assert one.getFloat64([names["time"]]) == [0.0]


@pytest.mark.parametrize(("runtime", "kind"), KINDS)
@pytest.mark.parametrize(("name", "has_states"), [("foot", False), ("ppy_actuator", True)])
def test_an_event_tells_a_host_that_integrates_to_start_its_solver_again(
    fmu, tmp_path, name, has_states, runtime, kind
):
    """By the nominals of states: one that does not integrate has no solver."""
    exchange = kind == "ModelExchange"
    given = {} if exchange else {"eventModeUsed": True}
    with opened(fmu(name, runtime, 3), tmp_path / name, exchange, **given) as (one, _, of):
        assert of.coSimulation.hasEventMode, "or the FMU must refuse eventModeUsed"
        initialized(one)
        _, _, nominals, values, _, _ = one.updateDiscreteStates()
        assert (nominals, values) == (exchange and has_states, False)


@pytest.mark.parametrize(("runtime", "kind"), KINDS)
def test_a_tunable_parameter_is_taken_at_events_and_between_steps(fmu, tmp_path, runtime, kind):
    """A margin is its limit less the load of 1 N."""
    exchange = kind == "ModelExchange"
    given = {} if exchange else {"eventModeUsed": True}
    path = fmu("ppy_actuator", runtime, 3)
    with opened(path, tmp_path / "actuator", exchange, **given) as (one, names, _):
        limit, margin = [names["force_limit"]], [names["force_margin"]]
        one.setFloat64([names["force"]], [1.0])
        initialized(one)
        one.updateDiscreteStates()
        one.setFloat64(limit, [5.0])
        assert one.getFloat64(margin) == [4.0]
        if exchange:
            one.enterContinuousTimeMode()
            one.setFloat64(limit, [5.0])
            with pytest.raises(FMICallException):
                one.setFloat64(limit, [6.0])
        else:
            one.enterStepMode()
            one.setFloat64(limit, [6.0])
            assert one.getFloat64(margin) == [5.0]
            one.doStep(0.0, 0.1)
            one.setFloat64(limit, [5.0])
        with pytest.raises(FMICallException):
            one.setFloat64(limit, [-1.0])
        with pytest.raises(FMICallException):
            one.setFloat64([names["R1"]], [0.5])
        assert one.getFloat64(margin) == [4.0]


def test_samples_cannot_be_evaluated_in_advance(fmu, tmp_path):
    """FMI 3.0 has the call ignored, as nothing says that it is offered."""
    with opened(fmu("galvanostat", "native", 3), tmp_path, exchange=True) as (one, names, of):
        assert not of.modelExchange.providesEvaluateDiscreteStates
        one.enterInitializationMode()
        one.setFloat64([names["voltage"]], [0.5])
        one.exitInitializationMode()
        one.fmi3EvaluateDiscreteStates(one.component)
        assert one.getFloat64([names["sampled_voltage"]]) == [0.0]
        one.updateDiscreteStates()
        assert one.getFloat64([names["sampled_voltage"]]) == [0.5]


def test_steps_end_early_at_samples_only_where_the_host_allows_it(fmu, tmp_path, runtime):
    """The galvanostat converts every millisecond."""
    path = fmu("galvanostat", runtime, 3)
    period = next(p.start for p in component("galvanostat").layout.parameters if "period" in p.name)
    given = {"eventModeUsed": True, "earlyReturnAllowed": True}
    with opened(path, tmp_path / "early", **given) as (one, _, _):
        initialized(one)
        one.updateDiscreteStates()
        one.enterStepMode()
        event, terminate, early, last = one.doStep(0.0, 2.5 * period)
        assert (event, terminate, early) == (True, False, True)
        assert last == pytest.approx(period, rel=1e-12)
        one.enterEventMode()
        needed, *_, defined, following = one.updateDiscreteStates()
        assert not needed
        assert defined
        assert following == pytest.approx(2.0 * period, rel=1e-12)
        one.enterStepMode()
        event, _, early, last = one.doStep(last, 0.5 * period)
        assert (event, early) == (False, False)
        assert last == pytest.approx(1.5 * period, rel=1e-12)
        event, _, early, last = one.doStep(last, 0.5 * period)
        assert (event, early) == (True, False), "a sample at the very end is no early return"
    with opened(path, tmp_path / "late", eventModeUsed=True) as (one, _, _):
        initialized(one)
        one.updateDiscreteStates()
        one.enterStepMode()
        event, _, early, last = one.doStep(0.0, 2.5 * period)
        assert (event, early) == (False, False)
        assert last == pytest.approx(2.5 * period, rel=1e-12)


def test_a_host_that_passes_over_an_event_gets_its_sample_with_the_next_step(
    fmu, tmp_path, runtime
):
    """A sample that is due when a step begins is no reason to end it."""
    path = fmu("galvanostat", runtime, 3)
    period = next(p.start for p in component("galvanostat").layout.parameters if "period" in p.name)
    given = {"eventModeUsed": True, "earlyReturnAllowed": True}
    with opened(path, tmp_path, **given) as (one, names, _):
        one.enterInitializationMode()
        one.setFloat64([names["current_command"]], [0.5])
        one.exitInitializationMode()
        one.enterStepMode()
        ends = [0.0]
        for _ in range(3):
            event, _, early, last = one.doStep(ends[-1], 2.5 * period)
            assert (event, early) == (True, True)
            ends.append(last)
        assert ends == pytest.approx([0.0, period, 2.0 * period, 3.0 * period], rel=1e-12)
        assert one.getFloat64([names["current"]])[0] > 0.0, "samples were made"


def clocked(name, runtime="native"):
    return build_cached(component(name), runtime, 3, clocks=True)


def clocks_of(name, names, starts):
    """Reference, period and first instant of each clock, by what the component declares."""
    values = {p.name: p.start for p in component(name).layout.parameters} | starts
    return [
        (
            names[f"clock[{k + 1}]"],
            values.get(clock.period, clock.period),
            sum(values[shift] for shift in clock.shift),
        )
        for k, (clock, _) in enumerate(component(name).layout.sampled)
    ]


@pytest.mark.parametrize("name", SAMPLED)
def test_clocks_are_declared_where_they_are_asked_for(fmu, name):
    """As the standard allows it: outputs that are triggered, without intervals."""
    assert "Clock" not in {
        v.type for v in read_model_description(fmu(name, "native", 3)).modelVariables
    }
    path = clocked(name)
    assert validate_fmu(str(path)) == []
    described = read_model_description(path)
    clocks = [v for v in described.modelVariables if v.type == "Clock"]
    assert len(clocks) == len(component(name).layout.sampled)
    for clock in clocks:
        assert (clock.causality, clock.intervalVariability) == ("output", "triggered")
        assert clock.intervalDecimal is None
        (dependency,) = (u.dependencies for u in described.outputs if u.variable is clock)
        assert [known.name for known in dependency] == ["time"]


def assert_ticks(ticks, clocks, stop):
    for reference, period, shift in clocks:
        expected = np.arange(shift, stop - 1e-6 * period, period)
        np.testing.assert_allclose(ticks[reference], expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", SAMPLED)
def test_clocks_are_active_at_the_samples_of_a_step(tmp_path, name, runtime):
    """Closed form: at shift + k period, in event mode alone, until the sample is made."""
    given = {"eventModeUsed": True, "earlyReturnAllowed": True}
    with opened(clocked(name, runtime), tmp_path, **given) as (one, names, _):
        clocks = clocks_of(name, names, {})
        references = [reference for reference, *_ in clocks]
        one.enterInitializationMode()
        assert not any(one.getClock(references))
        one.exitInitializationMode()
        longest = max(period + shift for _, period, shift in clocks)
        time, stop, ticks = 0.0, 5.5 * longest, {reference: [] for reference in references}
        while time < stop:
            for reference, active in zip(references, one.getClock(references), strict=True):
                if active:
                    ticks[reference].append(time)
            one.updateDiscreteStates()
            assert not any(one.getClock(references))
            one.enterStepMode()
            event = False
            while time < stop and not event:
                event, _, _, time = one.doStep(time, min(0.37 * longest, stop - time + 1e-9))
                assert not any(one.getClock(references))
            one.enterEventMode()
        assert_ticks(ticks, clocks, stop)


def test_clocks_are_active_at_time_events_of_model_exchange_alone(tmp_path):
    with opened(clocked("voice_coil_dma"), tmp_path, exchange=True) as (one, names, _):
        starts = {"sample_period": 0.0015, "sample_shift": 0.0004}
        one.setFloat64([names[name] for name in starts], list(starts.values()))
        clocks = clocks_of("voice_coil_dma", names, starts)
        ((reference, *_),) = clocks
        initialized(one)
        time, stop, ticks = 0.0, 0.01, {reference: []}
        while time < stop:
            if one.getClock([reference])[0]:
                ticks[reference].append(time)
            *_, following = one.updateDiscreteStates()
            one.enterContinuousTimeMode()
            for instant in (0.5 * (time + following), following):
                one.setTime(instant)
                assert not one.getClock([reference])[0]
                one.enterEventMode()
                assert one.getClock([reference]) == [instant == following]
                if instant < following:
                    one.updateDiscreteStates()
                    one.enterContinuousTimeMode()
            time = following
        assert_ticks(ticks, clocks, stop)


def test_clocks_tell_periods_and_shifts(tmp_path):
    """As decimal numbers and as fractions, of the parameters as they are."""
    changed, unchanged = 2, 1
    said = []
    with opened(
        clocked("voice_coil_dma"),
        tmp_path,
        logMessage=lambda *told: said.append(told[-1].decode()),
    ) as (one, names, _):
        reference = (ctypes.c_uint * 1)(names["clock[1]"])
        number, qualifier = (ctypes.c_double * 1)(), (ctypes.c_int * 1)()
        counter, resolution = (ctypes.c_uint64 * 1)(), (ctypes.c_uint64 * 1)()
        one.enterInitializationMode()
        for period, shift in ((0.0015, 0.0), (0.000125, 0.25)):
            one.setFloat64([names["sample_period"], names["sample_shift"]], [period, shift])
            one.getIntervalDecimal(reference, number, qualifier)
            assert (number[0], qualifier[0]) == (period, changed)
            one.getIntervalFraction(reference, counter, resolution, qualifier)
            assert Fraction(counter[0], resolution[0]) == Fraction(str(period))
            one.getShiftDecimal(reference, number)
            assert number[0] == shift
            one.getShiftFraction(reference, counter, resolution)
            assert Fraction(counter[0], resolution[0]) == Fraction(str(shift))
        one.exitInitializationMode()
        one.getIntervalDecimal(reference, number, qualifier)
        assert (number[0], qualifier[0]) == (period, unchanged)
        assert said == []
        for refused in (
            lambda: one.setClock(reference, [True]),
            lambda: one.fmi3SetIntervalDecimal(one.component, reference, 1, number),
            lambda: one.fmi3SetShiftDecimal(one.component, reference, 1, number),
        ):
            with pytest.raises(FMICallException):
                refused()
        assert len(said) == 3
        assert {line.partition(": ")[2] for line in said} == {
            "'clock[1]' is an output; voice_coil_dma activates it, with the period that its"
            " parameters give"
        }
        with pytest.raises(FMICallException):
            one.getClock([names["time"]])
        assert said[3:] == [
            f"fmi3GetClock: value reference {names['time']} is no clock; voice_coil_dma has 1 of"
            " them"
        ]
        with pytest.raises(FMICallException):
            one.getFloat64([reference[0]])


def test_a_saved_state_has_its_clocks(tmp_path):
    """Restored before a sample, the clock is active again."""
    given = {"eventModeUsed": True, "earlyReturnAllowed": True}
    with opened(clocked("pid"), tmp_path, **given) as (one, names, _):
        initialized(one)
        state = one.getFMUState()
        for _ in range(2):
            assert one.getClock([names["clock[1]"]]) == [True]
            one.updateDiscreteStates()
            assert one.getClock([names["clock[1]"]]) == [False]
            one.setFMUState(state)
        one.freeFMUState(state)


@pytest.mark.parametrize("place", range(4))
def test_a_null_for_a_result_of_a_step_is_refused_by_its_name(fmu, tmp_path, place):
    names = ("eventHandlingNeeded", "terminateSimulation", "earlyReturn", "lastSuccessfulTime")
    said = []
    results = [ctypes.c_bool(), ctypes.c_bool(), ctypes.c_bool(), ctypes.c_double()]
    pointers = [ctypes.byref(result) for result in results]
    pointers[place] = None
    with opened(
        fmu("pid", "native", 3), tmp_path, logMessage=lambda *told: said.append(told[-1].decode())
    ) as (one, references, _):
        initialized(one)
        with pytest.raises(Exception, match="fmi3DoStep"):
            one.fmi3DoStep(one.component, 0.0, 0.1, True, *pointers)
        assert said == [f"fmi3DoStep: the pointer to {names[place]} is NULL"]
        assert one.doStep(0.0, 0.1)[-1] == pytest.approx(0.1), "no time has passed"
        with pytest.raises(Exception, match="fmi3GetFloat64"):
            one.fmi3GetFloat64(one.component, (ctypes.c_uint * 1)(references["time"]), 1, None, 1)
        assert said[1:] == ["fmi3GetFloat64: an array is NULL though it should have 1 elements"]


def moving_point(one, references, description, rng):
    """Start an instance for model exchange at random values of inputs and states."""
    initialized(one)
    inputs = [
        v.valueReference
        for v in description.modelVariables
        if v.causality == "input" and v.type == "Float64"
    ]
    one.setFloat64(inputs, rng.uniform(0.01, 0.1, len(inputs)))
    states = [u.variable.derivative for u in description.derivatives]
    nominals = np.array([float(state.nominal or 1.0) for state in states])
    values = [state.valueReference for state in states]
    start = np.array(one.getFloat64(values)) if values else np.zeros(0)
    values_now = start + 1e-3 * nominals * rng.uniform(0.5, 1.0, len(states))
    if values:
        one.setFloat64(values, values_now)
    unknowns = [
        u.variable.valueReference
        for u in (*description.outputs, *description.derivatives)
        if u.variable.type == "Float64" and u.variable.variability == "continuous"
    ]
    return inputs + values, unknowns


@pytest.mark.parametrize("name", fmus.COMPONENTS)
def test_adjoint_and_directional_derivatives_are_one_matrix(fmu, tmp_path, name):
    """Rows of the one are columns of the other, in event mode and during initialization."""
    rng = np.random.default_rng(11)
    with opened(fmu(name, "native", 3), tmp_path / name, exchange=True) as (one, names, described):
        one.enterInitializationMode()
        parameters = [
            v.valueReference
            for v in described.modelVariables
            if v.causality == "parameter" and v.type == "Float64"
        ]
        outputs = [
            u.variable.valueReference for u in described.outputs if u.variable.type == "Float64"
        ]
        compare(one, outputs, parameters, described)
        one.exitInitializationMode()
    with opened(fmu(name, "native", 3), tmp_path / "b", exchange=True) as (one, names, described):
        knowns, unknowns = moving_point(one, names, described, rng)
        compare(one, unknowns, knowns, described)


def compare(one, unknowns, knowns, described):
    """By a seed for each element of arrays."""
    sizes = {
        v.valueReference: prod(int(d.start) for d in v.dimensions) for v in described.modelVariables
    }
    n, m = (sum(sizes[vr] for vr in references) for references in (unknowns, knowns))
    forward = np.array(
        [one.getDirectionalDerivative(unknowns, knowns, list(seed), n) for seed in np.eye(m)]
    ).T
    backward = np.array(
        [one.getAdjointDerivative(unknowns, knowns, list(seed), m) for seed in np.eye(n)]
    )
    if forward.size == 0:
        return
    size = np.abs(forward).max(axis=1, keepdims=True)
    assert np.all(np.abs(forward - backward) <= 1e-12 * size)


@pytest.mark.parametrize("name", ["ppy_actuator", "foot_dynamic", "isotonic_stand"])
def test_directional_derivatives_are_differences(fmu, tmp_path, name):
    rng = np.random.default_rng(5)
    with opened(fmu(name, "native", 3), tmp_path / name, exchange=True) as (one, names, described):
        knowns, unknowns = moving_point(one, names, described, rng)
        at = np.array(one.getFloat64(knowns))
        for k, value in zip(knowns, at, strict=True):
            step = 1e-6 * max(abs(value), 1e-6)
            ends = []
            for sign in (1.0, -1.0):
                one.setFloat64([k], [value + sign * step])
                ends.append(np.array(one.getFloat64(unknowns)))
            one.setFloat64([k], [value])
            difference = (ends[0] - ends[1]) / (2.0 * step)
            found = np.array(one.getDirectionalDerivative(unknowns, [k], [1.0]))
            noise = 1e-15 * np.abs(ends[0]) / step
            assert np.all(np.abs(found - difference) <= 1e-5 * np.abs(difference) + 10 * noise)


def test_output_derivatives_are_differences_in_time(fmu, tmp_path):
    outputs = ["charge", "displacement", "voltage"]
    with opened(fmu("ppy_actuator", "native", 3), tmp_path) as (one, names, _):
        one.enterInitializationMode()
        one.setFloat64([names["current"], names["force"]], [0.25, 0.4])
        one.exitInitializationMode()
        vr = [names[output] for output in outputs]
        one.doStep(0.0, 2.0)
        rates = one.getOutputDerivatives(vr, [1] * len(vr))
        before = np.array(one.getFloat64(vr))
        one.doStep(2.0, 1e-4)
        after = np.array(one.getFloat64(vr))
    np.testing.assert_allclose(rates, (after - before) / 1e-4, rtol=1e-4)


class Timed(Component):
    """An output that the time moves, too."""

    name = "timed"

    x = State("1", rate="slow", start=1.0, output=True, doc="decays")

    def slow(self):
        return -0.5 * self.x

    @Output("1")
    def both(self):
        """Square of the time, and the state."""
        return self.time * self.time + self.x


def test_output_derivatives_count_the_time_itself(tmp_path):
    path = tmp_path / "timed.fmu"
    path.write_bytes(build(Timed, "native", [host_platform()], fmi=3))
    with opened(path, tmp_path / "unpacked") as (one, names, _):
        initialized(one)
        one.doStep(0.0, 3.0)
        (rate,) = one.getOutputDerivatives([names["both"]], [1])
    assert rate == pytest.approx(2.0 * 3.0 - 0.5 * np.exp(-1.5), rel=1e-6)


@pytest.mark.parametrize("starting", [True, False])
def test_the_time_is_a_known(tmp_path, starting):
    """It may stand among the knowns of a derivative, as it does among dependencies."""
    path = tmp_path / "timed.fmu"
    path.write_bytes(build(Timed, "native", [host_platform()], fmi=3))
    with opened(path, tmp_path / "unpacked", exchange=True) as (one, names, described):
        known = {u.variable.name: {d.name for d in u.dependencies} for u in described.outputs}
        assert known == {"both": {"x", "time"}, "x": {"x"}}
        one.enterInitializationMode(startTime=3.0)
        if not starting:
            one.exitInitializationMode()
        state = names["x_start" if starting else "x"]
        unknowns = [names["both"], names["der(x)"]]
        knowns = [names["time"], state, names["time"]]
        assert one.getDirectionalDerivative(unknowns, knowns, [1.0, 0.25, 2.0]) == [18.25, -0.125]
        assert one.getAdjointDerivative(unknowns, knowns, [1.0, 4.0], 3) == [6.0, -1.0, 6.0]
        assert one.getAdjointDerivative([names["x"]], knowns, [1.0], 3) == [0.0, 1.0, 0.0]


def dependencies_by_name(unknowns):
    return {u.variable.name: {d.name for d in u.dependencies} for u in unknowns}


@pytest.mark.parametrize(
    ("name", "effect", "settings"),
    [
        ("isotonic_stand", None, {"carrier_ripple": 0.1}),
        ("voice_coil_dma", "clock_jitter", {}),
        ("voice_coil_dma", "mains_hum", {"common_mode_voltage": 1.0, "mains_frequency": 53.0}),
    ],
)
def test_what_the_time_moves_depends_on_it(tmp_path, name, effect, settings):
    """Found by moving the time alone, between events."""
    cls = component(name)
    if effect is not None:
        cls = stack(cls, effects(name)[effect])
    path = tmp_path / "timed.fmu"
    path.write_bytes(build(cls, "native", [host_platform()], fmi=3))
    with opened(path, tmp_path / "unpacked", exchange=True) as (one, names, described):
        one.setFloat64([names[key] for key in settings], list(settings.values()))
        initialized(one)
        while one.updateDiscreteStates()[0]:
            pass
        one.enterContinuousTimeMode()
        of = dependencies_by_name(
            (*described.outputs, *described.derivatives, *described.eventIndicators)
        )
        kinds = {v.name: v.type for v in described.modelVariables}
        floats = [n for n in of if kinds[n] == "Float64"]
        rows = []
        for time in (1e-4, 0.0137, 0.41):
            one.setTime(time)
            rows.append(one.getFloat64([names[n] for n in floats]))
        moved = {n for n, *values in zip(floats, *rows, strict=True) if len(set(values)) > 1}
    assert moved
    assert {n for n in moved if "time" not in of[n]} == set()


@pytest.mark.parametrize("name", ["ppy_actuator", "voice_coil_dma"])
def test_a_state_is_restored_and_survives_as_bytes(fmu, tmp_path, name, runtime):
    with opened(fmu(name, runtime, 3), tmp_path / "a") as (one, names, described):
        vr = [names[u.variable.name] for u in described.outputs if u.variable.type == "Float64"]
        initialized(one)
        one.doStep(0.0, 0.0123)
        state = one.getFMUState()
        block = one.serializeFMUState(state)
        one.doStep(0.0123, 0.01)
        expected = one.getFloat64(vr)
        for again in (state, one.deserializeFMUState(block)):
            one.setFMUState(again)
            one.doStep(0.0123, 0.01)
            assert one.getFloat64(vr) == expected
            one.freeFMUState(again)


@pytest.mark.parametrize("late", [False, True])
def test_a_sample_is_taken_once_in_event_mode(fmu, tmp_path, runtime, late):
    """The galvanostat converts the voltage that it is given; samples within a step are its own."""
    path = fmu("galvanostat", runtime, 3)
    period = next(p.start for p in component("galvanostat").layout.parameters if "period" in p.name)
    with opened(path, tmp_path, eventModeUsed=True) as (one, names, _):
        sampled, voltage = [names["sampled_voltage"]], [names["voltage"]]
        initialized(one)
        assert one.updateDiscreteStates()[0] is False
        one.setFloat64(voltage, [0.5])
        assert one.updateDiscreteStates()[0] is False
        assert one.getFloat64(sampled) == [0.0]
        one.enterStepMode()
        end = period * (3.5 if late else 1.0)
        one.doStep(0.0, end)
        one.enterEventMode()
        one.updateDiscreteStates()
        assert one.getFloat64(sampled) == [0.5]
        *_, defined, following = one.updateDiscreteStates()
        assert defined
        assert following == pytest.approx(period * (4.0 if late else 2.0), rel=1e-12)


@pytest.mark.parametrize("name", ["galvanostat", "ppy_actuator"])
def test_a_python_build_declares_what_it_can(fmu, name):
    with zipfile.ZipFile(fmu(name, "python", 3)) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
        assert not any(name.startswith("sources/") for name in archive.namelist())
    assert root.find("ModelExchange") is None
    assert root.find("ModelStructure/EventIndicator") is None
    assert root.find("ModelStructure/ContinuousStateDerivative") is None, "which nobody can get"
    assert root.find("CoSimulation").attrib == {
        "modelIdentifier": name,
        "needsExecutionTool": "true",
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "providesDirectionalDerivatives": "false",
        "providesAdjointDerivatives": "false",
        "canHandleVariableCommunicationStepSize": "true",
        "maxOutputDerivativeOrder": "0",
        "hasEventMode": "true",
        "mightReturnEarlyFromDoStep": str(name == "galvanostat").lower(),
    }


def test_a_python_build_refuses_what_it_does_not_declare(fmu, tmp_path):
    """By name, after which it goes on."""
    said = []
    path = fmu("ppy_actuator", "python", 3)
    given = {"logMessage": lambda *told: said.append(told[-1].decode())}
    with opened(path, tmp_path / "a", **given) as (one, names, described):
        assert described.modelExchange is None
        initialized(one)
        one.doStep(0.0, 0.1)
        charge, current = [names["charge"]], [names["current"]]
        for ask in (
            lambda: one.getDirectionalDerivative(charge, current, [1.0]),
            lambda: one.getAdjointDerivative(charge, current, [1.0], 1),
            lambda: one.getOutputDerivatives(charge, [1]),
        ):
            with pytest.raises(FMICallException):
                ask()
        assert [line.split(" by")[0] for line in said] == [
            f"fmi3Get{of} is not supported"
            for of in ("DirectionalDerivative", "AdjointDerivative", "OutputDerivatives")
        ]
        one.doStep(0.1, 0.1)
    interface = described.coSimulation
    model = FMU3Model(
        guid=described.guid,
        modelIdentifier=interface.modelIdentifier,
        unzipDirectory=str(tmp_path / "a"),
        instanceName="one",
    )
    with pytest.raises(Exception, match=r"[Ii]nstantiate"):
        model.instantiate(**given)
    assert said[-1].endswith("ppy_actuator is made for co-simulation")


def test_time_and_indicators_are_variables(fmu, tmp_path):
    with opened(fmu("galvanostat", "native", 3), tmp_path, exchange=True) as (
        one,
        names,
        described,
    ):
        initialized(one)
        one.setTime(0.25)
        assert one.getFloat64([names["time"]]) == [0.25]
        count = one.getNumberOfEventIndicators()
        assert count == len(described.eventIndicators) > 0
        listed = [u.variable.valueReference for u in described.eventIndicators]
        values = np.empty(count)
        one.getEventIndicators(values.ctypes.data_as(ctypes.POINTER(ctypes.c_double)), count)
        assert one.getFloat64(listed) == list(values)


class Rooted(Component):
    """A law that switches at the root of an input, and an output."""

    name = "rooted"

    u = Input("1", start=4.0, doc="whose root is taken")
    x = State("1", rate="beyond", output=True, doc="integral of what is beyond one")

    def beyond(self):
        return maximum(sqrt(self.u) - 1.0, 0.0)


@pytest.mark.parametrize(("is_continuous", "status"), [(False, "error"), (True, "discard")])
def test_an_indicator_that_is_no_number_is_no_value(tmp_path, is_continuous, status):
    """A host that integrates may try a shorter step; then what is read is a number again."""
    path = tmp_path / "rooted.fmu"
    path.write_bytes(build(Rooted, "native", [host_platform()], fmi=3))
    with opened(path, tmp_path / "unpacked", exchange=True) as (one, names, described):
        (indicator,) = (u.variable.valueReference for u in described.eventIndicators)
        initialized(one)
        if is_continuous:
            one.updateDiscreteStates()
            one.enterContinuousTimeMode()
        one.setFloat64([names["u"]], [-1.0])
        for asked in ([indicator], [names["time"], indicator, names["u"]]):
            with pytest.raises(FMICallException) as caught:
                one.getFloat64(asked)
            assert caught.value.status == {"discard": 2, "error": 3}[status]
        if is_continuous:
            one.setFloat64([names["u"]], [9.0])
            assert one.getFloat64([indicator])[0] > 0.0


@pytest.mark.slow
def test_sources_are_built_by_fmpy(fmu, tmp_path):
    """By CMake, from what ``buildDescription.xml`` says."""
    if shutil.which("cmake") is None:
        pytest.skip("no cmake here")
    folder = tmp_path / "unpacked"
    path = fmu("ppy_actuator", "native", 3)
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    shutil.rmtree(folder / "binaries")
    (tmp_path / "build").mkdir()
    build_platform_binary(folder, tmp_path / "build")
    ours, theirs = (
        simulate_fmu(str(one), stop_time=5.0, start_values={"current": 0.3, "force": 0.2})
        for one in (path, folder)
    )
    for output in ours.dtype.names:
        np.testing.assert_allclose(theirs[output], ours[output], rtol=1e-12)


@pytest.mark.parametrize("name", fmus.COMPONENTS)
def test_fmpy_finds_no_problem_in_the_archive(fmu, name, runtime):
    assert validate_fmu(str(fmu(name, runtime, 3))) == []
