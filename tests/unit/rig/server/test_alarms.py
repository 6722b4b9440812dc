"""Claims: an alarm stays until its cause is over and somebody has acknowledged it by its name; one
of another source neither replaces nor clears it; and a shelved source is silent.
"""

from __future__ import annotations

import pytest

from orchestration.rig.server import alarms as module
from orchestration.rig.server.alarms import MAJOR, MINOR, SAFE_STATE, Alarms, watch_limits
from orchestration.rig.server.calls import BackendSignals
from orchestration.rig.signals import Limit


class Trial:
    def __init__(self):
        self.lines, self.announced = [], []
        self.alarms = Alarms(self, self.announced.append)

    def tell(self, line, kind=""):
        self.lines.append(line)

    def names(self):
        return {one["source"]: one["name"] for one in self.alarms.fields()}


@pytest.fixture
def trial():
    return Trial()


def test_it_stays_until_it_is_over_and_acknowledged_whichever_comes_first(trial):
    for first in ("end", "acknowledge"):
        trial.alarms.add("force", MINOR, "force 3 N is above 2.5 N", lasts=True)
        steps = {
            "end": lambda: trial.alarms.end("force"),
            "acknowledge": lambda: trial.alarms.acknowledge(trial.names()["force"], "lab"),
        }
        steps.pop(first)()
        assert len(trial.alarms.fields()) == 1
        assert trial.alarms.text == ("force 3 N is above 2.5 N" if first == "end" else "")
        steps.popitem()[1]()
        assert trial.alarms.fields() == []
    assert len(trial.announced) == 2


def test_each_is_acknowledged_by_its_own_name_and_the_worst_is_shown_first(trial):
    trial.alarms.add("force", MINOR, "force is high")
    trial.alarms.add("voltage", MAJOR, "voltage is stuck")
    assert trial.alarms.text == "voltage is stuck; force is high"
    before = trial.names()
    trial.alarms.add("voltage", MAJOR, "voltage is stuck")
    assert not trial.alarms.acknowledge(before["voltage"], "a replay")
    assert not trial.alarms.acknowledge("", "nobody")
    assert trial.alarms.acknowledge(before["force"], "lab")
    assert trial.alarms.text == "voltage is stuck"


def test_a_shelved_source_is_neither_shown_nor_announced_for_a_while(trial, monkeypatch):
    now = 100.0
    monkeypatch.setattr(module, "monotonic", lambda: now)
    trial.alarms.add("voltage", MAJOR, "voltage is stuck")
    assert trial.alarms.shelve(trial.names()["voltage"], 60.0, "lab") == ""
    trial.alarms.add("voltage", MAJOR, "voltage is stuck again")
    assert (trial.alarms.text, len(trial.announced)) == ("", 1)
    assert [one["shelved"] for one in trial.alarms.fields()] == [True]
    now += 60.1
    assert trial.alarms.text == "voltage is stuck again"


@pytest.mark.parametrize("seconds", [-1.0, 1e6, float("nan")])
def test_what_cannot_be_shelved_is_refused(trial, seconds):
    trial.alarms.add("voltage", MAJOR, "voltage is stuck")
    trial.alarms.add(SAFE_STATE, MAJOR, "NOT REACHED")
    names = trial.names()
    assert "allowed are 0 to 86400 s" in trial.alarms.shelve(names["voltage"], seconds, "lab")
    assert "not of the safe state" in trial.alarms.shelve(names[SAFE_STATE], 60.0, "lab")
    assert "'other'" in trial.alarms.shelve("other", 60.0, "lab")
    assert trial.alarms.text == "voltage is stuck; NOT REACHED"


def test_a_value_that_wavers_about_its_limit_of_warning_is_one_alarm(trial):
    limits = {"force": Limit(0.0, 3.0, warn_min=0.5, warn_max=2.5), "charge": Limit(0.0, 1.0)}
    signals = BackendSignals({}, {"force": "N", "charge": "C", "voltage": "V"}, limits)
    for force in (1.0, 2.51, 2.499, 2.52, None, 2.495):
        watch_limits(trial.alarms, signals, (force, 5.0, 1e6))
    (alarm,) = trial.alarms.fields()
    assert alarm["text"] == "force 2.51 N is above 2.5 N, its limit of warning"
    assert (alarm["severity"], alarm["active"]) == (MINOR, True)
    watch_limits(trial.alarms, signals, (2.47, 5.0, 1e6))
    assert not trial.alarms.fields()[0]["active"]
    watch_limits(trial.alarms, signals, (0.4, 5.0, 1e6))
    assert "is below 0.5 N" in trial.alarms.text
    assert len(trial.announced) == 2
