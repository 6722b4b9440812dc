"""Claims: a run is drawn, and one without points says that there is nothing."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fmus.kit import UserError
from orchestration.master import run
from tests.support.master.failing import TIME, chain, ones


def test_a_run_is_drawn_and_one_without_points_says_that_there_is_nothing(member):
    result = run(chain(member), TIME, ones())
    drawn = {axis.get_ylabel().partition("\n")[0] for axis in result.plot().axes}
    assert drawn == {name.replace("_", " ") for name in result.signals}
    empty = replace(result, time=TIME[:0], signals=dict.fromkeys(result.signals, TIME[:0]))
    with pytest.raises(UserError, match="the run has no points or no signals"):
        empty.plot()
    assert list(empty._repr_mimebundle_()) == ["text/html"]
