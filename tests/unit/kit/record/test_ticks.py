"""Claims: ticks belong to the step after them, in the order of their clocks."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit.record import ticks_of

TIME = 0.1 * np.arange(7)


def test_a_tick_at_a_sample_belongs_to_the_step_after_it() -> None:
    found = ticks_of(TIME, 0.0, [(0.0, 0.25)])
    assert found.time == pytest.approx([0.0, 0.25, 0.5])
    assert found.first.tolist() == [0, 1, 1, 2, 2, 2, 3]


def test_clocks_tick_in_their_order_at_the_same_instant() -> None:
    """0.1 + 2 * 0.1 is more than 0.3 in doubles."""
    found = ticks_of(TIME, 0.0, [(0.0, 0.3), (0.1, 0.1), (0.05, 10.0)])
    assert found.time == pytest.approx([0.0, 0.05, 0.1, 0.2, 0.3, 0.3, 0.4, 0.5])
    assert found.clock.tolist() == [0, 2, 1, 1, 0, 1, 1, 1]
    between = ticks_of(np.array([0.0, 1.0]), 0.0, [(0.1, 0.1), (0.0, 0.3)])
    assert between.clock.tolist() == [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1]


def test_a_clock_has_begun_before_the_record() -> None:
    found = ticks_of(TIME, -0.32, [(0.0, 0.1)])
    assert found.time == pytest.approx([0.08, 0.18, 0.28, 0.38, 0.48, 0.58])
    later = ticks_of(1e6 + TIME, 1e6, [(0.1, 0.1)])
    assert later.first.tolist() == [0, 0, 1, 2, 3, 4, 5]
    assert (later.time >= (1e6 + TIME)[1:6]).all()


def test_without_clocks_nothing_ticks() -> None:
    assert ticks_of(TIME, 0.0, []).first.tolist() == [0] * 7
