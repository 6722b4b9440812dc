"""Claims: an interrupted search goes on from its points, to the same front, without running what
was run; a folder is of one search.
"""

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.journal import count_done
from orchestration.sweeps.pareto import Objectives, pareto_front

SEARCH = {"count": 7, "samples": 32}


def press_at(level):
    def progress(done, whole):
        if done >= level:
            raise KeyboardInterrupt

    return progress


@pytest.mark.slow
@pytest.mark.parametrize("level", [1, 3, 7])
def test_an_interrupted_search_goes_on_to_the_same_front(bells, level, tmp_path, monkeypatch):
    whole = pareto_front(bells, **SEARCH)
    folder = tmp_path / "part"
    bells.evaluations = 0
    with pytest.raises(KeyboardInterrupt):
        pareto_front(bells, **SEARCH, progress=press_at(level), folder=folder)
    done, of = count_done(folder)
    assert (done, of) == (32 + 4 + level if level < 7 else of, 32 + 14)
    runs = []
    run = Objectives.evaluate
    monkeypatch.setattr(Objectives, "evaluate", lambda self, s: runs.append(1) or run(self, s))
    bells.evaluations = 0
    again = pareto_front(bells, **SEARCH, folder=folder)
    np.testing.assert_array_equal(again.values, whole.values)
    for name in whole.parameters:
        np.testing.assert_array_equal(again.parameters[name], whole.parameters[name])
    assert again.evaluations == whole.evaluations
    assert len(runs) < 0.8 * whole.evaluations
    assert count_done(folder) == (of, of)


def test_an_interrupt_within_the_sample_keeps_what_was_run(bells, tmp_path, monkeypatch):
    worst = Objectives.worst
    runs = []

    def few(self, shares):
        runs.append(1)
        if len(runs) > 20:
            raise KeyboardInterrupt
        return worst(self, shares)

    monkeypatch.setattr(Objectives, "worst", few)
    with pytest.raises(KeyboardInterrupt):
        pareto_front(bells, **SEARCH, folder=tmp_path / "part")
    assert count_done(tmp_path / "part") == (20, 46)


@pytest.mark.parametrize(
    ("change", "said"),
    [({"seed": 1}, "not the same: the search"), ({"samples": 64}, "not the same: the search")],
)
def test_a_folder_is_of_one_search(decay, change, said, tmp_path):
    pareto_front(decay, samples=32, folder=tmp_path / "part")
    with pytest.raises(UserError, match=rf"is of another optimisation \({said}"):
        pareto_front(decay, **{"samples": 32} | change, folder=tmp_path / "part")


def test_other_objectives_are_another_search(bells, tmp_path):
    pareto_front(bells, **SEARCH, folder=tmp_path / "part")
    bells.objectives.reverse()
    with pytest.raises(UserError, match=r"\(not the same: the objectives\)"):
        pareto_front(bells, **SEARCH, folder=tmp_path / "part")


def test_without_a_folder_nothing_stays(decay, scratch):
    pareto_front(decay, samples=32)
    assert list(scratch.iterdir()) == []
