"""Claims: a run beyond a limit, or at one, is told of with signal, value, limit and time; others
are not.
"""

import numpy as np
import pytest

from orchestration.fmu import Signal
from orchestration.fmu.simulation import LimitOutputs

TIME = np.array([0.0, 1.0, 2.0, 3.0])


def signal(name, unit="m", display="mm", start=0.0, kind="real", doc="", low=-np.inf, high=np.inf):
    return Signal(name, kind, unit, display, start, low, high, doc)


OUTPUTS = {
    "a.stroke_margin": signal("stroke_margin"),
    "a.profit_margin": signal("profit_margin"),
    "a.stroke": signal("stroke"),
    "a.on_margin": signal("on_margin", kind="boolean"),
    "a.limited": signal("limited", kind="boolean", doc="why it is"),
    "a.saturated": signal("saturated"),
}
PARAMETERS = {
    "a.stroke_limit": signal("stroke_limit", start=7e-3, doc="what it has"),
    "a.on_limit": signal("on_limit"),
}
KNOWN = LimitOutputs.among(OUTPUTS, PARAMETERS)


def told(left, **settings):
    return list(KNOWN.remarks(TIME, {"a.stroke_margin": np.array(left)}, settings))


def test_a_margin_is_a_number_beside_a_limit_of_its_name():
    assert list(KNOWN.margins) == ["a.stroke_margin"]


def test_what_lies_beyond_is_told_once_with_where_it_began():
    """From 7 mm, 7.5 and 9 mm are beyond; the farthest is named, and the first time."""
    assert told([1e-3, -5e-4, -2e-3, 1e-3]) == [
        "a.stroke reaches 9 mm, beyond a.stroke_limit = 7 mm, first at 1 s: what it has"
    ]


def test_a_limit_that_was_set_is_that_one():
    (line,) = told([1e-3, -1e-3, 0.0, 0.0], **{"a.stroke_limit": 2e-3})
    assert line.startswith("a.stroke reaches 3 mm, beyond a.stroke_limit = 2 mm")


def test_at_the_limit_and_by_rounding_nothing_is_told():
    assert told([1e-3, 0.0, -1e-15, 1e-3]) == []
    assert list(KNOWN.remarks(TIME, {}, {})) == []


def held(values):
    return list(KNOWN.remarks(np.array([0.0, 1.0, 2.0, 5.0]), {"a.limited": np.array(values)}, {}))


def test_a_limited_command_is_told_of_with_its_share_of_the_time():
    """From 1 s to 2 s, and from 2 s to 5 s, of 5 s."""
    assert list(KNOWN.limiters) == ["a.limited"], "a number says something else"
    assert held([0.0, 1.0, 0.0, 0.0]) == ["a.limited for 20 % of the time, first at 1 s: why it is"]
    assert held([0.0, 0.0, 1.0, 1.0]) == ["a.limited for 60 % of the time, first at 2 s: why it is"]


def test_a_command_that_is_not_limited_or_only_at_the_end_is_not_told_of():
    assert held([0.0, 0.0, 0.0, 0.0]) == []
    assert held([0.0, 0.0, 0.0, 1.0]) == []


def test_a_limit_that_moves_is_that_of_the_worst_point():
    signals = {
        "a.stroke_margin": np.array([1e-3, -1e-3, -3e-3, 0.0]),
        "a.stroke_limit": np.array([7e-3, 7e-3, 4e-3, 4e-3]),
    }
    (line,) = KNOWN.remarks(TIME, signals, {})
    assert line.startswith("a.stroke reaches 7 mm, beyond a.stroke_limit = 4 mm, first at 1 s")


RANGED = {
    "a.heat": signal("heat", "K", "degC", low=300.0, high=400.0, doc="why it is"),
    "a.open": signal("open", low=0.0),
}


@pytest.mark.parametrize(
    ("values", "farthest", "first"),
    [([350.0, 402.0, 420.0, 390.0], "146.85", "1"), ([350.0, 301.0, 300.0, 280.0], "6.85", "3")],
)
def test_an_output_outside_of_its_range_is_told_of(values, farthest, first):
    ranges = LimitOutputs.among(RANGED, {})
    assert ranges.watched == ["a.heat"], "what has one end only has no range"
    (line,) = ranges.remarks(TIME, {"a.heat": np.array(values)}, {})
    assert line == (
        f"a.heat reaches {farthest} degC, outside of its range, 26.85 degC to 126.85 degC,"
        f" first at {first} s: why it is"
    )


def test_within_a_range_and_by_its_noise_nothing_is_told():
    ranges = LimitOutputs.among(RANGED, {})
    assert list(ranges.remarks(TIME, {"a.heat": np.array([300.0, 299.1, 400.9, np.nan])}, {})) == []
