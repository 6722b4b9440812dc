import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline

from fmus.kit import (
    absolute,
    arccos,
    arctan2,
    clip,
    cos,
    exp,
    floor,
    hypot,
    log,
    logical_and,
    logical_not,
    logical_or,
    maximum,
    minimum,
    outside,
    sign,
    sin,
    smooth_table,
    sqrt,
    tanh,
    where,
)
from fmus.kit.build.building import RUNTIMES, build
from fmus.kit.build.toolchain import host_platform
from fmus.kit.functions import table
from fmus.kit.record.compiled import CompiledModel
from orchestration.fmu.instance import Fmu
from orchestration.fmu.simulation import simulate_instance
from tests.support.kit_samples import Sledge

UNARY = {
    "exp": exp,
    "log": log,
    "sqrt": sqrt,
    "sin": sin,
    "cos": cos,
    "tanh": tanh,
    "floor": floor,
    "sign": sign,
    "absolute": absolute,
    "arccos": arccos,
}
EDGES = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    710.0,
    -746.0,
    1e308,
    -1e308,
    5e-324,
    math.inf,
    -math.inf,
    math.nan,
]
reals = st.one_of(st.sampled_from(EDGES), st.floats(-1e3, 1e3))


def alike(a, b):
    return (math.isnan(a) and math.isnan(b)) or a == pytest.approx(b, rel=1e-14, abs=0)


def symbolic(function, *values):
    symbols = [ca.SX.sym(f"x{i}") for i in range(len(values))]
    return float(ca.Function("f", symbols, [function(*symbols)])(*values))


def on_array(function, *values):
    with np.errstate(all="ignore"):
        result = function(*(np.array([value, 1.0, value]) for value in values))
    assert isinstance(result, np.ndarray)
    assert alike(result[0], result[2])
    return float(result[0])


@pytest.mark.parametrize("name", UNARY)
@given(x=reals)
def test_floats_arrays_and_symbols_agree(name, x):
    function = UNARY[name]
    value = function(x)
    assert isinstance(value, float)
    # the trigonometry of huge arguments is where libraries differ
    if name not in ("sin", "cos") or not abs(x) > 1e3 or math.isinf(x):
        assert alike(value, on_array(function, x))
        assert alike(value, symbolic(function, x))


@pytest.mark.parametrize(
    ("function", "x", "expected"),
    [
        (exp, 1000.0, math.inf),
        (exp, -1000.0, 0.0),
        (log, 0.0, -math.inf),
        (log, -0.0, -math.inf),
        (log, -1.0, math.nan),
        (sqrt, -1.0, math.nan),
        (sin, math.inf, math.nan),
        (cos, -math.inf, math.nan),
        (tanh, math.inf, 1.0),
        (floor, -math.inf, -math.inf),
        (floor, math.inf, math.inf),
        (floor, math.nan, math.nan),
        (floor, -0.5, -1.0),
        (sign, math.nan, math.nan),
        (sign, -0.0, 0.0),
        (sign, -3.0, -1.0),
        (arccos, 1.5, math.nan),
        (arccos, -1.0, math.pi),
        (arccos, math.inf, math.nan),
        (absolute, -math.inf, math.inf),
        (absolute, True, 1.0),
        (exp, math.nan, math.nan),
        (sqrt, 2.25, 1.5),
        (exp, True, math.e),
        (floor, 3, 3.0),
    ],
)
def test_special_values_are_those_of_c(function, x, expected):
    assert alike(function(x), expected)


@given(a=reals, b=reals)
def test_extrema_agree_and_pass_over_nan(a, b):
    for function, reference in ((minimum, np.fmin), (maximum, np.fmax)):
        expected = float(reference(a, b))
        assert alike(function(a, b), expected)
        assert alike(on_array(function, a, b), expected)
        assert alike(symbolic(function, a, b), expected)
        # a number on either side of an array or a symbol
        assert alike(float(function(a, np.array([b]))[0]), expected)
        assert alike(float(function(np.array([a]), b)[0]), expected)
        if math.isfinite(
            a
        ):  # an infinite limit CasADi drops from the graph, and with it what it does to a NaN
            assert alike(symbolic(lambda x, a=a, function=function: function(a, x), b), expected)


