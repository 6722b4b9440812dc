"""Names of intermediate values of laws: their local variables, and functions that return them."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

import casadi as ca

_WITHOUT_NAMES = ("casadi", "fmus.kit")  # modules whose names say nothing of a law


@contextmanager
def recorded_intermediates() -> Iterator[list[tuple[str, ca.SX]]]:
    """Record the names of intermediate values while laws are evaluated on symbols.

    Yields
    ------
    list of tuple
        Each name with its scalar expression; filled at the end. Local variables come before
        functions, and those of a function before those of its callers. Arguments of a function are
        omitted: they are values of its callers.
    """
    variables: dict[int, tuple[str, ca.SX]] = {}
    functions: dict[int, tuple[str, ca.SX]] = {}

    def record(found: dict[int, tuple[str, ca.SX]], name: str, value: Any) -> None:
        word = name.strip("_")
        is_expression = isinstance(value, ca.SX) and value.is_scalar() and not value.is_leaf()
        if is_expression and word.isidentifier():
            found.setdefault(value.element_hash(), (word, value))

    def profile(frame: FrameType, event: str, returned: Any) -> None:
        module = frame.f_globals.get("__name__", "")
        if event != "return" or module.startswith(_WITHOUT_NAMES):
            return
        code = frame.f_code
        values = frame.f_locals
        for name in code.co_varnames[code.co_argcount :]:
            record(variables, name, values.get(name))
        record(functions, code.co_name, returned)

    intermediates: list[tuple[str, ca.SX]] = []
    earlier = sys.getprofile()
    sys.setprofile(profile)
    try:
        yield intermediates
    finally:
        sys.setprofile(earlier)
    intermediates += [*variables.values(), *functions.values()]
