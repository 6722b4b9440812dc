"""Claims: an arm adds a memory to a law, which begins in equilibrium.

Oracle: equations of motion with the missing term, integrated by SciPy.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import EffectNames, UserError, stack
from fmus.kit.arms import lag_effect
from fmus.kit.record.compiled import CompiledModel
from tests.support.pushed_mass import ARM_CASES, MASS, SPRING, Tank, follows


@pytest.mark.parametrize("name", sorted(ARM_CASES))
def test_an_arm_in_a_law_is_what_its_formula_says(name):
    follows(*ARM_CASES[name])


@pytest.mark.parametrize("kind", ["lagging", "leading", "play"])
def test_what_remembers_a_state_begins_in_equilibrium_with_it(kind):
    """The level stands at a metre; a memory that began at zero would let a settled part flow."""
    steady = {"inflow": np.full(50, 0.1)}
    remembering = stack(Tank, lag_effect(Tank, "outflow", "level", kind, 5.0, "m^3/s"))
    values = {f"outflow_{kind}": 0.01 if kind != "lagging" else 0.02, "level_start": 1.0}
    values |= {"outlet": 0.08} if kind == "lagging" else {}  # what is remembered flows, too
    found = CompiledModel(remembering).run(np.arange(50.0), steady, values).signals["height"]
    assert found == pytest.approx(np.ones(50), abs=1e-9)


def test_mistakes_are_told_in_one_line():
    with pytest.raises(UserError, match="no arm named 'laging'"):
        lag_effect(MASS, *SPRING, "laging", 1.0)
    with pytest.raises(UserError, match="hysteresis is over a state, which 'force' is not"):
        lag_effect(MASS, "spring_force", "force", "hysteresis", 1.0)


def test_variables_are_named_after_the_law_and_the_effect():
    effect = lag_effect(MASS, *SPRING, "leading", 1.0, names=EffectNames("maxwell"))
    own = "spring_force_maxwell"
    assert list(effect.declared) == [own, f"{own}_constant", f"{own}_state"]
    assert effect.neutral == own
