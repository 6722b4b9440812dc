"""Experiments that several tests write: a good one to spoil, and one that plays a record back."""

from pathlib import Path

import numpy as np

from demonstrations.emulator.emulator import EmulatedRig
from orchestration.records import write_record
from tests.support.command import measure

GOOD = """
component = "ppy_actuator"
duration = "2 s"
step = 0.1
record = ["voltage"]
[inputs]
force = "1 N"
[inputs.current]
kind = "square"
amplitude = "0.9 A"
frequency = "0.5 Hz"
"""
PLAYED = """
title = "A record is played back"
component = "ppy_actuator"
duration = "3 s"
step = "0.1 s"
seed = 3
record = ["voltage", "displacement"]
[parameters]
R1 = "610 mohm"
[inputs]
force = { kind = "multilevel", levels = [0.5, 2], dwell = [0.3, 0.9] }
current = { kind = "file", file = "drive.csv", column = "I" }
[noise.voltage]
rms = "1 mV"
"""


def good_experiment(folder: Path) -> Path:
    """Fill a folder with a good experiment, a record and earlier results; return the folder."""
    (folder / "good.toml").write_text(GOOD, encoding="utf-8")
    measure(folder / "record.csv", EmulatedRig(seed=1), 40)
    for name in ("out.nc", "out.csv", "out.png", "out.html"):
        (folder / name).write_text("the result of earlier work\n", encoding="utf-8")
    return folder


def played_record(folder: Path) -> Path:
    """Fill a folder with an experiment whose current comes from a file; return the folder."""
    moments = np.arange(0.0, 3.1, 0.3)
    write_record(folder / "drive.csv", moments, {"I": np.sin(moments)}, {"I": "A"})
    (folder / "play.toml").write_text(PLAYED, encoding="utf-8")
    return folder
