"""Claims: free runs with terms are the solutions of the equations, and their derivatives exact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from fmus.kit import Component, Input, Output, Parameter, State, stack
from fmus.kit.arrays import Array
from fmus.kit.sensors import transport_delay
from orchestration.diagnosis import LawModel, Record, Shape, Term, law_model
from orchestration.diagnosis.fitting import Problem
from orchestration.diagnosis.runs import Course, Setting
from orchestration.diagnosis.terms import Memory
from tests.support.diagnosed_mass import (
    FREE,
    START,
    D,
    K,
    M,
    Mass,
    exact,
    integrated,
    mass,
    nominal,
    pushed,
)
from tests.support.oscillator_model import Oscillator

SIZE, SCALE, MIDDLE, WIDTH = 0.4, 0.1, 0.01, 0.5
PLACES = (-3.0, -1.5, 0.0, 1.5, 3.0)
COEFFICIENTS = 0.7, -0.3, 0.2, 0.9, -0.5
C = COEFFICIENTS[0]
T = 0.4

SHAPES: dict[Shape, Callable[[float], float]] = {
    Shape.CONSTANT: lambda z: 1.0,
    Shape.LINEAR: lambda z: z,
    Shape.MODULUS: abs,
    Shape.SQUARE: lambda z: z**2,
    Shape.ODD_SQUARE: lambda z: z * abs(z),
    Shape.CUBE: lambda z: z**3,
    Shape.ROOT: lambda z: z / np.sqrt(abs(z) + 0.02),
    Shape.DRY: lambda z: np.tanh(z / WIDTH),
    Shape.DEAD_ZONE: lambda z: np.sign(z) * max(abs(z) - WIDTH, 0.0),
    Shape.ABOVE: lambda z: max(z - WIDTH, 0.0),
    Shape.BELOW: lambda z: min(z + WIDTH, 0.0),
    Shape.EXPONENTIAL: lambda z: np.expm1(z / WIDTH),
    Shape.LEVELLING: lambda z: -np.expm1(-z / WIDTH),
    Shape.SINH: lambda z: np.sinh(z / WIDTH),
    Shape.STEP: lambda z: 0.5 + 0.5 * np.tanh((z - WIDTH) / 0.004),
}
LENGTH = 3.0  # s, scale of a step over time


def shaped(shape: Shape, z: float) -> float:
    """Return the sum of coefficients and shape functions at a scaled signal."""
    if shape is Shape.CURVE:
        chords = np.diff(COEFFICIENTS) / np.diff(PLACES)
        slopes = [chords[0], *(0.5 * (chords[:-1] + chords[1:])), chords[-1]]
        within = np.clip(z, PLACES[0], PLACES[-1])
        return float(CubicHermiteSpline(PLACES, COEFFICIENTS, slopes)(within))
    return C * SHAPES[shape](z)


def term_of(shape: Shape, memory: Memory = Memory.NONE, **changes: object) -> Term:
    constants = (T, 0.5)[: memory.constants]
    places = PLACES if shape is Shape.CURVE else ()
    if shape is Shape.STEP:
        return Term(
            "spring", "time", shape, memory, constants, size=SIZE, scale=LENGTH, width=WIDTH
        )
    return Term(
        "spring", "x", shape, memory, constants, size=SIZE, scale=SCALE, middle=MIDDLE,
        width=WIDTH, places=places, **changes,
    )  # fmt: skip


def values_of(term: Term) -> Array:
    return np.append(COEFFICIENTS[: term.coefficients], term.start)


def setting_of(*terms: Term, substeps: int = 2) -> Setting:
    values = np.concatenate([np.zeros(0), *map(values_of, terms)])
    return Setting(nominal(), FREE, terms, values, substeps)


def run(record: Record, setting: Setting, start: Array = START, sensitive: bool = False) -> Course:
    course = mass().run(record, setting, start, sensitive=sensitive)
    assert course is not None
    return course


def rates(x: Array, u: float, addition: float) -> list[float]:
    return [x[1], (u - K * x[0] - addition - D * x[1]) / M]


@pytest.mark.parametrize("smooth", [False, True])
def test_a_run_without_terms_solves_the_equations(smooth: bool) -> None:
    record = pushed(120, smooth=smooth)
    expected = integrated(record, lambda x, u, t: rates(x, u, 0.0), START)
    course = run(record, setting_of())
    assert course.states == pytest.approx(expected, abs=1e-7)
    assert course.outputs[:, 0] == pytest.approx(expected[:, 0], abs=1e-7)


def test_a_curved_input_goes_as_its_spline_does() -> None:
    """Nine samples to a period of the force, by SciPy's integration of its own spline."""
    time = 0.1 * np.arange(80)
    force = 5.0 * np.sin(7.0 * time)
    record = Record(time, force[:, None].copy(), np.zeros((80, 1)), (True,), curved=True)
    spline = CubicSpline(time, force)
    expected = solve_ivp(
        lambda t, x: rates(x, float(spline(t)), 0.0),
        (0.0, time[-1]),
        START,
        t_eval=time,
        rtol=1e-9,
        atol=1e-11,
    ).y.T
    assert run(record, setting_of(substeps=8)).states == pytest.approx(expected, abs=2e-6)
    straight = run(replace(record, curved=False), setting_of(substeps=8)).states
    assert abs(straight - expected).max() > 1e-3
    assert run(replace(record, smooth=(False,)), setting_of()).states == pytest.approx(
        run(replace(record, smooth=(False,), curved=False), setting_of()).states, abs=0.0
    )


