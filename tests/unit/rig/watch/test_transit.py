"""Claims: the bound of a transit time is never below the truth, and no wider than a round trip of
the best exchange and the drift of clocks.
"""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from orchestration.rig.watch.transit import TransitBound

DRIFT = 1e-3  # s in a second: what two clocks slewed by 500 ppm part, at most
delays = st.floats(0.0, 0.5)


def test_nothing_is_known_before_the_first_round_trip():
    assert TransitBound().transit_time(3.0, 4.0) is None


def test_one_round_trip_of_40_ms():
    bound = TransitBound()
    bound.take_round_trip(100.0, 612.03, 100.04)  # stamped at 100.03: the clock is 512 s ahead
    assert 0.04 - 1e-9 <= bound.transit_time(612.03, 100.04) <= 0.04 + 1.1 * DRIFT
    later = bound.transit_time(613.0, 101.02)  # sent at 101.0, under way for 20 ms
    assert 0.02 <= later <= 0.02 + 0.03 + 1.1 * DRIFT + 1e-9


@given(
    st.floats(-1e5, 1e5),
    st.floats(-DRIFT / 2, DRIFT / 2),
    st.lists(st.tuples(st.floats(0.01, 2.0), delays, delays, delays), min_size=1, max_size=20),
)
def test_it_is_never_below_the_truth(ahead, rate, exchanges):
    """Of a clock that is ahead by any time and goes fast or slow, whatever each way takes."""

    def stamp(now):
        return ahead + (1.0 + rate) * now

    bound = TransitBound()
    now = 0.0
    for pause, there, back, telemetry in exchanges:
        now += pause
        answered = now + there
        received = answered + back
        bound.take_round_trip(now, stamp(answered), received)
        sent = received + 0.1
        transit = bound.transit_time(stamp(sent), sent + telemetry)
        assert transit is not None
        assert transit >= telemetry - 1e-6
        assert transit <= telemetry + there + 2 * DRIFT * (there + back + 0.1 + telemetry) + 1e-6
        now = received


def test_the_best_round_trip_counts_for_the_next():
    bound = TransitBound()
    bound.take_round_trip(0.0, 0.001, 0.002)
    bound.take_round_trip(1.0, 1.4, 1.5)
    assert bound.transit_time(2.0, 2.01) < 0.02


def test_another_clock_is_not_taken_for_the_one_before():
    bound = TransitBound()
    bound.take_round_trip(100.0, 612.0, 100.01)
    assert bound.transit_time(9000.0, 101.0) is None  # ahead of what it can be
    bound.take_round_trip(101.0, 9000.0, 101.01)
    assert 0.02 <= bound.transit_time(9001.0, 102.02) < 0.04
    bound.take_round_trip(103.0, 5.0, 103.01)  # behind
    assert 0.02 <= bound.transit_time(6.0, 104.02) < 0.04
