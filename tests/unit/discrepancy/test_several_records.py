"""Claims: several records are diagnosed as one, with one set of parameters.

Start values are each record's own.

The records are exact solutions of the cell's equations, written without the kit.
"""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.diagnosis import Verdict, diagnose
from orchestration.records.joined import base_name
from tests.support.several import OCVS, STARTS, TRUE, Cell, measured, several

SHARED = ("R0", "R1", "tau1")
NOISE = 1e-3


@pytest.fixture(scope="module")
def diagnosis():
    """Diagnose six records with one open circuit voltage, which is known; two are held out."""
    return diagnose(Cell, several(), [], held=["ocv"])


@pytest.fixture(scope="module")
def differing():
    """Diagnose six records of which every one has an open circuit voltage of its own."""
    return diagnose(Cell, several(ocvs=OCVS), [], each=["ocv"])


def test_parameters_are_of_all_records_and_starts_of_each(diagnosis):
    names = {*SHARED, *(f"relaxed_start@{label}" for label in STARTS)}
    assert set(diagnosis.estimates) == names, "once the gain is known all records are fitted"
    assert {base_name(n) for n in diagnosis.selection.best.problem.names} == {
        *SHARED,
        "relaxed_start",
    }


def test_the_truth_is_found(diagnosis):
    """Every start is another: one for all of them would be off by many times its interval."""
    truth = TRUE | {f"relaxed_start@{label}": start for label, start in STARTS.items()}
    for name, e in diagnosis.estimates.items():
        half = 0.5 * (e.interval[1] - e.interval[0])
        assert e.value == pytest.approx(truth[name], abs=2.0 * half), name
    assert diagnosis.verdict is Verdict.RECALIBRATE
    assert set(diagnosis.changed) == {"R0", "R1", "tau1"}


def test_records_held_out_are_followed_as_closely_as_their_noise_allows(diagnosis):
    validation = diagnosis.validation
    assert [run.label for run in validation.data.runs] == ["e", "f"]
    y = validation.data.measured["voltage"][validation.judged]
    assert diagnosis.before["voltage"] == pytest.approx(NOISE / np.std(y), rel=0.15)


def test_what_differs_from_record_to_record_is_each_its_own_and_no_change(differing):
    for label, ocv in OCVS.items():
        assert differing.estimates[f"ocv@{label}"].value == pytest.approx(ocv, abs=1e-3)
    assert set(differing.changed) <= set(SHARED)
    y = differing.validation.data.measured["voltage"][differing.validation.judged]
    assert differing.before["voltage"] == pytest.approx(NOISE / np.std(y), rel=0.15)


def test_what_differs_without_being_said_so_leaves_an_error():
    records = several("abc", ocvs=OCVS)
    shared = diagnose(Cell, records, [])
    y = shared.validation.data.measured["voltage"][shared.validation.judged]
    assert shared.before["voltage"] > 5.0 * NOISE / np.std(y)


def test_more_records_tell_parameters_more_closely():
    one, four = (
        diagnose(Cell, data, [], held=["ocv"])
        for data in (measured(0, STARTS["a"]), several("abcd"))
    )
    for name in SHARED:
        widths = [
            e.interval[1] - e.interval[0] for e in (one.estimates[name], four.estimates[name])
        ]
        assert widths[1] < 0.7 * widths[0]