@pytest.mark.parametrize("shape", Shape)
def test_a_run_with_a_shape_solves_the_equations(shape: Shape) -> None:
    record = pushed(160)

    def of(x: Array, u: float, t: float) -> list[float]:
        z = t / LENGTH if shape is Shape.STEP else (x[0] - MIDDLE) / SCALE
        return rates(x, u, SIZE * shaped(shape, z))

    course = run(record, setting_of(term_of(shape), substeps=8))
    expected = integrated(record, of, START)
    assert course.states[:, 0] == pytest.approx(expected[:, 0], abs=2e-6)
    plain = run(record, setting_of()).states[:, 0]
    assert np.abs(plain - expected[:, 0]).max() > 1e-3, "the term is too small to be seen"


@pytest.mark.parametrize("shape", Shape)
def test_shape_functions_sum_to_the_shape(shape: Shape) -> None:
    term = term_of(shape)
    x = np.linspace(-0.5, 0.5, 101)
    total = mass().shape_values(term, x) @ COEFFICIENTS[: term.coefficients]
    scaled = (x - term.middle) / term.scale
    assert total == pytest.approx([shaped(shape, z) for z in scaled], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("shape", [Shape.EXPONENTIAL, Shape.LEVELLING, Shape.SINH])
def test_an_exponential_stays_finite_far_beyond_its_width(shape: Shape) -> None:
    term = replace(term_of(shape), width=1e-3)
    values = mass().shape_values(term, np.array([-9.0, -1.0, 1.0, 9.0]))[:, 0]
    assert np.isfinite(values).all()
    assert np.all(np.diff(values) >= 0.0)
    assert np.abs(values).max() == pytest.approx(np.exp(30.0), rel=0.6)


def lag(x: float, z: float) -> float:
    return (x - z) / T


def two_lags(x: float, z: float) -> float:
    return (x - z) / (T if x >= z else T * 0.5)


def rate_limit(x: float, z: float) -> float:
    most = SCALE * 0.5
    return most * np.tanh((x - z) / T / most)


def heat(x: float, z: float) -> float:
    return (x**2 - z) / T


def integral(x: float, z: float) -> float:
    return x


def throughput(x: float, z: float) -> float:
    return abs(x)


FROM_REST = (Memory.HEAT, Memory.INTEGRAL, Memory.THROUGHPUT)
RATES = {
    Memory.LAG: lag,
    Memory.FADING: lag,
    Memory.TWO_LAGS: two_lags,
    Memory.RATE_LIMIT: rate_limit,
    Memory.HEAT: heat,
    Memory.INTEGRAL: integral,
    Memory.THROUGHPUT: throughput,
}


@pytest.mark.parametrize("memory", RATES)
def test_a_run_with_a_memory_of_a_rate_solves_the_equations(memory: Memory) -> None:
    record = pushed(100)

    def of(x: Array, u: float, t: float) -> list[float]:
        stays = memory in (Memory.LAG, *FROM_REST)
        seen = x[2] if stays else x[0] - x[2]
        addition = SIZE * shaped(Shape.CUBE, (seen - MIDDLE) / SCALE)
        return [*rates(x, u, addition), RATES[memory](x[0], x[2])]

    course = run(record, setting_of(term_of(Shape.CUBE, memory), substeps=16))
    begin = 0.0 if memory in FROM_REST else START[0]  # at rest, or in equilibrium
    expected = integrated(record, of, np.append(START, begin))
    assert course.states == pytest.approx(expected, abs=2e-6)


def test_play_follows_its_signal_at_a_distance() -> None:
    record = pushed(200)
    way = T * SCALE
    course = run(record, setting_of(term_of(Shape.LINEAR, Memory.PLAY), substeps=1))
    z, positions = START[0], []
    for x in course.states[:, 0]:
        z = min(max(z, x - way), x + way)
        positions.append(z)
    assert course.states[:, 2] == pytest.approx(positions, abs=1e-12)
    assert np.count_nonzero(np.diff(positions) == 0.0) > 20, "it never stood still"


def test_backlash_is_a_signal_less_its_play() -> None:
    """Which stands still during a step, over which the mass is linear with another spring."""
    record = pushed(150)
    way = T * SCALE
    course = run(record, setting_of(term_of(Shape.LINEAR, Memory.BACKLASH), substeps=1))
    z = course.states[:, 2]
    assert np.abs(course.states[:, 0] - z).max() <= way + 1e-12
    stiffer = K + SIZE * C / SCALE
    held = record.inputs[:, 0] + SIZE * C * (z + MIDDLE) / SCALE
    expected = exact(record, (M, stiffer, D), START, held)
    assert course.states[:, :2] == pytest.approx(expected, abs=1e-5)


def test_a_dahl_element_gives_before_it_slides() -> None:
    """From rest it is w (1 - exp(-s / w)) after a way s in one direction."""
    record = pushed(200)
    way = T * SCALE
    course = run(record, setting_of(term_of(Shape.LINEAR, Memory.DAHL), substeps=1))
    x, z = course.states[:, 0], course.states[:, 2]
    turn = int(np.argmax(np.diff(x) < 0.0)) + 1
    assert turn > 5
    closed = way * (1.0 - np.exp(-(x[:turn] - x[0]) / way))
    assert z[:turn] == pytest.approx(closed, abs=1e-12)
    bristle = [0.0]
    for moved in np.diff(x):
        end = way * np.sign(moved)
        bristle.append(end + (bristle[-1] - end) * np.exp(-abs(moved) / way))
    assert z == pytest.approx(bristle, abs=1e-12)


@pytest.mark.parametrize("memory", [Memory.PLAY, Memory.DAHL])
def test_play_and_dahl_act_on_the_law(memory: Memory) -> None:
    """They stand still during a step, over which the mass is linear."""
    record = pushed(150)
    course = run(record, setting_of(term_of(Shape.LINEAR, memory), substeps=1))
    addition = SIZE * C * (course.states[:, 2] - MIDDLE) / SCALE
    expected = exact(record, (M, K, D), START, record.inputs[:, 0] - addition)
    assert course.states[:, :2] == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("memory", [m for m in Memory if m not in (Memory.NONE, *FROM_REST)])
def test_memories_begin_in_equilibrium(memory: Memory) -> None:
    """A mass at rest under a spring's force stays there, whatever the memory."""
    start = np.array([0.1, 0.0])
    term = term_of(Shape.LINEAR, memory)
    is_place = memory in (Memory.LAG, Memory.PLAY)
    addition = SIZE * C * ((start[0] if is_place else 0.0) - MIDDLE) / SCALE
    record = pushed(50)
    record.inputs[:] = K * start[0] + addition
    states = run(record, setting_of(term), start).states
    assert states == pytest.approx(np.tile(states[0], (50, 1)), abs=1e-12)
    assert states[0, 2] == (0.0 if memory is Memory.DAHL else start[0])


def test_a_factor_multiplies_and_time_is_a_signal() -> None:
    record = pushed(100)
    term = Term("spring", "time", Shape.LINEAR, factor="friction", size=1.0, scale=2.0)

    def of(x: Array, u: float, t: float) -> list[float]:
        return rates(x, u, C * (t / 2.0) * D * x[1])

    expected = integrated(record, of, START)
    assert run(record, setting_of(term)).states == pytest.approx(expected, abs=1e-7)


def test_a_law_as_signal_of_another_and_two_terms_at_once() -> None:
    record = pushed(100)
    one = Term("friction", "spring", Shape.SQUARE, size=2.0, scale=3.0)
    two = Term("acceleration", "force", Shape.LINEAR, size=1.0, scale=10.0)

    def of(x: Array, u: float, t: float) -> list[float]:
        speed, force = rates(x, u, 2.0 * C * (K * x[0] / 3.0) ** 2)
        return [speed, force + C * u / 10.0]

    expected = integrated(record, of, START)
    assert run(record, setting_of(one, two, substeps=8)).states == pytest.approx(expected, abs=1e-7)


def differences(record: Record, setting: Setting) -> Array:
    """Return central differences of a run by parameters, values of terms and start states."""
    sizes = [setting.parameters[FREE], np.maximum(1.0, np.abs(setting.values)), np.ones(2)]
    columns = []
    for group, size in enumerate(sizes):
        for i, h in enumerate(1e-5 * size):
            outputs = []
            for sign in (1.0, -1.0):
                moved = [setting.parameters.copy(), setting.values.copy(), START.copy()]
                moved[group][i] += sign * h
                other = Setting(moved[0], FREE, setting.terms, moved[1], setting.substeps)
                outputs.append(run(record, other, moved[2]).outputs)
            columns.append((outputs[0] - outputs[1]) / (2.0 * h))
    return np.stack(columns, axis=2)


SLOPED = [
    *((term_of(shape),) for shape in Shape),
    *((term_of(Shape.CUBE, memory),) for memory in Memory if memory is not Memory.NONE),
    (term_of(Shape.SQUARE, Memory.LAG, factor="friction"),),
    (term_of(Shape.DRY, Memory.DAHL),),
    (
        Term("friction", "v", Shape.DRY, size=2.0, scale=0.5, width=0.3),
        Term("friction", "spring", Shape.SQUARE, Memory.FADING, (0.4,), size=2.0, scale=3.0),
    ),
]


@pytest.mark.parametrize("terms", SLOPED, ids=lambda terms: " and ".join(map(str, terms)))
def test_slopes_are_those_of_the_run(terms: tuple[Term, ...]) -> None:
    record = pushed(150, smooth=True)
    setting = setting_of(*terms)
    slopes = run(record, setting, sensitive=True).slopes
    expected = differences(record, setting)
    largest = np.abs(expected).max(axis=(0, 1))
    # a kink that is passed within a difference
    kinked = any(
        t.shape.has_width or t.memory in (Memory.PLAY, Memory.BACKLASH, Memory.TWO_LAGS)
        for t in terms
    )
    limit = 2e-3 if kinked else 1e-6
    assert np.abs(slopes - expected).max(axis=(0, 1)) == pytest.approx(
        0.0, abs=limit * largest.max()
    )
    assert slopes.shape == expected.shape


class Priced(Mass):
    """A mass with an output that has a parameter of its own."""

    price = Parameter(7.0, "1/kg", min=0.0, max=100.0)

    @Output("1")
    def cost(self):
        """Price of the mass."""
        return self.price * self.mass


@pytest.mark.parametrize("measured", [[True, False], [False, True], [True, True]])
def test_a_parameter_without_effect_on_what_is_measured_has_no_slopes(measured: list[bool]) -> None:
    model = LawModel(Priced)
    plain = pushed(40)
    outputs = np.where(measured, np.zeros((40, 2)), np.nan)
    setting = Setting(np.append(nominal()[:3], [7.0, *nominal()[3:]]), np.arange(4), substeps=2)
    names = [p.name for p in model.parameters]
    assert names[:4] == ["mass", "stiffness", "damping", "price"]
    course = model.run(replace(plain, outputs=outputs), setting, START, sensitive=True)
    assert course is not None
    own = run(plain, setting_of(), sensitive=True).slopes
    position = np.insert(own, 3, 0.0, axis=2)
    cost = np.zeros((40, 1, 6))
    cost[:, :, 0], cost[:, :, 3] = 7.0, M
    assert course.slopes == pytest.approx(np.hstack([position, cost])[:, measured], abs=1e-12)


def test_a_run_is_the_same_to_the_bit_on_a_machine_without_vectors(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(law_model, "_has_avx2", lambda: False)
    record, setting = pushed(50), setting_of(term_of(Shape.CURVE, Memory.LAG))
    plain = LawModel(Mass).run(record, setting, START, sensitive=True)
    assert plain is not None
    np.testing.assert_array_equal(plain.slopes, run(record, setting, sensitive=True).slopes)


def test_linearisation_is_that_of_the_equations() -> None:
    """Of a mass with dry friction and a spring that lags."""
    dry = Term("friction", "v", Shape.DRY, size=2.0, scale=0.5, width=0.3)
    late = Term("spring", "x", Shape.SQUARE, Memory.LAG, (T,), size=1.5, scale=0.2)
    record, setting = pushed(60), setting_of(dry, late)
    course = run(record, setting)
    found = mass().linearise(record, setting, course)
    x, v, z = course.states.T
    u = record.inputs[:, 0]
    bend = np.tanh(v / 0.5 / 0.3)
    acceleration = (u - K * x - D * v - 2.0 * C * bend - 1.5 * C * (z / 0.2) ** 2) / M
    zero, one = np.zeros_like(x), np.ones_like(x)
    # mass, stiffness, damping; c, log width; c, log constant; x, v, z
    expected = np.array(
        [
            [zero] * 8 + [one, zero],
            [
                -acceleration / M,
                -x / M,
                -v / M,
                -2.0 * bend / M,
                2.0 * C * (1.0 - bend**2) * v / 0.5 / 0.3 / M,
                -1.5 * (z / 0.2) ** 2 / M,
                zero,
                -K / M * one,
                -(D + 2.0 * C * (1.0 - bend**2) / 0.5 / 0.3) / M,
                -1.5 * C * 2.0 * z / 0.2**2 / M,
            ],
            [zero] * 6 + [-(x - z) / T, one / T, zero, -one / T],
        ]
    )
    assert found.rates == pytest.approx(expected.transpose(2, 0, 1), rel=1e-9, abs=1e-9)
    seen = np.zeros((60, 1, 10))
    seen[:, 0, 7] = 1.0
    assert found.outputs == pytest.approx(seen, abs=1e-12)
    laws = mass().laws
    actions = {"velocity": (1.0, 0.0), "acceleration": (0.0, 1.0)}
    actions |= {"spring": (0.0, -1.0 / M), "friction": (0.0, -1.0 / M)}
    for law, action in actions.items():
        by_law = found.rates_by_laws[:, :, laws.index(law)]
        assert by_law == pytest.approx(np.tile(action, (60, 1))), law
    shown = [float(law == "position") for law in laws]
    assert found.outputs_by_laws == pytest.approx(np.tile(shown, (60, 1, 1)))
    assert found.laws[:, laws.index("spring")] == pytest.approx(K * x)
    assert found.laws[:, laws.index("friction")] == pytest.approx(D * v)


def stiff(damping: float) -> Setting:
    parameters = nominal()
    parameters[FREE] = 0.1, K, damping
    return Setting(parameters, FREE)


def test_a_stiff_model_asks_for_substeps() -> None:
    record = pushed(200)
    setting = stiff(40.0)
    still = Course(np.zeros((200, 1)), np.empty(0), np.zeros((200, 2)))
    fastest = np.abs(np.linalg.eigvals([[0.0, 1.0], [-K / 0.1, -40.0 / 0.1]])).max()
    count = mass().substeps(record, setting, still)
    assert count == np.ceil(0.02 * fastest / 0.7)
    assert mass().substeps(record, stiff(1e5), still) == 100
    assert mass().run(record, setting, START) is None, "a single step is unstable"
    course = mass().run(record, Setting(setting.parameters, FREE, substeps=count), START)
    assert course is not None
    expected = exact(record, (0.1, K, 40.0), START, record.inputs[:, 0])
    assert course.outputs[:, 0] == pytest.approx(expected[:, 0], abs=1e-4)


def test_a_mode_that_is_gone_before_the_next_sample_has_long_steps() -> None:
    record = pushed(200)
    still = Course(np.zeros((200, 1)), np.empty(0), np.zeros((200, 2)))
    setting = stiff(200.0)
    fastest = np.abs(np.linalg.eigvals([[0.0, 1.0], [-K / 0.1, -200.0 / 0.1]])).max()
    count = mass().substeps(record, setting, still)
    assert count == np.ceil(0.02 * fastest / 1.4)
    course = mass().run(record, replace(setting, substeps=count), START)
    assert course is not None
    expected = exact(record, (0.1, K, 200.0), START, record.inputs[:, 0])
    assert course.outputs[:, 0] == pytest.approx(expected[:, 0], abs=1e-4)
    parameters = nominal()
    parameters[FREE] = 0.1, 0.1 * 3000.0**2, D
    assert mass().substeps(record, Setting(parameters, FREE), still) == 86, "it turns"


def test_a_run_that_leaves_its_range_is_none() -> None:
    term = Term("friction", "v", Shape.LINEAR)
    setting = Setting(nominal(), FREE, (term,), np.array([-60.0]), 2)
    assert mass().run(pushed(200), setting, START) is None
    assert mass().run(pushed(200), setting, START, sensitive=True) is None


def test_an_output_that_is_a_state_is_seen() -> None:
    assert mass().measured_states == {0: 0}
    assert mass().integrals == {"x"}, "of the velocity"
    assert mass().nominal_states == pytest.approx([0.1, 1.0])


def test_a_dead_time_of_a_sensor_adds_no_law_no_signal_and_a_known_memory() -> None:
    """Laws that may lack a term are those without it; its history is a line, two states."""
    late = LawModel(stack(Mass, transport_delay(Mass, "position")))
    assert late.measured_states == {0: 0}
    assert late.targets == mass().targets
    assert late.arguments == mass().arguments
    problem = Problem(late, (pushed(60),), np.ones(1), ())
    free = [s.name for s, known in zip(late.states, problem.known_starts, strict=True) if not known]
    assert free == ["x", "v", "position_delay_history", "position_delay_history_slope"]


class ShownMass(Mass):
    """A mass whose velocity is an output of its FMU, too."""

    name = "shown_mass"
    v = State("m/s", rate="acceleration", nominal=1.0, output=True)


def test_a_state_that_the_fmu_shows_is_an_output() -> None:
    model = LawModel(ShownMass)
    assert [output.name for output in model.outputs] == ["position", "v"]
    record = replace(pushed(60), outputs=np.zeros((60, 2)))
    setting = Setting(nominal(), FREE, substeps=4)
    course = model.run(record, setting, START, sensitive=True)
    assert course is not None

    def rates(x: Array, u: float, t: float) -> list[float]:
        return [x[1], (u - K * x[0] - D * x[1]) / M]

    states = integrated(record, rates, START, 1e-9)
    later = integrated(record, rates, np.array([START[0], START[1] + 1.0]), 1e-9)
    assert course.outputs == pytest.approx(states, abs=1e-5)
    assert course.slopes[:, :, -1] == pytest.approx(later - states, abs=1e-5)
    assert model.measured_states[1] == 1
    offset = Term("v", "", Shape.CONSTANT, size=0.5)
    shifted = model.run(record, replace(setting, terms=(offset,), values=np.array([0.2])), START)
    assert shifted is not None
    assert shifted.outputs - course.outputs == pytest.approx(np.tile([0.0, 0.1], (60, 1)))


def test_a_law_reads_the_laws_that_it_calls_beside_what_it_is_a_function_of() -> None:
    model = LawModel(Oscillator)
    assert model.reads("friction") == model.depends_on("friction") == {"velocity"}
    assert model.reads("acceleration") == {
        *("elongation", "velocity", "force"),
        *("spring_force", "friction"),
    }


class Scaled(Component):
    """A strain that its caller gives a charge, of a film that grows."""

    name = "scaled"
    experiment = (1.0, 0.1)
    alpha = Parameter(2.0, "m/C", doc="strain over charge")
    charge = Input("C", nominal=1.0, doc="of the film")
    growth = State("1", rate="growth_rate", nominal=1.0, doc="of the film")

    def growth_rate(self):
        """Of the film."""
        return 0.1 - self.growth / 5.0

    def strain(self, charge):
        """Of so much charge."""
        return self.alpha * charge * (1.0 + self.growth)

    @Output("m", nominal=1.0)
    def displacement(self):
        """Of the tip."""
        return self.strain(self.charge) + 0.1 * self.charge


def test_a_law_that_its_caller_gives_a_value_is_no_signal_of_a_term() -> None:
    """Only its callers know of what it is: no other law can have its value."""
    model = LawModel(Scaled)
    assert "strain" in model.laws
    assert "strain" not in model.arguments
