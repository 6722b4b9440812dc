"""A diagnosis of an oscillator that rubs, for what is said of it."""

from __future__ import annotations

import pytest

from tests.support.oscillator import CUBE, DRY, diagnosis_with, oscillator_record


@pytest.fixture(scope="module")
def dry():
    return diagnosis_with(oscillator_record(1, dry=1.5), (DRY,), (CUBE,), (DRY, CUBE))
