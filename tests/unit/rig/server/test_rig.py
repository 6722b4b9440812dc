"""Claims: ages are those of the rig's clock, of values that are there; a backend is named once."""

from __future__ import annotations

import pytest

from orchestration.rig.server.rig import RigState, cannot_open
from orchestration.rig.server.settings import ServerSettings


def test_a_value_has_an_age_and_where_there_is_none_there_is_no_age():
    state = RigState(3, (0.0,), (None,), (1.5, None, 0.0), (9.75, 0.0, 10.0), 0)
    assert state.ages(10.25) == [0.5, None, 0.25]


def test_no_value_is_of_the_future():
    """Taken while the age was being asked for."""
    assert RigState(1, (), (), (1.0,), (10.0,), 0).ages(9.9) == [0.0]


@pytest.mark.parametrize("reason", ["it is in use", "backend own.py:Own: it is in use"])
def test_the_backend_is_named_once(reason):
    error = cannot_open(ServerSettings("own.py:Own"), reason)
    assert str(error) == "backend own.py:Own: it is in use"
