"""Claims: corrections are told apart by their directions, and named by law, signal and kind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from orchestration.discrepancy.laws.entry import identical, indistinguishable
from tests.support.law_reports import entry


def test_it_is_named_by_what_it_corrects():
    lagged = entry(memory="lagged")
    assert lagged.key == ("friction", "omega", "lagged", "add")
    assert lagged.key == replace(lagged, signal=replace(lagged.signal, constant=2.0)).key
    assert entry(kind="multiply").label == "friction x over omega"
    assert entry(signal="voltage").family == "friction over voltage"


@pytest.mark.parametrize(
    ("angle", "alike", "same"), [(0.0, True, True), (0.1, True, False), (0.2, False, False)]
)
def test_the_angle_between_their_effects_tells_them_apart(angle, alike, same):
    """Of cosines 1, 0.995 and 0.980, of either sign."""
    one = replace(entry(), direction=np.array([1.0, 0.0]))
    for sign in (1.0, -1.0):
        other = replace(one, direction=sign * np.array([np.cos(angle), np.sin(angle)]))
        assert indistinguishable(one, other) is alike
        assert identical(one, other) is same
