"""Claims: a run in real time tells how far it is and how its links are; its journal is a record."""

from types import SimpleNamespace

import numpy as np

from orchestration.experiment.live import Follower, Live, Moment, link_outputs
from orchestration.fmu import Signal
from orchestration.records import read_record


def test_outputs_about_a_link_are_told_by_the_last_part_of_their_name():
    outputs = ["proxy.voltage", "proxy.voltage_age", "link_state", "a.b.round_trip_time", "age"]
    assert link_outputs(outputs) == ["proxy.voltage_age", "link_state", "a.b.round_trip_time"]


def test_every_point_is_told_and_journalled(tmp_path):
    """What is wanted of the FMU, in its order, is more than what is recorded."""
    signals = {
        name: Signal(name, "real", unit, unit, 0.0, -np.inf, np.inf)
        for name, unit in {"u": "A", "y": "V", "link_state": "1"}.items()
    }
    prepared = SimpleNamespace(
        time=np.array([0.0, 0.5, 1.0]),
        inputs={"u": np.array([1.0, 2.0, 3.0])},
        signals=signals,
        wanted=["hidden", "link_state", "y"],
        record=["y", "link_state"],
    )
    moments = []
    live = Live(journal=tmp_path / "j.csv", look=moments.append)
    follower = Follower(live, prepared)
    for k, y in enumerate((7.0, 8.0, 9.0)):
        follower.pace.watch(k, [-1.0, 2.0, y], 0.01 * k, k)
    follower.close()
    assert moments[2] == Moment(1.0, 1.0, 0.02, 2, {"link_state": 2.0}, "")
    assert [moment.time for moment in moments] == [0.0, 0.5, 1.0]
    record = read_record(tmp_path / "j.csv", {"u": "A", "y": "V", "link_state": "1"})
    assert record.signals["u"].tolist() == [1.0, 2.0, 3.0]
    assert record.signals["y"].tolist() == [7.0, 8.0, 9.0]
    assert record.signals["link_state"].tolist() == [2.0, 2.0, 2.0]
