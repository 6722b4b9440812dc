"""Claims: every experiment that ships is valid and says where it is from; the one for
identification gives the parameters in spite of noise.
"""

import numpy as np
import pytest

import orchestration as ppy
from orchestration.experiment.library import shipped
from orchestration.experiment.reading import read
from orchestration.records import read_record
from tests.support.command import UNITS, works

# those of table 3-1, which ppy_actuator has by default, and how far off a fit starts
TRUE = {"R1": 0.43, "R2": 2.35, "C": 2.7, "alpha": 0.068e-3, "k1": 6300.0}
START = {"R1": 0.6, "R2": 2.0, "C": 2.0, "alpha": 0.05e-3, "k1": 5000.0}
NOISE = ["--set", "noise.voltage.rms=5mV", "--set", "noise.displacement.rms=10um"]


def test_every_experiment_that_ships_is_valid_and_says_what_is_assumed():
    third = [f"fig_3_{n}" for n in (3, 4, 5, 6, 7, 8, 10, 11, 12)]
    figures = ["fig_2_6", *third, "fig_4_4", "fig_4_5", "fig_4_8", "fig_5_8", "fig_5_9"]
    assert set(shipped()) == {
        *figures,
        "fig_3_3_stand",
        "foot_stance",
        "hil_bench",
        "displacement_loop",
        "state_feedback_loop",
        "adaptive_loop",
        "tension_loop",
        "impedance_bench",
        "hil_displacement_loop",
        "identification",
        "work_loop",
    }
    for name, path in shipped().items():
        experiment = read(name)
        if name in figures:
            assert experiment.title.startswith(
                name.replace("fig_", "Fig. ").replace("_", "-") + ":"
            )
        assert "thesis section" in experiment.source
        assert path.read_text(encoding="utf-8").startswith("# ")


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_experiment_for_identification_can_be_run_and_identified_with(tmp_path, seed):
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
