"""Identifiers, literals and comments of Modelica (specification 3.6, chapter 2)."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Collection, Iterable, Mapping

from fmus.kit.errors import UserError

PACKAGE = "PpyRig"  # name of the package of components
_WIDTH = 100
# keywords (section 2.3.3), and names that the generated equations use
_WORDS = """
algorithm and annotation block break class connect connector constant constrainedby der discrete
each else elseif elsewhen encapsulated end enumeration equation expandable extends external false
final flow for function if import impure in initial inner input loop model not operator or outer
output package parameter partial protected public pure record redeclare replaceable return stream
then true type when while within
abs acos asin atan atan2 cos cosh exp integer log max min pre sample sign sin sinh sqrt tan tanh
time Boolean Examples FMUs Functions Integer Interfaces PpyRig Real Sources String
"""
_RESERVED = frozenset(_WORDS.split())
_ELEMENT = str.maketrans("[,", "__", "]")
_ESCAPED = str.maketrans({"\\": "\\\\", '"': '\\"'})


def identifier(name: str, taken: Collection[str] = ()) -> str:
    """Return a Modelica identifier: the name, with underscores appended if it is not available.

    Parameters
    ----------
    name : str
        A Python identifier, in ASCII, or an element of an array, ``x[1,2]``: ``x_1_2``.
    taken : collection of str
        Names that are not available, besides Modelica's reserved words.

    Returns
    -------
    str
    """
    name = name.translate(_ELEMENT)
    while name in _RESERVED or name in taken:
        name += "_"
    return name


def class_name(name: str) -> str:
    """Return the name of the class of a component: ``PpyActuator`` for ``ppy_actuator``."""
    return identifier("".join(part[:1].upper() + part[1:] for part in name.split("_")))


def real(value: float) -> str:
    """Write a literal of type Real.

    Raises
    ------
    UserError
        If the number is not finite, which Modelica cannot express.
    """
    if not math.isfinite(value):
        raise UserError(f"Modelica has no number for {value:g}")
    return repr(float(value))


def string(text: str) -> str:
    """Write a string literal."""
    return f'"{text.translate(_ESCAPED)}"'


def comment(text: str) -> str:
    """Write the comment of an element with a space before it; return an empty text for none."""
    plain = text.replace("``", "")  # literals of a docstring
    return f" {string(plain)}" if text else ""


def modification(values: Mapping[str, str]) -> str:
    """Write the modification of an element by values, in brackets; an empty text for none."""
    items = ", ".join(f"{name}={value}" for name, value in values.items())
    return f"({items})" if items else ""


def indented(lines: Iterable[str]) -> list[str]:
    """Indent lines by two spaces."""
    return [f"  {line}" for line in lines]


def wrapped(lines: Iterable[str], indent: str = "  ") -> list[str]:
    """Indent lines without strings, and break long ones."""
    wrapper = textwrap.TextWrapper(
        _WIDTH,
        initial_indent=indent,
        subsequent_indent=indent + "    ",
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [part for line in lines for part in wrapper.wrap(line)]
