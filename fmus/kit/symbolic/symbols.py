"""Numbers with a unit and without a value, by which laws are checked and have their units.

A law must work on floats, arrays and CasADi symbols, so that it may not branch on a value or pass
it to a function of floats. The numbers here have no value: code that needs one raises an error.
Units are products of powers of declared units (:mod:`fmus.kit.symbolic.law_units`); an angle has
no dimension. A numeric constant in a law may have any unit as a term of a sum. As a factor it has
no unit if it is a simple number (2, 1/3, pi and the like); any other may convert
(``load / 3600.0``) or have a unit (``9.81 * mass``), which the first sum with a number whose unit
is certain determines.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from math import isclose, isnan, log, nan, pi, prod
from numbers import Number
from typing import Any

import numpy as np

from fmus.kit.declare import Constant
from fmus.kit.symbolic.law_units import Unit, dimension
from fmus.kit.units import powers_of_names

# functions of NumPy by the units of arguments and result; these have all in one unit
_MATCHING = {
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
_PURE = {"exp", "expm1", "log", "log10", "log1p", "sin", "cos", "tan", "sinh", "cosh", "tanh"}
_ANGLES = {"arccos", "arcsin", "arctan"}
_ROOTS = {"sqrt": 0.5, "square": 2}
_COMPARISONS = {"equal", "not_equal", "less", "less_equal", "greater", "greater_equal"}

_LARGEST_PLAIN = 4  # largest numerator and denominator of a constant without a unit
# tolerance of a conversion, because a product may have another factor, such as an efficiency
_NEARLY = log(2.0)
_LOGICAL = {"logical_and", "logical_or", "logical_not", "sign", "isnan", "isfinite"}
_OPERATORS: dict[str, Callable[[Any, Any], Any]] = {
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "divide": operator.truediv,
    "power": operator.pow,
}


class LawError(ValueError):
    """A mistake in a law, with a remedy.

    Parameters
    ----------
    text : str
        The mistake.
    remedy : str
        Instruction to the author; empty if there is none.
    """

    def __init__(self, text: str, remedy: str = ""):
        super().__init__(text)
        self.remedy = remedy


class ScaleError(LawError):
    """Units of the same dimension and different scale."""


class ValueNeeded(LawError):
    """Code that needs the value of a number: a branch, or a function of floats."""


class Symbol:
    """A number with a unit and without a value.

    Parameters
    ----------
    powers : Mapping of str to float
        Power of each unit by name.
    numbers : tuple of float
        Numeric factors that may convert or have a unit; NaN is a factor that may be any.
    is_variable : bool
        Whether no sum determines its unit, because other laws use it, too.
    """

    def __init__(
        self,
        powers: Mapping[str, float],
        numbers: tuple[float, ...] = (),
        is_variable: bool = False,
    ):
        self.unit = Unit(powers)
        self.numbers = numbers
        self.is_variable = is_variable

    def match(self, other: Any) -> Symbol:
        """Return the sum of this and another number, after a check of their units.

        If one of them is certain, the other, whose numeric factors explain the difference, takes
        its unit.

        Raises
        ------
        LawError
            If their units differ, and no numeric factor explains the difference.
        """
        if isinstance(other, Constant):
            return self.match(Symbol(powers_of_names(other.unit)))
        if not isinstance(other, Symbol):
            check_number(other)
            return self
        # of the two, the one without numeric factors, whose unit is certain, comes first
        known, doubtful = sorted((self, other), key=lambda symbol: bool(symbol.numbers))
        if self.unit.powers == other.unit.powers:
            return known
        numbers = self.numbers + other.numbers
        if dimension(self.unit) != dimension(other.unit):
            if not numbers:
                raise LawError(f"{self.unit} and {other.unit} are of different kinds")
        else:
            larger, smaller = sorted((self.unit, other.unit), key=lambda unit: -unit.factor)
            ratio = larger.factor / smaller.factor
            if not isclose(ratio, 1.0, rel_tol=1e-9) and not _may_convert(numbers, ratio):
                raise ScaleError(f"1 {larger} is {ratio:g} {smaller}")
        if doubtful.numbers and not (known.numbers or doubtful.is_variable):
            doubtful.unit, doubtful.numbers = known.unit, ()
        return known

    def check_pure(self, name: str) -> None:
        """Raise an error unless the number can be the argument of a function of pure numbers.

        Parameters
        ----------
        name : str
            Name of the function, for the message.

        Raises
        ------
        LawError
            If its unit has a dimension or a scale.
        """
        try:
            self.match(Symbol({}))
        except LawError as error:
            reason = f"{name} of a number in {self.unit}"
            remedy = "divide by a parameter in this unit"
            raise type(error)(reason, remedy) from error

    def _times(self, other: Any, sign: float) -> Symbol:
        """Return the product with another number, or for sign -1 the quotient."""
        if isinstance(other, Constant):
            return self._times(Symbol(powers_of_names(other.unit)), sign)
        if isinstance(other, Symbol):
            powers = _sum_of_powers(self.unit.powers, other.unit.powers, sign)
            return Symbol(powers, self.numbers + other.numbers)
        check_number(other)
        return Symbol(self.unit.powers, self.numbers + _converting_factors(other))

    def __mul__(self, other: Any) -> Symbol:
        return self._times(other, 1.0)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Symbol:
        return self._times(other, -1.0)

    def __rtruediv__(self, other: Any) -> Symbol:
        return (self**-1.0)._times(other, 1.0)

    def __pow__(self, other: Any) -> Symbol:
        if isinstance(other, Symbol):
            other.check_pure("a power to the exponent")
            self.check_pure("a power, to an exponent that varies,")
            return Symbol({})
        check_number(other)
        power = float(other)
        powers = {name: power * of_unit for name, of_unit in self.unit.powers.items()}
        return Symbol(powers, self.numbers)

    def __rpow__(self, other: Any) -> Symbol:
        self.check_pure("a power to the exponent")
        return Symbol({})

    def __neg__(self) -> Symbol:
        return self

    __pos__ = __abs__ = __neg__

    def __add__(self, other: Any) -> Symbol:
        return self.match(other)

    __radd__ = __sub__ = __rsub__ = __add__

    def __lt__(self, other: Any) -> Symbol:
        self.match(other)
        return Symbol({})

    __le__ = __gt__ = __ge__ = __lt__

    def __eq__(self, other: object) -> Any:
        return self < other

    def __ne__(self, other: object) -> Any:
        return self < other

    __hash__ = None  # type: ignore[assignment]

    def __mod__(self, other: Any) -> Symbol:
        raise LawError("% does not work in laws", "write x - y * floor(x / y) for x % y")

    def __floordiv__(self, other: Any) -> Symbol:
        raise LawError("// does not work in laws", "write floor(x / y) for x // y")

    __rmod__ = __mod__
    __rfloordiv__ = __floordiv__

    def __bool__(self) -> bool:
        raise ValueNeeded(
            "a law decides by a value, which symbols do not have",
            "write where(condition, yes, no), of fmus.kit",
        )

    def __float__(self) -> float:
        raise ValueNeeded(
            "a function of floats is called on a signal",
            "use the functions of fmus.kit: sqrt, exp, log, sin, cos, tanh, floor, ...",
        )

    __int__ = __index__ = __complex__ = __float__

    def __round__(self, digits: Any = None) -> Symbol:
        raise ValueNeeded("round is called on a signal", "write floor(x + 0.5)")

    def __iter__(self) -> Any:
        raise LawError("one number is used like several", "return several from the law it comes of")

    def __array_ufunc__(self, function: Any, method: str, *inputs: Any, **named: Any) -> Any:
        """Apply an elementwise function of NumPy, to which the functions of fmus.kit dispatch."""
        return _apply_numpy_function(function.__name__, inputs)

    def __array_function__(
        self, function: Any, types: Any, inputs: Sequence[Any], named: Mapping[str, Any]
    ) -> Any:
        """Apply ``numpy.where``."""
        if function is not np.where or len(inputs) != 3:
            raise LawError(f"there is no {function.__name__} for laws", "use fmus.kit's functions")
        return _common_symbol(inputs[1:])

    def looked_up(self, xs: Sequence[Any], ys: Sequence[Any]) -> Any:
        """Return a value of a table at this number (:func:`fmus.kit.table`)."""
        _common_symbol([self, *xs])
        return _common_symbol(ys)


ANY = Symbol({}, (nan,), is_variable=True)  # a variable of any unit


def check_number(value: Any) -> None:
    """Raise an error unless an operand in a law is a number.

    Parameters
    ----------
    value : object

    Raises
    ------
    LawError
        With the probable remedy.
    """
    if isinstance(value, Number | np.generic | np.ndarray):
        return
    if value is None:
        raise LawError("there is a law that gives nothing", "it lacks a return")
    if callable(value):
        name = getattr(value, "__name__", "law")
        raise LawError(f"the law {name} stands there, not its value", f"write {name}()")
    if isinstance(value, Sequence):
        raise LawError("several numbers stand there", "choose one: law()[0]")
    raise LawError(f"{value!r} is no number")


def _common_symbol(values: Sequence[Any]) -> Any:
    """Return the symbol of values that must have one unit; of any unit if none of them has one."""
    symbols = [each for each in values if isinstance(each, Symbol)]
    known = symbols[0] if symbols else Symbol({}, ANY.numbers)
    for each in values:
        known = known.match(each)
    return known


def _apply_numpy_function(name: str, inputs: Sequence[Any]) -> Any:
    """Return the symbol that is the result of a function of NumPy, by the function's name."""
    plain = [_without_numpy(each) for each in inputs]
    if name in _OPERATORS:
        return _OPERATORS[name](*plain)
    first = next(each for each in plain if isinstance(each, Symbol))
    if name in _MATCHING:
        return _common_symbol(plain)
    if name in _ROOTS:
        return first ** _ROOTS[name]
    if name in _PURE:
        first.check_pure(name)
        return Symbol({})
    if name in _COMPARISONS or name in ("arctan2", *_LOGICAL):
        _common_symbol(plain if name not in _LOGICAL else [first])
        return Symbol({"rad": 1.0} if name == "arctan2" else {})
    if name in _ANGLES:
        first.check_pure(name)
        return Symbol({"rad": 1.0})
    raise LawError(f"there is no {name} for laws", "use the functions of fmus.kit")


