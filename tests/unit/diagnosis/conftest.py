"""A diagnosis of an oscillator that rubs, for what is said of it."""

from __future__ import annotations

import pytest

from orchestration.diagnosis.readings import Reading, ReadingKind
from tests.support.oscillator import (
    CUBE,
    DRY,
    diagnosis_read_as,
    diagnosis_with,
    misread,
    oscillator_record,
)


@pytest.fixture(scope="module")
def dry():
    return diagnosis_with(oscillator_record(1, dry=1.5), (DRY,), (CUBE,), (DRY, CUBE))


@pytest.fixture(scope="module")
def flipped():
    """A record whose force has the wrong sign."""
    reading = Reading(ReadingKind.SIGN, ("force",), factor=-1.0)
    return diagnosis_read_as(misread(oscillator_record(1), force=-1.0), reading)
