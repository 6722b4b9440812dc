"""Claims: the experiment for identification is one of 45 s at 30 Hz, and gives the parameters in
spite of noise.
"""

from __future__ import annotations

import numpy as np
import pytest

import orchestration as ppy
from orchestration.records import read_record
from tests.support.command import UNITS, works

# those of table 3-1, which ppy_actuator has by default, and how far off a fit starts
TRUE = {"R1": 0.43, "R2": 2.35, "C": 2.7, "alpha": 0.068e-3, "k1": 6300.0}
START = {"R1": 0.6, "R2": 2.0, "C": 2.0, "alpha": 0.05e-3, "k1": 5000.0}
NOISE = ["--set", "noise.voltage.rms=5mV", "--set", "noise.displacement.rms=10um"]


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_it_can_be_run_and_identified_with(tmp_path, seed):
    works("run", "identification", "--set", f"seed={seed}", *NOISE, "--out", "id.csv", cwd=tmp_path)
    record = read_record(tmp_path / "id.csv", UNITS)
    assert record.time == pytest.approx(np.arange(1351) / 30.0, abs=1e-9)
    for name, low, high in [("current", -0.9, 0.9), ("force", 0.5, 2.75)]:
        values = record.signals[name]
        assert (values.min(), values.max()) == pytest.approx((low, high))
        assert len(np.unique(values)) == 5
    fitted = ppy.fit(tmp_path / "id.csv", "ppy_actuator", list(TRUE), settings=START)
    for name, value in TRUE.items():
        low, high = fitted.intervals[name]
        assert high / low < 1.05  # 95 %: within 2.5 % of it
        assert value == pytest.approx(fitted.values[name], rel=0.02)
