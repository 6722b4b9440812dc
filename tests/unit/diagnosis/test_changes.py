"""Claims: of two records of one specimen it is said what changed, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.diagnosis import Options
from orchestration.diagnosis.changes import (
    Changed,
    changes_between,
    changes_in_time,
    find_changes,
)
from orchestration.diagnosis.engine import Diagnosis
from orchestration.diagnosis.report import changes_view
from orchestration.identify.changes import describe_changes
from tests.support.oscillator import DRY, diagnosis_with, oscillator_record

PARAMETERS = {"mass", "damping", "stiffness"}


def diagnosed(seed: int, dry: float = 0.0, damping: float = 0.8) -> Diagnosis:
    return diagnosis_with(oscillator_record(seed, dry=dry, damping=damping), (DRY,))


def told(changed: Changed) -> dict[str, tuple[float, float]]:
    """Return what changed, with its values."""
    return {one.name: (one.before, one.after) for one in changed.changes if one.changed}


@pytest.fixture(scope="module")
def right() -> Diagnosis:
    return diagnosed(1)


@pytest.fixture(scope="module")
def rubbing() -> Diagnosis:
    return diagnosed(2, dry=1.5)


@pytest.fixture(scope="module")
def damped(right: Diagnosis) -> Changed:
    return changes_between(right, diagnosed(2, damping=1.2))


def test_a_parameter_that_differs_is_told_with_both_values(damped):
    """The damping that the records were integrated with."""
    ((name, values),) = told(damped).items()
    assert name == "damping"
    assert values == pytest.approx((0.8, 1.2), rel=2e-3)
    first = damped.changes[0]
    assert first.before_interval[0] < 0.8 < first.before_interval[1]
    assert first.after_interval[0] < 1.2 < first.after_interval[1]
    assert first.gain == pytest.approx(1.0, abs=0.01)
    assert {one.name for one in damped.changes} == PARAMETERS
    assert not any(one.uncertain for one in damped.changes)
    said = describe_changes(damped.changes)
    assert said.startswith("What changed: damping, times 1.5. Unchanged: mass within 0.0")


def test_a_bound_is_by_the_difference_and_both_intervals(damped):
    """Those of two records are independent: their deviations add up as squares do."""
    for one in damped.changes:
        if one.unchanged:
            ends = np.log([one.before_interval, one.after_interval])
            half = float(np.hypot(*(np.diff(ends, axis=1)[:, 0] / 2.0)))
            change = abs(np.log(one.after / one.before))
            assert one.bound == pytest.approx(change + half, rel=0.02), one.name
    assert [one.name for one in damped.changes if one.unchanged] == ["mass", "stiffness"]


@pytest.mark.slow
def test_several_later_records_are_compared_in_time(right):
    records = [oscillator_record(seed, damping=d) for seed, d in ((2, 0.8), (3, 0.9), (4, 1.2))]
    changed = changes_in_time(right, records, Options(effects=[], laws=False))
    assert [told(one).keys() for one in changed.in_time] == [set(), {"damping"}, {"damping"}]
    shown = changes_view(changed)
    assert [row[0] for row in shown.rows[:3]] == [
        f"damping, oscillator_{seed}.csv" for seed in (2, 3, 4)
    ]
    verdicts = [row[-1] for row in shown.rows[:3]]
    assert verdicts[0].startswith("unchanged, within 0.")
    assert verdicts[1:] == ["changed", "changed"]
    assert len(shown.rows) == len(shown.intervals) == 9
    assert shown.after == "oscillator_4.csv"
    assert "oscillator_3.csv: What changed: damping, times 1.1" in shown.text


def test_where_nothing_differs_nothing_is_told(right):
    changed = changes_between(right, diagnosed(2))
    assert not told(changed)
    assert {one.gain for one in changed.changes} == {None}
    assert describe_changes(changed.changes).startswith("Nothing changed beyond noise. Unchanged")
    assert all(one.unchanged for one in changed.changes)


def test_a_cause_of_the_later_record_alone_has_appeared(right, rubbing):
    changed = changes_between(right, rubbing)
    ((name, (before, after)),) = told(changed).items()
    assert name == "friction_of_velocity"
    assert (before, after) == pytest.approx((0.0, 1.5), abs=0.01)
    first = changed.changes[0]
    assert (first.effect, first.unit, first.neutral) == ("friction(velocity)", "N", 0.0)
    assert first.lacking == (True, False)


def test_a_cause_of_the_earlier_record_alone_has_vanished(right, rubbing):
    gone = changes_between(rubbing, right)
    said = describe_changes(gone.changes)
    assert said.startswith("What changed: friction(velocity) vanished. Unchanged: mass")


def test_a_cause_of_both_that_is_as_strong_has_not_changed(rubbing):
    changed = changes_between(diagnosed(1, dry=1.5, damping=1.2), rubbing)
    assert told(changed).keys() == {"damping"}
    (rubs,) = [one for one in changed.changes if one.effect]
    assert not rubs.uncertain
    assert rubs.before == pytest.approx(1.5, rel=0.02)


def test_what_each_record_has_of_its_own_is_no_change(right):
    changed = changes_between(right, diagnosed(2, damping=1.2), Options(each=["damping"]))
    assert not told(changed)
    assert {one.name for one in changed.changes} == PARAMETERS - {"damping"}


def test_what_could_not_be_tried_in_time_is_not_denied(right):
    changed = changes_between(right, diagnosed(2, damping=1.2), Options(time=1e-9))
    assert not told(changed)
    assert {one.name for one in changed.changes if one.uncertain} == {"damping"}


def test_a_later_record_is_diagnosed_by_itself(right):
    after = oscillator_record(2, damping=1.2)
    changed = find_changes(right, after, Options(effects=[], laws=False))
    assert changed.later.records == (after,)
    assert changed.later.verdict == "recalibrate"
    assert changed.later.parameters["damping"].value == pytest.approx(1.2, rel=2e-3)
    assert told(changed).keys() == {"damping"}


def test_a_later_record_without_an_output_or_samples_is_refused_with_its_name(right):
    record = oscillator_record(2)
    lost = replace(record, signals={"force": record.signals["force"]})
    only = Options(effects=[], laws=False)
    said = r"compare.*oscillator_2\.csv.*: no record has any of position"
    with pytest.raises(UserError, match=said):
        find_changes(right, lost, only)
