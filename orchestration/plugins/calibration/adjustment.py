"""Adjustment of a channel's gain and offset at two known values, read from its rig's telemetry."""

from __future__ import annotations

import datetime
import math
import re
import statistics
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tomlkit

from fmus.kit import files
from fmus.kit.errors import UserError, suggestion
from fmus.kit.interrupt import Interrupt
from orchestration.plugins.calibration.channels import Channel
from orchestration.plugins.calibration.file import parse_calibration, read_calibration
from orchestration.rig import Endpoint
from orchestration.rig.record import RecordingObserver, listen

_FEWEST = 3  # values of a point, for a standard deviation that says something
_SAME = 1e-6  # s between two statements of when one value was measured
_DISTINCT = 3.0  # standard deviations by which readings of different values differ


def _ignore(*_: object) -> None:
    """Show nothing of a reading."""


_UNSEEN = RecordingObserver(_ignore, _ignore, str, _ignore)


class Point(NamedTuple):
    """A known value and what is read there, before gain and offset.

    Attributes
    ----------
    known : float
        In the channel's unit.
    reading, deviation : float
        Mean, and standard deviation of a single reading.
    size : float
        Number of readings; 0 if there are none yet.
    """

    known: float
    reading: float = 0.0
    deviation: float = 0.0
    size: float = 0.0

    def __str__(self) -> str:
        return f"{self.known!r}={self.reading!r},{self.deviation!r},{self.size:g}"

    @classmethod
    def parse(cls, text: str) -> Point:
        """Read a point from a known value, or from the text of a point.

        Raises
        ------
        UserError
            If the text is neither.
        """
        try:
            point = cls(*map(float, re.split("[=,]", text)))
        except (TypeError, ValueError):
            point = cls(math.nan)
        is_measured = point.deviation >= 0.0 and point.size >= _FEWEST
        if not all(map(math.isfinite, point)) or not (is_measured or "=" not in text):
            raise UserError(
                f"point {text!r}: a finite number in the channel's unit is wanted, or what an"
                " earlier measurement printed, KNOWN=READING,DEVIATION,SIZE"
            )
        return point


class Adjustment(NamedTuple):
    """Gain and offset through two points.

    Attributes
    ----------
    gain, offset : float
    uncertainty : float
        Standard uncertainty of one value between the points, in the channel's unit.
    """

    gain: float
    offset: float
    uncertainty: float


def served_channel(path: Path, name: str, status: Mapping[str, Any]) -> Channel:
    """Return a measured channel of a calibration file with which a server was started.

    Parameters
    ----------
    path : Path
    name : str
    status : Mapping
        The message ``status`` of the server.

    Returns
    -------
    Channel

    Raises
    ------
    UserError
        If there is no such file or output, or the server has another calibration of it.
    """
    if not files.is_file(path):
        raise UserError(f"{path}: no such file; copy a preset to a file of yours first")
    outputs = read_calibration(str(path)).outputs
    if name not in outputs:
        raise UserError(f"{path}: [outputs.{name}]: no such output{suggestion(name, outputs)}")
    if status.get("attributes", {}).get(name) != outputs[name].attributes:
        raise UserError(
            f"the server does not have the calibration of {name} that is in {path}: it reads the"
            " file when it starts, so start it (again) with this one"
        )
    return outputs[name]


def measure(
    remote: Endpoint, status: Mapping[str, Any], channel: Channel, known: float, duration: float
) -> Point:
    """Read a channel for a while at a known value.

    Parameters
    ----------
    remote : Endpoint
    status : Mapping
        The message ``status`` of the server.
    channel : Channel
    known : float
        In the channel's unit.
    duration : float
        s.

    Returns
    -------
    Point

    Raises
    ------
    UserError
        If there are too few values.
    """
    rows, failure = listen(remote, status, duration, Interrupt(), _UNSEEN)
    width = len(status["outputs"])
    first = 1 + len(status["inputs"]) + [*status["outputs"]].index(channel.name)
    clock, values, ages = rows[:, [0, first, first + width]].T
    measured = clock - ages
    # each once, and none from before
    is_new = (np.diff(measured, prepend=math.inf) > _SAME) & (measured > clock[:1])
    readings = [channel.reading(value) for value in values[is_new & np.isfinite(values)].tolist()]
    if failure or len(readings) < _FEWEST:
        raise UserError(
            f"{channel.name}: {len(readings)} values from {remote.telemetry} in {duration:g} s,"
            f" {_FEWEST} are wanted; {failure or 'is the sensor open, short or out of range?'}"
        )
    return Point(known, statistics.fmean(readings), statistics.stdev(readings), len(readings))


def adjust(channel: Channel, points: Sequence[Point], uncertainty: float) -> Adjustment:
    """Return gain and offset of a channel through two points.

    The uncertainty is that of a single value between the points: by the known values, a reading and
    the mean of the readings at a point, added in squares (JCGM 100:2008, 5.1.2).

    Parameters
    ----------
    channel : Channel
    points : sequence of two Point
    uncertainty : float
        Standard uncertainty of the known values, in the channel's unit.

    Returns
    -------
    Adjustment

    Raises
    ------
    UserError
        If the known values are the same, or their readings do not differ by more than their noise.
    """
    first, second = points
    change = second.reading - first.reading
    if first.known == second.known:
        raise UserError(f"both points are at {first.known:g}; two different values are wanted")
    if not abs(change) > _DISTINCT * math.hypot(first.deviation, second.deviation):
        raise UserError(
            f"{channel.name}: the readings at both points, {first.reading:.6g} and"
            f" {second.reading:.6g}, do not differ by more than their noise"
        )
    gain = channel.sign * (second.known - first.known) / change
    offset = channel.sign * first.known - gain * first.reading
    noise = abs(gain) * max(first.deviation, second.deviation)
    fewest = min(first.size, second.size)
    return Adjustment(gain, offset, math.hypot(uncertainty, noise * math.sqrt(1.0 + 1.0 / fewest)))


def write_adjustment(
    path: Path, name: str, adjustment: Adjustment, points: Sequence[Point], by: str, source: str
) -> Path:
    """Write an adjustment to a calibration file, and keep the old file beside it.

    Parameters
    ----------
    path : Path
    name : str
        Output of the file.
    adjustment : Adjustment
    points : sequence of Point
    by : str
        Whoever adjusted.
    source : str
        Reference of the known values.

    Returns
    -------
    Path
        The old file, with date and time in its name.

    Raises
    ------
    UserError
        If the file cannot be written, or has changed so that it is no calibration any more.
    """
    now = datetime.datetime.now().replace(microsecond=0)
    before = path.read_bytes()
    document: Any = tomlkit.parse(before.decode())
    table = document["outputs"][name]
    table.pop("relative_uncertainty", None)
    pairs = [[point.known, point.reading] for point in points]
    table.update(adjustment._asdict(), date=now.date(), by=by, source=source, points=pairs)
    parse_calibration(document.unwrap(), path)
    old = path.with_name(f"{path.stem}_until_{now:%Y-%m-%dT%H-%M-%S}{path.suffix}")
    try:
        with open(old, "xb") as kept:
            kept.write(before)
    except OSError as error:
        raise UserError(f"cannot write {old}: {error.strerror}") from error
    files.write(path, tomlkit.dumps(document).encode())
    return old
