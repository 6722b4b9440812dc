"""Formulas of shapes: parsed from the line people read, and typeset as MathML.

A line such as ``a x |x|`` or ``a (exp(x / w) - 1)`` has factors side by side, and a quotient is of
all that stands before it. What a letter stands for may follow after ``with``, where it begins after
``beyond``, and a remark after a comma. MathML is drawn by browsers themselves.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from fmus.kit import UserError
from orchestration.reporting import Markup, escaped

_TOKEN = re.compile(r"\s*([A-Za-z_]\w*|\d+(?:\.\d+)?|[-+/^(),|=])")
_ENDS_OF_PRODUCT = ("", "+", "-", ")", ",", "=")
_TIMES = "<mo>&#x22C5;</mo>"  # a dot
_APPLY = "<mo>&#x2061;</mo>"  # invisible, between a function and its arguments
_MINUS = "<mo>&#x2212;</mo>"
_FENCE = '<mo stretchy="true">{}</mo>'


@dataclass(frozen=True)
class Node:
    """A part of a formula.

    Attributes
    ----------
    kind : str
        "symbol", "number", "sum", "minus", "product", "quotient", "power", "bars", "group" or
        "call".
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
    """A formula with the equation and the remark that stand beside it.

    Attributes
    ----------
    value : Node
    word : {"", "with", "beyond"}
        Whether the equation says what a letter stands for, or where the formula begins.
    sides : tuple of Node
        Both sides of that equation; none where there is none.
    remark : str
    """

    value: Node
    word: str
    sides: tuple[Node, ...]
    remark: str


def parse_formula(text: str) -> Formula:
    """Parse a formula.

    Parameters
    ----------
    text : str
        Such as the text of one of `fmus.kit.curves.SHAPES`.

    Raises
    ------
    UserError
        If it is none.
    """
    main, *more = re.split(r" (with|beyond) ", text, maxsplit=1)
    reader = _FormulaReader(main)
    value = reader.read_sum()
    remark = reader.read_remark()
    if not more:
        return Formula(value, "", (), remark)
    word, equation_text = more
    left_side, _, right_side = equation_text.partition("=")
    readers = (_FormulaReader(left_side), _FormulaReader(right_side))
    sides = tuple(side.read_sum() for side in readers)
    return Formula(value, word, sides, "".join(side.read_remark() for side in readers))


class _FormulaReader:
    """Recursive-descent parser that reads from the left, with a method for each rank of operators.

    Parameters
    ----------
    text : str
    """

    def __init__(self, text: str):
        self._text = text
        self._position = 0
        self._open_bars = 0

    def read_sum(self) -> Node:
        """Read terms with signs between them."""
        parts = [self._read_product()]
        while self._peek() in ("+", "-"):
            sign = self._take()
            part = self._read_product()
            parts.append(Node("minus", parts=(part,)) if sign == "-" else part)
        return Node("sum", parts=tuple(parts)) if len(parts) > 1 else parts[0]

    def read_remark(self) -> str:
        """Read the remark that follows after a comma; nothing else may follow."""
        remainder = self._text[self._position :].strip()
        if remainder and not remainder.startswith(","):
            raise UserError(f"{self._text!r} is no formula from {remainder!r} on")
        return remainder.lstrip(", ")

    def _read_product(self) -> Node:
        parts = [self._read_factor()]
        while not self._at_end_of_product():
            if self._peek() == "/":
                self._take()
                numerator = _product(parts)
                parts = [Node("quotient", parts=(numerator, self._read_factor()))]
            else:
                parts.append(self._read_factor())
        return _product(parts)

    def _at_end_of_product(self) -> bool:
        closes_bars = self._peek() == "|" and self._open_bars > 0
        return self._peek() in _ENDS_OF_PRODUCT or closes_bars

    def _read_factor(self) -> Node:
        if self._peek() == "-":
            self._take()
            return Node("minus", parts=(self._read_factor(),))
        base = self._read_base()
        if self._peek() != "^":
            return base
        self._take()
        return Node("power", parts=(base, self._read_factor()))

    def _read_base(self) -> Node:
        token = self._take()
        if token == "(":
            inner = self.read_sum()
            self._expect(")")
            return Node("group", parts=(inner,))
        if token == "|":
            self._open_bars += 1
            inner = self.read_sum()
            self._expect("|")
            self._open_bars -= 1
            return Node("bars", parts=(inner,))
        if token[:1].isdigit():
            return Node("number", token)
        if not token[:1].isalpha():
            raise UserError(
                f"{self._text!r} is no formula: something is missing before {token or 'its end'!r}"
            )
        return self._read_call(token) if self._is_followed_by("(") else Node("symbol", token)

    def _read_call(self, name: str) -> Node:
        self._expect("(")
        arguments = [self.read_sum()]
        while self._peek() == ",":
            self._take()
            arguments.append(self.read_sum())
        self._expect(")")
        return Node("call", name, tuple(arguments))

    def _is_followed_by(self, token: str) -> bool:
        """Return whether a token follows at once: only then is a name that of a function."""
        return self._text.startswith(token, self._position)

    def _peek(self) -> str:
        """Return the next token; empty at the end."""
        match = _TOKEN.match(self._text, self._position)
        return match[1] if match else ""

    def _take(self) -> str:
        """Return the next token, and go on behind it."""
        match = _TOKEN.match(self._text, self._position)
        if match is None:
            return ""
        self._position = match.end()
        return match[1]

    def _expect(self, token: str) -> None:
        taken = self._take()
        if taken != token:
            raise UserError(
                f"{self._text!r} is no formula: {token!r} is missing before {taken or 'its end'!r}"
            )


