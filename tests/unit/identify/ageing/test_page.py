"""Claim: the page has the forecast, the derating, every window, and how to make it again."""

from pathlib import Path

import numpy as np

from orchestration.fmu.signal import Signal
from orchestration.identify.ageing import Ageing, Course, Derating, forecast_life
from orchestration.reporting import make_page

TIME = 600.0 * np.arange(10)
VALUE = 0.5 + 1e-6 * TIME


def test_the_page_has_all():
    declared = Signal("R1", "real", "ohm", "ohm", 0.0, 0.0, 1e3)
    courses = {"R1": Course(VALUE, VALUE - 0.01, VALUE + 0.01, declared)}
    derating = Derating(TIME[:3], np.array([1.5, 1.5, 1.45]), np.array([np.nan, 0.01, 0.05]))
    forecast = forecast_life(TIME, VALUE, 0.1)
    labels = ("<life>",) * 10
    found = Ageing(
        "ppy_actuator", (Path("life.csv"),), "R1", TIME, labels, courses, forecast, derating
    )
    page = make_page(found, "ppy age life.csv").html()
    assert "R1 is 10.0 % above its first value after 13.9 h" in page
    assert "lowered to 1.45 V after 0.333 h" in page
    assert page.count("&lt;life&gt;") == 10
    assert "ppy age life.csv" in page
    assert "end of the life" in page
