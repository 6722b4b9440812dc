"""Claims: the study of intervals hides what its effect is, and counts where it is named.

`python -m studies.judging.coverage` draws records whose hidden term has the form of the effect.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import stack
from fmus.kit.corrections import SignalTerm, correction
from orchestration.fmu import find_model
from studies.clean.disturbances import ON_OUTPUTS
from studies.judging import coverage
from studies.plants import PLANTS


@pytest.mark.parametrize("term", coverage.TERMS, ids=lambda term: f"{term.plant}-{term.law}")
def test_the_effect_has_the_form_of_what_is_hidden(term):
    """Of the law with the effect less the law without it, wherever the model is."""
    cls = find_model(PLANTS[term.plant].model).cls
    signal = SignalTerm(term.signal, scale=term.at)
    effect = correction(cls, term.law, signal, term.shape, term.unit, term.amount)
    strength = term.amount / term.at**term.power
    bare = cls()
    extended = stack(cls, effect)(**{effect.neutral: strength})
    random = np.random.default_rng(1)
    for variable in (*cls.layout.states, *cls.layout.inputs):
        value = random.uniform(-2.0, 2.0)
        setattr(bare, variable.name, value)
        setattr(extended, variable.name, value)
    x = getattr(bare, term.signal)
    x = x() if callable(x) else x
    more = getattr(extended, term.law)() - getattr(bare, term.law)()
    assert more == pytest.approx(term.amount * term.form(x / term.at))


def test_every_kind_of_noise_has_its_turn():
    drawn = coverage.cases(80, 1)
    assert {case.noise for case in drawn} == set(ON_OUTPUTS)
    assert {case.term for case in drawn} == set(range(len(coverage.TERMS)))
