"""Units of equations as a compiler of Modelica checks them, on the flat class that pymoca gives.

A number that is written into an equation may have any unit; so may what has no unit declared.
Angles have no dimension.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import pymoca.ast

_BASE = {
    "1": {},
    "A": {"A": 1},
    "C": {"A": 1, "s": 1},
    "F": {"A": 2, "s": 4, "kg": -1, "m": -2},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
    "Hz": {"s": -1},
    "J": {"kg": 1, "m": 2, "s": -2},
    "K": {"K": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "Ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "W": {"kg": 1, "m": 2, "s": -3},
    "kg": {"kg": 1},
    "m": {"m": 1},
    "rad": {},
    "s": {"s": 1},
}
_SAME = {"+", "-", "min", "max", "<", "<=", ">", ">=", "=="}
_KEEPING = {"abs", "noEvent", "pre", "PpyRig.Functions.hypotenuse"}
_RELATIONS = {"<", "<=", ">", ">=", "==", "and", "or", "not", "sign"}


@dataclass(frozen=True)
class Dimension:
    """Powers of base units; open if a number may have others."""

    powers: dict[str, float] = field(default_factory=dict)
    is_open: bool = False

    def times(self, other: Dimension, sign: float) -> Dimension:
        names = {*self.powers, *other.powers}
        powers = {n: self.powers.get(n, 0) + sign * other.powers.get(n, 0) for n in names}
        return Dimension({n: p for n, p in powers.items() if p}, self.is_open or other.is_open)

    def raised(self, power: float) -> Dimension:
        return Dimension({n: power * p for n, p in self.powers.items() if power}, self.is_open)

    def fits(self, other: Dimension) -> bool:
        return self.is_open or other.is_open or self.powers == other.powers


ANY = Dimension(is_open=True)
PURE = Dimension()


def read_unit(text: str) -> Dimension:
    """Read a unit in the grammar of the language (specification 3.6, chapter 19)."""
    above, _, below = text.partition("/")
    result = PURE
    for part, sign in ((above, 1.0), (below.strip("()"), -1.0)):
        for factor in filter(None, part.split(".")):
            name, power = re.fullmatch(r"([A-Za-z]+|1)(-?\d+)?", factor).groups()
            result = result.times(Dimension(dict(_BASE[name])).raised(float(power or 1)), sign)
    return result


def misfits(flat: Any) -> tuple[list[str], int]:
    """Return what does not fit in the equations of a flat class, and how many were compared."""
    dimensions = {}
    for name, symbol in flat.symbols.items():
        unit = getattr(symbol.unit, "value", None)
        dimensions[name] = read_unit(unit) if unit else ANY
    checker = _Checker(dimensions)
    for equation in _equations(flat.equations):
        left, right = checker.of(equation.left), checker.of(equation.right)
        checker.meet(equation, left, right)
    return checker.found, checker.compared


def _equations(nodes: Any) -> Iterator[Any]:
    for node in nodes:
        if isinstance(node, pymoca.ast.WhenEquation):
            for block in node.blocks:
                yield from _equations(block)
        else:
            yield node


class _Checker:
    def __init__(self, dimensions: dict[str, Dimension]):
        self.dimensions = dimensions
        self.found: list[str] = []
        self.compared = 0

    def meet(self, node: Any, one: Dimension, other: Dimension) -> Dimension:
        self.compared += not (one.is_open or other.is_open)
        if not one.fits(other):
            self.found.append(f"{_first_name(node)}: {one.powers} and {other.powers}")
        return other if one.is_open else one

    def of(self, node: Any) -> Dimension:
        if isinstance(node, pymoca.ast.Primary):
            return ANY
        if isinstance(node, pymoca.ast.ComponentRef | pymoca.ast.Symbol):
            return Dimension({"s": 1}) if node.name == "time" else self.dimensions[node.name]
        if isinstance(node, pymoca.ast.IfExpression):
            for condition in node.conditions:
                self.of(condition)
            return self._alike(node, node.expressions)
        if isinstance(node, pymoca.ast.Array):
            return self._alike(node, node.values)
        if getattr(node.operator, "name", node.operator) == "cat":
            return self._alike(node, node.operands[1:])
        return self._operation(node)

    def _alike(self, node: Any, members: Sequence[Any]) -> Dimension:
        first, *others = map(self.of, members)
        for other in others:
            first = self.meet(node, first, other)
        return first

    def _operation(self, node: Any) -> Dimension:
        name = getattr(node.operator, "name", node.operator)
        operands = [self.of(operand) for operand in node.operands]
        if name == "der":
            return operands[0].times(Dimension({"s": 1}), -1.0)
        if name in ("*", "/"):
            return operands[0].times(operands[1], 1.0 if name == "*" else -1.0)
        if name == "^":
            power = getattr(node.operands[1], "value", None)
            return ANY if power is None else operands[0].raised(float(power))
        if name == "sqrt":
            return operands[0].raised(0.5)
        result = operands[0]
        if name in _SAME or name in _KEEPING or name == "atan2":
            for other in operands[1:]:
                result = self.meet(node, result, other)
        elif name not in _RELATIONS and name not in ("integer", "sample"):
            self.meet(node, result, PURE)
        return result if name in _SAME - _RELATIONS or name in _KEEPING else PURE


def _first_name(node: Any) -> str:
    return re.findall(r'"name": "([^"]+)"', str(node))[0]
