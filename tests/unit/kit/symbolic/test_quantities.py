"""Numbers with exponents. Oracle: pint, for every operation of laws; exponents by hand."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from fmus import MODELS, component
from fmus.kit import units
from fmus.kit.symbolic import families
from fmus.kit.symbolic.quantities import Quantity, UnitError, UnknownOperationError
from tests.support.pushed_mass import MASS, Tank

M, RAD, N = {"m": 1.0}, {"rad": 1.0}, {"kg": 1.0, "m": 1.0, "s": -2.0}
EXPRESSIONS = """
m + m; m - f; m + 0; 0 - m; m + 1; 1 + m; 1 + a; a + 1; np.float64(1) + a; m / m + a; a + m / m
m + float("nan"); m + True; -m; +m; abs(-m); m * f; f / m; 2 * m; np.float64(2) * m; 1 / m
np.float64(1) / m; np.float64(1) - m; m * a; f * m * a / a; m**2; m**2.0; m**-1; m**0; m**1
m**(m / m); m**m; 2.0**a; 2.0**m; (m**0.5) ** 2; m**1.5 * m**0.5; np.power(m, 2); np.float64(2) ** m
m > 0; m > 1; m < f; a > 1; m == 1; m == m; m == f; m != f; m <= 2 * m; m >= 0.0
np.float64(0) < m; bool(m); float(m / m); float(a); float(m); sum([m, m]); max(m, 2 * m)
np.where(m > 0, m, 0.0); np.where(m > 0, 0.0, m); np.where(True, 1.0, a); np.where(True, 1.0, m)
np.where(m > 0, m, f); np.where(m, m, m); np.sqrt(m * m); np.sqrt(f); np.exp(a); np.exp(m)
np.log(m / m); np.sin(a); np.cos(m); np.tanh(m / m); np.arccos(a); np.arctan2(m, 2 * m)
np.arctan2(m, f); np.hypot(m, 0.0); np.hypot(m, 1.0); np.absolute(-m); np.fabs(m); np.floor(m)
np.sign(m); np.fmin(m, m); np.fmax(m, 0.0); np.logical_not(m); np.logical_and(m > 0, m < 2 * m)
np.maximum(m, 0); np.minimum(m, f); np.add(1.0, m); np.subtract(a, 1.0); np.negative(m)
"""


def told(expression, make):
    """Return the unit and value of an expression, a plain value, or that it fails."""
    scope = {"np": np, "m": make(3.0, M), "a": make(0.3, RAD), "f": make(2.0, N)}
    try:
        found = eval(expression, scope)
    except UnknownOperationError:
        raise
    except Exception:
        return "refused"
    if isinstance(found, Quantity):
        return found.unit, pytest.approx(float(found.value), nan_ok=True)
    if hasattr(found, "to_base_units"):
        unit = f"{found.to_base_units().units:~C}".replace("**", "^") or "1"
        return unit, float(found.to_base_units().magnitude)
    return float(found)


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
    assert Quantity(1.0, exponents).unit == written


@pytest.mark.parametrize(
    "expression", ["m % m", "m // m", "round(m)", "np.square(m)", "np.clip(m, m, m)"]
)
def test_what_is_not_known_here_is_left_to_pint(expression):
    with pytest.raises(UnknownOperationError):
        told(expression, Quantity)


def test_a_dimension_is_no_number():
    with pytest.raises(UnitError):
        float(Quantity(1.0, M))


@pytest.mark.parametrize("cls", [MASS, Tank, *map(component, MODELS)])
def test_laws_of_models_have_the_units_that_pint_tells(cls, monkeypatch):
    found = {law.name: law.unit for law in families.list_laws(cls)}
    monkeypatch.setattr(units, "coherent_exponents", lambda unit: None)
    assert found == {law.name: law.unit for law in families.list_laws(cls)}


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
