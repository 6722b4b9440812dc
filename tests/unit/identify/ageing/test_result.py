"""Claims: a result says its forecast in hours, its derating by steps, and its page and picture have
every quantity.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration.fmu.signal import Signal
from orchestration.identify.ageing import Ageing, Course, Derating, forecast_life

TIME = 600.0 * np.arange(10)
VALUE = 0.5 + 1e-6 * TIME
DECLARED = Signal("R1", "real", "ohm", "ohm", 0.0, 0.0, 1e3)
COURSE = Course(VALUE, VALUE - 0.01, np.append(VALUE[:-1] + 0.01, np.inf), DECLARED)
LIMIT = np.array([1.5, 1.5, 1.45, 1.4])
DERATING = Derating(1800.0 * np.arange(4), LIMIT, np.array([np.nan, 0.01, 0.05, 0.1]))
FOUND = Ageing(
    "ppy_actuator",
    (Path("life.csv"),),
    "R1",
    TIME,
    ("life",) * 10,
    {"R1": COURSE},
    forecast_life(TIME, VALUE, 0.1),
    DERATING,
    ("a remark",),
)


def test_the_forecast_is_in_hours():
    """0.05 ohm at 1 uohm/s are 13.9 hours."""
    assert FOUND.headline().startswith("R1 is 10.0 % above its first value after 13.9 h")
    flat = replace(FOUND, forecast=forecast_life(TIME, 0.5 - 1e-6 * TIME, 0.1))
    assert "no sign" in flat.headline() or "perhaps never" in flat.headline()
    assert "too few" in replace(FOUND, forecast=None).headline()


def test_steps_of_the_derating():
    assert DERATING.steps() == [(3600.0, 1.45), (5400.0, 1.4)]
    assert "lowered to 1.45 V after 1 h, 1.4 V after 1.5 h" in DERATING.summary()
    assert "never have been valid" in replace(DERATING, change=np.full(4, np.nan)).summary()


def test_figures_are_ready_for_json():
    figures = json.loads(json.dumps(FOUND.to_dict(), allow_nan=False))
    assert figures["windows"]["R1"]["high"][-1] is None
    assert figures["derating"] == [[3600.0, 1.45], [5400.0, 1.4]]
    assert FOUND.to_frame()["R1_low"].iloc[0] == pytest.approx(0.49)


def test_a_change_from_what_may_be_zero_is_not_told():
    zero = replace(COURSE, low=np.full(10, -1.0))
    assert (COURSE.change(), zero.change()) == ("1.1 %", "")


def test_a_page_ends_in_html(tmp_path):
    with pytest.raises(UserError, match=r"ends in \.html"):
        FOUND.report(tmp_path / "page.txt")
