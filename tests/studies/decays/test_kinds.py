"""Claims: what is hidden in a decay changes it by more than noise, and is zero in a clean one."""

from __future__ import annotations

import numpy as np
import pytest

from studies.decays import KINDS
from studies.decays.models import decays


@pytest.mark.parametrize("name", KINDS)
def test_a_hidden_law_acts_and_is_none_of_the_model(name):
    """Oracle: the model's own rates, at parameters and states of the specimen."""
    kind = KINDS[name]
    model = getattr(decays, kind.model)()
    state = np.array([0.7 * high + 0.3 * low for low, high in kind.starts])
    for own, value in kind.nominal.items():
        setattr(model, own, value)
    states = [s.name for s in model.layout.states]
    for own, value in zip(states, state, strict=False):
        setattr(model, own, value)
    clean = kind.rates(state, kind.nominal, 0.0)[: len(states)]
    assert clean == pytest.approx(model.rates(), rel=1e-9)
    if name != "recovery":  # of which the hidden element has a state
        assert kind.rates(state, kind.nominal, kind.hidden) != pytest.approx(clean, rel=1e-3)
