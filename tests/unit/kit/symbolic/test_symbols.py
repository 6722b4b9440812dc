"""Numbers of which only the unit is known. Oracle: pint, on numbers; what a number that is written
into a law may be, by hand.
"""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from fmus.kit import Constant, functions, units
from fmus.kit.symbolic.symbols import LawError, ScaleError, Symbol, ValueNeeded

KIT = vars(functions)
UNITS = {"m": "m", "mm": "mm", "n": "N", "k": "N/m", "v": "m/s", "t": "s", "one": "1", "q": "A*h"}
QUANTITIES = {name: units.registry().Quantity(0.5, units.parse(u)) for name, u in UNITS.items()}


def symbols():
    return {name: Symbol(units.powers_of_names(unit)) for name, unit in UNITS.items()}


EXPRESSIONS = """
m + m; m + n; m - v * t; k * m + n; k * m - n * m; n / k + m; -m + m; +m - m; abs(m) + m
m**2 / m + m; m**2 + m; (m * m) ** 0.5 + m; (m * n) ** 0.5 + m; 1 / t + v / m; 1 / m + t
m < v * t; m > n; k * m >= n; m <= t; n == k * m; one ** (m / m) + one; m ** (t / t + t)
np.sqrt(m * m) + m; np.sqrt(m) + m; np.exp(one); np.exp(m); np.log(m / m); np.log(m)
np.sin(one); np.cos(n); np.tanh(m / m); np.tanh(v); 2.0**one; 2.0**m; np.hypot(m, v * t)
np.hypot(m, n); np.where(m > v * t, m, m); np.where(m > v, m, m); np.where(m > m, m, n)
np.maximum(m, v * t); np.minimum(m, n); np.float64(2) * m + m; np.float64(2) * m + n
"""


def is_allowed(expression, numbers):
    try:
        eval(expression, {"np": np} | numbers)
    except Exception:
        return False
    return True


@pytest.mark.parametrize("expression", EXPRESSIONS.strip().replace("\n", "; ").split("; "))
def test_units_allow_what_pint_allows(expression):
    assert is_allowed(expression, symbols()) == is_allowed(expression, QUANTITIES)


def test_an_equation_of_different_kinds_is_refused():
    """Pint says that they differ, which is of no use in a law."""
    with pytest.raises(LawError):
        eval("m == n", symbols())


@pytest.mark.parametrize(
    ("expression", "unit"),
    [
        ("sqrt(m * m)", "m"),
        ("absolute(v) * t", "m"),
        ("clip(m, -1.0, m)", "m"),
        ("outside(m, -m, 2.0 * m)", "m"),
        ("floor(m / m + 0.5)", "1"),
        ("sign(v) * m", "m"),
        ("where(logical_and(m > 0.0, logical_not(t > 1.0)), m, 0.0)", "m"),
        ("arctan2(m, 2.0 * m) * m", "m"),
        ("arccos(m / m)", "1"),
        ("table(m, (0.0, 1.0), (n, 2.0 * n))", "N"),
        ("smooth_table(m, (0.0, 1.0), (n, 2.0 * n))", "N"),
        ("table(m, (0.0, 1.0, 2.0), (0.0, 1.0, 3.0))", "N"),  # of numbers: any unit
        ("where(m > 0.0, 1.0, 0.0)", "K"),
        ("hypot(m, 0.0)", "m"),
    ],
)
def test_functions_of_the_kit_have_the_units_of_their_mathematics(expression, unit):
    eval(expression, KIT | symbols()).match(Symbol(units.powers_of_names(unit)))


@pytest.mark.parametrize(
    "expression", ["sqrt(m)", "clip(m, -1.0, m)", "table(m, (m, 2.0 * m), (m, m))"]
)
def test_functions_of_the_kit_have_no_other_units(expression):
    with pytest.raises(LawError):
        eval(expression, KIT | symbols()).match(Symbol({"N": 1.0}))


@pytest.mark.parametrize(
    ("expression", "unit", "fits"),
    [
        ("2.0 * m", "N", False),  # a plain number has no unit
        ("0.5 * m / math.pi", "N", False),
        ("4.0 / 3.0 * math.pi * m", "N", False),
        ("9.81 * m", "N", True),  # any other may have one
        ("0.0 * m", "N", True),
        ("m + 1e-6", "m", True),
        ("3600.0 * one / q", "1/(A*s)", True),  # and may convert
        ("0.95 * 3600.0 * one / q", "1/(A*s)", True),
        ("one / q", "1/(A*s)", False),
        ("0.95 * one / q", "1/(A*s)", False),
        ("mm", "m", False),
        ("1e-3 * mm", "m", True),
        ("60.0 * mm", "m", False),
        ("gravity * t", "m/s", True),
        ("gravity * t", "m/s^2", False),
    ],
)
def test_a_factor_explains_what_it_can_explain(expression, unit, fits):
    scope = {"math": math, "gravity": Constant(9.81, "m/s^2")} | symbols()
    wanted = Symbol(units.powers_of_names(unit))
    if fits:
        eval(expression, scope).match(wanted)
    else:
        with pytest.raises(LawError):
            eval(expression, scope).match(wanted)


def test_the_first_sum_with_a_certain_number_determines_the_unit_of_a_factor():
    """Oracle: by hand. The variable, which other laws use, keeps its unit."""
    speed, weight = Symbol({"m": 1.0, "s": -1.0}), 9.81 * Symbol({"kg": 1.0})
    converted = 1e3 * speed
    total = Symbol({"mm": 1.0, "s": -1.0}) - converted
    assert str(converted.unit) == str(total.unit) == "mm/s"
    assert str(speed.unit) == "m/s"
    assert str((-weight + Symbol({"N": 1.0})).unit) == str(weight.unit) == "N"
    with pytest.raises(LawError):
        weight + Symbol({"K": 1.0})


def test_a_table_of_numbers_has_the_unit_of_the_sum_it_stands_in():
    voltage = eval("table(m, (0.0, 1.0), (3.1, 3.6))", KIT | symbols())
    assert str((voltage - Symbol({"V": 1.0})).unit) == str(voltage.unit) == "V"


def test_a_factor_between_units_of_one_kind_is_told():
    with pytest.raises(ScaleError, match=r"1 A\*h is 3600 A\*s"):
        symbols()["q"].match(Symbol({"A": 1.0, "s": 1.0}))


@pytest.mark.parametrize(
    "expression",
    [
        "1 if m > 0.0 else 2",
        "m > 0.0 and m < 1.0",
        "max(m, 0.0)",
        "0.0 < m < 1.0",
        "math.sqrt(m)",
        "float(m)",
        "int(m)",
        "range(m)",
        "round(m)",
        "not m",
    ],
)
def test_nothing_is_decided_by_a_value(expression):
    with pytest.raises(ValueNeeded):
        eval(expression, {"math": math} | symbols())


@pytest.mark.parametrize(
    ("expression", "remedy"),
    [
        ("m + law", r"write law\(\)"),
        ("2.0 * m * None", "lacks a return"),
        ("m + (1.0, 2.0)", "choose one"),
        ("m % 2.0", "floor"),
        ("m // 2.0", "floor"),
        ("list(m)", "return several"),
        ("np.cumsum(m)", "fmus.kit"),
        ("exp(m)", "divide by a parameter"),
    ],
)
def test_a_remedy_is_told(expression, remedy):
    def law():
        return 1.0

    with pytest.raises(LawError) as caught:
        eval(expression, {"law": law, "np": np} | KIT | symbols())
    assert re.search(remedy, caught.value.remedy)
