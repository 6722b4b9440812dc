"""Numbers of which only the unit is known: what laws are evaluated on before anything is built.

A law must give its value for floats, arrays and CasADi symbols alike, so it may not decide by a
value, nor hand one to a function of floats. The numbers here have none: what would need a value is
refused where it stands. Units are those that variables are declared in
(:mod:`fmus.kit.symbolic.quantities`); an angle has no dimension. A number that is written into a
law has any unit as a summand. As a factor it is a plain number if it is one of few (2, 1/3, pi and
the like); any other may convert (``load / 3600.0``) or have a unit itself (``9.81 * mass``).
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
from fmus.kit.symbolic.quantities import (
    ANGLES,
    COMPARISONS,
    MATCHING,
    PURE,
    ROOTS,
    Unit,
    dimension,
)
from fmus.kit.units import powers_of_names

_LARGEST_PLAIN = 4  # numerator and denominator of a number that is taken to have no unit
# A number that converts may stand in one product with another, such as an efficiency.
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
    """What a law does that it may not, with what to write instead.

    Parameters
    ----------
    text : str
    remedy : str
    """

    def __init__(self, text: str, remedy: str = ""):
        super().__init__(text)
        self.remedy = remedy


class ScaleError(LawError):
    """Units of the same dimension, one of which is several of the other."""


class ValueNeeded(LawError):
    """A decision by a value, or a function of floats."""


class Symbol:
    """A number of which only the unit is known.

    Parameters
    ----------
    powers : Mapping of str to float
        Of units by name.
    numbers : tuple of float
        Written into the law as factors, if they may convert or have a unit; NaN is one that is
        known for nothing.
    """

    def __init__(self, powers: Mapping[str, float], numbers: tuple[float, ...] = ()):
        self.unit = Unit(powers)
        self.numbers = numbers

    def meet(self, other: Any) -> Symbol:
        """Return what a sum of this and another number is.

        Raises
        ------
        LawError
            If they are of different units, and no number that is written into the law explains it.
        """
        if isinstance(other, Constant):
            other = Symbol(powers_of_names(other.unit))
        if not isinstance(other, Symbol):
            check_number(other)
            return self
        known = min(self, other, key=lambda symbol: bool(symbol.numbers))
        if self.unit.powers == other.unit.powers:
            return known
        numbers = self.numbers + other.numbers
        if dimension(self.unit) != dimension(other.unit):
            if not numbers:
                raise LawError(f"{self.unit} and {other.unit} are of different kinds")
            return known
        larger, smaller = sorted((self.unit, other.unit), key=lambda unit: -unit.factor)
        ratio = larger.factor / smaller.factor
        if not isclose(ratio, 1.0, rel_tol=1e-9) and not _explain(numbers, ratio):
            raise ScaleError(f"1 {larger} is {ratio:g} {smaller}")
        return known

    def pure(self, name: str) -> None:
        """Check that it can be the argument of a function of plain numbers.

        Raises
        ------
        LawError
        """
        try:
            self.meet(Symbol({}))
        except LawError as error:
            reason = f"{name} of a number in {self.unit}"
            remedy = "divide by a parameter in this unit"
            raise type(error)(reason, remedy) from error

    def _times(self, other: Any, sign: float) -> Symbol:
        """Return the product with another number, or with its inverse."""
        if isinstance(other, Constant):
            other = Symbol(powers_of_names(other.unit))
        if isinstance(other, Symbol):
            powers = _sum(self.unit.powers, other.unit.powers, sign)
            return Symbol(powers, self.numbers + other.numbers)
        check_number(other)
        return Symbol(self.unit.powers, self.numbers + _told(other))

    def __mul__(self, other: Any) -> Symbol:
        return self._times(other, 1.0)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Symbol:
        return self._times(other, -1.0)

    def __rtruediv__(self, other: Any) -> Symbol:
        return (self**-1.0)._times(other, 1.0)

    def __pow__(self, other: Any) -> Symbol:
        if isinstance(other, Symbol):
            other.pure("a power to the exponent")
            self.pure("a power, to an exponent that varies,")
            return Symbol({})
        check_number(other)
        power = float(other)
        powers = {name: power * of_unit for name, of_unit in self.unit.powers.items()}
        return Symbol(powers, self.numbers)

    def __rpow__(self, other: Any) -> Symbol:
        self.pure("a power to the exponent")
        return Symbol({})

    def __neg__(self) -> Symbol:
        return self

    __pos__ = __abs__ = __neg__

    def __add__(self, other: Any) -> Symbol:
        return self.meet(other)

    __radd__ = __sub__ = __rsub__ = __add__

    def __lt__(self, other: Any) -> Symbol:
        self.meet(other)
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
        """Do what NumPy's functions of elements do, by which those of fmus.kit dispatch."""
        return _applied(function.__name__, inputs)

    def __array_function__(
        self, function: Any, types: Any, inputs: Sequence[Any], named: Mapping[str, Any]
    ) -> Any:
        """Do what NumPy's choice between two values does."""
        if function is not np.where or len(inputs) != 3:
            raise LawError(f"there is no {function.__name__} for laws", "use fmus.kit's functions")
        return _met(inputs[1:])

    def looked_up(self, xs: Sequence[Any], ys: Sequence[Any]) -> Any:
        """Return a value of a table at this number (:func:`fmus.kit.table`)."""
        _met([self, *xs])
        return _met([ANY, *ys])


