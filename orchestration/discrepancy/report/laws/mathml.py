"""A corrected law typeset as MathML, which browsers draw by themselves."""

from __future__ import annotations

import unicodedata
from collections.abc import Callable, Mapping

from orchestration.discrepancy.report.laws.formula import Formula, Node, formula
from orchestration.reporting.page import Markup, escaped

_TIMES, _APPLY, _MINUS = (
    "<mo>&#x22C5;</mo>",
    "<mo>&#x2061;</mo>",
    "<mo>&#x2212;</mo>",
)  # dot, application, minus
_FENCE = '<mo stretchy="true">{}</mo>'


def symbol(name: str) -> str:
    """Return an identifier; one that spells a Greek letter is that letter."""
    try:
        shown = unicodedata.lookup(f"GREEK SMALL LETTER {name}")
    except KeyError:
        shown = name
    return f"<mi>{escaped(shown)}</mi>"


def expression(node: Node, names: Mapping[str, str] | None = None) -> str:
    """Typeset a part of a formula.

    Parameters
    ----------
    node : Node
    names : Mapping of str to str, optional
        MathML of symbols that are shown as something else.
    """
    return _KINDS[node.kind](node, names or {})


def _bare(node: Node, names: Mapping[str, str]) -> str:
    """Without brackets around all of it, where what surrounds it shows where it ends."""
    return _row(expression(node.parts[0] if node.kind == "group" else node, names))


def _row(inside: str) -> str:
    return f"<mrow>{inside}</mrow>"


def _fenced(inside: str, left: str = "(", right: str = ")") -> str:
    return _row(_FENCE.format(left) + inside + _FENCE.format(right))


def _sum(node: Node, names: Mapping[str, str]) -> str:
    first, *others = node.parts
    more = (
        expression(p, names) if p.kind == "minus" else f"<mo>+</mo>{expression(p, names)}"
        for p in others
    )
    return expression(first, names) + "".join(more)


def _quotient(node: Node, names: Mapping[str, str]) -> str:
    """A fraction; of two symbols it stays in the line, where brackets about it are as high as they are."""
    if all(part.kind in ("symbol", "number") for part in node.parts):
        return _row("<mo>/</mo>".join(expression(part, names) for part in node.parts))
    return f"<mfrac>{''.join(_bare(part, names) for part in node.parts)}</mfrac>"


def _power(node: Node, names: Mapping[str, str]) -> str:
    base, exponent = node.parts
    return f"<msup>{_row(expression(base, names))}{_bare(exponent, names)}</msup>"


def _call(node: Node, names: Mapping[str, str]) -> str:
    if node.text == "sqrt":
        return f"<msqrt>{_bare(node.parts[0], names)}</msqrt>"
    arguments = "<mo>,</mo>".join(expression(part, names) for part in node.parts)
    return f"<mi>{escaped(node.text)}</mi>{_APPLY}{_fenced(arguments)}"


_KINDS: dict[str, Callable[[Node, Mapping[str, str]], str]] = {
    "symbol": lambda node, names: names.get(node.text) or symbol(node.text),
    "number": lambda node, names: f"<mn>{node.text}</mn>",
    "sum": _sum,
    "minus": lambda node, names: _MINUS + expression(node.parts[0], names),
    "product": lambda node, names: _TIMES.join(expression(part, names) for part in node.parts),
    "quotient": _quotient,
    "power": _power,
    "bars": lambda node, names: _fenced(expression(node.parts[0], names), "|", "|"),
    "group": lambda node, names: _fenced(expression(node.parts[0], names)),
    "call": _call,
}


def equation(
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
    x = symbol("x") if remembered else symbol(signal)
    names = {"x": x}
    taken: Formula | None = formula(text) if text else None
    more = expression(taken.value, names) if taken else f"<mi>f</mi>{_APPLY}{_fenced(x)}"
    model = f"<msub>{symbol(law)}<mtext>model</mtext></msub>"
    right = (
        f"{model}<mo>+</mo>{more}"
        if kind == "add"
        else f"{model}{_TIMES}{_fenced(f'<mn>1</mn><mo>+</mo>{more}')}"
    )
    beside = ""
    if taken and taken.sides:
        left, right_side = (expression(side, names) for side in taken.sides)
        beside = f'<mspace width="2em"/><mtext>{taken.word}</mtext><mspace width="0.5em"/>{left}<mo>=</mo>{right_side}'
    return Markup(f'<math display="block">{_row(f"{symbol(law)}<mo>=</mo>{right}{beside}")}</math>')
