"""Claims: a sample is outside exactly where csv-compare's tube of rectangles says so, the worst
place is named, and what cannot be compared is told apart from what differs.

Oracle: the definition itself, segment by segment: what a rectangle around any point of the
reference covers.
"""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus.kit import UserError
from orchestration.experiment.regression import compare, read_tolerances
from orchestration.experiment.regression.comparison import extent, tube
from orchestration.records import Record

eighths = st.integers(-40, 40).map(lambda k: k / 8)
steps = st.lists(st.integers(0, 8), min_size=1, max_size=12)


def covered(time, reference, at, width):
    """Lowest and highest point of the reference at most a width away, by every segment alone."""
    found = []
    for (t0, y0), (t1, y1) in pairwise(zip(time, reference, strict=True)):
        first, last = max(t0, at - width), min(t1, at + width)
        if first > last:
            continue
        if t0 == t1:
            found += [y0, y1]
        else:
            found += [y0 + (y1 - y0) * (s - t0) / (t1 - t0) for s in (first, last)]
    return (min(found), max(found)) if found else (np.nan, np.nan)


@given(steps, st.data(), st.integers(0, 20), st.integers(0, 8))
def test_the_tube_is_what_rectangles_around_the_reference_cover(increments, data, wide, high):
    time = np.cumsum([0, *increments]) / 8
    reference = np.array(data.draw(st.lists(eighths, min_size=time.size, max_size=time.size)))
    at = np.array(data.draw(st.lists(eighths, min_size=1, max_size=10)))
    lower, upper = tube(time, reference, at, wide / 8, high / 8)
    for t, low, top in zip(at, lower, upper, strict=True):
        lowest, highest = covered(time, reference, t, wide / 8)
        np.testing.assert_allclose([low, top], [lowest - high / 8, highest + high / 8], atol=1e-12)


@pytest.mark.parametrize(
    ("values", "base"),
    [
        ([1.0, 4.0, 2.0], 3.0),
        ([-5.0, -5.0], 5.0),
        ([0.0, np.nan], 0.0),
        ([1.0, np.inf, 4.0], 3.0),
    ],
)
def test_a_share_is_of_the_range_and_of_a_constant_of_its_magnitude(values, base):
    assert extent(np.array(values)) == base


TIME = np.linspace(0.0, 2.0, 201)
REFERENCE = Record(
    TIME,
    {"v": np.sin(TIME), "w": np.where(TIME < 1.0, 0.0, 5.0)},
    {"v": "V", "w": "rad/s"},
    Path("reference.csv"),
)


def result(**signals):
    return replace(
        REFERENCE,
        signals={**REFERENCE.signals, **signals},
        source=Path("result.csv"),
    )


def refused(one, tolerances, reference=REFERENCE):
    read = read_tolerances(tolerances, "--tube")
    return {d.signal: d.message for d in compare(one, reference, read).refused}


def exact(one, reference=REFERENCE):
    return {d.signal: d.message for d in compare(one, reference, {}).refused}


def test_the_worst_place_is_named():
    bumped = REFERENCE.signals["v"].copy()
    bumped[120:123] += [0.1, 0.3, 0.2]
    (message,) = refused(result(v=bumped), "v=10ms, 0.15V").values()
    found = re.match(
        r"differs by 0.3 V at 1.21 s: (\S+) V, allowed (\S+) V to (\S+) V;"
        r" 2 of 201 samples are outside",
        message,
    )
    value, low, top = map(float, found.groups())
    assert value == pytest.approx(np.sin(1.21) + 0.3)
    # sin rises there: the ends of the tube are those of the window
    assert (low, top) == pytest.approx((np.sin(1.20) - 0.15, np.sin(1.22) + 0.15))


@pytest.mark.parametrize(("allowed", "differs"), [("10ms", True), ("30ms", False), ("40%", True)])
def test_a_step_may_come_as_late_as_the_tube_is_wide(allowed, differs):
    late = np.where(TIME < 1.0 + 0.02, 0.0, 5.0)
    assert ("w" in refused(result(w=late), allowed)) is differs


def test_each_signal_has_its_own_tolerance_and_the_others_none():
    both = result(v=REFERENCE.signals["v"] + 0.9e-3, w=REFERENCE.signals["w"] + 0.02)
    assert set(refused(both, "v=1mV, w=0.5%")) == set()
    assert set(refused(both, "v=1mV, w=0.1%")) == {"w"}
    assert set(refused(both, "w=0.5%")) == {"v"}
    assert set(refused(both, "0.03, v=0.1mV")) == {"v"}


def test_without_a_tolerance_the_last_bit_counts():
    assert exact(result()) == {}
    nudged = REFERENCE.signals["v"].copy()
    nudged[7] = np.nextafter(nudged[7], 1.0)
    (message,) = exact(result(v=nudged)).values()
    assert re.match(r"differs by \S+e-1\d V at 0.07 s: \S+ V, allowed \S+ V to \S+ V", message)
    zeros = replace(REFERENCE, signals={"v": np.zeros(201)})
    assert "v" in exact(replace(result(), signals={"v": -np.zeros(201)}), zeros)
    assert "other times" in exact(replace(result(), time=TIME + 1e-15))["v"]


