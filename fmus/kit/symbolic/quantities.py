"""Numbers with the exponents of SI base units: which unit a law has, told without pint.

pint's registry takes half a second to make. What it says of numbers in SI units is a sum of
exponents, by rules that are repeated here: an angle has a unit and no dimension, a sum has the unit
of its first part, and nothing, like NaN, may be added to anything.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

# as pint orders them
_ORDER = ("A", "cd", "K", "kg", "m", "mol", "rad", "s")
# of NumPy, by what they take and give: all in one unit, and that
_MATCHING = {"absolute", "fabs", "floor", "ceil", "rint", "hypot", "maximum", "minimum"}
_PURE = {"exp", "expm1", "log", "log10", "log1p", "sin", "cos", "tan", "sinh", "cosh", "tanh"}
_ANGLES = {"arccos", "arcsin", "arctan"}
_COMPARISONS = {"equal", "not_equal", "less", "less_equal", "greater", "greater_equal"}
_OF_TWO = {"add", "subtract", "arctan2"} | _MATCHING | _COMPARISONS
# that pint refuses of numbers with a unit
_REFUSED = {"fmin", "fmax", "logical_and", "logical_or", "logical_not"}
_OPERATORS: dict[str, Callable[[Any, Any], Any]] = {
    "multiply": operator.mul,
    "divide": operator.truediv,
    "power": operator.pow,
}
Exponents = Mapping[str, float]


class UnitError(ValueError):
    """Numbers of different dimensions where they must have the same."""


class UnknownOperationError(Exception):
    """An operation of which it is not known here what pint makes of it."""


class Quantity:
    """A number in a product of SI base units.

    Parameters
    ----------
    value : float
    exponents : Mapping of str to float
        By the symbol of the base unit, an angle's ``rad`` among them.
    """

    def __init__(self, value: Any, exponents: Exponents):
        self.value = value
        self.exponents = {base: power for base, power in exponents.items() if power}

    @property
    def unit(self) -> str:
        """The unit as pint writes it, ``kg*m/s^2``; ``"1"`` if there is none."""
        powers = {base: self.exponents[base] for base in _ORDER if base in self.exponents}
        above = "*".join(_factor(base, power) for base, power in powers.items() if power > 0.0)
        below = [f"/{_factor(base, -power)}" for base, power in powers.items() if power < 0.0]
        return "".join([above or "1", *below])

    @property
    def is_pure(self) -> bool:
        """True without a dimension, which an angle does not have."""
        return not self.exponents.keys() - {"rad"}

    def _same(self, other: Any) -> Any:
        """Return the value of another number that must have the same dimension."""
        if isinstance(other, Quantity):
            if _dimension(self) != _dimension(other):
                raise UnitError(f"{self.unit} and {other.unit}")
            return other.value
        if not self.is_pure and not _is_nothing(other):
            raise UnitError(f"{self.unit} and a number")
        return other

    def __add__(self, other: Any) -> Quantity:
        value = self.value + self._same(other)
        keeps = isinstance(other, Quantity) or _is_nothing(other)
        return Quantity(value, self.exponents if keeps else {})

    __radd__ = __add__

    def __sub__(self, other: Any) -> Quantity:
        return self.__add__(-other)

    def __rsub__(self, other: Any) -> Quantity:
        return (-self).__add__(other)

    def __neg__(self) -> Quantity:
        return Quantity(-self.value, self.exponents)

    def __pos__(self) -> Quantity:
        return self

    def __abs__(self) -> Quantity:
        return Quantity(abs(self.value), self.exponents)

    def __mul__(self, other: Any) -> Quantity:
        if isinstance(other, Quantity):
            return Quantity(self.value * other.value, _product(self, other, 1.0))
        return Quantity(self.value * other, self.exponents)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Quantity:
        if isinstance(other, Quantity):
            return Quantity(self.value / other.value, _product(self, other, -1.0))
        return Quantity(self.value / other, self.exponents)

    def __rtruediv__(self, other: Any) -> Quantity:
        return Quantity(other / self.value, {n: -power for n, power in self.exponents.items()})

    def __pow__(self, other: Any) -> Quantity:
        if isinstance(other, Quantity) and not other.is_pure:
            raise UnitError(f"a power of {other.unit}")
        power = other.value if isinstance(other, Quantity) else other
        exponents = {n: float(power) * of_base for n, of_base in self.exponents.items()}
        return Quantity(self.value**power, exponents)

    def __rpow__(self, other: Any) -> Any:
        return other ** float(self)

    def __float__(self) -> float:
        if not self.is_pure:
            raise UnitError(f"{self.unit} is no pure number")
        return float(self.value)

    def __bool__(self) -> bool:
        return bool(self.value)

    def __eq__(self, other: object) -> Any:
        try:
            return self.value == self._same(other)
        except UnitError:
            return False

    __hash__ = None  # type: ignore[assignment]

    def __lt__(self, other: Any) -> Any:
        return self.value < self._same(other)

    def __le__(self, other: Any) -> Any:
        return self.value <= self._same(other)

    def __gt__(self, other: Any) -> Any:
        return self.value > self._same(other)

    def __ge__(self, other: Any) -> Any:
        return self.value >= self._same(other)

    def _unknown(self, *arguments: Any) -> Any:
        raise UnknownOperationError

    __mod__ = __rmod__ = __floordiv__ = __rfloordiv__ = __divmod__ = __rdivmod__ = _unknown
    __round__ = __int__ = __index__ = __len__ = __iter__ = __getitem__ = _unknown

    def __getattr__(self, name: str) -> Any:
        # Python and NumPy look for names of their own, and go without
        raise AttributeError(name) if name.startswith("__") else UnknownOperationError

    def __array_ufunc__(self, function: Any, method: str, *inputs: Any, **named: Any) -> Any:
        """Do what NumPy's functions of elements do."""
        name = function.__name__
        if method != "__call__" or named:
            raise UnknownOperationError
        if name in _REFUSED:
            raise UnitError(f"{name} of numbers with a unit")
        if name in _OPERATORS:
            one, other = (_own_kind(each) for each in inputs)
            return _OPERATORS[name](one, other)
        first = next(each for each in inputs if isinstance(each, Quantity))
        if len(inputs) > 1:
            if name not in _OF_TWO:
                raise UnknownOperationError
            return _of_two(name, first, function(*map(first._same, inputs)))
        return _of_one(name, first, function)

    def __array_function__(
        self, function: Any, types: Any, inputs: Sequence[Any], named: Mapping[str, Any]
    ) -> Any:
        """Do what NumPy's choice between two values does; it is the only one that laws call."""
        if function is not np.where or len(inputs) != 3 or named:
            raise UnknownOperationError
        condition, *values = inputs
        if isinstance(condition, Quantity):
            condition = condition.value
        first = next((each for each in values if isinstance(each, Quantity)), None)
        if first is None:
            return np.where(condition, *values)
        return Quantity(np.where(condition, *map(first._same, values)), first.exponents)


