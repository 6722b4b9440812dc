"""Choice of the cases of a test for `make test` and for `make test-slow`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import pytest

from fmus import COMPONENTS

# a small component, and one with samples and all types of variables
TELLING_NAMES = ("ppy_actuator", "voice_coil_dma")
FREE_FEET = frozenset(("foot_displacement_driven", "foot_free"))
_OTHERS = frozenset(COMPONENTS) - set(TELLING_NAMES)
# they have the laws of the foot, and cost more than all others together
_FEET = FREE_FEET | {"foot_design", "foot_dynamic"}


def slow_but(cases: Iterable[Any], *fast: Any) -> list[Any]:
    """Cases of a parametrisation of which all but those named are slow; a case of several values is
    a tuple.
    """
    cases = list(cases)
    assert all(case in cases for case in fast), "what is to be fast is one of the cases"
    values = (case if isinstance(case, tuple) else (case,) for case in cases)
    return [
        case if case in fast else pytest.param(*value, marks=pytest.mark.slow)
        for case, value in zip(cases, values, strict=True)
    ]


def names_other_components(given: Mapping[str, Any]) -> set[str]:
    """Components among the values of a case, effects or not, but for the telling ones."""
    names = (getattr(value, "name", value) for value in given.values())
    return {name.partition("_with_")[0] for name in names if isinstance(name, str)} & _OTHERS


def is_repetition(given: Mapping[str, Any]) -> bool:
    """Return True if others cover a case: the front-end in Python is one for all
    components, and the foot that rests is there for those that move.
    """
    others = names_other_components(given)
    return bool(others & _FEET) or (given.get("runtime") == "python" and bool(others))
