"""The master and members that misbehave: told with component, time and their own words, never
passed over.
"""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.master import Stopped, run
from tests.support.master.failing import (
    DISCARD,
    ERROR,
    FATAL,
    TIME,
    chain,
    ones,
)
from tests.support.master.samples import ring


@pytest.mark.parametrize(
    "options", [{}, {"method": "jacobi"}, {"extrapolation": 1}, {"rates": {"bad": 3}}]
)
@pytest.mark.parametrize(
    ("status", "told"),
    [
        (
            DISCARD,
            "failed (discard, it reached 3 s, it asks to end the simulation): I have had enough",
        ),
        (ERROR, "failed (error): I have had enough"),
        (FATAL, "failed (fatal): I have had enough"),
    ],
)
def test_a_step_that_fails_stops_the_run(member, status, told, options):
    with pytest.raises(Stopped) as caught:
        run(chain(member, status=status, when=3.0), TIME, ones(), **options)
    end = "3.033333333" if "rates" in options else "3.1"
    assert str(caught.value) == f"bad: member.fmu: step from 3 s to {end} s {told}"
    partial = caught.value.run
    assert not partial.complete
    assert partial.message == str(caught.value)
    assert partial.time.tolist() == TIME[:31].tolist()
    assert {values.shape for values in partial.signals.values()} == {(31,)}
    assert partial.signals["good.x"] == pytest.approx(-np.expm1(-TIME[:31]), abs=1e-13)


def test_a_slow_member_fails_in_a_step_of_its_own(member):
    with pytest.raises(Stopped) as caught:
        run(chain(member, status=ERROR, when=2.8), TIME, ones(), rates={"bad": 0.25})
    assert (
        str(caught.value)
        == "bad: member.fmu: step from 2.8 s to 3.2 s failed (error): I have had enough"
    )
    assert caught.value.run.time[-1] == TIME[31]


def test_what_is_no_number_is_not_passed_on(member):
    system = ring(
        member, {"bad": {"nan": 1.0, "when": 3.0}, "good": {}}, "bad.y -> good.u", u="bad.u"
    )
    with pytest.raises(Stopped, match=r"^bad: its output y is nan at 3 s$") as caught:
        run(system, TIME, ones())
    assert caught.value.run.time[-1] == TIME[29]


@pytest.mark.parametrize("options", [{}, {"tolerance": 1e-3}])
def test_what_is_only_recorded_may_be_no_number(member, options):
    """y of bad is passed on to nobody; x is as without it."""
    found, plain = (
        run(chain(member, nan=nan, when=3.0), TIME, ones(), **options).signals for nan in (1.0, 0.0)
    )
    assert np.isnan(found["bad.y"]).tolist() == (TIME > 3.0 - 1e-9).tolist()
    assert found["bad.x"].tolist() == plain["bad.x"].tolist()


def test_a_member_that_did_not_get_to_the_end(member):
    with pytest.raises(Stopped, match=r"^bad: says that it is at 4.9 s at the end, 5 s$") as caught:
        run(chain(member, lag=0.1), TIME, ones())
    assert not caught.value.run.complete
