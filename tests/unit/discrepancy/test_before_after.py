"""Claims: a later record is diagnosed as the one before was, or refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration.discrepancy.before_after import compare
from orchestration.discrepancy.pipeline import DiagnosisOptions, diagnose_only
from orchestration.fmu.model import model_of
from orchestration.records import Record
from tests.support.several import TRUE, Cell, measured

OPTIONS = DiagnosisOptions(effects=[], hold=["ocv"])


def record_of(name: str, seed: int, start: float, **other: float) -> Record:
    """Write down a record of a cell as if it had been read from a file."""
    data = measured(seed, start, **other)
    return Record(
        data.time, data.inputs | data.measured, {"current": "A", "voltage": "V"}, Path(name)
    )


@pytest.fixture(scope="module")
def before():
    return diagnose_only(record_of("before.csv", 3, 4.0), model_of(Cell), options=OPTIONS)


def test_what_changed_is_told_with_the_later_diagnosis(before):
    after = record_of("after.csv", 4, -2.0, R0=2.0 * TRUE["R0"])
    compared = compare(before, after, OPTIONS)
    (change,) = [change for change in compared.changes if change.changed]
    assert change.name == "R0"
    assert change.after == pytest.approx(2.0 * TRUE["R0"], rel=0.1)
    assert "ocv" not in {change.name for change in compared.changes}, "it is held"
    assert compared.later.records == [after]
    assert compared.later.gain is None
    assert compared.later.diagnosis.estimates["R0"].value == pytest.approx(change.after, rel=0.1)


def test_a_change_that_time_did_not_allow_to_look_for_is_not_denied(before):
    after = record_of("after.csv", 4, -2.0, R0=2.0 * TRUE["R0"])
    compared = compare(before, after, replace(OPTIONS, time=1e-6))
    assert compared.notes
    assert all(change.changed or change.uncertain for change in compared.changes)


def test_a_record_without_an_output_of_the_one_before_is_refused(before):
    after = record_of("after.csv", 4, -2.0)
    lost = replace(after, signals={"current": after.signals["current"]})
    with pytest.raises(
        UserError, match=r"after\.csv: it lacks an output of the record before, voltage"
    ):
        compare(before, lost, OPTIONS)


def test_the_same_record_is_refused_however_it_is_written(before):
    """On another clock, and rounded: noise is never the same."""
    record = before.record
    signals = {n: np.array([float(f"{x:.8g}") for x in v]) for n, v in record.signals.items()}
    same = replace(record, time=record.time + 100.0, signals=signals, source=Path("same.csv"))
    with pytest.raises(UserError, match=r"same\.csv: this is the same record as before\.csv"):
        compare(before, same, OPTIONS)
