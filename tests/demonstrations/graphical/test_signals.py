"""Claims: signals are vectors of one length over an increasing time, or refused by their name."""

from __future__ import annotations

import re

import numpy as np
import pytest

from demonstrations.graphical.signals import over_time
from fmus.kit.errors import UserError


def test_what_is_given_comes_back_as_arrays_in_its_order():
    time, force, x = over_time([0, 1, 3], force=[1, 2, 3], x=(0.5, 0.5, 0.5))
    assert (time.tolist(), force.tolist(), x.tolist()) == ([0, 1, 3], [1, 2, 3], [0.5] * 3)
    assert time.dtype == force.dtype == np.float64


@pytest.mark.parametrize(
    ("time", "x", "message"),
    [
        ([0, 1, 2], [1, 2], "x has the shape (2,): time and signals must be vectors of one length"),
        ([0], [1], "time has the shape (1,): time and signals must be vectors of one length"),
        ([0, np.nan, 2], [1, 2, 3], "time: sample 1 is nan, and must be a finite number"),
        ([0, 1, 2], [1, 2, -np.inf], "x: sample 2 is -inf, and must be a finite number"),
        ([0, 1, 1], [1, 2, 3], "time: must increase, and does not after sample 1"),
    ],
)
def test_what_is_no_signal_is_refused(time, x, message):
    with pytest.raises(UserError, match=f"^{re.escape(message)}$"):
        over_time(time, x=x)
