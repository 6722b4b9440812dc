"""Small drawings in the text of a report."""

from __future__ import annotations

import re

import numpy as np
import pytest

from orchestration.discrepancy.report import elements
from orchestration.identify.estimate import Estimate


def test_an_interval_is_drawn_to_scale():
    near, far = (Estimate(v, 1.0, (0.9 * v, 1.1 * v), "1") for v in (1.0, 2.0))
    scale = elements.Scale.of([near, far])
    middle, off = (
        float(re.search(r'cx="([\d.]+)"', scale.drawn(e, False))[1]) for e in (near, far)
    )
    end = float(re.search(r'<svg width="(\d+)"', scale.title)[1])
    assert middle == end / 2
    assert (off - middle) / (end / 2) == pytest.approx(np.log(2.0) / scale.reach, abs=1e-3)
    assert middle < off < end
    assert scale.drawn(Estimate(1.0, 0.0, (0.0, 2.0), "1"), False) == ""
