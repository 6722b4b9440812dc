"""Claims: limits are those that were asked for, and of foreign FMUs only where that is so."""

from __future__ import annotations

import math
import os

import pytest

from orchestration.fmu.isolation.limits import Limits, isolating, isolation, limits_of
from tests.support.command import posix


@pytest.mark.parametrize(("memory", "expected"), [(2e9, 2_000_000_000), (1.9, 1), (math.inf, 0)])
def test_memory_is_in_whole_bytes_and_0_is_no_limit(memory, expected):
    assert Limits(memory=memory).bytes == expected


@posix
def test_memory_is_by_default_that_of_the_machine():
    assert Limits().bytes == os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def test_a_caller_may_give_limits_or_choose_the_usual_ones():
    own = Limits(step_timeout=1.0)
    assert isolation(own) is own
    assert isolation(True) == Limits()
    assert isolation(False) is None


def test_foreign_fmus_are_isolated_within_the_context_only():
    own = Limits(step_timeout=1.0)
    assert limits_of(foreign=True) is None
    with isolating(own):
        assert limits_of(foreign=True) is own
        assert limits_of(foreign=False) is None
        with isolating(None):
            assert limits_of(foreign=True) is None
        assert limits_of(foreign=True) is own
    assert limits_of(foreign=True) is None
