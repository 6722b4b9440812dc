"""Units of laws. Oracle: pint, for products of units and for laws of models in SI."""

from __future__ import annotations

import subprocess
import sys

import pytest

from fmus import MODELS, component
from fmus.kit import units
from fmus.kit.symbolic.law_units import Unit
from fmus.kit.symbolic.laws import list_laws
from fmus.kit.symbolic.symbols import Symbol
from tests.support.pushed_mass import MASS, Tank


def in_order(exponents):
    return dict(sorted(exponents.items(), key=lambda item: item[0].lower()))


def of_pint(value, exponents):
    registry = units.registry()
    unit = "*".join(f"{n}**{power:g}" for n, power in exponents.items())
    return registry.Quantity(value, registry.Unit(unit))


@pytest.mark.parametrize(
    "exponents",
    [{"kg": 1, "m": 1, "s": -3, "A": -1, "K": -1}, {"s": -1, "K": -1}, {"mol": 2, "cd": 1}, {}],
)
def test_a_unit_is_written_as_pint_writes_it(exponents):
    written = f"{of_pint(1.0, exponents).units:~C}".replace("**", "^") if exponents else "1"
    assert str(Unit(in_order(exponents))) == written


@pytest.mark.parametrize("units_of", [("kW", "K", "mm"), ("bar", "g/s", "h"), ("km/h", "deg", "L")])
@pytest.mark.parametrize("expression", ["x * y / z", "x / y + x / y", "(x * z) ** 2 * y", "1 / x"])
def test_products_of_any_units_are_what_pint_makes_of_them(units_of, expression):
    registry = units.registry()
    powers = [units.powers_of_names(unit) for unit in units_of]
    ours = eval(expression, dict(zip("xyz", map(Symbol, powers), strict=True)))
    theirs = eval(expression, dict(zip("xyz", map(registry.Quantity, units_of), strict=True)))
    si = theirs.to_base_units()
    assert eval(expression, dict.fromkeys("xyz", 1.0)) * ours.unit.factor == pytest.approx(
        si.magnitude
    )
    assert registry.Quantity(str(Unit(ours.unit.exponents))).units == si.units


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
    for law in list_laws(cls):
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
        "from fmus.kit.symbolic import list_laws\n"
        "assert list_laws(MASS)\n"
        "assert not {'pint', 'flexparser'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True)
