"""Claims: a fit of a curve ends in one place, whatever it starts from."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import pytest

from orchestration.discrepancy.laws import fit
from orchestration.discrepancy.laws.base import search_of
from orchestration.discrepancy.laws.fit import CurveFit
from orchestration.discrepancy.laws.fitting import Fitting
from orchestration.discrepancy.laws.map import LawMap
from orchestration.identify.fitting.least_squares import Minimum, SearchEndedError


@pytest.mark.slow
def test_a_fit_starts_from_the_nearest_of_its_starts(drag):
    """Of values far off and of those that go with the curve the latter are taken, in whatever order
    they come.
    """
    _, diagnosis = drag
    base, search = diagnosis.selection.base, search_of(diagnosis)
    found = LawMap(search, base)
    best = found.entries()[0]
    far = {"damping": 1e3 * base.fit.values["damping"]}
    made = CurveFit(search, base, Fitting(search, base, found).effect(best), best.basis)
    fits = [
        made.settled(made.first(starts, best.curve, found.floor))
        for starts in ([found.beside(best)], [far, found.beside(best)], [found.beside(best), far])
    ]
    assert fits[1].criterion == pytest.approx(fits[0].criterion, abs=0.1)
    assert fits[2].criterion == pytest.approx(fits[0].criterion, abs=0.1)


def test_a_fit_begins_with_less_of_a_curve_where_the_map_is_far_off(drag):
    """From a curve three thousand times as large, and the other way, it ends where it ends from the
    right one.
    """
    _, diagnosis = drag
    base, search = diagnosis.selection.base, search_of(diagnosis)
    found = LawMap(search, base)
    best = next(e for e in found.entries() if e.key == ("friction", "omega", "", "add"))
    made = CurveFit(search, base, Fitting(search, base, found).effect(best), best.basis)
    much = replace(best.curve, values=-3000.0 * best.curve.values)
    right, wrong = (
        made.settled(made.first([base.fit.values], c, found.floor)) for c in (best.curve, much)
    )
    assert base.fit.bic - right.criterion > 200.0
    assert wrong.criterion == pytest.approx(right.criterion, abs=2.0)


def test_a_fit_that_comes_nowhere_near_is_given_up(drag, monkeypatch):
    """In noise of a thousandth of its size nothing explains the record, and a search ends though it
    might go on; in noise a thousand times as large it does not.
    """
    _, diagnosis = drag
    base, search = diagnosis.selection.base, search_of(diagnosis)
    found = LawMap(search, base)
    best = found.entries()[0]
    made = CurveFit(search, base, Fitting(search, base, found).effect(best), best.basis)
    began = made.first([base.fit.values], best.curve, found.floor)
    ended = []

    def search_for_ever(residual, jacobian, begin, *bounds, trials):
        points = 0
        with suppress(SearchEndedError):
            while points < trials:
                residual(begin)
                points += 1
        ended.append(points)
        return Minimum(begin, False)

    monkeypatch.setattr(fit, "minimise", search_for_ever)
    for factor, points in ((1e-3, 21), (1e3, 200)):
        noise = {o: replace(n, deviation=factor * n.deviation) for o, n in began.noise.items()}
        made.settled(replace(began, noise=noise))
        assert ended[0] == points
        ended.clear()
