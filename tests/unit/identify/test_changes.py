"""Claims: a change is a row with its verdict, and what is uncertain is not denied."""

from __future__ import annotations

import pytest

from fmus.ppy_actuator import PpyActuator
from orchestration.identify.changes import Change, change_rows, describe_changes

DECLARED = {p.name: p for p in PpyActuator.layout.parameters}


@pytest.mark.parametrize(
    ("changed", "uncertain", "verdict"),
    [(True, False, "changed"), (False, True, "uncertain"), (False, False, "not claimed")],
)
def test_a_change_is_a_row_with_its_verdict(changed, uncertain, verdict):
    change = Change(
        "R1", 0.5, 0.6, (0.4, 0.55), (0.58, 0.7), changed, uncertain, 0.5, DECLARED["R1"]
    )
    assert change_rows([change]) == [["R1", "0.5 ohm", "0.6 ohm", "50.0 %", verdict]]


@pytest.mark.parametrize(
    ("bound", "uncertain", "verdict"),
    [
        (1e-4, False, "unchanged, within 0.01 %"),
        (0.019, False, "unchanged, within 1.9 %"),
        (0.019, False, "not claimed, within 1.9 %"),
        (0.3, False, "not claimed, within 30.0 %"),
        (0.3, True, "uncertain"),
        (1.5, False, "not claimed"),
    ],
)
def test_what_stayed_is_unchanged_within_its_bound(bound, uncertain, verdict):
    ends = (0.9, 1.1), (0.9, 1.1)
    unchanged = verdict.startswith("unchanged")
    one = Change(
        "C", 1.0, 1.0, *ends, False, uncertain, None, DECLARED["C"], "", None, bound, unchanged
    )
    assert change_rows([one])[0][-1] == verdict
    assert (one.to_dict()["bound"], one.to_dict()["unchanged"]) == (bound, unchanged)
    said = "Nothing changed beyond noise. Unchanged: C within 0.01 %."
    assert bound > 1e-3 or describe_changes([one]) == said


def change(name, changed=False, uncertain=False):
    ends = (0.9, 1.1), (1.4, 1.6)
    return Change(name, 1.0, 1.5, *ends, changed, uncertain, 0.5, DECLARED[name])


@pytest.mark.parametrize(
    ("found", "told"),
    [
        ([change("R1")], "Nothing changed beyond noise."),
        ([change("R1", uncertain=True)], "Nothing surely changed. Uncertain: R1."),
        ([change("R1", changed=True), change("C")], "What changed: R1, times 1.5."),
        (
            [change("R1", changed=True), change("C", uncertain=True)],
            "What changed: R1, times 1.5. Uncertain: C.",
        ),
    ],
)
def test_what_is_uncertain_is_not_said_to_be_unchanged(found, told):
    assert describe_changes(found) == told


@pytest.mark.parametrize(
    ("ratio", "told"), [(1.0195, "1.0195"), (0.9982, "0.9982"), (0.947, "0.947"), (2.0, "2")]
)
def test_a_change_is_told_with_its_size_however_small(ratio, told):
    ends = (0.99, 1.01), (0.99 * ratio, 1.01 * ratio)
    one = Change("R1", 1.0, ratio, *ends, True, False, 0.5, DECLARED["R1"])
    assert describe_changes([one]) == f"What changed: R1, times {told}."


@pytest.mark.parametrize(
    ("intervals", "told"),
    [
        (((-0.1, 0.1), (0.9, 1.1)), "What changed: stiction appeared."),
        (((0.9, 1.1), (-0.1, 0.1)), "What changed: stiction vanished."),
        (((0.4, 0.6), (0.9, 1.1)), "What changed: stiction (R1), times 2."),
    ],
)
def test_an_effect_appears_or_vanishes_where_its_strength_may_be_none(intervals, told):
    middle = [sum(ends) / 2.0 for ends in intervals]
    one = Change("R1", *middle, *intervals, True, False, 0.5, DECLARED["R1"], "stiction", 0.0)
    assert describe_changes([one]) == told
    assert one.to_dict()["effect"] == "stiction"