def _without_numpy(one: Any) -> Any:
    """Return a value whose operators do not dispatch to NumPy; NaN for an array."""
    if isinstance(one, np.ndarray):
        return nan
    return one.item() if isinstance(one, np.generic) else one


def _sum_of_powers(
    one: Mapping[str, float], other: Mapping[str, float], sign: float
) -> dict[str, float]:
    """Return the powers of units of a product, or for sign -1 of a quotient."""
    return {n: one.get(n, 0.0) + sign * other.get(n, 0.0) for n in {**one, **other}}


def _converting_factors(factor: Any) -> tuple[float, ...]:
    """Return a numeric factor that may convert or have a unit; none for a simple number."""
    if isinstance(factor, np.ndarray) or not factor or isnan(factor):
        return (nan,)  # zero times any unit is zero, and an array may have any values
    size = abs(float(factor))
    return () if _is_plain(size) else (size,)


@lru_cache
def _is_plain(size: float) -> bool:
    """Return whether a number is a ratio of small integers, or one times a power of pi."""
    for power in (-2, -1, 0, 1, 2):
        rest = size * pi**power
        near = Fraction(rest).limit_denominator(_LARGEST_PLAIN)
        if 0 < near.numerator <= _LARGEST_PLAIN and isclose(near, rest, rel_tol=1e-12):
            return True
    return False


def _may_convert(numbers: Sequence[float], ratio: float) -> bool:
    """Return whether one of the numeric factors, or their product, can convert by a ratio.

    It can if it, or its inverse, is about the ratio, and it is not about one.
    """
    if any(map(isnan, numbers)):
        return True
    candidates = (*numbers, prod(numbers)) if numbers else ()
    return any(
        abs(abs(log(number)) - abs(log(ratio))) < _NEARLY and abs(log(number)) > _NEARLY / 2.0
        for number in candidates
    )