def _of_two(name: str, first: Quantity, value: Any) -> Any:
    """Return the result of a function of NumPy of two numbers in one unit, the first's."""
    if name in ("add", "subtract") or name in _MATCHING:
        return Quantity(value, first.exponents)
    if name == "arctan2":
        return Quantity(value, {"rad": 1.0})
    return value  # of a comparison


def _of_one(name: str, one: Quantity, function: Any) -> Any:
    """Return the result of a function of NumPy of one number."""
    if name in _MATCHING:
        return Quantity(function(one.value), one.exponents)
    if name in _PURE or name in _ANGLES:
        return Quantity(function(float(one)), {"rad": 1.0} if name in _ANGLES else {})
    if name == "sqrt":
        halves = {base: 0.5 * power for base, power in one.exponents.items()}
        return Quantity(function(one.value), halves)
    if name == "negative":
        return -one
    if name == "sign":
        return function(one.value)
    raise UnknownOperationError


def _own_kind(one: Any) -> Any:
    """Return a number that does not ask NumPy again."""
    return one.item() if isinstance(one, np.generic) else one


def _is_nothing(number: Any) -> bool:
    """Return whether a number is zero or NaN, which have every unit."""
    return bool(number == 0) or math.isnan(number)


def _dimension(one: Quantity) -> dict[str, float]:
    """Return the exponents without those of an angle."""
    return {base: power for base, power in one.exponents.items() if base != "rad"}


def _product(one: Quantity, other: Quantity, sign: float) -> dict[str, float]:
    """Return the exponents of a product, or of a quotient with sign -1."""
    bases = {**one.exponents, **other.exponents}
    return {n: one.exponents.get(n, 0.0) + sign * other.exponents.get(n, 0.0) for n in bases}


def _factor(base: str, power: float) -> str:
    """Write a base unit with its power."""
    return base if power == 1.0 else f"{base}^{power:g}"
