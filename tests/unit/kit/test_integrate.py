import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from fmus.kit import (
    Component,
    Discrete,
    Input,
    Parameter,
    State,
    UserError,
    cos,
    maximum,
    sqrt,
    where,
)
from fmus.kit import integrate as module
from fmus.kit.integrate import Integrator
from fmus.kit.record.compiled import CompiledModel


class Decay(Component):
    rate = Parameter(1.0, "1/s")
    x = State("1", rate="falling", start=1.0)

    def falling(self):
        return -self.rate * self.x


class Oscillator(Component):
    damping = Parameter(5.0, "1")
    position = State("1", rate="velocity_of", start=2.0)
    velocity = State("1", rate="acceleration")

    def velocity_of(self):
        return self.velocity

    def acceleration(self):
        """Van der Pol."""
        return self.damping * (1.0 - self.position * self.position) * self.velocity - self.position


MATRIX = np.array([[-1000.0, 1000.0, 0.0], [0.0, -2.0, 5.0], [0.0, -5.0, -2.0]])


class Linear(Component):
    """One fast mode that follows two slow ones."""

    u = Input("1", start=0.7)
    a = State("1", rate="da", start=1.0)
    b = State("1", rate="db", start=-1.0)
    c = State("1", rate="dc", start=0.5)

    def da(self):
        return -1000.0 * self.a + 1000.0 * self.b

    def db(self):
        return -2.0 * self.b + 5.0 * self.c + self.u

    def dc(self):
        return -5.0 * self.b - 2.0 * self.c


class Clocked(Component):
    """Two sampled groups: a counter and a time stamp on one period, a swapping pair on another."""

    period = Parameter(0.3, "s")
    ramp = State("s", rate="slope")
    count = Discrete("1", update="increased", period="period")
    stamp = Discrete("s", update="now", period="period")
    left = Discrete("1", update="to_left", period=0.25, start=1.0)
    right = Discrete("1", update="to_right", period=0.25, start=2.0)

    def slope(self):
        return self.count

    def increased(self):
        return self.count + 1.0

    def now(self):
        return self.time

    def to_left(self):
        return self.right

    def to_right(self):
        return self.left


class Quartic(Component):
    """A fast oscillator on a cubic spring; from 1000 a trial step of 1 s overflows."""

    x = State("1", rate="moving", start=1.0)
    v = State("1", rate="pulled")

    def moving(self):
        return self.v

    def pulled(self):
        return -(self.x**3)


def run(integrator, step, steps, start=0.0):
    for k in range(steps):
        integrator.advance(start + k * step, step)


# --- continuous
# --------------------------------------------------------------------------------------------------


@given(rate=st.floats(-2.0, 50.0), step=st.floats(1e-3, 1.0), steps=st.integers(1, 20))
def test_exponential(rate, step, steps):
    model = Decay(rate=rate)
    run(Integrator(model), step, steps)
    assert model.x == pytest.approx(
        math.exp(-rate * step * steps), rel=1e-6, abs=10 * model.tolerance
    )


def test_one_internal_step_is_the_taylor_polynomial_of_fourth_order():
    model = Decay()
    integrator = Integrator(model)
    integrator.tolerance = 1e9
    h = 0.8
    integrator.advance(0.0, h)
    assert model.x == pytest.approx(1 - h + h**2 / 2 - h**3 / 6 + h**4 / 24, rel=1e-15)
    assert integrator.hint == math.inf


@pytest.mark.parametrize("tolerance", [1e-5, 1e-7, 1e-9])
def test_error_follows_the_tolerance(tolerance):
    model = Oscillator(damping=0.0)
    integrator = Integrator(model)
    integrator.tolerance = tolerance
    run(integrator, 0.5, 20)
    error = max(
        abs(model.position - 2.0 * math.cos(10.0)), abs(model.velocity + 2.0 * math.sin(10.0))
    )
    assert error < 1000 * tolerance


