"""Numbers with units. Oracle: pint, for every operation of laws without numbers written into them;
units that such a number takes, by hand.
"""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from fmus import MODELS, component
from fmus.kit import units
from fmus.kit.symbolic import families
from fmus.kit.symbolic.quantities import Quantity, Unit, UnitError
from tests.support.pushed_mass import MASS, Tank

M, RAD, N = {"m": 1.0}, {"rad": 1.0}, {"kg": 1.0, "m": 1.0, "s": -2.0}
EXPRESSIONS = """
m + m; m - f; m + 0; 0 - m; a + a; m / m + a; a + m / m
m + float("nan"); -m; +m; abs(-m); m * f; f / m; 2 * m; np.float64(2) * m; 1 / m
np.float64(1) / m; m * a; f * m * a / a; m**2; m**2.0; m**-1; m**0; m**1
m**(m / m); m**m; 2.0**a; 2.0**m; (m**0.5) ** 2; m**1.5 * m**0.5; np.power(m, 2); np.float64(2) ** m
m > 0; m < f; m == m; m == f; m != f; m <= 2 * m; m >= 0.0
np.float64(0) < m; bool(m); float(m / m); float(a); float(m); sum([m, m]); max(m, 2 * m)
np.where(m > 0, m, 0.0); np.where(m > 0, 0.0, m)
np.where(m > 0, m, f); np.where(m, m, m); np.sqrt(m * m); np.sqrt(f); np.exp(a); np.exp(m)
np.log(m / m); np.sin(a); np.cos(m); np.tanh(m / m); np.arccos(a); np.arctan2(m, 2 * m)
np.arctan2(m, f); np.hypot(m, 0.0); np.absolute(-m); np.fabs(m); np.floor(m)
np.sign(m); np.logical_not(m); np.logical_and(m, m)
np.maximum(m, 0); np.minimum(m, f); np.negative(m); m % m; m // m; round(m); np.square(m)
np.clip(m, 0 * m, 2 * m); np.floor_divide(m, m); np.remainder(m, m); np.interp(m, m, m)
"""


def told(expression, make):
    """Return the unit and value of an expression, a plain value, or that it fails."""
    scope = {"np": np, "m": make(3.0, M), "a": make(0.3, RAD), "f": make(2.0, N)}
    try:
        found = eval(expression, scope)
    except Exception:
        return "refused"
    if isinstance(found, Quantity):
        return str(Unit(in_order(found.unit.exponents))), pytest.approx(found.value, nan_ok=True)
    if hasattr(found, "to_base_units"):
        unit = f"{found.to_base_units().units:~C}".replace("**", "^") or "1"
        return unit, float(found.to_base_units().magnitude)
    return float(found)


def in_order(exponents):
    return dict(sorted(exponents.items(), key=lambda item: item[0].lower()))


def of_pint(value, exponents):
    registry = units.registry()
    unit = "*".join(f"{n}**{power:g}" for n, power in exponents.items())
    return registry.Quantity(value, registry.Unit(unit))


@pytest.mark.parametrize(
    "expression", [e.strip() for line in EXPRESSIONS.split("\n") for e in line.split(";") if e]
)
def test_every_operation_does_what_pint_does(expression):
    assert told(expression, Quantity) == told(expression, of_pint)


@pytest.mark.parametrize(
    "exponents",
    [{"kg": 1, "m": 1, "s": -3, "A": -1, "K": -1}, {"s": -1, "K": -1}, {"mol": 2, "cd": 1}, {}],
)
def test_a_unit_is_written_as_pint_writes_it(exponents):
    written = f"{of_pint(1.0, exponents).units:~C}".replace("**", "^") if exponents else "1"
    assert str(Unit(in_order(exponents))) == written


def test_a_dimension_is_no_number():
    with pytest.raises(UnitError):
        float(Quantity(1.0, M))


@pytest.mark.parametrize(
    "expression", ["m + 1", "1 - m", "np.hypot(m, 1.0)", "np.where(True, 1.0, m)", "max(1.0, m)"]
)
def test_a_summand_written_into_a_law_has_its_unit(expression):
    assert told(expression, Quantity)[0] == "m"


@pytest.mark.parametrize("expression", ["m > 1", "m == 3", "np.float64(5) > m"])
def test_a_limit_written_into_a_law_has_its_unit(expression):
    assert told(expression, Quantity) == 1.0


@pytest.mark.parametrize("expression", ["np.exp(m / 2.0)", "2.0 ** (m * 0.3)", "np.tanh(0.1 * f)"])
def test_a_factor_written_into_a_law_may_take_a_unit_away(expression):
    scope = {"np": np, "m": 3.0, "f": 2.0}
    found = told(expression, Quantity)
    value = found[1] if isinstance(found, tuple) else found
    assert value == pytest.approx(eval(expression, scope))


@pytest.mark.parametrize("units_of", [("kW", "K", "mm"), ("bar", "g/s", "h"), ("km/h", "deg", "L")])
@pytest.mark.parametrize("expression", ["x * y / z", "x / y + x / y", "(x * z) ** 2 * y", "1 / x"])
def test_products_of_any_units_are_what_pint_makes_of_them(units_of, expression):
    registry = units.registry()
    powers = [units.powers_of_names(unit) for unit in units_of]
    ours = eval(expression, dict(zip("xyz", [Quantity(1.0, p) for p in powers], strict=True)))
    theirs = eval(expression, dict(zip("xyz", map(registry.Quantity, units_of), strict=True)))
    si = theirs.to_base_units()
    assert ours.value * ours.unit.factor == pytest.approx(si.magnitude)
    assert registry.Quantity(str(Unit(ours.unit.exponents))).units == si.units


def test_where_a_sum_shows_it_a_factor_converts():
    speed = Quantity(2.0, {"m": 1, "s": -1})
    converted = 1e3 * speed
    total = Quantity(5.0, {"mm": 1, "s": -1}) - converted
    assert str(converted.unit) == str(total.unit) == "mm/s"
    assert str(speed.unit) == "m/s"
    weight = 9.81 * Quantity(2.0, {"kg": 1})
    assert str((-weight + Quantity(1.0, {"N": 1})).unit) == str(weight.unit) == "N"
    with pytest.raises(UnitError):
        speed + Quantity(1.0, {"N": 1})


@pytest.mark.parametrize("cls", [MASS, Tank, *map(component, MODELS)])
def test_laws_of_models_in_si_have_the_units_that_pint_tells(cls):
    registry = units.registry()
    one = cls()
    layout = cls.layout
    for v in (*layout.parameters, *layout.inputs, *layout.states, *layout.discretes):
        if v.type == "real":
            start = float(v.start or v.nominal)
            one.__dict__[v.name] = registry.Quantity(start, units.parse(v.unit))
    one.time = registry.Quantity(1.0, "s")
    for law in families.list_laws(cls):
        try:
            dimension = getattr(one, law.name)().dimensionality
        except Exception:  # a sum with a number that is written into it, or of several values
            continue
        assert units.parse(law.unit).dimensionality == dimension, law.name


def test_common_units_need_no_pint():
    """In a process of its own: here others have loaded it."""
    script = (
        "import sys\n"
        "from tests.support.pushed_mass import MASS\n"
        "from fmus.kit.symbolic import families\n"
        "assert families.families_for(MASS)\n"
        "assert not {'pint', 'flexparser'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True)
