"""Claims: a screen has the responses of free runs, less what parameters and starts can do."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.arrays import Array
from orchestration.diagnosis import LawModel, Record, Shape, Term
from orchestration.diagnosis.comparison import WEIGHTS
from orchestration.diagnosis.courses import courses_of
from orchestration.diagnosis.fitting import (
    Fit,
    Problem,
    StartPrior,
    fit,
    nominal_point,
    weights_of,
)
from orchestration.diagnosis.local_values import LocalValues
from orchestration.diagnosis.runs import Setting
from orchestration.diagnosis.screening import (
    Candidate,
    Screen,
    alike,
    screen_of,
    with_shorter_lags,
)
from orchestration.diagnosis.terms import DelayTerm, Memory, SensorTerm
from tests.support.diagnosed_mass import (
    FREE,
    START,
    D,
    K,
    M,
    integrated,
    mass,
    nominal,
    problem_of,
    pushed,
)
from tests.support.diagnosed_vessels import vessels


def drawn(size: float) -> Record:
    """Return a record of the mass whose spring has a cubic part, without noise worth the name."""
    record = pushed(200, smooth=True)

    def rates(x: Array, u: float, t: float) -> list[float]:
        return [x[1], (u - K * x[0] - size * x[0] ** 3 - D * x[1]) / M]

    states = integrated(record, rates, START, 1e-7)
    noise = 1e-4 * np.random.default_rng(0).standard_normal((200, 1))
    return replace(record, outputs=states[:, :1] + noise)


@cache
def screened(size: float = 40.0, gaps: int = 0) -> tuple[Screen, Fit]:
    """Return the screen along the nominal run, and that run as a fit."""
    record = drawn(size)
    record.outputs[np.random.default_rng(1).choice(200, gaps, replace=False)] = np.nan
    problem = problem_of([record])
    course = mass().run(record, Setting(nominal(), FREE), START)
    assert course is not None
    errors = ((record.outputs - course.outputs) / problem.spread,)
    found = Fit(problem, (), nominal_point(problem), errors, 0.0, np.zeros((5, 5)))
    along = courses_of(found, problem.records, found.point.starts)
    assert along is not None
    return screen_of(along), found


def weight(found: Fit) -> float:
    """Return the root of the weight of a sample, in SI."""
    return float(np.sqrt(weights_of(found.errors)[0][0]) / found.problem.spread[0])


def moved(found: Fit, term: Term, j: int, h: float) -> Array:
    """Return outputs of the free run with a small coefficient."""
    coefficients = np.zeros(term.coefficients)
    coefficients[j] = h
    setting = Setting(nominal(), FREE, (term,), np.append(coefficients, term.start), 4)
    course = mass().run(found.problem.records[0], setting, START)
    assert course is not None
    return course.outputs[:, 0]


def test_columns_are_responses_of_free_runs_to_small_coefficients() -> None:
    """Of every shape and memory that is proposed, in every law and factor."""
    screen, found = screened()
    assert {c.term.memory for c in screen.candidates} >= {
        Memory.NONE,
        Memory.LAG,
        Memory.DAHL,
        Memory.BACKLASH,
    }
    chosen: dict[object, int] = {}
    for i, candidate in enumerate(screen.candidates):
        term = candidate.term
        if not isinstance(term, DelayTerm):
            chosen[term.shape, term.memory, bool(term.factor)] = i
    assert len(chosen) > 12
    for i in chosen.values():
        term = screen.candidates[i].term
        for j in range(term.coefficients):
            difference = (moved(found, term, j, 1e-4) - moved(found, term, j, -1e-4)) / 2e-4
            column = screen._columns.columns[:, screen.ends[i] + j] / weight(found)
            error = np.linalg.norm(column - difference) / np.linalg.norm(difference)
            # what is held during a step is late by half of one, and backlash gives within few
            limit = 0.08 if term.memory is Memory.BACKLASH else 0.06
            assert error < limit, (str(term), j, error)


def test_the_column_of_a_delay_is_what_the_delay_does() -> None:
    """At a value of 1 it is so late as its size."""
    screen, found = screened()
    late = [i for i, c in enumerate(screen.candidates) if isinstance(c.term, DelayTerm)]
    assert len({screen.candidates[i].term.size for i in late}) == len(late) > 3
    time = found.problem.records[0].time
    course = mass().run(found.problem.records[0], Setting(nominal(), FREE), START)
    assert course is not None
    for i in late:
        shown = np.interp(time - screen.candidates[i].term.size, time, course.outputs[:, 0])
        column = screen._columns.columns[:, screen.ends[i]] / weight(found)
        assert column == pytest.approx(shown - course.outputs[:, 0], abs=1e-9)


def nuisances(found: Fit) -> Array:
    """Return differences of runs by parameters and starts, by a deviation of the prior of each."""
    columns = []
    record = found.problem.records[0]
    for i in range(5):
        outputs = []
        for h in (1e-4, -1e-4):
            parameters, start = nominal(), START.copy()
            if i < 3:
                parameters[i] *= np.exp(h * np.log(10.0))
            else:
                start[i - 3] += h * 3.0 * mass().nominal_states[i - 3]
            course = mass().run(record, Setting(parameters, FREE, substeps=4), start)
            assert course is not None
            outputs.append(course.outputs[:, 0])
        columns.append((outputs[0] - outputs[1]) / 2e-4)
    return np.column_stack(columns)


def test_products_are_without_what_parameters_and_starts_can_do() -> None:
    """By Woodbury: C' (1 + N N')^-1 C, with N in deviations of the prior.

    The screen takes N from derivatives that are held over each step.
    """
    screen, found = screened()
    free = nuisances(found) * weight(found)
    c, y = screen._columns.columns, screen._columns.target
    inverse = np.linalg.inv(np.eye(len(y)) + free @ free.T)
    scale = np.sqrt(np.diag(c.T @ c) + 1e-30)
    expected = c.T @ inverse @ c
    products = screen._columns.products(np.arange(c.shape[1]))
    assert np.abs((products - expected) / np.outer(scale, scale)).max() < 0.03
    size = np.sqrt(y @ y)
    assert np.abs((screen._columns.moments - c.T @ inverse @ y) / (scale * size)).max() < 0.03
    remaining = screen._columns.remaining
    assert remaining @ remaining == pytest.approx(y @ inverse @ y, rel=0.03)


def test_what_a_parameter_does_is_left_with_nothing() -> None:
    """A linear spring is the stiffness; a cubic one is not."""
    screen, _ = screened()
    left = {}
    for i, candidate in enumerate(screen.candidates):
        at = screen.ends[i]
        if candidate.term.memory is Memory.NONE and not candidate.term.factor:
            left[candidate.term.signal, candidate.term.shape] = (
                screen._columns.norms[at] / screen._columns.alone[at]
            )
    assert left["x", Shape.LINEAR] < 0.02
    assert left["v", Shape.LINEAR] < 0.02
    assert left["x", Shape.CUBE] > 0.04


@pytest.mark.parametrize("local", [True, False])
def test_what_a_local_value_does_is_left_with_nothing(local: bool) -> None:
    """The spring of the second record is a hundredth stiffer than that of a fit to both.

    The fit has another mass in the second, by which the courses differ.
    """
    of_each = LocalValues(("a", "b"), ("mass", "stiffness") if local else ("mass",))
    plain = [replace(pushed(200, smooth=True), group=group) for group in (0, 1)]
    records = []
    for record, values in zip(plain, ((M, K, D), (1.5 * M, 1.01 * K, D)), strict=True):

        def rates(x: Array, u: float, t: float, v: tuple[float, ...] = values) -> list[float]:
            return [x[1], (u - v[1] * x[0] - v[2] * x[1]) / v[0]]

        records.append(replace(record, outputs=integrated(record, rates, START, 1e-7)[:, :1]))
    problem = replace(problem_of(records), local=of_each)
    point = nominal_point(problem)
    q = point.q + np.eye(len(point.q))[problem.names.index("mass@b")] * np.log(1.5)
    errors = tuple(np.ones((200, 1)) for _ in records)
    found = Fit(problem, (), replace(point, q=q), errors, 0.0, np.zeros((9, 9)))
    along = courses_of(found, problem.records, found.point.starts)
    assert along is not None
    assert np.abs(along.errors[0]).max() < 1e-3
    columns = screen_of(along, is_candidate=lambda term: isinstance(term, SensorTerm))._columns
    left = np.linalg.norm(columns.remaining) / np.linalg.norm(columns.target)
    assert (left < 0.1) == local


def test_a_small_term_is_solved_for() -> None:
    """Its coefficient, and no shift of the parameters, of a record that lacks it alone."""
    screen, _ = screened(2.0)
    terms = [c.term for c in screen.candidates]
    i = next(k for k, t in enumerate(terms) if t.shape is Shape.CUBE and t.signal == "x")
    (coefficient,), shift = screen.solve([i])
    term = terms[i]
    expected = 2.0 * term.scale**3 / term.size
    assert coefficient[0] == pytest.approx(expected, rel=0.15)
    assert shift[:3] * np.log(10.0) == pytest.approx(np.zeros(3), abs=0.02)


@pytest.mark.parametrize("gaps", [0, 30])
def test_the_gain_is_that_of_the_least_squares(gaps: int) -> None:
    """Of what is fitted, with the prior of parameters and starts, by NumPy."""
    screen, _ = screened(gaps=gaps)
    others, y = screen._columns.others, screen._columns.target
    assert int((y == 0.0).sum()) == gaps
    assert int((~screen._columns.columns.any(axis=1)).sum()) >= gaps
    left = y - others @ np.linalg.lstsq(*_with_prior(others, y), rcond=None)[0]
    for chosen in ([0], [3, 7], [5, 11, 20]):
        at = np.concatenate([np.arange(screen.ends[i], screen.ends[i + 1]) for i in chosen])
        columns = screen._columns.columns[:, at]
        ridge = np.sqrt(1e-6 * np.sum(columns**2, axis=0) + 1e-2)
        rows, target = _with_prior(np.hstack([columns, others]), y)
        rows[len(y) + np.arange(len(at)), np.arange(len(at))] = ridge
        values = np.linalg.lstsq(rows, target, rcond=None)[0]
        after = y - np.hstack([columns, others]) @ values
        before = np.linalg.lstsq(*_with_prior(others, y), rcond=None)[0]
        farther = values[len(at) :] @ values[len(at) :] - before @ before
        gain = 0.5 * screen.effective[0] * np.log((left @ left) / (after @ after)) - 0.5 * farther
        assert screen.gains([chosen])[0] == pytest.approx(gain, rel=1e-6)


def _with_prior(columns: Array, target: Array) -> tuple[Array, Array]:
    """Return rows of a least squares with a standard normal prior of the coefficients."""
    count = columns.shape[1]
    return np.vstack([columns, np.eye(count)]), np.append(target, np.zeros(count))


@pytest.mark.parametrize("size", [2.0, 40.0])
def test_sets_are_proposed_best_first_each_of_distinct_sources(size: float) -> None:
    screen, _ = screened(size)
    proposed = screen.propose(2)
    values = [value for value, _ in proposed]
    assert values == sorted(values, reverse=True)
    for _, chosen in proposed:
        sources = [screen.candidates[i].term.source for i in chosen]
        assert len(set(sources)) == len(sources)
    assert {len(chosen) for _, chosen in proposed} == {1, 2}
    assert {len(chosen) for _, chosen in screen.propose(3)} == {1, 2, 3}


def test_a_small_term_that_is_lacking_is_proposed_first() -> None:
    screen, _ = screened(2.0)
    singles = [screen.candidates[s[0]].term for _, s in screen.propose(1)]
    assert singles[0].cause == ("spring", "x")


def test_more_terms_and_more_words_have_less_value() -> None:
    """Beside what they explain."""
    screen, _ = screened()
    for i in range(0, len(screen.candidates), 9):
        candidate = screen.candidates[i]
        cost = 0.5 * np.log(screen.effective.sum()) * candidate.term.freedom + candidate.prior
        cost += 0.5 * np.log(len(screen.candidates))
        assert screen.value([i]) == pytest.approx(screen.gains([[i]])[0] - cost)


class Pair(Component):
    """Two vessels that share an inlet."""

    name = "pair"
    one = Parameter(1.0, "1/s", min=0.01)
    other = Parameter(0.5, "1/s", min=0.01)
    inlet = Input("1/s", nominal=1.0)
    a = State("1", rate="filling", nominal=1.0)
    b = State("1", rate="following", nominal=1.0)

    def filling(self):
        """Balance of the first."""
        return self.inlet - self.one * self.a

    def leak(self):
        """Lost by the second."""
        return self.other * self.b

    def following(self):
        """Balance of the second."""
        return self.inlet - self.leak()

    @Output("1", nominal=1.0)
    def first(self):
        """As measured."""
        return self.a

    @Output("1", nominal=1.0)
    def second(self):
        """As measured."""
        return self.b


def test_an_output_that_is_followed_well_hides_no_other() -> None:
    """The second vessel leaks by its square, too; the first is followed to its noise."""
    time = np.linspace(0.0, 40.0, 1001)
    inlet = 1.0 + np.sin(0.6 * time) * np.cos(0.23 * time)

    def rates(t: float, x: Array) -> list[float]:
        u = np.interp(t, time, inlet)
        return [u - x[0], u - 0.5 * x[1] - 0.05 * x[1] ** 2]

    states = solve_ivp(rates, (0.0, 40.0), [1.0, 0.5], t_eval=time, max_step=0.04).y.T
    outputs = states + np.random.default_rng(3).standard_normal((1001, 2)) * [0.1, 1e-3]
    record = Record(time, inlet[:, None].copy(), outputs, (True,))
    starts = (StartPrior(np.array([1.0, 0.5]), np.array([0.1, 0.1])),)
    problem = Problem(LawModel(Pair), (record,), outputs.std(axis=0), starts)
    base = fit(problem, (), [nominal_point(problem)], [np.full(2, 10.0)])
    assert base is not None
    along = courses_of(base, problem.records, base.point.starts)
    assert along is not None
    screen = screen_of(along)
    value, (first,) = screen.propose(1)[0]
    assert value > 0.0
    assert screen.candidates[first].term.cause == ("leak", "b")


def test_laws_that_act_alike_are_one_target() -> None:
    """A leak acts as the whole balance does; a flow acts on two of them, and outputs are none."""
    model, record, setting, course = vessels()
    classes = alike(model, [model.linearise(record, setting, course)])
    assert sorted(map(sorted, classes)) == [["filling", "leak"], ["flow"], ["following"]]


class Winding(Component):
    """A motor of which the speed is measured, and the current by a large unit."""

    name = "winding"
    voltage = Input("V", nominal=1.0)
    speed = State("rad/s", rate="acceleration", nominal=1.0, output=True)
    angle = State("rad", rate="turning", nominal=1.0)

    def turning(self):
        """By definition."""
        return self.speed

    def armature(self):
        """Ohm."""
        return self.voltage - self.speed

    def brake(self):
        """Viscous."""
        return 0.1 * self.speed

    def acceleration(self):
        """Newton."""
        return self.armature() - self.brake()

    @Output("A", nominal=1.0)
    def current(self):
        """As measured."""
        return 1e-3 * self.armature()


def test_laws_are_told_apart_by_an_output_whatever_its_unit() -> None:
    causes = {c.term.cause for c in noisy(Winding, 2).candidates if not c.term.factor}
    assert {("armature", "speed"), ("brake", "speed")} <= causes


def test_a_balance_and_its_parts_are_one_target_and_a_definition_none() -> None:
    setting = Setting(nominal(), FREE)
    record = pushed(30)
    course = mass().run(record, setting, START)
    assert course is not None
    classes = alike(mass(), [mass().linearise(record, setting, course)])
    assert sorted(map(sorted, classes)) == [["acceleration", "friction", "spring"]]
    screen, _ = screened()
    owners = {(c.term.signal, c.term.law) for c in screen.candidates if not c.term.factor}
    assert {("x", "spring"), ("v", "friction"), ("force", "acceleration")} <= owners
    assert ("x", "friction") not in owners, "the law that has the signal owns it"


class Tank(Component):
    """A vessel with two leaks, and a counter of all that has flowed in."""

    name = "tank"
    leak = Parameter(0.2, "1/s", min=0.0)
    inflow = Input("1/s", nominal=1.0)
    level = State("1", rate="change", nominal=1.0)
    total = State("1", rate="counting", nominal=1.0)

    def counting(self):
        """Flow into it."""
        return self.inflow

    def bent(self):
        """A function of one signal that is not in proportion to it."""
        return self.leak * self.level * self.level * self.level

    def mixed(self):
        """A function of two signals."""
        return self.leak * self.level * self.inflow

    def change(self):
        """Balance."""
        return self.inflow - self.bent() - self.mixed()

    @Output("1", nominal=1.0)
    def seen(self):
        """As measured."""
        return self.level


class Heater(Component):
    """A cell that its current warms, and that a share of it leaves."""

    name = "heater"
    resistance = Parameter(0.5, "ohm", min=0.0)
    current = Input("A", nominal=1.0)
    charge = State("C", rate="charging", nominal=1.0)
    rise = State("K", rate="warming", nominal=1.0)

    def drawn(self):
        """In proportion to the current."""
        return 0.9 * self.current

    def charging(self):
        """Balance."""
        return self.drawn() - 0.1 * self.charge

    def heating(self):
        """By the square of the current."""
        return self.resistance * self.current**2

    def warming(self):
        """Balance."""
        return self.heating() - self.rise

    @Output("K", nominal=1.0)
    def seen(self):
        """As measured."""
        return self.rise


@cache
def tank() -> Screen:
    return noisy(Tank)


@cache
def heater() -> Screen:
    return noisy(Heater)


def noisy(
    cls: type[Component], outputs: int = 1, start: tuple[float, float] = (0.5, 0.0)
) -> Screen:
    """Return the screen of a component with an input and outputs that are measured with noise."""
    time = 0.05 * np.arange(120)
    inflow = (1.0 + np.sin(1.7 * time) + 0.5 * np.sign(np.sin(0.9 * time)))[:, None].copy()
    record = Record(time, inflow, np.zeros((120, outputs)), (True,))
    model = LawModel(cls)
    starts = (StartPrior(np.array(start), np.array([0.1, 0.1])),)
    problem = Problem(model, (record,), np.ones(outputs), starts)
    point = nominal_point(problem)
    course = model.run(record, problem.setting(point, ()), point.starts[0])
    assert course is not None
    noise = 0.1 * np.random.default_rng(2).standard_normal((120, outputs))
    record = replace(record, outputs=course.outputs + noise)
    problem = replace(problem, records=(record,))
    fitted = Fit(problem, (), point, (noise,), 0.0, np.zeros((3, 3)))
    along = courses_of(fitted, problem.records, point.starts)
    assert along is not None
    return screen_of(along)


def test_laws_of_one_signal_are_no_signals() -> None:
    signals = {c.term.signal for c in tank().candidates}
    assert "mixed" in signals
    assert "bent" not in signals


class Shown(Component):
    """Two states of which one is shown, and the other read by an instrument."""

    name = "shown"
    inflow = Input("1", nominal=1.0)
    level = State("1", rate="change", nominal=1.0, output=True)
    total = State("1", rate="counting", nominal=1.0)

    def change(self):
        """Relaxation."""
        return self.inflow - self.level

    def counting(self):
        """Slower."""
        return self.level - self.total

    @Output("1", nominal=1.0)
    def read(self):
        """As measured."""
        return 2.0 * self.total


def test_faults_of_sensors_are_those_of_instruments() -> None:
    """A state that is shown has no law by which a model with such a fault could be made."""
    faults = {c.term.law for c in noisy(Shown, 2).candidates if isinstance(c.term, SensorTerm)}
    assert faults == {"read"}


def test_a_state_that_is_shown_is_a_signal_and_the_law_of_an_output_is_none() -> None:
    signals = {c.term.signal for c in noisy(Shown, 2).candidates}
    assert "level" in signals
    assert "read" not in {c.term.signal for c in noisy(Shown, 2).candidates if not _is_of_sensor(c)}


def _is_of_sensor(candidate: Candidate) -> bool:
    return isinstance(candidate.term, SensorTerm)


class Twins(Component):
    """Two states that are one but for a factor."""

    name = "twins"
    inflow = Input("1", nominal=1.0)
    first = State("1", rate="of_first", nominal=1.0)
    second = State("1", rate="of_second", nominal=1.0)

    def of_first(self):
        """Relaxation."""
        return self.inflow - self.first

    def of_second(self):
        """Relaxation."""
        return 2.0 * self.inflow - self.second

    @Output("1", nominal=1.0)
    def seen(self):
        """As measured."""
        return self.first * self.second


def test_of_signals_that_are_one_a_law_has_the_one_that_it_reads() -> None:
    terms = [c.term for c in noisy(Twins, start=(0.5, 1.0)).candidates]
    for law, own, other in (("of_first", "first", "second"), ("of_second", "second", "first")):
        signals = {term.signal for term in terms if term.law == law}
        assert own in signals
        assert other not in signals


def test_a_law_may_be_in_percent_over_its_own_heat_but_not_over_itself() -> None:
    own = {c.term.memory for c in tank().candidates if c.term.signal == c.term.factor == "mixed"}
    assert Memory.HEAT in own
    assert Memory.NONE not in own


def test_inputs_and_states_are_counted_and_laws_are_not() -> None:
    """But for the input that a state counts already."""
    counted = {c.term.signal for c in heater().candidates if c.term.memory.counts}
    assert {"current", "charge"} <= counted <= {"current", "charge", "rise"}
    net = {c.term.signal for c in tank().candidates if c.term.memory is Memory.INTEGRAL}
    assert "inflow" not in net


def test_what_has_passed_is_no_signal_of_a_piece_that_begins_later() -> None:
    along = heater()._along
    (whole,), (course,) = along.pieces, along.courses
    halves = whole.part(0, 60), whole.part(60, 120)
    along = courses_of(along.fitted, halves, (course.states[0], course.states[60]))
    assert along is not None
    memories = {c.term.memory for c in screen_of(along).candidates}
    assert Memory.LAG in memories
    assert not any(memory.counts for memory in memories)


def test_a_balance_may_be_in_proportion_to_a_function_of_a_signal() -> None:
    """As the acceleration is where the mass depends on the place."""
    screen, _ = screened()
    factors = {(c.term.law, c.term.factor, c.term.signal) for c in screen.candidates}
    assert ("acceleration", "acceleration", "x") in factors
    assert ("acceleration", "acceleration", "acceleration") not in factors


def test_a_rate_that_relaxes_its_state_may_be_over_itself() -> None:
    """By direction, by size, or limited; a counter of an input relaxes nothing."""
    own = {c.term.shape for c in tank().candidates if c.term.cause == ("change", "change")}
    assert own == {Shape.MODULUS, Shape.ODD_SQUARE, Shape.CUBE, Shape.DRY}
    assert not any(c.term.cause == ("counting", "counting") for c in tank().candidates)


def test_a_product_with_an_input_is_owned_by_the_law_of_the_input() -> None:
    """Unless a law is in proportion to it: then it is a change in percent of that law."""
    products = {
        (c.term.law, c.term.signal, c.term.factor)
        for c in heater().candidates
        if c.term.factor in ("current", "drawn")
    }
    assert ("heating", "charge", "current") in products
    assert ("drawn", "charge", "drawn") in products
    assert ("drawn", "charge", "current") not in products


def test_a_product_of_two_signals_is_a_candidate_once() -> None:
    """Of the others each has another shape of one of them, or a memory."""
    along = heater()
    products: dict[str, list[np.ndarray]] = defaultdict(list)
    for candidate in along.candidates:
        term = candidate.term
        if term.factor and term.shape is Shape.LINEAR and not term.has_memory:
            product = candidate.values[:, 0] * candidate.amount
            products[term.law].append(product / np.linalg.norm(product))
    assert max(map(len, products.values())) > 1
    for own in products.values():
        for k, one in enumerate(own):
            assert all(abs(one @ other) < 0.9999 for other in own[:k])


def test_the_lag_of_a_sensor_is_searched_from_shorter_ones_too() -> None:
    lag = SensorTerm("place", "place", Shape.LINEAR, Memory.FADING, (50.0,))
    assert [term.constants for term in with_shorter_lags(lag)] == [(50.0,), (5.0,), (0.5,)]
    gain = SensorTerm("place", "place", Shape.LINEAR)
    assert list(with_shorter_lags(gain)) == [gain]


def test_what_counts_an_input_is_no_target() -> None:
    assert "counting" not in {c.term.law for c in tank().candidates}


def test_a_law_is_no_signal_of_those_that_act_alike() -> None:
    """But remembered, or as a factor, it may be."""
    plain = [c.term for c in tank().candidates if c.term.memory is Memory.NONE]
    assert not any(t.signal == "mixed" and not t.factor for t in plain)


def test_partners_are_those_that_gain_most_beside_a_candidate() -> None:
    """Those of one coefficient, by the sets' own values."""
    screen, _ = screened()
    first = int(np.argmax([screen.value([i]) for i in range(len(screen.candidates))]))
    simple = [j for j in np.flatnonzero(np.diff(screen.ends) == 1).tolist() if j != first]
    ranked = sorted(simple, key=lambda j: -screen.value((first, j)))
    assert set(ranked[:10]) <= set(screen._partners(first))


