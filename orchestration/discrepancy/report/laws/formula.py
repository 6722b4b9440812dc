"""Formulas of shapes, as people read them in a line, taken apart: ``a x |x|``, ``a (exp(x / w) - 1)``.

Factors stand side by side, and a quotient is of all that stands before it. What a letter stands for may follow after
``with``, where it begins after ``beyond``, and a remark after a comma.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from fmus.kit.errors import UserError

_TOKEN = re.compile(r"\s*([A-Za-z_]\w*|\d+(?:\.\d+)?|[-+/^(),|=])")
_NO_FACTOR = ("", "+", "-", ")", ",", "=")  # what ends a product


@dataclass(frozen=True)
class Node:
    """A part of a formula.

    Attributes
    ----------
    kind : {"symbol", "number", "sum", "minus", "product", "quotient", "power", "bars", "group", "call"}
    text : str
        The symbol, the number, or the name of the function that is called.
    parts : tuple of Node
        What it is made of; what is subtracted in a sum is a ``minus``.
    """

    kind: str
    text: str = ""
    parts: tuple[Node, ...] = ()


@dataclass(frozen=True)
class Formula:
    """A formula with what is said beside it.

    Attributes
    ----------
    value : Node
    word : {"", "with", "beyond"}
        What is said beside it: what a letter stands for, or where it begins.
    sides : tuple of Node
        Both sides of that equation; none where nothing is said.
    remark : str
        What is said of it in words.
    """

    value: Node
    word: str
    sides: tuple[Node, ...]
    remark: str


def formula(text: str) -> Formula:
    """Take a formula apart.

    Parameters
    ----------
    text : str
        Such as the text of one of `fmus.kit.curves.SHAPES`.

    Raises
    ------
    UserError
        If it is none.
    """
    whole, *more = re.split(r" (with|beyond) ", text, maxsplit=1)
    reader = _Reader(whole)
    value = reader.sum()
    remark = reader.end()
    if not more:
        return Formula(value, "", (), remark)
    left, _, right = more[1].partition("=")
    sides = _Reader(left), _Reader(right)
    return Formula(
        value, more[0], tuple(side.sum() for side in sides), "".join(side.end() for side in sides)
    )


class _Reader:
    """Reads from the left, one function for each rank of operators."""

    def __init__(self, text: str):
        self._text, self._at, self._bars = text, 0, 0

    def sum(self) -> Node:
        parts = [self._product()]
        while self._next() in ("+", "-"):
            sign = self._take()
            part = self._product()
            parts.append(Node("minus", parts=(part,)) if sign == "-" else part)
        return Node("sum", parts=tuple(parts)) if len(parts) > 1 else parts[0]

    def end(self) -> str:
        """Remark that follows after a comma; nothing else may follow."""
        rest = self._text[self._at :].strip()
        if rest and not rest.startswith(","):
            raise UserError(f"{self._text!r} is no formula from {rest!r} on")
        return rest.lstrip(", ")

    def _product(self) -> Node:
        parts = [self._factor()]
        while self._next() not in _NO_FACTOR and not (self._next() == "|" and self._bars):
            if self._next() == "/":
                self._take()
                above = Node("product", parts=tuple(parts)) if len(parts) > 1 else parts[0]
                parts = [Node("quotient", parts=(above, self._factor()))]
            else:
                parts.append(self._factor())
        return Node("product", parts=tuple(parts)) if len(parts) > 1 else parts[0]

    def _factor(self) -> Node:
        if self._next() == "-":
            self._take()
            return Node("minus", parts=(self._factor(),))
        base = self._base()
        if self._next() != "^":
            return base
        self._take()
        return Node("power", parts=(base, self._factor()))

    def _base(self) -> Node:
        token = self._take()
        if token == "(":
            inner = self.sum()
            self._expect(")")
            return Node("group", parts=(inner,))
        if token == "|":
            self._bars += 1
            inner = self.sum()
            self._expect("|")
            self._bars -= 1
            return Node("bars", parts=(inner,))
        if token[:1].isdigit():
            return Node("number", token)
        if not token[:1].isalpha():
            raise UserError(
                f"{self._text!r} is no formula: something is missing before {token or 'its end'!r}"
            )
        return self._called(token) if self._follows("(") else Node("symbol", token)

    def _called(self, name: str) -> Node:
        self._expect("(")
        arguments = [self.sum()]
        while self._next() == ",":
            self._take()
            arguments.append(self.sum())
        self._expect(")")
        return Node("call", name, tuple(arguments))

    def _follows(self, token: str) -> bool:
        """Whether a token stands at once behind the last one: only then is a name that of a function."""
        return self._text.startswith(token, self._at)

    def _next(self) -> str:
        found = _TOKEN.match(self._text, self._at)
        return found[1] if found else ""

    def _take(self) -> str:
        found = _TOKEN.match(self._text, self._at)
        if found is None:
            return ""
        self._at = found.end()
        return found[1]

    def _expect(self, token: str) -> None:
        if (taken := self._take()) != token:
            raise UserError(
                f"{self._text!r} is no formula: {token!r} is missing before {taken or 'its end'!r}"
            )
