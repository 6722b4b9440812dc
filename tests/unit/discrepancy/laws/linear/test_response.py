"""What outputs make of additions to laws.

Oracles: exact sensitivities of the same model with the addition compiled in; closed forms;
superposition.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, Parameter, State, stack
from fmus.kit.curves import SHAPES, curve
from fmus.kit.record.compiled import CompiledModel
from fmus.kit.symbolic.perturbed import PerturbedLaws
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.laws.linear.response import (
    LinearResponse,
    Sides,
    SimulatedCourse,
    continuous,
    responses_of_runs,
)
from orchestration.records.runs import MeasuredRun
from studies.plants.models.pendulum import Pendulum

SAMPLES = 1500
FIRST_ORDER = 0.01  # rms, relative: of what is straight between samples
EXACT = 1e-6


class Lag(Component):
    """T dx/dt = u - x, of which twice the state and the input are seen."""

    name = "lag"

    constant = Parameter(0.8, "s", min=1e-9)
    drive = Input("V")
    state = State("V", rate="change")

    def change(self):
        return (self.arriving() - self.state) / self.constant

    def arriving(self):
        return self.drive

    def unheard(self):
        return 0.0 * self.state

    @Output("V")
    def seen(self):
        """Twice."""
        return 2.0 * self.state + self.arriving() + self.unheard()


class Stiff(Component):
    """A fast state, a thousand times faster than a sample, that drives a slow one."""

    name = "stiff"

    drive = Input("1")
    fast = State("1", rate="fast_rate")
    slow = State("1", rate="slow_rate")

    def target(self):
        return self.drive

    def fast_rate(self):
        return 2e4 * (self.target() - self.fast)

    def slow_rate(self):
        return self.fast - 0.5 * self.slow

    @Output("1")
    def position(self):
        """Slow."""
        return self.slow

    @Output("1")
    def quick(self):
        """Fast."""
        return self.fast


class Straight(Component):
    """Two states that swing, linear in everything."""

    name = "straight"

    drive = Input("N")
    place = State("m", rate="place_rate", start=0.3)
    speed = State("m/s", rate="speed_rate")

    def place_rate(self):
        return self.speed

    def spring(self):
        return 4.0 * self.place

    def speed_rate(self):
        return self.drive - self.spring() - 0.3 * self.speed

    @Output("m")
    def position(self):
        """Place, and some of the force."""
        return self.place + 0.1 * self.spring()


def held(n, seed, values=(-1.0, 0.0, 1.0), length=20):
    rng = np.random.default_rng(seed)
    return np.repeat(rng.choice(values, -(-n // length)), length)[:n]


def smooth(time, seed):
    rng = np.random.default_rng(seed)
    return sum(np.sin(f * time + rng.uniform(0.0, 6.0)) for f in (0.3, 1.1, 2.3)) / 2.0


def clocks(step, uneven):
    steps = np.full(SAMPLES - 1, step)
    if uneven:
        steps *= np.random.default_rng(8).choice([0.3, 1.0, 2.0], SAMPLES - 1)
    return np.append(0.0, np.cumsum(steps))


def error(found, exact):
    assert np.any(exact)
    return float(np.sqrt(np.mean((found - exact) ** 2) / np.mean(exact**2)))


def sensitivities(cls, law, signal, shape, time, inputs, linear, values=None):
    effect = curve(cls, law, signal, shape)
    width = {f"{law}_{shape}_width": 1.0} if SHAPES[shape].width else {}
    model = CompiledModel(stack(cls, effect), [effect.neutral])
    ran = model.run(time, inputs, (values or {}) | width, linear)
    return ran.signals, {name: rows[:, 0] for name, rows in ran.sensitivities.items()}


def responses(cls, law, signal, shape, time, inputs, linear, ran, outputs, runs=None, values=None):
    """Of every run, end to end."""
    runs = runs or [MeasuredRun("", 0, len(time))]
    found = {o: np.full(len(time), np.nan) for o in outputs}
    parts = responses_of_runs(
        PerturbedLaws(cls),
        time,
        inputs,
        ran,
        values or {},
        linear=linear,
        runs=runs,
        outputs=outputs,
    )
    for run, course, response in parts:
        x = {**course.inputs, **course.states}[signal]
        begin, end = (SHAPES[shape].form(side, 1.0, 1.0)[:, None] for side in (x.begin, x.end))
        for o, rows in response(law, Sides(begin, end)).items():
            found[o][run.samples] = rows[:, 0]
    return found


CASES = [
    (PpyActuator, "film_voltage", "charge", "cubic", ("voltage", "displacement"), 0.05),
    (PpyActuator, "kelvin_force", "kelvin_elongation", "quadratic", ("displacement",), 0.05),
    (PpyActuator, "series_resistance", "current", "quadratic", ("voltage",), 0.05),
    (Pendulum, "friction", "velocity", "odd_quadratic", ("position", "velocity"), 0.02),
    (Pendulum, "gravity", "angle", "saturating", ("position",), 0.02),
    (Pendulum, "friction", "torque", "cubic", ("position",), 0.02),
]


def given(cls, time, moving):
    n = len(time)
    if cls is PpyActuator:
        force = 1.5 + (0.4 * smooth(time, 4) if moving else held(n, 4, (0.0, 0.5, 1.0), 35))
        return {"current": smooth(time, 3) if moving else held(n, 3), "force": force}
    return {"torque": 1.2 * (smooth(time, 3) if moving else held(n, 3))}


@pytest.mark.parametrize("uneven", [False, True], ids=["even", "uneven"])
@pytest.mark.parametrize("moving", [False, True], ids=["held", "smooth"])
@pytest.mark.parametrize("case", CASES, ids=lambda c: f"{c[0].name}-{c[1]}-{c[2]}")
def test_it_is_the_sensitivity_of_the_model_that_has_it(case, moving, uneven):
    cls, law, signal, shape, outputs, step = case
    time = clocks(step, uneven)
    inputs = given(cls, time, moving)
    ran, exact = sensitivities(cls, law, signal, shape, time, inputs, moving)
    found = responses(cls, law, signal, shape, time, inputs, moving, ran, outputs)
    for o in outputs:
        assert error(found[o], exact[o]) < FIRST_ORDER, o


def test_parameters_are_those_that_are_given():
    time, values = clocks(0.02, False), {"weight": 8.0, "damping": 0.8}
    inputs = given(Pendulum, time, True)
    ran, exact = sensitivities(Pendulum, "gravity", "angle", "cubic", time, inputs, True, values)
    found = responses(
        Pendulum, "gravity", "angle", "cubic", time, inputs, True, ran, ["position"], values=values
    )
    other = responses(Pendulum, "gravity", "angle", "cubic", time, inputs, True, ran, ["position"])
    assert error(found["position"], exact["position"]) < FIRST_ORDER
    assert error(other["position"], exact["position"]) > 10.0 * FIRST_ORDER


def test_one_input_smooth_and_one_held():
    time = clocks(0.05, False)
    inputs = {"current": smooth(time, 3), "force": held(SAMPLES, 4, (1.0, 2.0), 10)}
    for law, signal, output in (
        ("terminal_voltage", "current", "voltage"),
        ("load", "force", "displacement"),
    ):
        ran, exact = sensitivities(PpyActuator, law, signal, "quadratic", time, inputs, ["current"])
        found = responses(
            PpyActuator, law, signal, "quadratic", time, inputs, ["current"], ran, [output]
        )
        assert error(found[output], exact[output]) < 1e-4, law


@pytest.mark.parametrize("uneven", [False, True], ids=["even", "uneven"])
@pytest.mark.parametrize(
    ("cls", "law", "outputs"),
    [
        (Straight, "spring", ("position", "speed")),
        (Lag, "arriving", ("seen", "state")),
        (Stiff, "target", ("position", "quick")),
    ],
    ids=lambda v: getattr(v, "name", None),
)
def test_linear_models_are_met_exactly(cls, law, outputs, uneven):
    """What is added is held between samples as the input is, and a stiff part is far faster than
    these.
    """
    time, inputs = clocks(0.05, uneven), {"drive": held(SAMPLES, 5, (-1.0, 0.5, 2.0), 7)}
    ran, exact = sensitivities(cls, law, "drive", "cubic", time, inputs, False)
    found = responses(cls, law, "drive", "cubic", time, inputs, False, ran, outputs)
    for o in outputs:
        assert error(found[o], exact[o]) < EXACT, o


def test_runs_are_by_themselves():
    """Each with its own clock, its own start, and a value of its own."""
    first, second, gap = 700, SAMPLES - 700, 3.0
    time = clocks(0.02, False)
    ahead = time[first - 1] + gap
    joined = np.append(time[:first], ahead + time[:second])
    inputs = given(Pendulum, joined, True)
    runs = [MeasuredRun("a", 0, first), MeasuredRun("b", first, SAMPLES, ahead=ahead)]
    parts, exact = {}, []
    for run, weight in zip(runs, (5.0, 2.0), strict=True):
        fed = {n: v[run.samples] for n, v in inputs.items()}
        clock = joined[run.samples] - run.ahead
        ran, slopes = sensitivities(
            Pendulum, "gravity", "angle", "cubic", clock, fed, True, {"weight": weight}
        )
        parts[run.label] = ran
        exact.append(slopes["position"])
    signals = {n: np.append(parts["a"][n], parts["b"][n]) for n in parts["a"]}
    found = responses(
        Pendulum,
        "gravity",
        "angle",
        "cubic",
        joined,
        inputs,
        True,
        signals,
        ["position"],
        runs,
        {"weight@b": 2.0},
    )
    assert error(found["position"][:first], exact[0]) < FIRST_ORDER
    assert error(found["position"][first:], exact[1]) < FIRST_ORDER
    (_, _, one), (_, course, other) = responses_of_runs(
        PerturbedLaws(Pendulum),
        joined,
        inputs,
        signals,
        {"weight@b": 2.0},
        linear=True,
        runs=runs,
        outputs=["position"],
    )
    assert course.time[0] == pytest.approx(0.0)
    assert len(one.steps) == first - 1
    assert other.values["gravity"].begin == pytest.approx(2.0 * np.sin(signals["angle"][first:]))


def of_lag(time, drive, linear=False, **values):
    model = CompiledModel(Lag).run(time, {"drive": drive}, values, linear)
    course = SimulatedCourse.of(time, {"drive": drive}, {"state": model.signals["state"]}, linear)
    return LinearResponse(PerturbedLaws(Lag), course, values, ["seen", "state"])


def test_a_lag_in_closed_form():
    """T dx/dt = w - x from rest: 1 - exp(-t/T) for a step, t - T (1 - exp(-t/T)) for a ramp."""
    time = clocks(0.07, True)
    response = of_lag(time, np.sin(time), constant=1.3)
    step, ramp = 1.0 - np.exp(-time / 1.3), time - 1.3 * (1.0 - np.exp(-time / 1.3))
    added = continuous(np.column_stack([np.ones(SAMPLES), time]))
    found = response("arriving", added)
    assert found["state"] == pytest.approx(np.column_stack([step, ramp]), abs=1e-9)
    assert found["seen"] == pytest.approx(
        np.column_stack([2.0 * step + 1.0, 2.0 * ramp + time]), abs=1e-9
    )
    rate = response("change", added)
    assert rate["state"] == pytest.approx(1.3 * np.column_stack([step, ramp]), abs=1e-9), (
        "is not divided by T"
    )


def test_what_an_addition_drives_changes_within_a_step():
    """A law times a ramp: of dx/dt = t w with w = 1 comes t^2 / 2, however far samples are
    apart.
    """
    cls = type(
        "Ramped",
        (Lag,),
        {"change": lambda self: self.drive * self.arriving(), "arriving": lambda self: 0.0},
    )
    time = clocks(0.7, True)
    course = SimulatedCourse.of(time, {"drive": time}, {"state": np.zeros(SAMPLES)}, True)
    response = LinearResponse(PerturbedLaws(cls), course, {}, ["state"])
    assert response("arriving", continuous(np.ones((SAMPLES, 1))))["state"][:, 0] == pytest.approx(
        time**2 / 2.0
    )


def test_size_is_that_of_one_unit_all_the_time():
    time = clocks(0.07, False)
    step = 1.0 - np.exp(-time / 0.8)
    wanted = np.sqrt(np.sum((2.0 * step + 1.0) ** 2) / 4.0 + np.sum(step**2) / 9.0)
    assert of_lag(time, np.sin(time)).size(
        "arriving", {"seen": 2.0, "state": 3.0}
    ) == pytest.approx(wanted)


def test_what_a_unit_drives_and_shows():
    response = of_lag(clocks(0.1, False), np.zeros(SAMPLES))
    drives, shows = response.effect_of("arriving")
    assert drives == pytest.approx(np.full((SAMPLES, 1), 1.0 / 0.8))
    assert shows == pytest.approx(np.tile([1.0, 0.0], (SAMPLES, 1)))
    assert response.moves("arriving")
    assert not response.moves("unheard")
    assert response.row("arriving", "seen") == pytest.approx(np.tile([2.0, 1.0], (SAMPLES, 1)))
    assert response.row("unheard", "state") == pytest.approx(np.tile([1.0, 0.0], (SAMPLES, 1)))


def test_a_law_that_no_state_feels():
    response, added = (
        of_lag(clocks(0.1, False), np.zeros(SAMPLES)),
        np.arange(SAMPLES, dtype=float)[:, None],
    )
    found = response("unheard", continuous(added))
    assert found["seen"] == pytest.approx(added)
    assert not found["state"].any()


def test_steps_add_up_to_the_response():
    """The recursion that is handed out gives what the response does."""
    time = clocks(0.02, True)
    inputs = given(Pendulum, time, True)
    ran = CompiledModel(Pendulum).run(time, inputs, {}, True).signals
    [(_, _, response)] = responses_of_runs(
        PerturbedLaws(Pendulum),
        time,
        inputs,
        ran,
        {},
        linear=True,
        runs=[MeasuredRun("", 0, SAMPLES)],
        outputs=["angle", "velocity"],
    )
    rng = np.random.default_rng(2)
    added = Sides(rng.normal(size=(SAMPLES, 2)), rng.normal(size=(SAMPLES, 2)))
    transition, left, right = response.step("friction")
    states = np.zeros((SAMPLES, 2, 2))
    for k in range(SAMPLES - 1):
        for m in range(2):
            states[k + 1, :, m] = transition[k] @ states[k, :, m]
            states[k + 1, :, m] += left[k] * added.begin[k, m] + right[k] * added.end[k, m]
    found = response("friction", added)
    assert found["angle"] == pytest.approx(states[:, 0])
    assert found["velocity"] == pytest.approx(states[:, 1])


def test_sides_of_a_course():
    time = np.array([0.0, 1.0, 2.0])
    course = SimulatedCourse.of(
        time, {"a": np.array([1.0, 2.0, 4.0]), "b": np.float64(3.0)}, {"x": time}, ["b"]
    )
    assert course.inputs["a"].end.tolist() == [1.0, 2.0, 4.0], "held"
    assert course.inputs["b"].end.tolist() == [3.0, 3.0, 3.0]
    assert course.states["x"].end.tolist() == [1.0, 2.0, 2.0]
    assert SimulatedCourse.of(time, {"a": time}, {}, True).inputs["a"].end.tolist() == [
        1.0,
        2.0,
        2.0,
    ]


def test_the_time_goes_on_within_a_step():
    """A law of the time at the end of a step is that of the next sample."""
    cls = type("Ticking", (Lag,), {"arriving": lambda self: self.drive * self.time})
    time = np.array([0.0, 0.5, 2.0])
    course = SimulatedCourse.of(time, {"drive": np.ones(3)}, {"state": np.zeros(3)}, False)
    values = LinearResponse(PerturbedLaws(cls), course, {}, ["seen"]).values["arriving"]
    assert values.begin.tolist() == [0.0, 0.5, 2.0]
    assert values.end.tolist() == [0.5, 2.0, 2.0]


def test_an_output_that_is_none_is_refused():
    course = SimulatedCourse.of(
        np.arange(3.0), {"drive": np.ones(3)}, {"state": np.zeros(3)}, False
    )
    with pytest.raises(ValueError, match="nothing"):
        LinearResponse(PerturbedLaws(Lag), course, {}, ["nothing"])