def test_faults_of_the_sensor_of_a_measured_output_are_proposed() -> None:
    screen, _ = screened()
    faults = [c for c in screen.candidates if isinstance(c.term, SensorTerm)]
    names = {f"sensor_{fault}(position)" for fault in ("offset", "gain", "drift", "lag")}
    names.add("transport_delay(position)")
    assert {c.term.name for c in faults} == names
    assert {c.term.law for c in faults} == {"position"}
    plain = [c.prior for c in faults if c.term.shape in (Shape.CONSTANT, Shape.LINEAR)]
    assert plain == pytest.approx([WEIGHTS.misread] * len(plain)), "as likely as a misread file"


def test_what_may_be_no_cause_is_not_proposed() -> None:
    _, found = screened()
    along = courses_of(found, found.problem.records, found.point.starts)
    assert along is not None
    restricted = screen_of(along, is_candidate=lambda term: isinstance(term, SensorTerm))
    assert restricted.candidates
    assert all(isinstance(one.term, SensorTerm) for one in restricted.candidates)
    whole = screen_of(along)
    (place,) = [
        i for i, one in enumerate(whole.candidates) if one.term == restricted.candidates[0].term
    ]
    assert restricted.gains([(0,)]) == pytest.approx(whole.gains([(place,)]))
    assert not screen_of(along, is_candidate=lambda term: False).candidates


def test_the_response_to_a_fault_of_a_sensor_is_the_fault() -> None:
    """A drift is seen as it is, whatever the model does."""
    screen, found = screened()
    drift = next(
        i
        for i, c in enumerate(screen.candidates)
        if isinstance(c.term, SensorTerm)
        and c.term.fault == "drift"
        and c.term.shape is Shape.LINEAR
    )
    (record,) = found.problem.records
    column = screen._columns.columns[:, screen.ends[drift]]
    assert column / column[-1] == pytest.approx(record.time / record.time[-1], abs=1e-9)


def test_changes_of_an_integral_are_proposed_as_a_lag_of_what_it_integrates() -> None:
    """Of the position none are, which the velocity makes; of the velocity some."""
    screen, _ = screened()
    fading = {c.term.signal for c in screen.candidates if c.term.memory is Memory.FADING}
    lags = {c.term.signal for c in screen.candidates if c.term.memory is Memory.LAG}
    assert "v" in fading & lags
    assert "x" not in {
        c.term.signal
        for c in screen.candidates
        if c.term.memory is Memory.FADING and not isinstance(c.term, SensorTerm)
    }
