"""Formulas for signals: products, quotients, sums and differences of columns and numbers."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from fmus.kit import units
from fmus.kit.arrays import Array
from fmus.kit.errors import UserError, suggestion
from orchestration.records.record import refuse
from orchestration.records.tables import Column, Table, numbers

_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_NAME = re.compile(r"[^\s()+*/-]+")
_IS_FORMULA = re.compile(r"^\s*[-+(\d.]|[*/]|\s[-+]\s")
_DEEPEST = 50


def is_formula(text: str) -> bool:
    """Return whether the target of ``--map`` computes a signal, as ``-Current`` and ``P/U`` do."""
    return _IS_FORMULA.search(text) is not None


@dataclass(frozen=True)
class _Value:
    """A part of a formula: numbers in a unit, None if a column states none."""

    numbers: Array | float
    unit: str | None


@dataclass
class Formula:
    """A formula over the columns of a table.

    Columns are named as in the file, the longest name that fits; ``+ - * /`` and brackets have
    their usual precedence. Units are those of the columns: both sides of a sum measure the same.

    Parameters
    ----------
    table : Table
    text : str
        Such as ``0.001*I`` or ``(U1 - U2)/R``.
    argument : str
        The option for messages.
    """

    table: Table
    text: str
    argument: str
    columns: list[Column] = field(default_factory=list)
    _at: int = 0
    _depth: int = 0

    def column(self, name: str) -> Column:
        """Return the column of its values.

        Raises
        ------
        UserError
            If it is no formula of columns of the table, or its units do not fit.
        """
        value = self._sum()
        if self._at < len(self.text):
            raise self._refused(f"'{self.text[self._at :]}' is left over")
        values = np.broadcast_to(np.asarray(value.numbers, dtype=float), self.table.rows.shape)
        return Column(name, value.unit, np.array(values), self.text)

    def _refused(self, reason: str) -> UserError:
        return refuse(
            self.table.path,
            f"{self.argument}: {reason}; a formula has names of columns, numbers, + - * / and"
            " brackets",
        )

    def _takes(self, signs: str) -> str:
        """Return the next sign if it is one of some, and pass over it; else an empty text."""
        while self.text[self._at : self._at + 1].isspace():
            self._at += 1
        sign = self.text[self._at : self._at + 1]
        if not sign or sign not in signs:
            return ""
        self._at += 1
        return sign

    def _sum(self) -> _Value:
        left = self._product()
        while sign := self._takes("+-"):
            right = self._in_unit_of(left, self._product())
            change = right.numbers if sign == "+" else -right.numbers
            left = _Value(left.numbers + change, left.unit)
        return left

    def _in_unit_of(self, left: _Value, right: _Value) -> _Value:
        """Return a summand in the unit of the one before it."""
        if None in (left.unit, right.unit) or left.unit == right.unit:
            return _Value(right.numbers, left.unit)
        assert left.unit is not None
        assert right.unit is not None
        if not units.measure_alike(left.unit, right.unit):
            raise self._refused(f"{right.unit} cannot be added to {left.unit}")
        return _Value(units.convert(right.numbers, right.unit, left.unit), left.unit)

    def _product(self) -> _Value:
        left = self._factor()
        while sign := self._takes("*/"):
            right = self._factor()
            with np.errstate(divide="ignore", invalid="ignore"):  # infinite values are missing
                both = (
                    left.numbers * right.numbers
                    if sign == "*"
                    else np.divide(left.numbers, right.numbers)
                )
            left = _Value(both, _product_unit(left.unit, sign, right.unit))
        return left

    def _factor(self) -> _Value:
        self._depth += 1
        if self._depth > _DEEPEST:
            raise self._refused(f"it is deeper than {_DEEPEST} brackets and signs")
        try:
            if sign := self._takes("+-"):
                value = self._factor()
                return value if sign == "+" else _Value(-value.numbers, value.unit)
            if self._takes("("):
                value = self._sum()
                if not self._takes(")"):
                    raise self._refused("a bracket is not closed")
                return value
            return self._operand()
        finally:
            self._depth -= 1

    def _operand(self) -> _Value:
        """Return the next number or column."""
        self._takes("")
        rest = self.text[self._at :]
        names = [(name, c) for c in self.table.columns for name in {c.name, c.title} if name]
        fitting = [(name, c) for name, c in names if rest.startswith(name)]
        number = _NUMBER.match(rest)
        if fitting:
            name, column = max(fitting, key=lambda pair: len(pair[0]))
            if number is None or len(name) >= number.end():
                self._at += len(name)
                self.columns.append(column)
                return self._of(column)
        if number is not None:
            self._at += number.end()
            return _Value(float(number[0]), "1")
        word = _NAME.match(rest)
        if word is None:
            raise self._refused(
                "something is missing" if not rest else f"'{rest[0]}' is unexpected"
            )
        raise self._refused(
            f"there is no column '{word[0]}'{suggestion(word[0], self.table.names())}"
        )

    def _of(self, column: Column) -> _Value:
        """Return the numbers of a column; temperatures in K, as degrees cannot be multiplied."""
        values = numbers(self.table, column)
        if column.unit is None:
            return _Value(values, None)
        units.check(column.unit)
        offset = float(units.base_unit(column.unit).offset)
        if offset:
            return _Value(units.convert(values, column.unit, "K"), "K")
        return _Value(values, column.unit)


def _product_unit(left: str | None, sign: str, right: str | None) -> str | None:
    """Return the unit of a product or quotient; None if that of a column is not known."""
    if left is None or right is None:
        return None
    if right == "1":
        return left
    return f"({left}){sign}({right})" if left != "1" or sign == "/" else right
