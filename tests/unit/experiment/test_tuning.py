"""Claims: a parameter that is moved by hand in a run follows the closed form of a ramp, is recorded
as it was, and is repeated to the bit; nothing else can be moved, nor beyond its limits.
"""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.experiment import parse, read, results, run
from orchestration.experiment.live import Live
from orchestration.experiment.tuning import RAMP, Tuner
from orchestration.master import RealTime

EXPERIMENT = {
    "component": "ppy_actuator",
    "duration": "0.8 s",
    "step": "0.02 s",
    "record": ["force_margin"],
    "inputs": {"current": 0, "force": "0.5 N"},
    "parameters": {"force_limit": "2500 mN"},
}


def moved(*requests, names=("force_limit",), experiment=EXPERIMENT):
    """Run in real time and move parameters: ``(at which time, name, value, slew rate)``."""
    tuner = Tuner(names)
    waiting = list(requests)

    def look(moment):
        while waiting and moment.time > waiting[0][0] - 1e-9:
            tuner.move(*waiting.pop(0)[1:], by="operator")

    live = Live(RealTime(missed="warn", lag=60.0), tuner=tuner, look=look)
    return run(parse(experiment, "here", "."), "here", live=live), tuner


def test_it_is_a_ramp_from_the_next_point_on_and_the_result_repeats_it(tmp_path):
    found, tuner = moved((0.2, "force_limit", 1.5, 4.0), (0.6, "force_limit", 2.0, None))
    time = found.time.values
    first = 2.5 - np.clip(4.0 * (time - 0.22), 0.0, 1.0)
    expected = first + np.clip(0.5 / RAMP * (time - 0.62), 0.0, 0.5)
    np.testing.assert_allclose(found.force_limit.values, expected, atol=1e-12)
    np.testing.assert_allclose(found.force_margin.values, expected - 0.5, atol=1e-12)
    kept = json.loads(found.attrs["tuning"])
    assert kept == tuner.changes
    assert [(c["name"], c["old"], c["new"], c["by"]) for c in kept] == [
        ("force_limit", 2.5, 1.5, "operator"),
        ("force_limit", 1.5, 2.0, "operator"),
    ]
    assert [c["time"] for c in kept] == pytest.approx([0.22, 0.62])
    results.write(found, tmp_path / "run.nc")
    again = run(read(str(tmp_path / "run.nc")), "again")
    for name, values in results.read(tmp_path / "run.nc").data_vars.items():
        np.testing.assert_array_equal(again[name].values, values.values)
    assert np.ptp(again.force_limit.values) > 0.9


def test_nothing_moves_unless_somebody_moves_it():
    found, _ = moved(experiment=EXPERIMENT | {"duration": "0.1 s"})
    assert set(found.force_limit.values) == {2.5}
    assert "tuning" not in found.attrs


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        (("force_limit", -1.0, None), r"force_limit = -1: allowed is 0 … 1e\+09 N"),
        (("force_limit", float("nan"), None), "force_limit = nan: allowed is"),
        (("force_limit", 1.0, 0.0), "force_limit: slew = 0 per second: must be above 0"),
        (("force", 1.0, None), "this run has no parameter to tune named 'force'"),
    ],
)
def test_a_move_that_cannot_be_changes_nothing(request_, words):
    found, tuner = moved((0.02, *request_), experiment=EXPERIMENT | {"duration": "0.1 s"})
    assert re.search(words, found.attrs["failure"])
    assert tuner.changes == []
    assert set(found.force_limit.values) == {2.5}


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("R1", {}, "ppy_actuator has no tunable parameter named 'R1'"),
        (
            "force_limit",
            {"parameters": {}, "inputs": {"force_limit": 2}},
            "here: --tunable force_limit: it is moved by the experiment",
        ),
    ],
)
def test_what_is_not_tunable_is_refused_before_the_run(name, change, words):
    with pytest.raises(UserError, match=words):
        moved(names=(name,), experiment=EXPERIMENT | change)


BENCH = {
    "system": "dma_bench",
    "duration": "0.5 s",
    "record": ["bench.coil_voltage"],
    "inputs": {"force_reference": "1 N", "current": 0},
}


def test_a_parameter_of_a_member_moves_as_the_experiment_moves_it():
    """The same ramp, by hand and by the file: to the bit."""
    name = "bench.error_gain"
    by_hand, tuner = moved((0.1, name, 0.4, 1.0), names=(name,), experiment=BENCH)
    inputs = BENCH["inputs"] | {name: f"0.4@{tuner.changes[0]['time']!r}s@1"}
    by_file = run(parse(BENCH | {"inputs": inputs}, "here", "."), "here")
    for signal in (name, "bench.coil_voltage"):
        np.testing.assert_array_equal(by_hand[signal].values, by_file[signal].values)
    assert np.ptp(by_hand["bench.coil_voltage"].values) > 0.1
