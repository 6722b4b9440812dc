"""Identifiers, literals and comments of Modelica (specification 3.6, chapter 2)."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Collection, Iterable

from fmus.kit.errors import UserError

# keywords (section 2.3.3), and what the equations that are written here call
_WIDTH = 100
_WORDS = """
algorithm and annotation block break class connect connector constant constrainedby der discrete
each else elseif elsewhen encapsulated end enumeration equation expandable extends external false
final flow for function if import impure in initial inner input loop model not operator or outer
output package parameter partial protected public pure record redeclare replaceable return stream
then true type when while within
abs acos asin atan atan2 cos cosh exp integer log max min pre sample sign sin sinh sqrt tan tanh
time Boolean FMUs Functions Integer Interfaces Real String
"""
_RESERVED = frozenset(_WORDS.split())
_ESCAPED = str.maketrans({"\\": "\\\\", '"': '\\"'})


def identifier(name: str, taken: Collection[str] = ()) -> str:
    """Return an identifier, with underscores behind a name that is reserved or taken.

    Parameters
    ----------
    name : str
        An identifier of Python, in ASCII.
    taken : collection of str

    Returns
    -------
    str
    """
    while name in _RESERVED or name in taken:
        name += "_"
    return name


def class_name(name: str) -> str:
    """Return the name of a class: ``PpyActuator`` for ``ppy_actuator``."""
    return identifier("".join(part[:1].upper() + part[1:] for part in name.split("_")))


def real(value: float) -> str:
    """Write a number.

    Raises
    ------
    UserError
        If it is not finite, which no number of the language is.
    """
    if not math.isfinite(value):
        raise UserError(f"Modelica has no number for {value:g}")
    return repr(float(value))


def string(text: str) -> str:
    """Write a string."""
    return f'"{text.translate(_ESCAPED)}"'


def comment(text: str) -> str:
    """Write the comment of an element, with a space before it; empty if there is none."""
    plain = text.replace("``", "")  # of a docstring
    return f" {string(plain)}" if text else ""


def indented(lines: Iterable[str]) -> list[str]:
    """Indent lines by two spaces."""
    return [f"  {line}" for line in lines]


def wrapped(lines: Iterable[str], indent: str = "  ") -> list[str]:
    """Indent lines without strings, and break long ones."""
    return [
        part
        for line in lines
        for part in textwrap.wrap(
            line,
            _WIDTH,
            initial_indent=indent,
            subsequent_indent=indent + "    ",
            break_long_words=False,
            break_on_hyphens=False,
        )
    ]
