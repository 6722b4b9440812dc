"""Claims: an arm adds a memory to a law, which begins in equilibrium.

Oracle: equations of motion with the missing term, integrated by SciPy.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import UserError, stack
from fmus.kit.arms import lag_effect
from fmus.kit.curves import EffectNames
from fmus.kit.record.compiled import CompiledModel
from tests.support.pushed_mass import ARM_CASES, MASS, SPRING, Tank, follows


@pytest.mark.parametrize("name", sorted(ARM_CASES))
def test_an_arm_in_a_law_is_what_its_formula_says(name):
    follows(*ARM_CASES[name])


def test_what_remembers_a_state_begins_in_equilibrium_with_it():
    """The level stands at a metre; a memory that began at zero would let a settled part flow."""
    steady = {"inflow": np.full(50, 0.1)}
    remembering = stack(Tank, lag_effect(Tank, "outflow", "level", "lagging", 5.0, "m^3/s"))
    values = {"outflow_lagging": 0.02, "level_start": 1.0, "outlet": 0.08}
    found = CompiledModel(remembering).run(np.arange(50.0), steady, values).signals["height"]
    assert found == pytest.approx(np.ones(50), abs=1e-9)


def test_mistakes_are_told_in_one_line():
    with pytest.raises(UserError, match="no arm named 'laging'"):
        lag_effect(MASS, *SPRING, "laging", 1.0)


def test_variables_are_named_after_the_law_and_the_effect():
    effect = lag_effect(MASS, *SPRING, "lagging", 1.0, names=EffectNames("creep"))
    own = "spring_force_creep"
    assert list(effect.declared) == [own, f"{own}_constant", f"{own}_state"]
    assert effect.neutral == own


def test_the_mean_of_a_square_is_not_below_zero():
    heat = lag_effect(MASS, "spring_force", "velocity", "warming", 0.1)
    (start,) = [p for p in heat.layout.parameters if p.starts]
    assert start.min == 0.0
