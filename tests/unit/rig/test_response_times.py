"""Claims: the rate that a machine holds with a rig is measured by the rig's answers, and a run that
wants more is refused in one line that says which rate would do.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import UserError
from fmus.rig_proxy.link import Link
from orchestration.rig import response_times
from orchestration.rig.response_times import (
    ResponseTimes,
    check_response_times,
    measure_response_times,
)
from tests.support.rig.small_rig import SmallRig, free_port

THOUSAND = 1e-3 * np.arange(1, 1001)  # delays of 1 ms to 1 s, evenly


class Slow:
    """A rig that takes a known time for every answer, by a clock of its own."""

    endpoint = "tcp://127.0.0.1:5570"

    def __init__(self, *delays: float):
        self.delays, self.asked, self.now = delays, [], 0.0

    def status(self, timeout):
        self.asked.append(self.now)
        self.sleep(self.delays[len(self.asked) % len(self.delays)])
        return {"mode": "real-time", "watchdog": 0.2}

    def sleep(self, seconds):
        self.now += seconds

    def measured(self, step, monkeypatch):
        monkeypatch.setattr(response_times, "perf_counter", lambda: self.now)
        monkeypatch.setattr(response_times, "sleep", self.sleep)
        return measure_response_times(self, step)


def test_quantiles_are_delays_that_were_seen():
    measured = ResponseTimes(0.01, THOUSAND, 0.2)
    found = [measured.quantile(share) for share in (0.5, 0.99, 0.999, 1.0)]
    assert found == pytest.approx([0.5, 0.99, 0.999, 1.0])
    assert str(measured) == "p50 500 ms, p99 990 ms, p99.9 999 ms, max 1e+03 ms"
    assert measured.longest_pause == 0.1


@pytest.mark.parametrize(("late", "held"), [(1, True), (2, False)])
def test_one_answer_in_a_thousand_may_be_late(late, held):
    delays = np.sort(np.concatenate([np.full(1000 - late, 5e-4), np.full(late, 9e-3)]))
    measured = ResponseTimes(1e-3, delays, 0.2)
    assert measured.holds(1e-3) == held
    if held:
        check_response_times(measured, "tcp://rig:5570")
        return
    with pytest.raises(UserError) as refused:
        check_response_times(measured, "tcp://rig:5570")
    text = str(refused.value)
    assert "does not hold 1000 Hz with the rig at tcp://rig:5570" in text
    assert "p99.9 9 ms" in text
    assert "it holds 100 Hz" in text
    assert "\n" not in text


def test_a_delay_is_from_when_an_answer_was_due(monkeypatch):
    rig = Slow(0.002, 0.03)
    measured = rig.measured(0.05, monkeypatch)
    assert measured.times == pytest.approx([0.002] * 10 + [0.03] * 10)
    assert np.diff(rig.asked[1:]) == pytest.approx(np.full(19, 0.05))
    assert measured.watchdog == 0.2


def test_a_rig_slower_than_the_rate_is_found_late(monkeypatch):
    """Nothing of the backlog is forgotten: the last of fifty is late by all of it."""
    measured = Slow(0.03).measured(0.02, monkeypatch)
    assert measured.quantile(1.0) == pytest.approx(50 * 0.03 - 49 * 0.02)
    assert not measured.holds(0.02)


def test_a_rig_is_asked_and_nothing_moves():
    with SmallRig() as rig:
        link = Link(rig.endpoint, {}, {})
        measured = measure_response_times(link, 0.02)
        link.close()
    assert measured.times.size == 50
    assert {message["type"] for message in rig.heard} == {"status"}
    assert rig.state == "idle"


def test_a_rig_that_waits_for_its_client_is_never_too_slow():
    with SmallRig(mode="lockstep") as rig:
        link = Link(rig.endpoint, {}, {})
        assert measure_response_times(link, 1e-3) is None
        link.close()


def test_nobody_there():
    link = Link(f"tcp://127.0.0.1:{free_port()}", {}, {})
    with pytest.raises(UserError, match=r"no answer within 2 s .*, or do the keys not match\?"):
        measure_response_times(link, 0.1)
    link.close()