def test_units_are_converted_and_others_refused():
    millivolts = replace(result(v=1e3 * REFERENCE.signals["v"]), units={"v": "mV", "w": "rad/s"})
    assert refused(millivolts, "1e-9") == {}
    unstated = replace(result(), units={"v": "", "w": ""})
    assert refused(unstated, "v=1mV, w=1%") == {}
    assert refused(unstated, "v=1, w=1%", unstated) == {}
    metres = replace(result(), units={"v": "m", "w": "rad/s"})
    assert "cannot be compared" in refused(metres, "1%")["v"]


@pytest.mark.parametrize(
    ("unit", "scale", "zero"), [("degC", 1.0, 273.15), ("degF", 5.0 / 9.0, 255.372222222222)]
)
def test_temperatures_are_compared_across_scales_and_differ_by_kelvins(unit, scale, zero):
    kelvins = 300.0 + 10.0 * np.sin(TIME)
    read = ((kelvins - zero) / scale).round(12)
    one = Record(TIME, {"T": read}, {"T": unit}, Path("result.csv"))
    other = replace(one, signals={"T": kelvins}, units={"T": "K"}, source=Path("reference.csv"))
    for first, second in ((one, other), (other, one)):
        assert refused(first, "T=1mK", second) == {}
        bumped = second.signals["T"].copy()
        bumped[100] += 2.0 / (scale if second is one else 1.0)
        (message,) = refused(first, "T=1mK", replace(second, signals={"T": bumped})).values()
        assert message.startswith("differs by 2 K at 1 s: ")


def test_what_is_missing_is_told():
    one = result()
    assert (
        "is missing in result.csv"
        in refused(replace(one, signals={"v": one.signals["v"]}), "1%")["w"]
    )
    short = replace(one, time=TIME[:100], signals={n: v[:100] for n, v in one.signals.items()})
    assert refused(short, "1%")["v"] == "covers 0 s to 0.99 s, the reference 0 s to 2 s"
    late = replace(one, time=TIME[9:], signals={n: v[9:] for n, v in one.signals.items()})
    assert refused(late, "1%")["v"] == "covers 0.09 s to 2 s, the reference 0 s to 2 s"
    assert refused(late, "100ms, 10%") == {}
    lost = REFERENCE.signals["v"].copy()
    lost[5] = np.nan
    assert "at 0.05 s: nan V" in refused(result(v=lost), "1%")["v"]
    unknown = replace(REFERENCE, signals={"v": np.full(201, np.nan)})
    assert refused(one, "1%", unknown)["v"].startswith("has no value in the reference")


def test_samples_at_a_gap_of_the_reference_are_not_counted_as_compared():
    gap = REFERENCE.signals["v"].copy()
    gap[50:60] = np.nan
    known = replace(REFERENCE, signals={"v": gap})
    far = refused(result(v=np.full(201, 9.0)), "1%", known)["v"]
    assert far.endswith("191 of 191 samples are outside")
    (same,) = compare(result(), known, read_tolerances("1%", "--tube")).deviations
    assert (same.compared, same.message) == (191, "")


def test_what_goes_on_longer_is_compared_as_far_as_the_reference_goes():
    longer = Record(
        np.append(TIME, 3.0),
        {name: np.append(v, 99.0) for name, v in REFERENCE.signals.items()} | {"x": np.zeros(202)},
        {**REFERENCE.units, "x": "1"},
        Path("longer.csv"),
    )
    assert refused(longer, "1%") == {}
    assert compare(longer, REFERENCE, read_tolerances("1%", "--tube")).new == ["x"]


@pytest.mark.parametrize(
    ("one", "reference", "tolerances", "message"),
    [
        (replace(result(), signals={"y": TIME}), REFERENCE, "1%", "nothing to compare: result.csv"),
        (result(), REFERENCE, "vv=1%", r"tolerance of vv: reference.csv has no .*did you mean v"),
        (result(), REFERENCE, "v=1A", "tolerance of v"),
        (replace(result(), time=TIME[::-1]), REFERENCE, "1%", "result.csv: time goes back"),
        (result(), replace(REFERENCE, time=TIME[:0]), "1%", "there are no samples"),
    ],
)
def test_what_cannot_be_compared_is_refused(one, reference, tolerances, message):
    with pytest.raises(UserError, match=message) as caught:
        refused(one, tolerances, reference)
    assert "\n" not in str(caught.value)


def test_infinite_values_are_no_warning():
    endless = REFERENCE.signals["v"].copy()
    endless[3] = np.inf
    assert "at 0.03 s: inf V" in refused(result(v=endless), "1%")["v"]
    assert exact(result(v=endless), result(v=endless)) == {}
    # one in the reference allows nothing elsewhere
    zeros = result(v=0.0 * TIME)
    assert "allowed inf V to inf V; 199 of 201" in refused(zeros, "1%", result(v=endless))["v"]
