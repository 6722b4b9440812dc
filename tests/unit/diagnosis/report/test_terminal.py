"""Claims: the terminal says the verdict, the ladder, what is left and what to do."""

from __future__ import annotations

from orchestration.diagnosis.changes import Changed
from orchestration.diagnosis.report.content import answer_of, changes_view
from orchestration.diagnosis.report.terminal import comparison, filled, overview
from orchestration.identify.changes import Change
from orchestration.reporting import in_shell
from orchestration.reporting.console import plain_text


def test_the_ladder_falls_with_each_term(dry):
    rows = answer_of(dry).ladder
    assert [row[0] for row in rows][:2] == ["parameters fitted", "+ friction over velocity"]
    errors = [rung.error for rung in dry.ladder]
    assert errors[1] < 0.2 * errors[0]


def test_the_terminal_says_what_is_left_and_what_to_do(dry):
    with in_shell():
        text = plain_text(overview(answer_of(dry)))
    assert text.startswith("cause  ")
    assert "Left in position:" in text
    assert "noise widths" in text
    assert "Next: build the extended model with --fmu extended.fmu" in text
    assert "friction over velocity" in text


def test_what_changed_stands_above_the_later_record_by_itself(dry):
    declared = dry.subject.problem.model.parameters[1]
    ends = (0.7, 0.9), (1.1, 1.3)
    change = Change(declared.name, 0.8, 1.2, *ends, True, False, 0.9, declared)
    with in_shell():
        text = plain_text(comparison(changes_view(Changed(dry, dry, (change,)))))
    assert "What changed: damping, times 1.5." in text
    assert "damping    0.8 N*s/m  1.2 N*s/m  90.0 %  changed" in text
    assert "oscillator_1.csv by itself: cause  > 99 % friction over velocity" in text


def test_a_table_has_no_empty_column(flipped):
    assert filled(("a", "b", "c"), [("1", "", ""), ("2", "", "x")]) == (
        ["a", "c"],
        [("1", ""), ("2", "x")],
    )
    with in_shell():
        text = plain_text(overview(answer_of(flipped)))
    assert "memory" not in text
    assert "+ force has the opposite sign in oscillator_1.csv" in text
