"""Back-calculation in closed form."""

import pytest

from fmus.controllers.tracking import back_calculated, tracking_share


def test_the_share_is_the_period_over_the_time_and_all_below_a_period():
    assert tracking_share(0.1, 0.4) == pytest.approx(0.25)
    assert tracking_share(0.1, 0.1) == tracking_share(0.1, 0.0) == 1.0


def test_an_excess_dies_away_geometrically():
    command = 10.0
    for _ in range(5):
        command = back_calculated(command, 2.0, 0.25)
    assert command == pytest.approx(2.0 + 8.0 * 0.75**5, rel=1e-15)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_what_was_carried_out_keeps_its_bits(share):
    assert back_calculated(0.1 + 0.2, 0.1 + 0.2, share) == 0.1 + 0.2


def test_with_the_whole_share_the_applied_command_has_its_bits():
    assert back_calculated(25.7, 10.1, 1.0) == 10.1
