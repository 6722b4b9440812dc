"""Claims: every set of terms is listed once, in its best fit, the best set first."""

from __future__ import annotations

from dataclasses import replace

import pytest

from orchestration.diagnosis.report.tried import tried_sets


def test_sets_are_listed_once_the_best_first(dry):
    sets = list(tried_sets(dry))
    ranked = dry.found.compared()
    assert len({one.parts for one in sets}) == len(sets) == len(ranked)
    assert [one.score for one in sets] == [one.score for one in ranked]
    best = sets[0]
    assert best.parts == "friction over velocity, a tanh(x/w)"
    assert best.fitted == pytest.approx(ranked[0].comparison.fitted)
    assert best.error == pytest.approx(dry.error(ranked[0].judged))
    doubled = replace(dry, found=replace(dry.found, fits=(*dry.found.fits, *dry.found.fits)))
    assert list(tried_sets(doubled)) == sets
