"""Claims: laws are searched with the parameters of the base model, over what it was fitted to."""

from __future__ import annotations

from orchestration.discrepancy.diagnosis import diagnose
from orchestration.discrepancy.laws.base import search_of
from tests.support.several import OCVS, Cell, several


def test_a_search_is_for_the_parameters_of_all_runs():
    records = several("abc", ocvs=OCVS)
    diagnosis = diagnose(Cell, records, [], {"R1": 0.02}, held=["R1"], each=["ocv"])
    search = search_of(diagnosis)
    assert search.data is diagnosis.estimation
    assert [run.label for run in search.data.runs] == ["a", "b"]
    assert set(search.parameters) == {"R0", "tau1", "ocv", "relaxed_start"}
    assert len(search.parameters) == 4
    assert search.each == ["ocv"]
    assert search.fixed["R1"] == 0.02