@pytest.mark.parametrize(("function", "reference"), [(arctan2, np.arctan2), (hypot, np.hypot)])
@given(a=reals, b=reals)
def test_functions_of_two_agree_with_those_of_c(function, reference, a, b):
    with np.errstate(all="ignore"):
        expected = float(reference(a, b))
    value = function(a, b)
    assert isinstance(value, float)
    assert alike(value, expected)
    assert alike(on_array(function, a, b), expected)
    assert alike(symbolic(function, a, b), expected)
    with np.errstate(all="ignore"):
        assert alike(float(function(a, np.array([b]))[0]), expected)
        assert alike(float(function(np.array([a]), b)[0]), expected)


def test_two_that_are_known():
    assert arctan2(1.0, -1.0) == pytest.approx(0.75 * math.pi)
    assert hypot(3.0, -4.0) == 5.0
    assert hypot(1e300, 1e300) == pytest.approx(math.sqrt(2.0) * 1e300)


@given(a=st.floats(-2, 2), b=st.floats(-2, 2))
def test_conditions_are_combined(a, b):
    for function, expected in (
        (lambda x, y: logical_and(x > 0.5, y < 1.0), a > 0.5 and b < 1.0),
        (lambda x, y: logical_or(x > 0.5, y < 1.0), a > 0.5 or b < 1.0),
        (lambda x, y: logical_not(x > y), not a > b),
        (lambda x, y: logical_and(True, x > y), a > b),
        (lambda x, y: logical_or(x > y, 0.0), a > b),
        (lambda x, y: logical_and(x, logical_not(y)), bool(a) and not b),
    ):
        assert function(a, b) is expected
        assert on_array(function, a, b) == expected
        assert symbolic(function, a, b) == expected
        assert where(function(a, b), 2.0, 3.0) == symbolic(
            lambda x, y, f=function: where(f(x, y), 2.0, 3.0), a, b
        )


@given(x=reals, low=st.floats(-10, 0), high=st.floats(0, 10))
def test_clip_stays_inside(x, low, high):
    value = clip(x, low, high)
    assert low <= value <= high
    if low <= x <= high:
        assert value == x
    assert alike(on_array(lambda v: clip(v, low, high), x), value)
    assert alike(symbolic(lambda v: clip(v, low, high), x), value)


@given(x=reals.filter(lambda x: not math.isnan(x)), low=st.floats(-10, 0), high=st.floats(0, 10))
def test_outside_is_what_clip_takes_away(x, low, high):
    """Of numbers: what is none has no side, and FMUs refuse it."""
    value = outside(x, low, high)
    assert alike(value, x - clip(x, low, high))
    assert alike(on_array(lambda v: outside(v, low, high), x), value)
    assert alike(symbolic(lambda v: outside(v, low, high), x), value)


def test_outside_of_nothing_has_the_slopes_of_a_dead_zone_without_width():
    """By its argument 1 everywhere; by half its width that of -d sign(x), or the mean at 0."""
    x, half = ca.SX.sym("x"), ca.SX.sym("half")
    value = outside(x, -half, half)
    slopes = ca.Function("slopes", [x, half], [ca.jacobian(value, ca.vertcat(x, half))])
    found = [np.array(slopes(at, 0.0)).ravel() for at in (-1.0, 0.0, 1.0)]
    np.testing.assert_array_equal(found, [[1.0, 1.0], [1.0, 0.0], [1.0, -1.0]])


@given(x=reals, yes=st.floats(-10, 10), no=st.floats(-10, 10))
def test_where_agrees(x, yes, no):
    expected = yes if x > 0.5 else no
    assert where(x > 0.5, yes, no) == expected
    assert on_array(lambda v: where(v > 0.5, yes, no), x) == expected
    assert symbolic(lambda v: where(v > 0.5, yes, no), x) == expected


def test_where_with_a_number_for_condition_takes_anything():
    array = np.array([1.0, 2.0])
    assert where(True, array, 0.0) is array
    assert where(0.0, array, 3.0) == 3.0


