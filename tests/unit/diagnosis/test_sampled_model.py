"""Claims: discrete states are updated at the ticks of their clocks, with exact derivatives."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fmus.kit.arrays import Array
from fmus.kit.record import CompiledModel
from orchestration.diagnosis import LawModel, Options, Record, Shape, Term, diagnose
from orchestration.diagnosis.catalogue import named_terms
from orchestration.diagnosis.courses import Courses, courses_of
from orchestration.diagnosis.fitting import Fit, Problem, StartPrior, fit_base, nominal_point
from orchestration.diagnosis.readings import Reading, ReadingKind
from orchestration.diagnosis.responses import respond
from orchestration.diagnosis.runs import Course, Setting
from orchestration.diagnosis.screening import alike
from orchestration.diagnosis.term_names import estimates
from orchestration.diagnosis.terms import Memory
from orchestration.fmu import find_model
from orchestration.fmu.model import declared_model_of
from orchestration.records import Record as MeasuredRecord
from tests.contract.raw import instance
from tests.support.diagnosed_vessels import drives_of
from tests.support.sampled_loop import (
    KI,
    PERIOD,
    START,
    SampledLoop,
    driven,
    exact,
    sampled_loop,
)

FREE = np.arange(4)  # gain, lag, kp, ki


def setting_of(*terms: Term, value: float = 0.4, substeps: int = 12) -> Setting:
    parameters = np.array([float(p.start) for p in sampled_loop().parameters])
    values = np.concatenate([np.zeros(0), *(term.values(value) for term in terms)])
    return Setting(parameters, FREE, terms, values, substeps)


def run(record: Record, setting: Setting, start: Array = START, sensitive: bool = False) -> Course:
    course = sampled_loop().run(record, setting, start, sensitive=sensitive)
    assert course is not None
    return course


def along(record: Record) -> Courses:
    """Return the courses of the nominal loop over a record in which both outputs are measured."""
    record = replace(record, outputs=np.zeros((len(record.time), 2)))
    prior = StartPrior(START, np.ones(len(START)))
    problem = Problem(sampled_loop(), (record,), np.ones(2), (prior,), substeps=12)
    fitted = Fit(problem, (), nominal_point(problem), (), 0.0, np.zeros((0, 0)))
    courses = courses_of(fitted, problem.records, (START,))
    assert courses is not None
    return courses


@pytest.mark.parametrize("step", [0.1, 0.05, 0.03, 0.25, 0.37])
def test_a_run_is_the_recursion_of_the_sampled_loop(step: float) -> None:
    record = driven(80, step)
    course = run(record, setting_of())
    expected = exact(record)
    assert course.states == pytest.approx(expected, abs=1e-6)
    assert course.outputs == pytest.approx(expected[:, :2], abs=1e-6)
    assert np.abs(np.diff(expected[:, 1])).max() > 0.1, "the controller stands still"


def test_a_tick_at_a_sample_comes_after_the_output_there() -> None:
    record = driven(3, 0.1)
    setting = setting_of()
    setting.parameters[5] = 0.0  # shift
    course = run(record, setting)
    assert course.states[0] == pytest.approx(START)
    error = record.inputs[0, 0] - START[0]
    assert course.states[1, 2] == pytest.approx(START[2] + KI * 0.1 * error)
    assert course.states == pytest.approx(exact(record, shift=0.0), abs=1e-7)


def test_a_part_of_a_record_goes_on_with_the_clock() -> None:
    record = driven(90, 0.07)
    whole = run(record, setting_of())
    part = run(record.part(31, 90), setting_of(), whole.states[31])
    assert part.states == pytest.approx(whole.states[31:], abs=1e-12)


def test_after_a_gap_the_clock_has_run_on() -> None:
    record = replace(driven(60, 0.07), begin=-3.21)
    assert run(record, setting_of()).states == pytest.approx(exact(record, begin=-3.21), abs=1e-6)


@pytest.mark.parametrize(
    ("name", "given", "step"),
    [
        ("voice_coil_dma", {}, 1.0 / 30.0),
        ("voice_coil_dma", {"sample_shift": 0.0123}, 0.007),
        ("galvanostat", {"response_time": 0.02, "potentiostat": 1.0, "control_period": 0.02}, 0.03),
    ],
)
@pytest.mark.parametrize("smooth", [False, True])
def test_a_run_is_that_of_the_fmu_s_laws_and_integrator(
    name: str, given: dict[str, float], step: float, smooth: bool
) -> None:
    cls = find_model(name).cls
    model = LawModel(cls)
    time = step * np.arange(60)
    level = {"voltage": 16.0, "voltage_limit": 0.0}
    inputs = {
        v.name: v.start + level.get(v.name, 0.7) * np.sin((1.3 + 0.6 * i) * time)
        for i, v in enumerate(model.inputs)
        if v.type == "real"
    }
    columns = [inputs.get(v.name, np.zeros(60)) for v in model.inputs]
    outputs = np.zeros((60, len(model.outputs)))
    record = Record(time, np.column_stack(columns), outputs, (smooth,) * len(columns))
    parameters = np.array([given.get(p.name, float(p.start)) for p in model.parameters])
    setting = Setting(parameters, np.zeros(0, dtype=int), substeps=int(np.ceil(step / 2.5e-5)))
    course = model.run(record, setting, parameters[model.start_positions])
    assert course is not None
    found = CompiledModel(cls).run(time, inputs, given, linear=smooth, tolerance=1e-10)
    for state, column in zip(model.states, course.states.T, strict=True):
        expected = found.signals[state.name]
        assert column == pytest.approx(expected, abs=1e-5 * max(np.abs(expected).max(), 1e-9))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="an FMU in use cannot be removed there")
@pytest.mark.parametrize("step", [1.0 / 30.0, 0.007])
def test_a_run_is_that_of_the_fmu(fmu: Callable[..., Path], step: float) -> None:
    model = LawModel(find_model("voice_coil_dma").cls)
    time = step * np.arange(50)
    names = [v.name for v in model.inputs]
    inputs = np.zeros((50, len(names)))
    inputs[:, names.index("force_reference")] = 1.0 + np.sin(0.7 * np.arange(50))
    inputs[:, names.index("tension")] = 1.0 + 0.5 * np.sin(0.31 * np.arange(50))
    outputs = np.zeros((50, len(model.outputs)))
    record = Record(time, inputs, outputs, (False,) * len(names))
    parameters = np.array([float(p.start) for p in model.parameters])
    setting = Setting(parameters, np.zeros(0, dtype=int), substeps=int(np.ceil(step / 2.5e-5)))
    course = model.run(record, setting, parameters[model.start_positions])
    assert course is not None
    with instance(fmu("voice_coil_dma", "native")) as one:
        one.initialize({})
        for k in range(49):
            one.set({n: inputs[k, names.index(n)] for n in ("force_reference", "tension")})
            one.step(step)
            found = one.get(*(o.name for o in model.outputs))
            assert course.outputs[k + 1] == pytest.approx(found, rel=1e-5, abs=1e-7)


TERMS = [
    (),
    (Term("drive", "command", Shape.CUBE, size=0.5, scale=0.8),),
    (Term("error", "x", Shape.SQUARE, size=0.3, scale=1.2),),
    (Term("next_command", "x", Shape.LINEAR, Memory.LAG, (0.3,), size=0.2, scale=1.0),),
    (Term("rate", "error", Shape.SQUARE, Memory.FADING, (0.3,), size=0.2, scale=1.0),),
    (Term("rate", "command", Shape.CUBE, Memory.DAHL, (0.4,), size=0.4, scale=0.5),),
    (Term("next_total", "error", Shape.LINEAR, factor="load", size=0.1, scale=1.0),),
]


@pytest.mark.parametrize("terms", TERMS, ids=lambda terms: " and ".join(map(str, terms)))
def test_slopes_are_those_of_the_run(terms: tuple[Term, ...]) -> None:
    record, setting = driven(70, 0.07, smooth=True), setting_of(*terms)
    slopes = run(record, setting, sensitive=True).slopes
    columns = []
    for i in range(4 + len(setting.values) + 3):
        outputs = []
        for h in (1e-5, -1e-5):
            p, v, x = setting.parameters.copy(), setting.values.copy(), START.copy()
            group, place = ((p, i), (v, i - 4), (x, i - 4 - len(v)))[
                0 if i < 4 else 1 if i < 4 + len(v) else 2
            ]
            group[place] += h
            outputs.append(run(record, replace(setting, parameters=p, values=v), x).outputs)
        columns.append((outputs[0] - outputs[1]) / 2e-5)
    expected = np.stack(columns, axis=2)
    assert slopes == pytest.approx(expected, abs=2e-6 * np.abs(expected).max())


@pytest.mark.parametrize("signal", ["x", "command"])
def test_a_bristle_follows_what_moves_between_ticks_and_at_them(signal: str) -> None:
    record = driven(80, 0.1)
    setting = setting_of(Term("rate", signal, Shape.LINEAR, Memory.DAHL, (0.4,)), substeps=1)
    setting.parameters[5] = 0.0  # ticks at the samples
    states = run(record, setting).states
    bristle = [0.0]
    for moved in np.diff(states[:, ["x", "command"].index(signal)]):
        end = 0.4 * np.sign(moved)
        bristle.append(end + (bristle[-1] - end) * np.exp(-abs(moved) / 0.4))
    assert states[:, 3] == pytest.approx(bristle, abs=1e-12)


def test_responses_to_laws_of_plant_and_controller_are_those_of_runs() -> None:
    model, record, setting = sampled_loop(), driven(90, 0.25), setting_of()
    course = run(record, setting, sensitive=True)
    part = model.linearise(record, setting, course)
    names = ["drive", "error", "next_total"]
    laws = np.array([model.laws.index(n) for n in names])
    found = respond(record, part, drives_of(np.ones((90, 3)), laws), 1)
    assert found.to_coordinates == pytest.approx(course.slopes[:, :, :4], abs=1e-9)
    assert found.to_start == pytest.approx(course.slopes[:, :, 4:], abs=1e-9)
    for column, law in zip(found.to_drives.transpose(2, 0, 1), names, strict=True):
        moved = run(record, setting_of(Term(law, "", Shape.CONSTANT), value=1e-4))
        assert column == pytest.approx((moved.outputs - course.outputs) / 1e-4, abs=1e-6), law
        assert np.abs(column).max() > 0.1


def test_responses_of_a_memory_are_those_of_runs() -> None:
    lagging = Term("next_command", "x", Shape.LINEAR, Memory.LAG, (0.3,), size=0.2, scale=1.0)
    record, setting = driven(60, 0.07), setting_of(lagging)
    course = run(record, setting, sensitive=True)
    part = sampled_loop().linearise(record, setting, course)
    found = respond(record, part, drives_of(np.ones((60, 1)), np.array([0])), 1)
    assert found.to_coordinates == pytest.approx(course.slopes[:, :, :6], abs=1e-9)


def test_an_effect_that_acts_through_a_discrete_state_is_proposed() -> None:
    record, setting = driven(120, 0.07), setting_of()
    (one,) = named_terms(along(record))
    assert one.term.effect == "bend"
    h = 1e-5
    size = one.term.released[0].scale.size
    bent = exact(record, error=lambda e: e + h * size * e**3)
    expected = (bent - exact(record))[:, :2] / h
    assert one.response == pytest.approx(expected, abs=1e-3)
    stacked = replace(setting, terms=(one.term,), values=one.term.values(0.2))
    whole = exact(record, error=lambda e: e + 0.2 * size * e**3)
    assert run(record, stacked).states == pytest.approx(whole, abs=1e-6)


def test_the_linearisation_with_an_effect_is_that_of_its_runs() -> None:
    model, record, setting = sampled_loop(), driven(60, 0.07), setting_of()
    (one,) = named_terms(along(record))
    bent = replace(setting, terms=(one.term,), values=one.term.values(0.3))
    course = run(record, bent, sensitive=True)
    law = np.array([model.laws.index("drive")])
    part = model.linearise(record, bent, course)
    found = respond(record, part, drives_of(np.ones((60, 1)), law), 1)
    assert found.to_coordinates == pytest.approx(course.slopes[:, :, :5], abs=1e-9)
    constant = Term("drive", "", Shape.CONSTANT)
    values = np.append(bent.values, 1e-6)
    moved = run(record, replace(bent, terms=(one.term, constant), values=values))
    difference = (moved.outputs - course.outputs) / 1e-6
    assert found.to_drives[:, :, 0] == pytest.approx(difference, abs=1e-6)


def test_laws_that_act_at_a_tick_alone_are_targets_and_samples_are_signals() -> None:
    model, record, setting = sampled_loop(), driven(60, 0.07), setting_of()
    part = model.linearise(record, setting, run(record, setting))
    classes = [set(same) for same in alike(model, [part])]
    assert sorted(map(sorted, classes)) == [
        ["drive", "rate"],
        ["error"],
        ["next_command"],
        ["next_total"],
    ]
    assert set(model.followed) == {"rate", "next_total"}, "a command keeps nothing of itself"


def test_a_file_in_another_clock_has_no_more_ticks_than_a_run_can_take() -> None:
    record = replace(driven(60, 0.07), begin=-0.5)
    minutes = Reading(ReadingKind.CLOCK, ("time",), 60.0).apply(sampled_loop(), record)
    assert minutes.begin == -30.0
    assert sampled_loop().ticks_in_step(minutes, setting_of().parameters) == pytest.approx(42.0)
    microseconds = Reading(ReadingKind.CLOCK, ("time",), 1e6).apply(sampled_loop(), record)
    assert sampled_loop().run(microseconds, setting_of(), START) is None


@pytest.mark.parametrize("smooth", [False, True])
def test_slopes_by_a_shift_are_those_of_the_recursion(smooth: bool) -> None:
    record = driven(70, 0.07, smooth=smooth)
    setting = replace(setting_of(), free=np.array([0, 5]))
    setting.parameters[5] = 0.0331  # no tick at a sample, where a command that is shown jumps
    slopes = run(record, setting, sensitive=True).slopes[:, :, 1]

    def shown(shift: float) -> Array:
        if not smooth:
            return exact(record, shift=shift)[:, :2]
        moved = setting.parameters.copy()
        moved[5] = shift
        return run(record, replace(setting, parameters=moved)).outputs

    h = 1e-6
    expected = (shown(0.0331 + h) - shown(0.0331 - h)) / (2.0 * h)
    assert slopes == pytest.approx(expected, abs=1e-4 * np.abs(expected).max())
    assert np.abs(expected).max() > 1.0


@pytest.mark.parametrize("shift", [0.0004, 0.031, 0.0993])
def test_the_phase_of_a_clock_is_found_anywhere_in_its_period(shift: float) -> None:
    rng = np.random.default_rng(5)
    record = driven(150, 0.03)
    steps = rng.uniform(-1.5, 1.5, (30, 2)) * (1.0, 0.3)
    record = replace(record, inputs=np.repeat(steps, 5, axis=0))
    shown = exact(record, np.zeros(3), shift=shift, gain=2.4)[:, :2]
    record = replace(record, outputs=shown + 0.01 * rng.standard_normal(shown.shape))
    prior = StartPrior(np.zeros(3), 0.01 * np.ones(3))
    problem = Problem(sampled_loop(), (record,), np.ones(2), (prior,), substeps=4)
    fitted = fit_base(problem)
    assert fitted is not None
    found = estimates(fitted, {})["shift"]
    assert 0.0 <= found.value < PERIOD
    apart = (np.array(found.interval) - shift + 0.5 * PERIOD) % PERIOD - 0.5 * PERIOD
    assert apart[0] <= 0.0 <= apart[1]
    assert np.ptp(apart) < 0.1 * PERIOD


def test_a_phase_stays_between_jumps_of_the_inputs() -> None:
    """By the recursion, outputs jump where a tick meets a jump of an input, and nowhere else."""
    record = driven(60, 0.03)
    inputs = np.ones((60, 2))
    inputs[20:], inputs[33:] = 0.5, -1.0  # from 0.6 and from 0.99 s on
    record = replace(record, inputs=inputs)

    def jump(phase: float) -> float:
        sides = [exact(record, shift=(phase + d) * PERIOD)[:, 0] for d in (-1e-5, 1e-5)]
        return float(np.abs(sides[1] - sides[0]).max())

    assert min(map(jump, (0.9, 1.0))) > 100.0 * max(map(jump, (0.2, 0.55, 0.8, 0.95)))
    prior = StartPrior(np.zeros(3), 0.01 * np.ones(3))
    problem = Problem(sampled_loop(), (record,), np.ones(2), (prior,))
    assert problem.walls[0] == pytest.approx([0.0, 0.9])
    (k,) = problem.phases

    def at(phase: float) -> Array:
        q = problem.mean.copy()
        q[k] = phase
        return q

    for before, wanted, reached in ((0.5, 1.2, 0.9), (0.95, 0.5, 0.9), (-0.05, 0.3, 0.0)):
        assert problem.between_walls(at(before), at(wanted))[k] == pytest.approx(reached, abs=1e-5)
    assert problem.between_walls(at(0.5), at(0.6))[k] == 0.6
    assert [q[k] for q in problem.beyond_walls(at(0.88))] == [pytest.approx(0.91)]
    assert [q[k] for q in problem.beyond_walls(at(1.02))] == [pytest.approx(0.99)]
    assert not list(problem.beyond_walls(at(0.5)))
    straight = replace(problem, records=(replace(record, smooth=(True, True)),))
    assert not len(straight.walls[0])


def test_a_phase_is_no_change_of_the_model() -> None:
    record = measured(11, 0.0)
    late = replace(record, time=record.time + 0.055)
    found = diagnose([late], declared_model_of(SampledLoop), (), Options(laws=False, effects=()))
    assert found.changed == ()
    assert "shift" in found.parameters
    assert "period" not in found.parameters


def measured(seed: int, cube: float) -> MeasuredRecord:
    """Return a record of the loop whose controller takes ``e + cube e^3`` for its error."""
    rng = np.random.default_rng(seed)
    record = driven(300, 0.04)
    steps = rng.uniform(-1.5, 1.5, (20, 2)) * (1.0, 0.3)
    record = replace(record, inputs=np.repeat(steps, 15, axis=0))
    shown = exact(record, np.zeros(3), lambda e: e + cube * e**3)[:, :2]
    columns = np.hstack([record.inputs, shown + 0.003 * rng.standard_normal(shown.shape)])
    names = ("reference", "load", "shown", "issued")
    signals = dict(zip(names, columns.T, strict=True))
    return MeasuredRecord(record.time, signals, dict.fromkeys(names, "1"), Path(f"{seed}.csv"))


@pytest.mark.slow
@pytest.mark.parametrize("cube", [0.0, 0.4])
def test_a_controller_that_bends_is_the_cause_and_a_clean_loop_is_silent(cube: float) -> None:
    found = diagnose([measured(11, cube)], declared_model_of(SampledLoop), [measured(12, cube)])
    if not cube:
        assert found.verdict == "consistent"
        return
    assert found.verdict == "cause"
    assert {term.law for term in found.causes[0].terms} <= {"error", "next_command", "next_total"}
    assert found.error(found.final) < 0.1 * found.error(found.found.base)
