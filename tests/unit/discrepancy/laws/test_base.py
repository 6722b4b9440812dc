"""Claims: laws are searched with the parameters of the base model, over what it was fitted to, and
effects that are known are made for the record.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit.effects import made_with
from orchestration.discrepancy.diagnosis import diagnose
from orchestration.discrepancy.laws.base import effects_of, search_of
from tests.support.several import OCVS, Cell, several


@pytest.fixture(scope="module")
def diagnosis():
    """Of records of a cell, each with its own open-circuit voltage."""
    records = several("abc", ocvs=OCVS)
    return diagnose(Cell, records, [], {"R1": 0.02}, held=["R1"], each=["ocv"])


def test_a_search_is_for_the_parameters_of_all_runs(diagnosis):
    search = search_of(diagnosis)
    assert search.data is diagnosis.estimation
    assert [run.label for run in search.data.runs] == ["a", "b"]
    assert set(search.parameters) == {"R0", "tau1", "ocv", "relaxed_start"}
    assert len(search.parameters) == 4
    assert search.each == ["ocv"]
    assert search.fixed["R1"] == 0.02


def test_known_effects_are_made_for_the_sampling_of_the_record(diagnosis):
    """The oracle is NumPy; by default they are for a record of 100 s at 10 ms."""
    time = diagnosis.usable.time
    step, duration = np.median(np.diff(time)), np.ptp(time)
    made = [made_with(effect).get("sampling") for effect in effects_of(diagnosis)]
    samplings = [sampling for sampling in made if sampling is not None]
    assert samplings
    for sampling in samplings:
        assert sampling.step == pytest.approx(step, rel=0.05)
        assert sampling.duration == pytest.approx(duration, rel=0.05)
