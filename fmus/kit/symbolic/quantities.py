"""Numbers in the units that a model declares, which give the units of laws without pint.

pint's registry takes half a second to load, and it converts units, which a model does not: the
numbers of a model in kW and mm are in kW and mm. Therefore the unit of a number here is a product
of powers of declared units. An angle has a unit and no dimension. A sum has the unit of its first
term. A numeric constant in a law may have any unit: as a term that of the sum; as a factor it may
convert (``1e3 * self.speed`` for mm/s from m/s). The unit after such a factor is open, until a sum
or the declaration of the result determines it.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from math import isclose
from typing import Any

import numpy as np

from fmus.kit import units

# functions of NumPy by the units of arguments and result; these have all in one unit
MATCHING = {
    "absolute",
    "fabs",
    "floor",
    "ceil",
    "rint",
    "hypot",
    "maximum",
    "minimum",
    "remainder",
    "fmin",
    "fmax",
}
PURE = {"exp", "expm1", "log", "log10", "log1p", "sin", "cos", "tan", "sinh", "cosh", "tanh"}
ANGLES = {"arccos", "arcsin", "arctan"}
ROOTS = {"sqrt": 0.5, "square": 2}
COMPARISONS = {"equal", "not_equal", "less", "less_equal", "greater", "greater_equal"}
_OF_TWO = {"add", "subtract", "arctan2"} | MATCHING | COMPARISONS
_OPERATORS: dict[str, Callable[[Any, Any], Any]] = {
    "multiply": operator.mul,
    "divide": operator.truediv,
    "floor_divide": operator.floordiv,
    "power": operator.pow,
}
Powers = Mapping[str, float]


class UnitError(ValueError):
    """An operation that is unknown, or whose numbers must have the same dimension and do not."""


class Unit:
    """The unit of a number, which a later operation may determine.

    Parameters
    ----------
    powers : Mapping of str to float
        Power of each unit by name, including ``rad``.
    is_open : bool
        Whether the unit may be another one, because a law has a numeric factor that may convert.
    """

    def __init__(self, powers: Powers, is_open: bool = False):
        self.powers = {name: power for name, power in powers.items() if power}
        self.is_open = is_open

    @property
    def exponents(self) -> dict[str, float]:
        """Powers of SI base units."""
        total: dict[str, float] = {}
        for name, power in self.powers.items():
            for base, exponent in units.base_unit(name).exponents.items():
                total[base] = total.get(base, 0.0) + power * exponent
        return {base: exponent for base, exponent in total.items() if exponent}

    @property
    def factor(self) -> float:
        """Value in SI of the number one in this unit."""
        product = 1.0
        for name, power in self.powers.items():
            product *= units.base_unit(name).factor ** power
        return product

    @property
    def is_pure(self) -> bool:
        """True if the unit has no dimension; an angle has none."""
        return not self.exponents.keys() - {"rad"}

    def match(self, other: Unit) -> None:
        """Check that numbers in this and another unit can be added or compared.

        If the units differ, the one that is open (`is_open`) takes the powers of the other.

        Raises
        ------
        UnitError
            If they have different dimensions.
        """
        if self.powers == other.powers:
            return
        is_same = dimension(self) == dimension(other)
        if is_same and isclose(self.factor, other.factor, rel_tol=1e-9):
            return
        if self.is_open and not other.is_open:
            self.powers, self.is_open = other.powers, False
        elif other.is_open and not self.is_open:
            other.powers, other.is_open = self.powers, False
        elif not is_same and not self.is_open:
            raise UnitError(f"{self} and {other}")

    def __str__(self) -> str:
        above = "*".join(_factor(name, power) for name, power in self.powers.items() if power > 0.0)
        below = [f"/{_factor(name, -power)}" for name, power in self.powers.items() if power < 0.0]
        return "".join([above or "1", *below])


class Quantity:
    """A number in a unit.

    Parameters
    ----------
    value : float
    unit : Unit or Mapping of str to float
        Unit, which other numbers may share, or powers of units by name.
    """

    def __init__(self, value: Any, unit: Unit | Powers):
        self.value = value
        self.unit = unit if isinstance(unit, Unit) else Unit(unit)

    def _matching_value(self, other: Any) -> Any:
        """Return the value of another number; raise UnitError if its dimension differs."""
        if isinstance(other, Quantity):
            self.unit.match(other.unit)
            return other.value
        return other

    def __add__(self, other: Any) -> Quantity:
        return Quantity(self.value + self._matching_value(other), self.unit)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Quantity:
        return self.__add__(-other)

    def __rsub__(self, other: Any) -> Quantity:
        return (-self).__add__(other)

    def __neg__(self) -> Quantity:
        return Quantity(-self.value, self.unit)

    def __pos__(self) -> Quantity:
        return self

    def __abs__(self) -> Quantity:
        return Quantity(abs(self.value), self.unit)

    def __mul__(self, other: Any) -> Quantity:
        if isinstance(other, Quantity):
            return Quantity(self.value * other.value, _product(self.unit, other.unit, 1.0))
        return Quantity(self.value * other, _times_constant(self.unit, other, 1.0))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Quantity:
        if isinstance(other, Quantity):
            return Quantity(self.value / other.value, _product(self.unit, other.unit, -1.0))
        return Quantity(self.value / other, _times_constant(self.unit, other, 1.0))

    def __rtruediv__(self, other: Any) -> Quantity:
        return Quantity(other / self.value, _times_constant(self.unit, other, -1.0))

    __floordiv__ = __truediv__
    __rfloordiv__ = __rtruediv__

    def __mod__(self, other: Any) -> Quantity:
        return Quantity(self.value % self._matching_value(other), self.unit)

    def __rmod__(self, other: Any) -> Quantity:
        return Quantity(other % self.value, self.unit)

    def __round__(self, digits: int | None = None) -> Quantity:
        return Quantity(round(self.value, digits), self.unit)

    def __pow__(self, other: Any) -> Quantity:
        power = float(other)
        powers = {name: power * of_unit for name, of_unit in self.unit.powers.items()}
        return Quantity(self.value**power, Unit(powers, self.unit.is_open))

    def __rpow__(self, other: Any) -> Any:
        return other ** float(self)

    def __float__(self) -> float:
        if not self.unit.is_pure and not self.unit.is_open:
            raise UnitError(f"{self.unit} is no pure number")
        return float(self.value)

    def __bool__(self) -> bool:
        return bool(self.value)

    def __eq__(self, other: object) -> Any:
        try:
            return self.value == self._matching_value(other)
        except UnitError:
            return False

    __hash__ = None  # type: ignore[assignment]

    def __lt__(self, other: Any) -> Any:
        return self.value < self._matching_value(other)

    def __le__(self, other: Any) -> Any:
        return self.value <= self._matching_value(other)

    def __gt__(self, other: Any) -> Any:
        return self.value > self._matching_value(other)

    def __ge__(self, other: Any) -> Any:
        return self.value >= self._matching_value(other)

    def __array_ufunc__(self, function: Any, method: str, *inputs: Any, **named: Any) -> Any:
        """Apply an elementwise function of NumPy."""
        name = function.__name__
        if method != "__call__" or named:
            raise UnitError(f"{function.__name__} of numbers with a unit")
        if name in _OPERATORS:
            one, other = map(_without_numpy, inputs)
            return _OPERATORS[name](one, other)
        first = next(each for each in inputs if isinstance(each, Quantity))
        if len(inputs) > 1:
            if name not in _OF_TWO:
                raise UnitError(f"{function.__name__} of numbers with a unit")
            return _result_of_two(name, first, function(*map(first._matching_value, inputs)))
        return _result_of_one(name, first, function)

    def __array_function__(
        self, function: Any, types: Any, inputs: Sequence[Any], named: Mapping[str, Any]
    ) -> Any:
        """Apply ``numpy.where`` or ``numpy.clip``."""
        if function not in (np.where, np.clip) or len(inputs) != 3 or named:
            raise UnitError(f"{function.__name__} of numbers with a unit")
        plain = [each.value if isinstance(each, Quantity) else each for each in inputs]
        values = inputs[1:] if function is np.where else inputs
        first = next((each for each in values if isinstance(each, Quantity)), None)
        if first is None:
            return function(*plain)
        for each in values:
            first._matching_value(each)
        return Quantity(function(*plain), first.unit)


def _result_of_two(name: str, first: Quantity, value: Any) -> Any:
    """Return the value of a NumPy function of two numbers with the unit that it has."""
    if name in ("add", "subtract") or name in MATCHING:
        return Quantity(value, first.unit)
    if name == "arctan2":
        return Quantity(value, {"rad": 1.0})
    return value  # of a comparison


def _result_of_one(name: str, one: Quantity, function: Any) -> Any:
    """Return the result of a NumPy function of one number."""
    if name in MATCHING:
        return Quantity(function(one.value), one.unit)
    if name in PURE or name in ANGLES:
        return Quantity(function(float(one)), {"rad": 1.0} if name in ANGLES else {})
    if name in ROOTS:
        return Quantity(function(one.value), (one ** ROOTS[name]).unit)
    if name == "negative":
        return -one
    if name == "sign":
        return function(one.value)
    raise UnitError(f"{function.__name__} of numbers with a unit")


def _without_numpy(one: Any) -> Any:
    """Return a scalar of NumPy as a Python number, whose operators do not dispatch to NumPy."""
    return one.item() if isinstance(one, np.generic) else one


def dimension(unit: Unit) -> dict[str, float]:
    """Return the exponents of SI base units without those of angles."""
    return {base: power for base, power in unit.exponents.items() if base != "rad"}


def _product(one: Unit, other: Unit, sign: float) -> Unit:
    """Return the unit of a product, or for sign -1 of a quotient."""
    names = {**one.powers, **other.powers}
    powers = {n: one.powers.get(n, 0.0) + sign * other.powers.get(n, 0.0) for n in names}
    return Unit(powers, one.is_open or other.is_open)


def _times_constant(unit: Unit, by: Any, sign: float) -> Unit:
    """Return a unit, or for sign -1 its inverse, times a numeric constant of a law."""
    powers = {name: sign * power for name, power in unit.powers.items()}
    return Unit(powers, unit.is_open or bool(abs(by) != 1))


def _factor(name: str, power: float) -> str:
    """Write a unit with its power."""
    return name if power == 1.0 else f"{name}^{power:g}"
