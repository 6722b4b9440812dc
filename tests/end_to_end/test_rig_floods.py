"""Claims: beside any flood of hostile peers that was tried, a stop is answered soon, and stops.

`docs/rig-latency.md` has the figures of a measurement.
"""

from __future__ import annotations

import pytest

from orchestration.rig.operator import ask
from tests.support.rig.floods import CASES, flooded_server, stop_times

pytestmark = [pytest.mark.timeout(120), pytest.mark.real_time]

AIM = 0.05  # s, of half of the stops: on two cores the flood itself takes one
LONGEST = 0.5  # s, of any of them, where tests run beside each other
STOPS = 40


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "offset"), CASES)
def test_a_stop_beside_a_flood(tmp_path, kind, offset):
    with flooded_server(kind, offset, tmp_path) as remote:
        times = stop_times(remote, STOPS)
        assert times[STOPS // 2] <= AIM
        assert times[-1] <= LONGEST
        told = ask(remote, "status")
        assert told["state"] in ("safe", "stopping")  # a flood may be of stops, which are written
        assert told["alarm"] == ""
