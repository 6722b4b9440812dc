"""Claims: a run in real time tells how far it is and how its links are; its journal is a record."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.experiment.live import (
    Follower,
    Live,
    Moment,
    RigEnd,
    admitted,
    first_open_loop,
    link_outputs,
    rig_ends,
)
from orchestration.fmu import Signal
from orchestration.records import read_record


def test_outputs_about_a_link_are_told_by_the_last_part_of_their_name():
    outputs = ["proxy.voltage", "proxy.voltage_age", "link_state", "a.b.round_trip_time", "age"]
    assert link_outputs(outputs) == ["proxy.voltage_age", "link_state", "a.b.round_trip_time"]


def prepared_run():
    """Return a run whose FMU delivers more outputs, in its own order, than are recorded."""
    signals = {
        name: Signal(name, "real", unit, unit, 0.0, -np.inf, np.inf)
        for name, unit in {"u": "A", "y": "V", "link_state": "1"}.items()
    }
    return SimpleNamespace(
        time=np.array([0.0, 0.5, 1.0]),
        inputs={"u": np.array([1.0, 2.0, 3.0])},
        signals=signals,
        wanted=["hidden", "link_state", "y"],
        record=["y", "link_state"],
    )


def test_every_point_is_told_and_journalled(tmp_path):
    prepared, moments = prepared_run(), []
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


@pytest.mark.parametrize(("state", "said"), [(1.0, "refuses a command"), (3.0, "is lost")])
def test_a_loop_that_is_open_over_a_rig_ends(tmp_path, state, said):
    """The point itself is told and kept."""
    moments = []
    follower = Follower(Live(journal=tmp_path / "j.csv", look=moments.append), prepared_run())
    follower.pace.watch(0, [0.0, 0.0, 7.0], 0.0, 0)
    with pytest.raises(UserError, match=f"link_state at 0.5 s: .*{said}"):
        follower.pace.watch(1, [0.0, state, 8.0], 0.0, 0)
    follower.close()
    assert len(moments) == 2
    record = read_record(tmp_path / "j.csv", {"u": "A", "y": "V", "link_state": "1"})
    assert record.signals["link_state"].tolist() == [0.0, state]


def signal(name: str, text: str = "") -> Signal:
    return Signal(name, "string", "1", "1", 0.0, -np.inf, np.inf, text=text)


def test_the_first_opening_of_a_loop_counts():
    time = [0.0, 0.5, 1.0, 1.5]
    signals = {
        "voltage": np.array([1.0, 1.0, 1.0, 1.0]),  # the number of a refusal, and no link
        "a.link_state": np.array([0.0, 0.0, 2.0, 3.0]),  # stale, and lost
        "b.link_state": np.array([0.0, 0.0, 1.0, 0.0]),  # refused
    }
    assert first_open_loop(time, signals) == (2, "b.link_state at 1 s: the rig refuses a command")
    del signals["b.link_state"]
    assert first_open_loop(time, signals) == (
        3,
        "a.link_state at 1.5 s: the link to the rig is lost",
    )
    del signals["a.link_state"]
    assert first_open_loop(time, signals) is None


def test_whoever_has_a_link_is_admitted_by_what_it_asks():
    """An endpoint that is set counts, else the one that is declared."""
    outputs = ("a.link_state", "b.link_state", "plant.y")
    texts = {
        "a.endpoint": "tcp://a:1",
        "a.credentials": "",
        "b.endpoint": "tcp://b:1",
        "b.credentials": "b.toml",
        "plant.endpoint": "none of a rig",
    }
    prepared = prepared_run()
    prepared.subject = SimpleNamespace(
        outputs=dict.fromkeys(outputs),
        parameters={name: signal(name, text) for name, text in texts.items()},
    )
    prepared.settings = {"a.endpoint": "tcp://set:2"}
    ends = [RigEnd("tcp://set:2", ""), RigEnd("tcp://b:1", "b.toml")]
    assert rig_ends(prepared) == ends
    asked = []

    def admit(pace, rigs, step):
        asked.append((rigs, step))
        return replace(pace, lag=0.25)

    assert admitted(Live(admit=admit), prepared).pace.lag == 0.25
    assert asked == [(ends, 0.5)]