ANY = Symbol({}, (nan,))  # a number of any unit


def check_number(value: Any) -> None:
    """Check that what stands in a law beside a number is one.

    Parameters
    ----------
    value : object

    Raises
    ------
    LawError
        With what was probably meant.
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


def _met(values: Sequence[Any]) -> Any:
    """Return the one number that several in one unit are like; a plain one if there is no other."""
    symbols = [each for each in values if isinstance(each, Symbol)]
    if not symbols:
        return ANY
    known = symbols[0]
    for each in values:
        known = known.meet(each)
    return known


def _applied(name: str, inputs: Sequence[Any]) -> Any:
    """Return what a function of NumPy gives, by its name."""
    plain = [_own_kind(each) for each in inputs]
    if name in _OPERATORS:
        return _OPERATORS[name](*plain)
    first = next(each for each in plain if isinstance(each, Symbol))
    if name in MATCHING:
        return _met(plain)
    if name in ROOTS:
        return first ** ROOTS[name]
    if name in PURE:
        first.pure(name)
        return Symbol({})
    if name in COMPARISONS or name in ("arctan2", *_LOGICAL):
        _met(plain if name not in _LOGICAL else [first])
        return Symbol({"rad": 1.0} if name == "arctan2" else {})
    if name in ANGLES:
        first.pure(name)
        return Symbol({"rad": 1.0})
    raise LawError(f"there is no {name} for laws", "use the functions of fmus.kit")


def _own_kind(one: Any) -> Any:
    """Return a number that does not ask NumPy again; of an array one that may be anything."""
    if isinstance(one, np.ndarray):
        return nan
    return one.item() if isinstance(one, np.generic) else one


def _sum(one: Mapping[str, float], other: Mapping[str, float], sign: float) -> dict[str, float]:
    """Return the powers of a product, or of a quotient with sign -1."""
    return {n: one.get(n, 0.0) + sign * other.get(n, 0.0) for n in {**one, **other}}


def _told(factor: Any) -> tuple[float, ...]:
    """Return a factor that is written into a law, unless it is a plain number."""
    if isinstance(factor, np.ndarray) or not factor or isnan(factor):
        return (nan,)  # nothing of anything is nothing, and an array may be anything
    size = abs(float(factor))
    return () if _is_plain(size) else (size,)


@lru_cache
def _is_plain(size: float) -> bool:
    """Return whether a number is a ratio of small ones, or such a multiple of a power of pi."""
    for power in (-2, -1, 0, 1, 2):
        rest = size * pi**power
        near = Fraction(rest).limit_denominator(_LARGEST_PLAIN)
        if 0 < near.numerator <= _LARGEST_PLAIN and isclose(near, rest, rel_tol=1e-12):
            return True
    return False


def _explain(numbers: Sequence[float], ratio: float) -> bool:
    """Return whether a number that is written into a law, or all of them, can be a conversion."""
    if any(map(isnan, numbers)):
        return True
    candidates = (*numbers, prod(numbers)) if numbers else ()
    return any(
        abs(abs(log(number)) - abs(log(ratio))) < _NEARLY and abs(log(number)) > _NEARLY / 2.0
        for number in candidates
    )
