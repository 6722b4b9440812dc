"""Claims: an effect brings no laws of one actuator, so that it can be laid over either."""

import pytest

from fmus.kit import Effect
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.effects.base import ActuatorEffect
from fmus.ppy_actuator.model import Actuator


def test_the_base_is_the_plain_one_when_it_runs():
    """The laws of the actuator are its own for a type checker only."""
    assert ActuatorEffect is Effect


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_is_no_actuator(name):
    assert not issubclass(EFFECTS[name], Actuator)
