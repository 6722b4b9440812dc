"""Adjustment at two points: closed forms, what is refused, and the file that is written."""

from __future__ import annotations

import datetime
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration.plugins.calibration import Channel, Point, read_calibration
from orchestration.plugins.calibration.adjustment import (
    adjust,
    served_channel,
    write_adjustment,
)

FILE = """\
# our bench
[rig]
rate = 30
watchdog = 0.2

[outputs.load]
channel = "ai0"  # the white cable
amplification = 100
excitation = 5
gain = 2.5
offset = 0.5
sign = -1
relative_uncertainty = 0.01
unit = "kgf"
si = "N"
range = [-10, 10]
date = 2026-05-01

[limits.load]
max = 10  # what the cell bears
unit = "kgf"
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "bench.toml"
    path.write_text(FILE, encoding="utf-8")
    return path


@pytest.fixture
def channel(file: Path) -> Channel:
    return read_calibration(str(file)).outputs["load"]


def test_gain_and_offset_are_those_of_the_line_through_both_points(channel: Channel) -> None:
    points = (Point(0.5, 0.12, 1e-3, 90), Point(2.0, -1.5, 2e-3, 60))
    adjusted = adjust(channel, points, 0.004)
    slope, zero = np.polyfit([0.12, -1.5], [0.5, 2.0], 1)
    # the file's sign stays: value = -(gain * reading + offset)
    assert (adjusted.gain, adjusted.offset) == pytest.approx((-slope, -zero))
    noise = abs(slope) * 2e-3
    assert adjusted.uncertainty == pytest.approx(math.sqrt(0.004**2 + noise**2 * (1 + 1 / 60)))


def test_the_uncertainty_covers_values_between_the_points(channel: Channel) -> None:
    """Errors of 20,000 simulated calibrations, whose references and readings are random."""
    random = np.random.default_rng(1)
    count, noise, reference = 5, 0.02, 0.03
    stated = adjust(
        channel, (Point(0, 0.0, noise, count), Point(10, -4.0, noise, count)), reference
    )
    size = 20000
    known = np.array([[0.0], [10.0]]) + reference * random.standard_normal((2, size))
    readings = np.array([[0.0], [-4.0]])
    readings = readings + noise / np.sqrt(count) * random.standard_normal((2, size))
    slope = (known[1] - known[0]) / (readings[1] - readings[0])
    for share in (0.0, 0.5, 1.0):
        reading = -4.0 * share + noise * random.standard_normal(size)
        errors = known[0] + slope * (reading - readings[0]) - 10.0 * share
        assert np.std(errors) < 1.02 * stated.uncertainty
    assert np.std(errors) > 0.98 * stated.uncertainty  # at a point


@pytest.mark.parametrize(
    ("first", "second", "part"),
    [
        (Point(1.0, 0.1, 0.0, 9), Point(1.0, 0.2, 0.0, 9), "both points are at 1"),
        (Point(1.0, 0.1, 0.0, 9), Point(2.0, 0.1, 0.0, 9), "do not differ by more than their"),
        (Point(1.0, 0.1, 0.04, 9), Point(2.0, 0.2, 0.03, 9), "do not differ by more than their"),
    ],
)
def test_points_that_give_no_line_are_refused(
    channel: Channel, first: Point, second: Point, part: str
) -> None:
    with pytest.raises(UserError, match=part):
        adjust(channel, (first, second), 0.0)


def test_a_point_is_what_was_printed_before() -> None:
    point = Point(-2.5, 0.1 + 0.2, 1.5e-7, 12)
    assert Point.parse(str(point)) == point
    assert Point.parse("-2.5") == Point(-2.5)
    for text in ("", "two", "nan", "2=1", "2=1,0.1,2", "2=1,-0.1,9", "2=1,0.1,9,9", "1e999"):
        with pytest.raises(UserError, match="KNOWN=READING,DEVIATION,SIZE"):
            Point.parse(text)


def test_a_server_with_another_calibration_is_refused(channel: Channel, file: Path) -> None:
    same = {"attributes": {"load": channel.attributes}}
    assert served_channel(file, "load", same).gain == channel.gain
    other = {"load": {**channel.attributes, "calibration_gain": 2.4}}
    others: list[dict[str, object]] = [{}, {"attributes": {}}, {"attributes": other}]
    for status in others:
        with pytest.raises(UserError, match="start it \\(again\\) with this one"):
            served_channel(file, "load", status)


def test_a_signal_that_is_not_measured_is_refused(file: Path) -> None:
    with pytest.raises(UserError, match=r"\[outputs.laod\]: no such output \(did you mean load"):
        served_channel(file, "laod", {})
    with pytest.raises(UserError, match="thesis: no such file; copy a preset"):
        served_channel(Path("thesis"), "voltage", {})


def test_the_old_file_is_kept_and_the_rest_of_it_stays(channel: Channel, file: Path) -> None:
    points = (Point(0.0, 0.12, 1e-3, 90), Point(2.0, -1.5, 2e-3, 60))
    adjusted = adjust(channel, points, 0.004)
    old = write_adjustment(file, "load", adjusted, points, "A. Volta", "masses of class M1")
    assert old.read_text(encoding="utf-8") == FILE
    assert old.name.startswith(f"bench_until_{datetime.date.today():%Y-%m-%d}T")
    text = file.read_text(encoding="utf-8")
    assert "# our bench" in text
    assert 'channel = "ai0"  # the white cable' in text
    assert "max = 10  # what the cell bears" in text
    before = tomllib.loads(FILE)
    del before["outputs"]["load"]["relative_uncertainty"]
    before["outputs"]["load"] |= {
        "gain": adjusted.gain,
        "offset": adjusted.offset,
        "uncertainty": adjusted.uncertainty,
        "date": datetime.date.today(),
        "by": "A. Volta",
        "source": "masses of class M1",
        "points": [[0.0, 0.12], [2.0, -1.5]],
    }
    assert tomllib.loads(text) == before
    new = read_calibration(str(file)).outputs["load"]
    # 100 times 5 V: a reading of 1 mV/V is 0.5 V
    assert new.measured(0.06) == pytest.approx(0.0, abs=1e-12)
    assert new.measured(-0.75) == pytest.approx(2.0 * 9.80665)
    # of three within two seconds one would overwrite another
    with pytest.raises(UserError, match=r"cannot write .*bench_until_.*: File exists"):
        [write_adjustment(file, "load", adjusted, points, "A. Volta", "again") for _ in range(3)]
