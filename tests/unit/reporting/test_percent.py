"""A share is written as people read it."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.reporting import format_percent


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.365, "36.5 %"),
        (0.0123, "1.2 %"),
        (0.00123, "0.12 %"),
        (0.9996, "100 %"),
        (1.234, "123 %"),
        (np.inf, "more than 10000 %"),
        (np.nan, "–"),
    ],
)
def test_a_share_is_a_number_that_people_read(share, text):
    assert format_percent(share) == text
