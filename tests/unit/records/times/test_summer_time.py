"""Claims: local times of a stated zone are the instants that the zone database gives, also in the
hour that comes twice; a step of an hour without a zone is refused, a pause is not.
"""

from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.records.tables import Column, Table
from orchestration.records.times.summer_time import is_zone, local_to_utc

EPOCH = datetime(1, 1, 1)


def local(zone, start, seconds):
    """Return seconds since the day 0 at the clock on a wall."""
    began = start.replace(tzinfo=UTC)
    moments = [(began + timedelta(seconds=s)).astimezone(ZoneInfo(zone)) for s in seconds]
    return np.array([86400.0 + (m.replace(tzinfo=None) - EPOCH).total_seconds() for m in moments])


def instants(values, zone):
    rows = np.arange(2, 2 + len(values))
    column = Column("Zeit", None, [""] * len(values))
    return local_to_utc(Table("r.csv", [column], rows), column, values, zone)


@pytest.mark.parametrize("zone", ["Europe/Berlin", "America/New_York", "Australia/Sydney", "UTC"])
@pytest.mark.parametrize("step", [60.0, 900.0, 7.5])
def test_a_year_of_local_time_is_the_time_that_passed(zone, step):
    for month in range(1, 13):
        for day in (1, 8, 25, 26):
            seconds = step * np.arange(0, 86400.0 / step, max(1, int(600 / step)))
            found = instants(local(zone, datetime(2026, month, day), seconds), zone)
            np.testing.assert_allclose(found - found[0], seconds, atol=1e-3)


def test_a_record_that_begins_in_the_hour_that_comes_twice():
    seconds = 60.0 * np.arange(90)
    values = local("Europe/Berlin", datetime(2026, 10, 25, 1, 30), seconds)  # 02:30, second time
    np.testing.assert_allclose(np.diff(instants(values, "Europe/Berlin")), 60.0)


@pytest.mark.parametrize(
    ("start", "way"),
    [(datetime(2026, 10, 25, 0, 30), "back"), (datetime(2026, 3, 29, 0, 30), "forward")],
)
def test_without_a_zone_the_step_of_an_hour_is_refused(start, way):
    values = local("Europe/Berlin", start, 60.0 * np.arange(90))
    with pytest.raises(UserError, match=rf"row 32, .*goes {way} by an hour.*time\[Europe/Berlin\]"):
        instants(values, "")


def test_a_pause_of_an_hour_on_another_day_is_none():
    values = local(
        "UTC", datetime(2026, 6, 14, 1, 30), [*range(0, 1800, 60), *range(5400, 9000, 60)]
    )
    np.testing.assert_array_equal(instants(values, ""), values)


def test_names_of_zones():
    assert is_zone("Europe/Berlin")
    assert not is_zone("ms")
    assert not is_zone("../etc/passwd")