def test_numpy_scalars_are_floats():
    assert log(np.float64(0.0)) == -math.inf
    assert maximum(np.float64(2.0), 1.0) == 2.0


@settings(max_examples=60)
@given(
    st.lists(st.floats(-3.0, 3.0), min_size=2, max_size=9, unique_by=lambda x: round(x, 2)).map(
        sorted
    ),
    st.integers(0, 999),
)
def test_a_smooth_table_is_hermite_with_slopes_of_parabolas(knots, seed):
    knots = [x for x in knots if x != 0.0]
    assume(len(knots) > 1)
    heights = np.random.default_rng(seed).normal(size=len(knots))
    ends = [np.diff(heights[s]) / np.diff(knots[s]) for s in (slice(0, 2), slice(-2, None))]
    inner = [
        np.polyval(
            np.polyder(np.polyfit(knots[k - 1 : k + 2], heights[k - 1 : k + 2], 2)), knots[k]
        )
        for k in range(1, len(knots) - 1)
    ]
    curve = CubicHermiteSpline(knots, heights, [*ends[0], *inner, *ends[1]])
    for x in np.random.default_rng(seed + 1).uniform(knots[0], knots[-1], 20):
        assert smooth_table(float(x), knots, list(heights)) == pytest.approx(
            float(curve(x)), rel=1e-6, abs=1e-6
        )
    for x, k, slope in ((knots[0] - 1.3, 0, ends[0]), (knots[-1] + 0.7, -1, ends[1])):
        straight = heights[k] + float(slope[0]) * (x - knots[k])
        assert smooth_table(x, knots, list(heights)) == pytest.approx(straight, rel=1e-9, abs=1e-9)


def test_a_smooth_table_may_step_at_zero():
    knots, heights = (
        [-2.0, -1.0, -0.01, 0.0, 0.01, 1.0, 2.0],
        [-1.0, -1.0, -1.0, 0.0, 1.0, 1.0, 1.0],
    )
    x = np.linspace(-2.0, 2.0, 801)
    found = np.array([smooth_table(float(one), knots, heights) for one in x])
    assert found == pytest.approx(np.interp(x, knots, heights), abs=1e-12)


def test_a_smooth_table_of_one_point_is_a_constant():
    assert smooth_table(3.0, [1.0], [7.0]) == 7.0
    with pytest.raises(ValueError, match="1 abscissae and 2 values"):
        smooth_table(0.0, [1.0], [1.0, 2.0])


AT = np.array([-3.0, -1.0, -0.4, 0.5, 0.9, 2.0, 7.0])


@pytest.mark.parametrize("runtime", RUNTIMES)
def test_a_table_is_numpys_in_both_builds(tmp_path, runtime):
    path, time = tmp_path / f"{runtime}.fmu", np.arange(7.0)
    path.write_bytes(build(Sledge, runtime, [host_platform()]))
    values = {"low": -2.0, "middle": 1.0, "high": 1.5}
    with Fmu(path, values) as instance:
        instance.start(0.0, 6.0)
        found = simulate_instance(instance, time, {"command": AT})
    assert found["force"] == pytest.approx(
        np.interp(AT, [-1.0, 0.5, 2.0], [-2.0, 1.0, 1.5]), rel=1e-14
    )


def test_a_table_has_exact_slopes():
    """By its values they are the hat functions."""
    found = CompiledModel(Sledge, ["low", "middle", "high"]).run(
        np.arange(7.0), {"command": AT}, {}
    )
    hats = [np.interp(AT, [-1.0, 0.5, 2.0], one) for one in np.eye(3)]
    assert found.sensitivities["force"] == pytest.approx(np.column_stack(hats), abs=1e-14)
    assert table(AT, (0.0, 1.0), (2.0, 3.0)) == pytest.approx(
        np.interp(AT, [0.0, 1.0], [2.0, 3.0]), rel=1e-15
    )
    with pytest.raises(ValueError, match="a table of 2 abscissae and 1 values"):
        table(0.0, (1.0, 2.0), (1.0,))
