"""Claims: a message lists a few names, and of many how many more there are."""

from __future__ import annotations

import pytest

from orchestration.fmu.check.finding import listed


@pytest.mark.parametrize(
    ("count", "expected"),
    [
        (0, ""),
        (1, "n1"),
        (8, "n1, n2, n3, n4, n5, n6, n7, n8"),
        (9, "n1, n2, n3, n4, n5, n6, n7, n8 and 1 more"),
        (20, "n1, n2, n3, n4, n5, n6, n7, n8 and 12 more"),
    ],
)
def test_of_many_names_the_first_eight_are_listed(count, expected):
    assert listed(f"n{k}" for k in range(1, count + 1)) == expected
