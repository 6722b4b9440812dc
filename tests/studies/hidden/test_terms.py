"""Claims: a hidden term adds what it says to its law, and every kind of noise has its turn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from studies.clean import Case, draw
from studies.clean.disturbances import ON_OUTPUTS
from studies.hidden import TermCase, cases_of_terms, draw_term
from studies.hidden.terms import TERMS


def test_every_kind_of_noise_and_every_term_has_its_turn():
    drawn = cases_of_terms(80, 1)
    assert {case.noise for case in drawn} == set(ON_OUTPUTS)
    assert {case.term for case in drawn} == set(range(len(TERMS)))
    assert drawn == cases_of_terms(80, 1)


def test_a_cell_drops_by_the_modulus_of_its_current():
    """Ohm's law with another resistance each way: the drop is subtracted from the voltage."""
    term = next(k for k, one in enumerate(TERMS) if one.plant == "Cell")
    case = TermCase("Cell", "triangle", "Gaussian", 5, term=term, strength=0.5)
    less = (
        draw(Case("Cell", "triangle", "Gaussian", 5)).clean["voltage"]
        - (lacking := draw_term(case)).clean["voltage"]
    )
    assert less == pytest.approx(0.5 * 0.03 * np.abs(lacking.inputs["current"]) / 2.0, abs=1e-9)


@pytest.mark.parametrize("term", range(len(TERMS)))
def test_strength_zero_hides_nothing(term):
    case = TermCase(TERMS[term].plant, "multisine", "Gaussian", 5, term=term)
    clean = draw(Case(TERMS[term].plant, "multisine", "Gaussian", 5)).clean
    none, some = (draw_term(replace(case, strength=s)).clean for s in (0.0, 1.0))
    for output, y in clean.items():
        assert np.max(np.abs(none[output] - y)) < 1e-4 * np.ptp(y)
    assert any(np.max(np.abs(some[o] - y)) > 1e-3 * np.ptp(y) for o, y in clean.items())
