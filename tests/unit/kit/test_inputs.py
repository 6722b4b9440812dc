"""Claims: an effect of an input passes on what its formula says.

Oracle: equations of motion with that input, integrated by SciPy.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import UserError, stack
from fmus.kit.inputs import (
    dead_zone,
    input_offset,
)
from tests.support.pushed_mass import BASE, INPUT_CASES, MASS, M, follows


@pytest.mark.parametrize("name", sorted(INPUT_CASES))
def test_an_input_arrives_as_its_formula_says(name):
    follows(*INPUT_CASES[name])


def test_effects_on_one_input_follow_one_another():
    """The first is next to the command: an offset before a dead zone, and behind it."""
    for effects, expected in (
        (
            (input_offset(MASS, "force"), dead_zone(MASS, "force")),
            lambda u: (u + 1.0) - np.clip(u + 1.0, -2.0, 2.0),
        ),
        (
            (dead_zone(MASS, "force"), input_offset(MASS, "force")),
            lambda u: u - np.clip(u, -2.0, 2.0) + 1.0,
        ),
    ):
        model = stack(MASS, *effects)(**BASE, force_input_offset=1.0, force_dead_zone=2.0)
        for force in (-5.0, -1.5, 0.5, 4.0):
            model.force = force
            assert model.rates()[1] == pytest.approx(expected(force) / M)


def test_an_input_that_is_none_is_refused():
    with pytest.raises(UserError, match="mass_spring_damper: no real input named 'voltage'"):
        dead_zone(MASS, "voltage")
