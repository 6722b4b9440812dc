"""Claims: a result has the effort of each member and of the run; one that was stopped says why."""

from __future__ import annotations

import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.master import run
from tests.support.master.failing import ERROR, TIME, chain, ones


def test_progress_and_statistics(member):
    told = []
    result = run(chain(member), TIME, ones(), progress=told.append)
    assert told == sorted(told)
    assert told[-1] == TIME.size
    statistics = result.statistics
    assert statistics.steps == 50
    assert statistics.rollbacks == statistics.evaluations == 0
    for spent in statistics.components.values():
        assert spent.steps == 50
        assert 0.0 < spent.seconds < statistics.wall
        assert spent.share == pytest.approx(spent.seconds / statistics.wall)
    assert sum(spent.share for spent in statistics.components.values()) < 1.0


def test_a_whole_run_has_all_points_units_and_guids(member):
    result = run(chain(member), TIME, ones())
    assert (result.complete, result.message) == (True, "")
    assert {values.shape for values in result.signals.values()} == {TIME.shape}
    assert set(result.units) == set(result.signals)
    description = zipfile.ZipFile(member).read("modelDescription.xml")
    guid = ElementTree.fromstring(description).get("guid")
    assert set(result.guids.values()) == {guid}


def test_what_was_stopped_is_an_error_that_keeps_the_result_until_then(member):
    with pytest.raises(UserError) as caught:
        run(chain(member, status=ERROR, when=3.0), TIME, ones())
    partial = caught.value.run
    assert (partial.complete, partial.message) == (False, str(caught.value))
    assert np.array_equal(partial.time, TIME[: partial.time.size])
