"""Claims: where samples are missing for long, a record begins anew.

Its inputs in between decide nothing.

The records are exact solutions of the cell's equations, written without the kit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from orchestration.discrepancy.data.dataset import PIECE, Dataset
from orchestration.discrepancy.data.holdout import ValidationData
from orchestration.discrepancy.diagnosis import Verdict, diagnose
from orchestration.discrepancy.pipeline import DiagnosisOptions
from orchestration.discrepancy.pipeline import diagnose as diagnosed
from orchestration.discrepancy.report.tables import run_errors
from orchestration.fmu.model import find_model
from tests.support.diagnosis import rig_record
from tests.support.several import STEP, TRUE, Cell, current, measured, voltage

SAMPLES = 900
WHOLE = measured(3, 4.0, samples=SAMPLES)


def without(*missing: tuple[int, int]) -> Dataset:
    """Return the record, some of its samples being missing."""
    kept = np.ones(SAMPLES, dtype=bool)
    for first, last in missing:
        kept[first:last] = False
    return WHOLE.where(kept)


def joined(data: Dataset, label: str = "") -> Dataset:
    pieces = data.pieces(label)
    return Dataset.joined(pieces, dict.fromkeys(pieces, "it"))


def test_what_follows_a_gap_starts_where_it_then_was():
    diagnosis = diagnose(Cell, joined(without((300, 450))), [], TRUE, held=["ocv"])
    assert diagnosis.verdict is Verdict.CONSISTENT
    truth = current(3, SAMPLES)
    state = (3.3 - TRUE["R0"] * truth - voltage(truth, 4.0, 3.3, **TRUE)) / TRUE["R1"]
    for name, true in {"relaxed_start@1": state[0], "relaxed_start@2": state[450], **TRUE}.items():
        if name == "ocv":
            continue
        e = diagnosis.estimates[name]
        assert e.value == pytest.approx(true, abs=e.interval[1] - e.interval[0]), name
    assert {choice.linear for choice in diagnosis.intersample.values()} == {False}


def test_a_record_that_is_complete_or_comes_in_bursts_stays_as_it_is():
    assert list(WHOLE.pieces("a")) == ["a"]
    assert without(*((k, k + 20) for k in range(10, SAMPLES, 30))).pieces().keys() == {""}
    few = without((100, 120), (100 + PIECE, 200))
    assert [len(part.time) for part in few.pieces("a").values()] == [100, SAMPLES - 200]
    assert list(few.pieces("a")) == ["a.1", "a.2"]


@pytest.mark.parametrize(
    ("missing", "fitted"),
    [
        ([(300, 450)], [300, 200]),  # 750 are left, of which 500 are fitted to
        ([(60, 160)], [60, 473]),
        ([(600, 650), (750, 780)], [547]),
        ([(560, 640)], [560]),  # and so would what is left of the first
        ([(540, 640)], [540]),  # what was left of the second piece would be too short
    ],
)
def test_the_last_third_is_held_out_wherever_the_gaps_are(missing, fitted):
    data = joined(without(*missing))
    estimation, validation = ValidationData.split(data)
    assert [run.last - run.first for run in estimation.runs] == fitted
    both = int(estimation.within.sum() + validation.data.within.sum())
    assert both == int(data.within.sum())
    assert not validation.continued
    assert np.ptp(validation.data.time[validation.data.runs[0].samples]) > STEP * PIECE


def test_of_several_records_whole_ones_are_held_out():
    records = {"a": without((300, 450)), "b": WHOLE, "c": without((200, 300), (400, 500))}
    pieces = {
        label: part for name, data in records.items() for label, part in data.pieces(name).items()
    }
    of = {label: label[0] for label in pieces if "." in label}
    estimation, validation = ValidationData.split(Dataset.joined(pieces, of))
    assert [run.label for run in estimation.runs] == ["a.1", "a.2", "b"]
    assert [run.label for run in validation.data.runs] == ["c.1", "c.2", "c.3"]


def test_a_file_with_a_gap_is_diagnosed_as_two_runs_and_one_without_has_nothing_of_its_own():
    record, actuator = rig_record(), find_model("ppy_actuator")
    kept = np.r_[0:500, 700:1500]
    cut = replace(
        record, time=record.time[kept], signals={n: v[kept] for n, v in record.signals.items()}
    )
    estimates = diagnosed(cut, actuator, options=DiagnosisOptions(effects=[])).diagnosis.estimates
    assert {"R1", "charge_start@1", "charge_start@2"} <= estimates.keys()
    whole = diagnosed(record, actuator, options=DiagnosisOptions(effects=[], each=["R1"]))
    assert "R1" in whole.diagnosis.estimates
    assert not [name for name in whole.diagnosis.estimates if "@" in name]
    assert run_errors(whole) == [], "a record by itself is told once"
