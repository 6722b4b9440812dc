"""Which cases of a test everybody runs, and which are for `make test-slow`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


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
