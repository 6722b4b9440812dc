"""Both builds of the actuator with effects laid over it: all at once, and (slow) each alone."""

import pytest

from fmus.kit import stack
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from tests.support.builds import check_that_builds_agree
from tests.support.effect_samples import active, bases, effects


def ranges(base):
    return {"current": (-1.0, 1.3)} | (
        {"force": (0.0, 2.5)} if base is PpyActuator else {"length_change": (0.0, 8e-4)}
    )


@bases
def test_builds_agree_on_all_effects(base, tmp_path):
    cls = stack(base, *EFFECTS.values(), name="everything")
    check_that_builds_agree(cls, active(EFFECTS), ranges(base), tmp_path, steps=20)


@pytest.mark.slow
@bases
@effects
def test_builds_agree_on_each_effect(base, name, tmp_path):
    check_that_builds_agree(stack(base, EFFECTS[name]), active([name]), ranges(base), tmp_path)
