"""Corrections of laws: neutral at zero, each memory, shape and table as SciPy and NumPy have it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.signal import lsim

from fmus.galvanostat.model import Galvanostat
from fmus.kit import UserError, smooth_table, stack, units
from fmus.kit.corrections import KINDS, MEMORIES, SignalTerm, SmoothTable, correction, with_constant
from fmus.kit.curves import SHAPES
from fmus.kit.effects import effect_name, made_by, made_with
from fmus.kit.record.compiled import CompiledModel
from fmus.kit.symbolic.tracing import trace
from fmus.ppy_actuator.model import PpyActuator
from studies.plants.models.pendulum import Pendulum
from tests.support.builds import check_that_bad_values_are_refused, check_that_builds_agree
from tests.support.corrected import Plain
from tests.support.pace import slow_but

TIME = np.linspace(0.0, 10.0, 501)
WAVE = 1.5 * np.sin(1.7 * TIME) + 0.4


def run(cls, values, drive=WAVE, **inputs):
    """Smooth between samples."""
    return CompiledModel(cls).run(TIME, inputs or {"drive": drive}, values, True).signals


def added(effect, values, output="seen", base=Plain, **inputs):
    """Return the change of an output by a correction, over a smooth wave."""
    known = {p.name for p in base.layout.parameters}
    without = run(base, {n: x for n, x in values.items() if n in known}, **inputs)
    return run(stack(base, effect), values, **inputs)[output] - without[output]


TABLE = SmoothTable([0.0, 1.0])
CORRECTIONS = [
    (
        Plain,
        correction(
            Plain,
            "base",
            SignalTerm("drive", memory, 0.5, "V", 2.0, 0.3),
            shape,
            "V",
            1.0,
            kind=kind,
        ),
    )
    for memory in MEMORIES
    for shape, kind in (("cubic", "add"), (SmoothTable([-1.0, 0.5, 2.0]), "multiply"))
] + [
    (
        PpyActuator,
        correction(
            PpyActuator,
            "film_voltage",
            SignalTerm("voltage", "lagged", 3.0, "V"),
            "saturating",
            "V",
        ),
    ),
    (
        PpyActuator,
        correction(
            PpyActuator,
            "charge_elongation",
            SignalTerm("time", "", 0.0, "s", 100.0),
            "linear",
            "m",
            1e-4,
        ),
    ),
    (
        Pendulum,
        correction(
            Pendulum, "friction", SignalTerm("friction", unit="N*m"), "odd_quadratic", "N*m"
        ),
    ),
    (
        Galvanostat,
        correction(
            Galvanostat, "delivered_current", SignalTerm("sampled_voltage", unit="V"), TABLE, "A"
        ),
    ),
]
each = pytest.mark.parametrize(("base", "effect"), CORRECTIONS, ids=lambda v: v.__name__)


# --- neutral
# --------------------------------------------------------------------------------------------------


def drawn(cls, seed):
    rng = np.random.default_rng(seed)
    values = {
        p.name: p.start * rng.uniform(0.3, 3.0) for p in cls.layout.parameters if p.type == "real"
    }
    return values | {
        v.name: v.nominal * rng.normal() * 3.0
        for v in (*cls.layout.inputs, *cls.layout.states, *cls.layout.discretes)
        if v.type == "real"
    }


def evaluated(cls, values):
    model = cls()
    for name, value in values.items():
        setattr(model, name, value)
    found = {f"der({s.name})": x for s, x in zip(cls.layout.states, model.rates(), strict=True)}
    return found | {o.name: x for o, x in zip(cls.layout.outputs, model.outputs(), strict=True)}


@each
def test_neutral_is_bit_identical(base, effect):
    cls, moved = stack(base, effect), False
    tables = [n for n in effect.declared if "_at_" in n]
    for seed in range(30):
        values = drawn(cls, seed) | dict.fromkeys(tables, 1.7) | {"time": 3.0}
        known = {v.name for v in base.layout.variables} | {"time"}
        expected = evaluated(base, {n: v for n, v in values.items() if n in known})
        still = evaluated(cls, values | {effect.neutral: 0.0})
        active = evaluated(cls, values | {effect.neutral: 0.7})
        for name, value in expected.items():
            assert still[name] == value, name
            moved |= active[name] != value
    assert moved


@each
def test_neutral_is_bit_identical_in_the_graph(base, effect):
    cls = stack(base, effect)
    for seed in range(5):
        values, found = drawn(cls, seed) | {effect.neutral: 0.0}, []
        for graph in (trace(base), trace(cls)):
            rates, outputs, *_ = graph.functions(tangent=False)
            layout = graph.layout
            groups = (layout.parameters, layout.inputs, layout.states, layout.discretes)
            point = [[float(values.get(v.name, 0.5)) for v in group] for group in groups]
            n = len(base.layout.states)
            found.append((rates(3.0, *point).full()[:n], outputs(3.0, *point).full()))
        for one, other in zip(*found, strict=True):
            np.testing.assert_array_equal(one, other)


@each
def test_what_is_declared(base, effect):
    assert effect.assumption
    assert effect.__doc__.endswith(".")
    assert "\n" not in effect.__doc__
    assert effect.declared[effect.neutral].start == 0.0
    for v in effect.declared.values():
        assert v.doc
        units.base_unit(v.unit)
    own = [p for p in effect.layout.parameters if p.name in effect.declared]
    assert all(-math.inf < p.min <= p.start < p.max < math.inf for p in own)


# --- of which signal
# --------------------------------------------------------------------------------------------------


def linear(of, **about):
    return correction(Plain, "base", of, "linear", "V", **about)


@pytest.mark.parametrize(
    ("of", "expected"),
    [
        (SignalTerm("drive"), WAVE),
        (SignalTerm("time"), TIME),
        (SignalTerm("squared"), WAVE**2),
        (SignalTerm("base"), 2.0 + WAVE),
        (SignalTerm("level"), 0.5 + 0.4 * TIME + 1.5 / 1.7 * (1.0 - np.cos(1.7 * TIME))),
    ],
    ids=lambda v: getattr(v, "name", ""),
)
def test_a_signal_of_every_kind(of, expected):
    found = added(linear(of), {f"base_of_{of.name}": 3.0})
    assert found == pytest.approx(3.0 * expected, abs=1e-3 if of.name == "level" else 1e-9), (
        "straight between samples"
    )


def behind(x, constant, start, time=TIME):
    return lsim(([[-1.0 / constant]], [[1.0 / constant]], [[1.0]], [[0.0]]), x, time, X0=[start])[1]


def heat(constant, start):
    """Return the lagged square of the wave, which is straight between samples."""
    fine = np.linspace(TIME[0], TIME[-1], 50 * (len(TIME) - 1) + 1)
    return behind(np.interp(fine, TIME, WAVE) ** 2, constant, start, fine)[::50]


def accumulated(of):
    """Integral of a function of the wave, which is straight between samples."""
    return solve_ivp(
        lambda t, y: [of(np.interp(t, TIME, WAVE))],
        (0.0, TIME[-1]),
        [0.0],
        "DOP853",
        TIME,
        rtol=1e-8,
        atol=1e-8,
        max_step=0.02,
    ).y[0]


@pytest.mark.parametrize("start", [0.0, 0.4])
@pytest.mark.parametrize(
    ("memory", "remembered"),
    [
        ("lagged", lambda start: behind(WAVE, 0.7, start)),
        ("leading", lambda start: WAVE - behind(WAVE, 0.7, start)),
        ("heat", lambda start: heat(0.7, start)),
        ("integrated", lambda start: start + accumulated(float)),
        ("throughput", lambda start: start + accumulated(abs)),
    ],
)
def test_each_memory(memory, remembered, start):
    effect = linear(SignalTerm("drive", memory, 0.7, "V", start=start))
    found = added(effect, {f"base_of_drive_{memory}": 2.0})
    assert found == pytest.approx(2.0 * remembered(start), abs=1e-4)


def test_the_constant_of_a_lag_is_a_parameter():
    effect = linear(SignalTerm("drive", "lagged", 0.7, "V"))
    values = {"base_of_drive_lagged": 1.0, "base_of_drive_lagged_memory_constant": 2.5}
    assert added(effect, values) == pytest.approx(behind(WAVE, 2.5, 0.0), abs=1e-5)


def test_what_is_remembered_of_the_law_itself_is_without():
    effect = linear(SignalTerm("base", "lagged", 0.7, "V", start=1.0))
    values = {"base_of_base_lagged": -0.5}
    assert added(effect, values) == pytest.approx(-0.5 * behind(2.0 + WAVE, 0.7, 1.0), abs=1e-5)


def test_what_is_remembered_may_be_computed_from_the_law():
    """Behind a lag a loop is an equation of motion: T ds/dt = 2 (2 + u + a s) - s."""
    effect = linear(SignalTerm("of_base", "lagged", 0.7, "V"))
    found = run(stack(Plain, effect), {"base_of_of_base_lagged": -0.8})["seen"]
    solved = solve_ivp(
        lambda t, s: [(2.0 * (2.0 + np.interp(t, TIME, WAVE) - 0.8 * s[0]) - s[0]) / 0.7],
        (0.0, 10.0),
        [0.0],
        "DOP853",
        TIME,
        rtol=1e-9,
        atol=1e-10,
        max_step=0.02,
    )
    assert found == pytest.approx(2.0 + WAVE - 0.8 * solved.y[0], abs=1e-5)


def test_arguments_are_passed_on():
    effect = correction(Plain, "scaled", SignalTerm("drive"), "linear", "V")
    assert added(effect, {"scaled_of_drive": 0.5}, "other") == pytest.approx(2.0 * 0.5 * WAVE), (
        "it is called twice"
    )


# --- by how much
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape(shape):
    effect = correction(Plain, "base", SignalTerm("drive", scale=2.0), shape, "V")
    values = {"base_of_drive": 1.3} | ({"base_of_drive_width": 0.6} if SHAPES[shape].width else {})
    exact = [SHAPES[shape].form(float(x), 0.6, 2.0) for x in WAVE]
    assert added(effect, values) == pytest.approx(1.3 * np.array(exact), abs=1e-9)


@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_with_a_constant_beside_it_counted_from_elsewhere(shape):
    effect = correction(
        Plain, "base", SignalTerm("drive", scale=2.0, zero=0.7), shape, "V", beside=True
    )
    values = {"base_of_drive": 1.3, "base_of_drive_beside": -0.4}
    values |= {"base_of_drive_width": 0.6} if SHAPES[shape].width else {}
    exact = [SHAPES[shape].form(float(x) - 0.7, 0.6, 2.0) - 0.4 for x in WAVE]
    assert added(effect, values) == pytest.approx(1.3 * np.array(exact), abs=1e-9)
    assert added(effect, values | {"base_of_drive": 0.0}) == pytest.approx(0.0 * WAVE, abs=0.0), (
        "one switch for both"
    )
    assert effect.term.shape == with_constant(SHAPES[shape].text)


@pytest.mark.parametrize(
    ("shape", "text"),
    [
        ("cubic", "a (x^3 + b)"),
        ("levelling", "a (x - w tanh(x / w) + b)"),
        ("weir", "a (e sqrt(e / n) + b) with e = max(x - w, 0)"),
        ("sign_beyond", "a (sign(x) + b) beyond |x| = w, smooth"),
        ("stribeck", "a (sign(x) exp(-(x / w)^2) + b), smooth"),
        ("lower_stop", "a (min(x + w, 0) + b)"),
    ],
)
def test_formula_with_a_constant(shape, text):
    assert with_constant(SHAPES[shape].text) == text


def test_unit_of_a_constant_is_that_of_the_shape():
    effect = correction(
        Plain, "base", SignalTerm("drive", "integrated", unit="V"), "cubic", "N", beside=True
    )
    assert effect.declared["base_of_drive_integrated_beside"].unit == "((V)*s)^3"
    assert (
        correction(Plain, "base", SignalTerm("drive", unit="V"), "sign", beside=True)
        .declared["base_of_drive_beside"]
        .unit
        == "1"
    )


def test_a_law_multiplied():
    effect = correction(Plain, "base", SignalTerm("drive"), "quadratic", "V", kind="multiply")
    found = run(stack(Plain, effect), {"base_of_drive": 0.3})["seen"]
    assert found == pytest.approx((2.0 + WAVE) * (1.0 + 0.3 * WAVE**2))


@settings(max_examples=40)
@given(
    st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=8, unique_by=lambda x: round(x, 3)),
    st.integers(0, 999),
    st.sampled_from(KINDS),
    st.booleans(),
)
def test_a_table_is_smooth(knots, seed, kind, fixed):
    rng, knots = np.random.default_rng(seed), sorted(knots)
    heights = rng.normal(size=len(knots))
    table = SmoothTable(knots, list(heights), fixed)
    model = stack(Plain, correction(Plain, "base", SignalTerm("drive"), table, "V", kind=kind))()
    share = rng.uniform(-2.0, 2.0)
    model.base_of_drive = share
    for x in (*knots, *rng.uniform(-4.0, 4.0, 10)):
        model.drive = float(x)
        more = share * smooth_table(x, knots, heights)
        expected = (2.0 + x) + more if kind == "add" else (2.0 + x) * (1.0 + more)
        assert model.seen() == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_a_table_is_so_in_a_simulation():
    knots, heights = [-1.0, -0.2, 0.3, 1.6], [2.0, -1.0, 0.5, 3.0]
    signal = SignalTerm("drive", "lagged", 0.3, "V")
    effect = correction(Plain, "base", signal, SmoothTable(knots), "V")
    values = {"base_of_drive_lagged": 1.0} | {
        f"base_of_drive_lagged_at_{k}": y for k, y in enumerate(heights)
    }
    exact = np.array([smooth_table(float(x), knots, heights) for x in behind(WAVE, 0.3, 0.0)])
    assert added(effect, values) == pytest.approx(exact, abs=1e-4)
    fixed = correction(Plain, "base", signal, SmoothTable(knots, heights, fixed=True), "V")
    assert added(fixed, {"base_of_drive_lagged": 1.0}) == pytest.approx(exact, abs=1e-4)
    assert not any("_at_" in name for name in fixed.declared)
    given = correction(Plain, "base", signal, SmoothTable(knots, heights), "V")
    assert [given.declared[f"base_of_drive_lagged_at_{k}"].start for k in range(4)] == heights


@pytest.mark.parametrize(
    ("of", "shape", "kind", "unit"),
    [
        (SignalTerm("drive", unit="V"), "cubic", "add", "N/V^3"),
        (SignalTerm("drive", "integrated", unit="V"), "linear", "add", "N/(V*s)"),
        (SignalTerm("squared", "throughput", unit="V^2"), "quadratic", "multiply", "1/(V^2*s)^2"),
        (SignalTerm("drive", "throughput"), "linear", "add", "N/s"),
        (SignalTerm("drive", "lagged", 1.0, "V"), "saturating", "add", "N"),
        (SignalTerm("drive", unit="V"), TABLE, "add", "1"),
    ],
)
def test_unit_of_the_switch(of, shape, kind, unit):
    effect = correction(Plain, "base", of, shape, "N", kind=kind)
    assert units.base_unit(effect.declared[effect.neutral].unit) == units.base_unit(unit)


def test_units_of_what_comes_with_it():
    table = correction(Plain, "base", SignalTerm("drive", "integrated", unit="V"), TABLE, "N")
    wanted = {
        "base_of_drive_integrated": "1",
        "base_of_drive_integrated_at_0": "N",
        "base_of_drive_integrated_at_1": "N",
        "base_of_drive_integrated_memory": "(V)*s",
    }
    assert {n: v.unit for n, v in table.declared.items()} == wanted
    table = correction(Plain, "base", SignalTerm("drive", unit="V"), TABLE, "N", kind="multiply")
    assert table.declared["base_of_drive_at_0"].unit == "1"
    bend = correction(Plain, "base", SignalTerm("drive", "lagged", 2.0, "V"), "stops", "N")
    assert bend.declared["base_of_drive_lagged_width"].unit == "V"
    assert bend.declared["base_of_drive_lagged_memory_constant"].unit == "s"


def test_names():
    effect = correction(Plain, "base", SignalTerm("drive", "lagged", 0.25), "cubic")
    assert effect_name(effect) == "base(drive_lagged)"
    assert effect.assumption == "base does not hang on drive lagged like this"
    assert effect.__doc__ == "base hangs on drive lagged: a x^3, added."
    multiplied = correction(
        Plain, "base", SignalTerm("drive", "throughput"), TABLE, kind="multiply"
    )
    text = "base hangs on drive integrated in modulus: a table, multiplied with one and it."
    assert multiplied.__doc__ == text
    assert effect.term.family == "base remembering drive"
    assert multiplied.term.family == "base over throughput"
    assert correction(Plain, "base", SignalTerm("drive"), "cubic").term.family == "base over drive"


def test_two_over_one_another():
    """A table and, of another signal, a shape."""
    constant = SmoothTable([0.0, 1.0], [1.0, 1.0], fixed=True)
    first = correction(Plain, "base", SignalTerm("drive"), constant, "V")
    second = correction(Plain, "base", SignalTerm("time"), "linear", "V", kind="multiply")
    found = run(stack(Plain, first, second), {"base_of_drive": 0.5, "base_of_time": 0.1})["seen"]
    assert found == pytest.approx((2.0 + WAVE + 0.5) * (1.0 + 0.1 * TIME))


# --- as FMUs
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("memory", slow_but(MEMORIES, "lagged"), ids=lambda m: m or "none")
def test_builds_agree(memory, tmp_path):
    of = SignalTerm("squared", memory, 0.5, "V^2", 2.0, 0.3)
    effects = [
        correction(Plain, "base", of, "saturating", "V"),
        correction(
            Plain,
            "scaled",
            of,
            SmoothTable(
                np.array([0.0, 0.7, 1.5]), np.array([0.2, -0.3, 0.4]), fixed=memory == "lagged"
            ),
            "V",
            kind="multiply",
        ),
    ]
    cls = stack(Plain, *effects, name="corrected")
    values = {effect.neutral: 0.8 for effect in effects}
    check_that_builds_agree(cls, values, {"drive": (-2.0, 2.0)}, tmp_path)
    assert np.ptp(added(effects[0], {effects[0].neutral: 0.8})) > 0.1, "it is active"


def test_relaxations_of_one_signal_stand_beside_each_other(tmp_path):
    """Each with its own amount and constant: lags of a step, from rest, by their closed form."""
    of, constants, amounts = SignalTerm("drive", "lagged", 0.5, "V"), (0.3, 2.0), (0.7, -0.4)
    one, two = (correction(Plain, "base", of, "linear", "V", number=k) for k in (1, 2))
    assert (effect_name(one), effect_name(two)) == ("base(drive_lagged)", "base(drive_lagged_2)")
    both = stack(Plain, one, two, name="both")
    values = {"base_of_drive_lagged": amounts[0], "base_of_drive_lagged_2": amounts[1]}
    values |= {
        "base_of_drive_lagged_memory_constant": constants[0],
        "base_of_drive_lagged_2_memory_constant": constants[1],
    }
    assert [p.name for p in both.layout.parameters if p.name.endswith("constant")] == [*values][2:]
    check_that_builds_agree(both, values, {"drive": (-2.0, 2.0)}, tmp_path)
    model = both(**values)
    for state, constant in zip(("_memory", "_2_memory"), constants, strict=True):
        setattr(model, f"base_of_drive_lagged{state}", 1.0 - np.exp(-1.0 / constant))
    alone = Plain()
    for component in (model, alone):
        component.drive = 1.0
    expected = sum(a * (1.0 - np.exp(-1.0 / t)) for a, t in zip(amounts, constants, strict=True))
    assert model.base() - alone.base() == pytest.approx(expected)


def test_a_value_out_of_range_is_refused_by_an_fmu(tmp_path):
    effect = correction(Plain, "base", SignalTerm("drive", "lagged", 0.5, "V"), "saturating", "V")
    cls = stack(Plain, effect, name="corrected")
    check_that_bad_values_are_refused(
        cls, {"base_of_drive_lagged_width": 0.0}, "[0.0001, 1000] V", tmp_path
    )


def test_it_is_made_again_from_what_it_was_made_with():
    of = SignalTerm("drive", "lagged", np.float64(0.5), "V", 2.0, 0.3)
    for shape in ("cubic", SmoothTable(np.array([0.0, 1.0]), np.array([2.0, 3.0]))):
        one = correction(Plain, "base", of, shape, "V", np.float64(2.0), kind="multiply")
        assert "np." not in repr(made_with(one))
        again = made_by(one)(Plain, **eval(repr(made_with(one))))
        assert repr(again.declared) == repr(one.declared)
        assert made_with(again) == made_with(one)


# --- what is refused
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("law", "of", "shape", "about", "told"),
    [
        ("bas", SignalTerm("drive"), "cubic", {}, "plain: no law named 'bas' (did you mean base?)"),
        ("level", SignalTerm("drive"), "cubic", {}, "plain: no law named 'level'"),
        ("rates", SignalTerm("drive"), "cubic", {}, "plain: no law named 'rates'"),
        ("pair", SignalTerm("drive"), "cubic", {}, "plain: pair gives several numbers, not one"),
        (
            "base",
            SignalTerm("driv"),
            "cubic",
            {},
            "plain: no input, state or law named 'driv' (did you mean drive?)",
        ),
        ("base", SignalTerm("factor"), "cubic", {}, "plain: no input, state or law named 'factor'"),
        (
            "base",
            SignalTerm("scaled"),
            "cubic",
            {},
            "plain: scaled takes arguments, and is no signal",
        ),
        (
            "scaled",
            SignalTerm("scaled"),
            "cubic",
            {},
            "plain: scaled takes arguments, and is no signal",
        ),
        ("base", SignalTerm("pair"), "cubic", {}, "plain: pair gives several numbers, not one"),
        (
            "base",
            SignalTerm("of_base"),
            "cubic",
            {},
            "plain: base cannot hang on of_base, which is computed from it",
        ),
        (
            "base",
            SignalTerm("doubled", "leading", 1.0),
            "cubic",
            {},
            "plain: base cannot hang on doubled, which is computed",
        ),
        ("base", SignalTerm("drive"), "cubik", {}, "no shape named 'cubik' (did you mean cubic?)"),
        (
            "base",
            SignalTerm("drive", "laged", 1.0),
            "cubic",
            {},
            "no memory named 'laged' (did you mean lagged?)",
        ),
        (
            "base",
            SignalTerm("drive"),
            "cubic",
            {"kind": "divide"},
            "no kind named 'divide' (there are: add, multiply)",
        ),
        (
            "base",
            SignalTerm("drive", "lagged"),
            "cubic",
            {},
            "time constant of a lag must be positive, which 0 is not",
        ),
        (
            "base",
            SignalTerm("drive", "leading", math.nan),
            "cubic",
            {},
            "time constant of a lag must be positive, which nan",
        ),
        (
            "base",
            SignalTerm("drive", scale=0.0),
            "cubic",
            {},
            "typical magnitude of drive must be positive, which 0 is not",
        ),
        (
            "base",
            SignalTerm("drive", scale=math.inf),
            "cubic",
            {},
            "typical magnitude of drive must be positive, which inf",
        ),
        (
            "base",
            SignalTerm("drive"),
            "cubic",
            {"nominal": -1.0},
            "typical magnitude of the law must be positive, which -1",
        ),
        (
            "base",
            SignalTerm("drive", start=math.nan),
            "cubic",
            {},
            "start value of the memory of drive must be a number",
        ),
        (
            "base",
            SignalTerm("drive"),
            SmoothTable([]),
            {},
            "knots of a table must rise, which [] do not",
        ),
        (
            "base",
            SignalTerm("drive"),
            SmoothTable([0.0, 0.0]),
            {},
            "knots of a table must rise, which [0.0, 0.0] do not",
        ),
        (
            "base",
            SignalTerm("drive"),
            SmoothTable([-math.inf, 0.0]),
            {},
            "knots of a table must rise, which [-inf, 0.0] do not",
        ),
        (
            "base",
            SignalTerm("drive"),
            SmoothTable([0.0, math.nan]),
            {},
            "knots of a table must rise, which [0.0, nan] do not",
        ),
        (
            "base",
            SignalTerm("drive"),
            SmoothTable([0.0, math.inf]),
            {},
            "knots of a table must rise, which [0.0, inf] do not",
        ),
        (
            "base",
            SignalTerm("drive"),
            SmoothTable([0.0, 1.0], [1.0]),
            {},
            "a table of 2 knots has as many values, not 1",
        ),
        (
            "base",
            SignalTerm("drive"),
            SmoothTable([0.0, 1.0], [1.0, 2.0, 3.0], fixed=True),
            {},
            "a table of 2 knots has as many",
        ),
        (
            "base",
            SignalTerm("drive"),
            SmoothTable([0.0, 1.0], [1.0, math.nan]),
            {},
            "values of a table must be numbers, which [1.0",
        ),
    ],
)
def test_what_is_wrong_is_told_in_one_line(law, of, shape, about, told):
    with pytest.raises(UserError) as caught:
        correction(Plain, law, of, shape, **about)
    assert str(caught.value).startswith(told)
    assert "\n" not in str(caught.value)


def test_a_law_of_no_value_at_the_defaults_may_be_a_signal():
    assert correction(Plain, "base", SignalTerm("ratio"), "linear").neutral == "base_of_ratio"


def test_twice_the_same_is_told():
    twice = [correction(Plain, "base", SignalTerm("drive"), shape) for shape in ("cubic", TABLE)]
    with pytest.raises(UserError, match=r"'base_of_drive' is laid over it twice"):
        stack(Plain, *twice)
