"""Claim: the picture has every quantity over hours of operation, also where an interval is open."""

import numpy as np
import pytest

from orchestration.fmu.signal import Signal
from orchestration.identify.ageing import Ageing, Course, forecast_life

DECLARED = Signal("R1", "real", "ohm", "ohm", 0.0, 0.0, 1e3)


def test_a_panel_for_each_quantity():
    time = np.array([1800.0, 5400.0])
    low, high = np.array([0.39, -np.inf]), np.array([0.41, np.inf])
    course = Course(np.array([0.4, 0.5]), low, high, DECLARED)
    found = Ageing("m", (), "R1", time, ("a", "a"), {"R1": course, "R2": course}, None, None)
    axes = found.plot().axes
    assert len(axes) == 2
    assert axes[0].containers[0].lines[0].get_xdata() == pytest.approx([0.5, 1.5])


def test_the_expected_course_reaches_the_end_of_a_life_of_many_records():
    """Of 0.5 ohm that grow by 1 uohm/s, 42 hours after records of 1.5; the limit is 0.65 ohm."""
    time = 600.0 * np.arange(10)
    value = 0.5 + 1e-6 * time
    course = Course(value, value - 1e-5, value + 1e-5, DECLARED)
    forecast = forecast_life(time, value, 0.3)
    found = Ageing("m", (), "R1", time, ("a",) * 10, {"R1": course}, forecast, None)
    (axis,) = found.plot().axes
    _, expected, limit = axis.lines
    assert expected.get_xydata()[0] == pytest.approx([0.0, 0.5])
    assert expected.get_xydata()[-1] == pytest.approx([0.15 / 1e-6 / 3600.0, 0.65], rel=1e-3)
    assert axis.get_xlim()[1] > 0.15 / 1e-6 / 3600.0
    assert limit.get_ydata() == pytest.approx([0.65, 0.65], rel=1e-3)
    assert limit.get_linestyle() != expected.get_linestyle()
