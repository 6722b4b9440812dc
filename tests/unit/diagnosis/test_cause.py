"""Claims: a cause is a reading of the file if that leads, and else a law over a signal."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from orchestration.diagnosis import Shape, Term
from orchestration.diagnosis.cause import Cause
from orchestration.diagnosis.readings import Reading, ReadingKind

DRY = Term("friction", "v", Shape.DRY)
FLIPPED = Reading(ReadingKind.SIGN, ("force",))


def cause(*parts: Reading | Term) -> Cause:
    law, signal = parts[0].cause
    members = frozenset({parts[0].cause})
    return Cause(law, signal, 0.9, SimpleNamespace(), parts, SimpleNamespace(), 10.0, members)


def test_a_law_that_leads_is_the_cause() -> None:
    one = cause(DRY, FLIPPED)
    assert one.reading is None
    assert one.terms == (DRY,)
    assert one.name == "friction(v)"


@pytest.mark.parametrize("parts", [(FLIPPED,), (FLIPPED, DRY)])
def test_a_reading_that_leads_is_the_cause(parts: tuple[Reading | Term, ...]) -> None:
    one = cause(*parts)
    assert one.reading is FLIPPED
    assert one.terms == parts[1:]
    assert (one.law, one.signal) == FLIPPED.cause