def _product(factors: list[Node]) -> Node:
    return Node("product", parts=tuple(factors)) if len(factors) > 1 else factors[0]


def typeset_equation(
    law: str, signal: str, kind: str = "add", text: str = "", remembered: bool = False
) -> Markup:
    """Typeset a law with what it has more than the model says.

    Parameters
    ----------
    law, signal : str
    kind : {"add", "multiply"}
        Whether the function is added to the law, or one and it are what the law is multiplied with.
    text : str
        Formula of the function of x; a drawn curve unless given.
    remembered : bool
        Whether x is what is remembered of the signal; it is the signal itself otherwise.
    """
    x = _symbol("x") if remembered else _symbol(signal)
    names = {"x": x}
    formula = parse_formula(text) if text else None
    function = typeset(formula.value, names) if formula else f"<mi>f</mi>{_APPLY}{_fenced(x)}"
    model = f"<msub>{_symbol(law)}<mtext>model</mtext></msub>"
    if kind == "add":
        right = f"{model}<mo>+</mo>{function}"
    else:
        right = f"{model}{_TIMES}{_fenced(f'<mn>1</mn><mo>+</mo>{function}')}"
    beside = ""
    if formula and formula.sides:
        equated = "<mo>=</mo>".join(typeset(side, names) for side in formula.sides)
        beside = (
            f'<mspace width="2em"/><mtext>{formula.word}</mtext><mspace width="0.5em"/>{equated}'
        )
    equation = _row(f"{_symbol(law)}<mo>=</mo>{right}{beside}")
    return Markup(f'<math display="block">{equation}</math>')


def typeset(node: Node, names: Mapping[str, str] | None = None) -> str:
    """Typeset a part of a formula.

    Parameters
    ----------
    node : Node
    names : Mapping of str to str, optional
        MathML of symbols that are shown as something else.
    """
    return _TYPESETTERS[node.kind](node, names or {})


def _typeset_symbol(node: Node, names: Mapping[str, str]) -> str:
    return names.get(node.text) or _symbol(node.text)


def _symbol(name: str) -> str:
    """Return an identifier; one that spells a Greek letter is that letter."""
    try:
        letter = unicodedata.lookup(f"GREEK SMALL LETTER {name}")
    except KeyError:
        letter = name
    return f"<mi>{escaped(letter)}</mi>"


def _typeset_number(node: Node, names: Mapping[str, str]) -> str:
    return f"<mn>{node.text}</mn>"


def _typeset_sum(node: Node, names: Mapping[str, str]) -> str:
    text = typeset(node.parts[0], names)
    for part in node.parts[1:]:
        plus = "" if part.kind == "minus" else "<mo>+</mo>"
        text += plus + typeset(part, names)
    return text


def _typeset_minus(node: Node, names: Mapping[str, str]) -> str:
    return _MINUS + typeset(node.parts[0], names)


def _typeset_product(node: Node, names: Mapping[str, str]) -> str:
    return _TIMES.join(typeset(part, names) for part in node.parts)


def _typeset_quotient(node: Node, names: Mapping[str, str]) -> str:
    """Typeset a fraction; of two symbols it stays in the line, where brackets are as high."""
    if all(part.kind in ("symbol", "number") for part in node.parts):
        return _row("<mo>/</mo>".join(typeset(part, names) for part in node.parts))
    return f"<mfrac>{''.join(_without_brackets(part, names) for part in node.parts)}</mfrac>"


def _typeset_power(node: Node, names: Mapping[str, str]) -> str:
    base, exponent = node.parts
    return f"<msup>{_row(typeset(base, names))}{_without_brackets(exponent, names)}</msup>"


def _typeset_bars(node: Node, names: Mapping[str, str]) -> str:
    return _fenced(typeset(node.parts[0], names), "|", "|")


def _typeset_group(node: Node, names: Mapping[str, str]) -> str:
    return _fenced(typeset(node.parts[0], names))


def _typeset_call(node: Node, names: Mapping[str, str]) -> str:
    if node.text == "sqrt":
        return f"<msqrt>{_without_brackets(node.parts[0], names)}</msqrt>"
    arguments = "<mo>,</mo>".join(typeset(part, names) for part in node.parts)
    return f"<mi>{escaped(node.text)}</mi>{_APPLY}{_fenced(arguments)}"


def _without_brackets(node: Node, names: Mapping[str, str]) -> str:
    """Typeset a part without brackets around all of it, where its ends are seen anyway."""
    return _row(typeset(node.parts[0] if node.kind == "group" else node, names))


def _row(inside: str) -> str:
    return f"<mrow>{inside}</mrow>"


def _fenced(inside: str, left: str = "(", right: str = ")") -> str:
    return _row(_FENCE.format(left) + inside + _FENCE.format(right))


_TYPESETTERS: dict[str, Callable[[Node, Mapping[str, str]], str]] = {
    "symbol": _typeset_symbol,
    "number": _typeset_number,
    "sum": _typeset_sum,
    "minus": _typeset_minus,
    "product": _typeset_product,
    "quotient": _typeset_quotient,
    "power": _typeset_power,
    "bars": _typeset_bars,
    "group": _typeset_group,
    "call": _typeset_call,
}
