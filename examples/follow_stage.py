"""Columns of ``StageFollowed`` (velocity, acceleration, voltage) from a record of a stage.

The derivatives are those of the position below 10 Hz, and the voltage goes through the same filter,
which delays nothing. Two samples are kept of every period of that frequency: between them there is
nothing that the filter left, and what a diagnosis takes for noise has to fill the whole spectrum::

    python examples/follow_stage.py emps_positioning_stage.csv followed.csv ppy diagnose
    followed.csv --model examples/positioning_stage.py:StageFollowed --hold force_constant
"""

import sys
from pathlib import Path

import numpy as np
from scipy.signal import butter, filtfilt

from orchestration.records import read_record, write_record

PASS = 10.0  # Hz
EDGE = 2.0 / PASS  # s at either end of the record, where the filter sees the end


def follow(source: Path, target: Path) -> None:
    """Write the columns."""
    record = read_record(source, {"position": "m", "motor_voltage": "V"})
    time = record.time
    rate = 1.0 / np.median(np.diff(time))
    position, voltage = (
        filtfilt(*butter(4, PASS, fs=rate), record.signals[n])
        for n in ("position", "motor_voltage")
    )
    velocity = np.gradient(position, time)
    kept = slice(round(EDGE * rate), -round(EDGE * rate), round(rate / (2.0 * PASS)))
    signals = {
        "velocity": velocity,
        "acceleration": np.gradient(velocity, time),
        "motor_voltage": voltage,
    }
    units = {"velocity": "m/s", "acceleration": "m/s^2", "motor_voltage": "V"}
    write_record(
        target, time[kept], {name: values[kept] for name, values in signals.items()}, units
    )


if __name__ == "__main__":
    follow(Path(sys.argv[1]), Path(sys.argv[2]))
