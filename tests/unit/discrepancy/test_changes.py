"""Claims: of two records of one specimen, the changes are told, and nothing else.

The records are exact solutions of the cell's equations, written without the kit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from orchestration.discrepancy.candidates.candidate import Candidate
from orchestration.discrepancy.changes import AFTER, BEFORE, find_changes
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.identify.changes import change_rows
from tests.support.pace import slow_but
from tests.support.several import TRUE, Cell, measured

PARAMETERS = ("ocv", "R0", "R1", "tau1")
FACTORS = {"R0": 1.3, "R1": 2.0, "tau1": 0.5}


def changes_between(records):
    """Return the parameters of a cell in two records, with starts of each record's own."""
    return find_changes(
        Candidate((), Cell),
        Dataset.joined(records),
        parameters=PARAMETERS,
        own=["relaxed_start"],
        fixed={},
    )


def changes_of(seed, **after):
    """Compare two records that started differently and were driven differently."""
    records = {BEFORE: measured(2 * seed, 3.0), AFTER: measured(2 * seed + 1, -4.0, **after)}
    return changes_between(records)


@pytest.mark.parametrize("seed", slow_but(range(20, 23), 20))
@pytest.mark.parametrize("name", FACTORS)
def test_one_parameter_that_changed_is_claimed_alone(name, seed):
    compared = changes_of(seed, **{name: FACTORS[name] * TRUE[name]})
    assert [change.name for change in compared if change.changed] == [name]
    (change,) = [change for change in compared if change.changed]
    assert change.before == pytest.approx(TRUE[name], rel=0.1)
    assert change.after == pytest.approx(FACTORS[name] * TRUE[name], rel=0.1)
    assert change.before_interval[0] < TRUE[name] * 1.05
    assert change.gain > 0.5
    assert {change.name for change in compared} == set(PARAMETERS)


@pytest.mark.parametrize("seed", slow_but(range(30, 36), 30, 31, 32))
def test_where_nothing_changed_nothing_is_claimed(seed):
    assert not [change for change in changes_of(seed) if change.changed]


def test_of_nothing_no_share_is_told():
    compared = changes_of(31)
    assert [change.gain for change in compared] == [None] * len(PARAMETERS)
    assert {row[3] for row in change_rows(compared)} == {""}


def test_two_that_changed_are_both_claimed():
    compared = changes_of(40, R1=2.0 * TRUE["R1"], R0=1.3 * TRUE["R0"])
    assert {change.name for change in compared if change.changed} == {"R0", "R1"}


@pytest.mark.parametrize("seed", slow_but(range(50, 53), 50))
def test_what_the_model_lacks_in_both_records_is_no_change(seed):
    """Add a cubic resistance: it bends every parameter a little, and otherwise in each record."""
    records = {
        BEFORE: measured(2 * seed, 3.0),
        AFTER: measured(2 * seed + 1, -4.0, R1=3.0 * TRUE["R1"]),
    }
    bent = {}
    for k, (label, record) in enumerate(records.items()):
        current = record.inputs["current"]
        voltage = record.measured["voltage"] - (0.002 + 0.001 * k) * current**3
        bent[label] = replace(record, measured={"voltage": voltage})
    compared = changes_between(bent)
    assert [change.name for change in compared if change.changed] == ["R1"]


def scattering(seed, start, **other):
    """Return a record with a resistance that differs by 20 % between ten stretches.

    On average it is the same.
    """
    record = measured(seed, start, **other)
    parts = 0.2 * TRUE["R0"] * np.random.default_rng(900 + seed).standard_normal(10)
    more = np.repeat(parts - parts.mean(), len(record.time) // 10)
    return replace(
        record, measured={"voltage": record.measured["voltage"] - more * record.inputs["current"]}
    )


def resistance(seed, factor):
    records = {
        BEFORE: scattering(2 * seed, 3.0),
        AFTER: scattering(2 * seed + 1, -4.0, R0=factor * TRUE["R0"]),
    }
    compared = changes_between(records)
    return [change for change in compared if change.changed], [
        change.name for change in compared if change.uncertain
    ]


@pytest.mark.slow
def test_what_is_not_alike_within_a_record_is_no_change_between_two():
    """Grant 1 % to chance, which makes them all.

    By the noise alone one in six is beyond five standard errors.
    """
    compared = [resistance(seed, 1.0) for seed in range(60, 84)]
    assert sum(bool(claimed) for claimed, _ in compared) <= 1
    assert sum(bool(uncertain) for _, uncertain in compared) >= 2


def test_what_changed_by_more_than_within_a_record_is_told():
    claimed, _ = resistance(70, 2.0)
    assert [change.name for change in claimed] == ["R0"]
    low, high = claimed[0].after_interval
    assert low < 2.0 * TRUE["R0"] < high