@pytest.mark.parametrize("step", [0.01, 0.37, 12.0])
def test_nonlinear_against_scipy(step):
    steps = round(12.0 / step)
    model = Oscillator()
    run(Integrator(model), step, steps)
    exact = solve_ivp(
        lambda t, y: [y[1], 5.0 * (1.0 - y[0] ** 2) * y[1] - y[0]],
        (0.0, step * steps),
        [2.0, 0.0],
        method="DOP853",
        rtol=1e-12,
        atol=1e-13,
    )
    assert [model.position, model.velocity] == pytest.approx(exact.y[:, -1], rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("step", [1e-4, 0.013, 0.5])
def test_fast_and_slow_modes_against_the_matrix_exponential(step):
    steps = max(1, round(0.5 / step))
    model = Linear()
    run(Integrator(model), step, steps)
    augmented = np.zeros((4, 4))
    augmented[:3, :3], augmented[1, 3] = MATRIX, 1.0
    exact = expm(augmented * step * steps) @ [1.0, -1.0, 0.5, 0.7]
    assert [model.a, model.b, model.c] == pytest.approx(exact[:3], rel=1e-6, abs=1e-7)


def test_laws_may_depend_on_time():
    class Driven(Component):
        x = State("1", rate="wave")

        def wave(self):
            return cos(self.time)

    model = Driven()
    run(Integrator(model), 0.4, 25, start=3.0)
    # the estimate compares rates at one time, so it is blind to time itself: Simpson's rule at the
    # communication step
    assert model.x == pytest.approx(math.sin(13.0) - math.sin(3.0), abs=10 * 0.4**4 / 2880)


def test_remembered_step_is_kept_across_short_communication_steps():
    integrator = Integrator(Linear())
    integrator.advance(0.0, 0.1)
    remembered = integrator.hint
    assert 0.0 < remembered < 0.1
    integrator.advance(0.1, remembered / 50)
    assert integrator.hint >= remembered


def test_internal_step_lands_exactly_on_the_communication_point():
    seen = []

    class Watched(Decay):
        def falling(self):
            seen.append(self.time)
            return super().falling()

    integrator = Integrator(Watched(rate=40.0))
    for k in range(10):
        integrator.advance(k * 0.1, 0.1)
    assert max(seen) == pytest.approx(1.0, abs=1e-15)


# --- batches
# --------------------------------------------------------------------------------------------------


def test_batch_agrees_with_one_by_one():
    starts, dampings = np.array([2.0, -1.0, 0.3, 0.0]), np.array([5.0, 1.0, 0.1, 3.0])
    batch = Oscillator(damping=dampings, position_start=starts, velocity_start=np.zeros(4))
    run(Integrator(batch, batch=True), 0.25, 20)
    for i in range(4):
        single = Oscillator(damping=float(dampings[i]), position_start=float(starts[i]))
        run(Integrator(single), 0.25, 20)
        assert batch.position[i] == pytest.approx(single.position, rel=1e-6, abs=1e-7)
        assert batch.velocity[i] == pytest.approx(single.velocity, rel=1e-6, abs=1e-7)


def test_batch_of_one_takes_the_same_steps():
    batch, single = (
        Oscillator(position_start=np.array([2.0]), velocity_start=np.array([0.0])),
        Oscillator(),
    )
    arrays, floats = Integrator(batch, batch=True), Integrator(single)
    run(arrays, 0.3, 10)
    run(floats, 0.3, 10)
    assert arrays.hint == pytest.approx(floats.hint, rel=1e-9)
    assert batch.position[0] == pytest.approx(single.position, rel=1e-12)


def test_batch_that_overflows_in_a_trial_step_gives_no_warning():
    starts = np.array([300.0, 1.0])
    model = Quartic(x_start=starts, v_start=np.zeros(2))
    Integrator(model, batch=True).advance(0.0, 1.0)
    assert model.v**2 / 2 + model.x**4 / 4 == pytest.approx(starts**4 / 4, rel=1e-4)


# --- sampled
# --------------------------------------------------------------------------------------------------


def instants(period, end):
    """Return the number of k with k * period < end, exactly."""
    return -((-end) // period) if end > 0 else 0


@given(
    period=st.integers(1, 100),
    step=st.integers(1, 150),
    steps=st.integers(1, 25),
    start=st.sampled_from([0.0, 7.0]),
)
def test_samples_fall_on_exact_instants_for_any_communication_step(period, step, steps, start):
    model = Clocked(period=period / 100)
    integrator = Integrator(model)
    integrator.start_time = start
    for k in range(steps):
        integrator.advance(start + k * step / 100, step / 100)
    end = Fraction(step * steps, 100)
    taken = int(instants(Fraction(period, 100), end))
    assert model.count == taken == integrator.counters[0]
    assert model.stamp == pytest.approx(start + (taken - 1) * period / 100, abs=1e-12)
    swaps = int(instants(Fraction(1, 4), end))
    assert integrator.counters[1] == swaps
    assert (model.left, model.right) == ((2.0, 1.0) if swaps % 2 else (1.0, 2.0))
    # the ramp integrates the counter, held between samples
    ramp = sum(
        (k + 1) * (min(Fraction((k + 1) * period, 100), end) - Fraction(k * period, 100))
        for k in range(taken)
    )
    assert model.ramp == pytest.approx(float(ramp), rel=1e-9)


def test_a_sample_at_a_communication_point_belongs_to_the_step_that_begins_there():
    model = Clocked(period=0.5)
    integrator = Integrator(model)
    counts = []
    for k in range(4):
        integrator.advance(k * 0.5, 0.5)
        counts.append(model.count)
    assert counts == [1.0, 2.0, 3.0, 4.0]
    assert model.stamp == 1.5


def test_a_step_of_zero_makes_the_updates_that_are_due_and_no_other():
    model = Clocked(period=0.5)
    integrator = Integrator(model)
    integrator.advance(0.0, 0.4)
    seen = []
    for time in (0.4, 0.5, 0.5):
        integrator.advance(time, 0.0)
        seen.append((model.count, model.stamp, model.ramp))
    assert seen == [(1.0, 0.0, 0.4), (2.0, 0.5, 0.4), (2.0, 0.5, 0.4)]


def test_ten_million_samples_later_the_instants_are_still_exact():
    model = Clocked(period=0.1)
    integrator = Integrator(model)
    integrator.counters = [1e7, 4e6]
    integrator.advance(1e6, 0.1)
    integrator.advance(1e6 + 0.1, 0.1)
    assert model.count == 2.0
    assert model.stamp == 1e6 + 0.1


def test_only_sampled_states_need_no_integration():
    class Counter(Component):
        n = Discrete("1", update="next", period=0.1)

        def next(self):
            return self.n + 1.0

    model = Counter()
    Integrator(model).advance(0.0, 0.35)
    assert model.n == 4.0


# --- failures
# --------------------------------------------------------------------------------------------------


def failing(law, start=1.0, extra=None):
    class Failing(Component):
        calm = State("1", rate="resting")
        wild = State("1", rate="going", start=start)

        def resting(self):
            return 0.0

        def going(self):
            return law(self)

    return Failing()


@pytest.mark.parametrize(
    ("law", "start", "step"),
    [
        (lambda m: sqrt(-m.wild), 1.0, 1.0),
        (lambda m: math.nan, 1.0, 1.0),
        (lambda m: 1.0 / (m.calm * m.wild), 1.0, 1.0),
        (lambda m: m.wild**2, 1e200, 1.0),
    ],
    ids=["domain", "nan", "division by zero", "overflow that Python raises"],
)
def test_what_is_not_finite_is_reported_with_the_state(law, start, step):
    model = failing(law, start)
    with pytest.raises(UserError, match=r"^not finite: wild.* at 3 s$"):
        Integrator(model).advance(3.0, step)
    assert (model.calm, model.wild) == (0.0, start)  # left at the last good values


def test_batch_that_is_not_finite_is_reported_with_the_state():
    model = failing(lambda m: sqrt(m.wild))
    model.calm, model.wild = np.zeros(2), np.array([1.0, -1.0])
    with (
        np.errstate(invalid="ignore"),
        pytest.raises(UserError, match=r"^not finite: wild at 0 s$"),
    ):
        Integrator(model, batch=True).advance(0.0, 1.0)


@pytest.mark.parametrize(
    "law", [lambda m: m.wild * m.wild, lambda m: m.wild**2], ids=["infinity", "exception"]
)
def test_escape_in_finite_time_ends_with_a_message_near_that_time(law):
    model = failing(law)
    integrator = Integrator(model)
    integrator.advance(0.0, 0.9)
    assert model.wild == pytest.approx(10.0, rel=1e-6)
    with pytest.raises(UserError, match=r" at (0\.99999|1)") as caught:
        integrator.advance(0.9, 0.5)
    assert "\n" not in str(caught.value)


def test_an_unstable_law_ends_with_a_message():
    with pytest.raises(UserError, match=r"^not finite: wild at 0\.[67]"):
        Integrator(failing(lambda m: 1e3 * m.wild)).advance(0.0, 10.0)


def test_a_trial_step_that_overflows_is_only_rejected():
    model = Quartic(x_start=1000.0)
    Integrator(model).advance(0.0, 1.0)
    assert model.v**2 / 2 + model.x**4 / 4 == pytest.approx(1000.0**4 / 4, rel=1e-4)


def test_accuracy_that_cannot_be_reached_is_reported():
    calls = iter(range(10**6))
    model = failing(lambda m: 1e8 * (-1.0) ** next(calls))  # no two values are alike
    with pytest.raises(UserError, match=r"^accuracy 1e-08 cannot be reached at 0 s$"):
        Integrator(model).advance(0.0, 1.0)


def test_too_many_internal_steps_are_reported(monkeypatch):
    monkeypatch.setattr(module, "MAX_STEPS", 100)
    with pytest.raises(
        UserError, match=r"^more than 100 internal steps in one communication step at "
    ):
        Integrator(Oscillator()).advance(0.0, 1000.0)


def test_the_limit_counts_over_all_samples_of_a_communication_step(monkeypatch):
    class Fast(Oscillator):
        n = Discrete("1", update="next", period=0.1)

        def next(self):
            return self.n + 1.0

    monkeypatch.setattr(module, "MAX_STEPS", 100)
    with pytest.raises(UserError, match=r"^more than 100 internal steps"):
        Integrator(Fast()).advance(0.0, 1000.0)
    Integrator(Fast()).advance(0.0, 0.1)


class Emptying(Component):
    """x' = -50 max(x, 0): a step much too long ends where nothing moves."""

    x = State("1", rate="rate", start=1.0)

    def rate(self):
        return -50.0 * maximum(self.x, 0.0)


class Falling(Component):
    """Constant fall that stops at zero."""

    x = State("1", rate="rate", start=1.0)

    def rate(self):
        return where(self.x > 0.0, -100.0, 0.0)


class Swinging(Component):
    """x' = cos(t): nothing but quadrature."""

    x = State("1", rate="rate")

    def rate(self):
        return cos(self.time)


@pytest.mark.parametrize(
    ("cls", "step", "exact"),
    [
        (Emptying, 0.1, np.exp(-5.0)),
        (Emptying, 0.02, np.exp(-1.0)),  # one time constant, where Zonneveld's estimate vanishes
        (Emptying, 3.0, 0.0),
        (Falling, 0.1, 0.0),
        (Swinging, 0.4, np.sin(0.4)),
    ],
)
def test_no_step_is_too_long_to_be_noticed(cls, step, exact):
    model = cls()
    Integrator(model).advance(0.0, step)
    assert model.x == pytest.approx(exact, abs=1e-7)


class Shifted(Component):
    """Counts the samples of a clock that begins after the start."""

    name = "shifted"
    period = Parameter(0.5, "s", min=1e-3)
    first = Parameter(0.2, "s", min=0)
    more = Parameter(0.1, "s", min=0)
    count = Discrete("1", update="counted", period="period", shift=("first", "more"), output=True)
    age = State("s", rate="passing")

    def counted(self):
        return self.count + 1.0

    def passing(self):
        return 1.0 + 0.0 * self.count


@pytest.mark.parametrize("step", [0.07, 0.1, 0.5])
def test_a_clock_with_a_shift_begins_that_much_later(step):
    """Samples fall on 0.3, 0.8, 1.3 s and so on; one at the end of a step is of the next."""
    component = Shifted()
    integrator = Integrator(component)
    counts = []
    for k in range(30):
        integrator.advance(k * step, step)
        counts.append(component.count)
    ends = step * np.arange(1, 31)
    before = np.array([np.sum(0.3 + 0.5 * np.arange(60) < end - 1e-9) for end in ends])
    assert counts == before.tolist()
    time = np.concatenate([[0.0], ends])
    compiled = CompiledModel(Shifted).run(time, {}).signals["count"]
    assert compiled[1:].tolist() == counts


def test_a_shift_that_is_no_parameter_is_refused():
    with pytest.raises(UserError, match="has the shift 'late', which is no parameter"):
        type(
            "Late",
            (Shifted,),
            {
                "name": "late",
                "other": Discrete("1", update="counted", period=1.0, shift=("late",)),
            },
        )
