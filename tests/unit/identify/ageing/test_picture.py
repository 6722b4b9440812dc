"""Claim: the picture has every quantity over hours of operation, also where an interval is open."""

import numpy as np
import pytest

from orchestration.fmu.signal import Signal
from orchestration.identify.ageing import Ageing, Course

DECLARED = Signal("R1", "real", "ohm", "ohm", 0.0, 0.0, 1e3)


def test_a_panel_for_each_quantity():
    time = np.array([1800.0, 5400.0])
    low, high = np.array([0.39, -np.inf]), np.array([0.41, np.inf])
    course = Course(np.array([0.4, 0.5]), low, high, DECLARED)
    found = Ageing("m", (), "R1", time, ("a", "a"), {"R1": course, "R2": course}, None, None)
    axes = found.plot().axes
    assert len(axes) == 2
    assert axes[0].containers[0].lines[0].get_xdata() == pytest.approx([0.5, 1.5])
