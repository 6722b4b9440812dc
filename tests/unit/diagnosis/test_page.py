"""Claims: the page has the answer, charts of the record and of the terms, and every table."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orchestration.diagnosis.changes import Changed
from orchestration.diagnosis.law_map import LawEntry, LawMap
from orchestration.diagnosis.readings import Reading, ReadingKind
from orchestration.diagnosis.terms import Shape, Term
from orchestration.identify.changes import Change
from orchestration.reporting import make_page
from tests.support.oscillator import (
    CUBE,
    DRY,
    diagnosis_read_as,
    diagnosis_with,
    misread,
    oscillator_record,
    telling_apart,
    with_group,
)


@pytest.fixture
def dry(tmp_path: Path):
    """A diagnosis whose record is a file, of which the page has a digest."""
    record = oscillator_record(1, dry=1.5)
    source = tmp_path / "rubbing.csv"
    np.savetxt(source, np.column_stack([record.time, *record.signals.values()]))
    return diagnosis_with(replace(record, source=source), (DRY,), (CUBE,))


def test_the_page_of_a_cause(dry):
    html = make_page(dry, "ppy diagnose rubbing.csv --no-laws").html()
    for text in (
        "&gt; 99 % friction over velocity",
        'class="chip cause"',
        "Error on unseen samples, part by part",
        "parameters fitted",
        "with the cause",
        "measured − simulated [m]",
        "added to friction [N]",
        "velocity [m/s]",
        "friction_of_velocity",
        "SHA-256 of rubbing.csv",
        "ppy diagnose rubbing.csv --no-laws",
    ):
        assert text in html
    assert html.count('class="chart"') == 2
    assert "<script" not in html


def test_the_page_shows_what_changed_with_both_intervals(dry):
    declared = dry.subject.problem.model.parameters[1]
    ends = (0.7, 0.9), (-np.inf, np.inf)
    change = Change(declared.name, 0.8, 1.2, *ends, True, False, 0.9, declared)
    source = dry.records[0].source.with_name("later.csv")
    source.write_text("later", encoding="utf-8")
    later = replace(dry, records=(replace(dry.records[0], source=source),))
    html = make_page(Changed(dry, later, (change,))).html()
    for text in (
        "What changed from rubbing.csv to later.csv",
        "What changed: damping, times 1.5.",
        "0.7 … 0.9",
        "not determined",
        "later.csv by itself: ",
        "SHA-256 of later.csv",
        "--compare",
    ):
        assert text in html


def test_the_page_of_a_group_has_the_experiment_that_tells_it_apart(dry):
    experiment = telling_apart("friction(velocity)", "friction(elongation)")
    group = replace(with_group(dry, "ambiguous", 0.6, 0.35), experiment=experiment)
    html = make_page(group).html()
    assert "An experiment that would tell more" in html
    assert "[inputs.force]" in html
    assert "An experiment that would tell more" not in make_page(dry).html()


def test_the_page_of_a_model_that_is_right_shows_no_terms(dry):
    right = diagnosis_with(replace(oscillator_record(1), source=dry.records[0].source), (DRY,))
    html = make_page(right).html()
    assert "Nothing is missing that this record can show" in html
    assert html.count('class="chart"') == 1
    assert "with the cause" not in html
    assert "What the terms add" not in html


def test_the_page_of_a_misread_file_shows_the_corrected_record(dry):
    record = replace(misread(oscillator_record(1), force=-1.0), source=dry.records[0].source)
    reading = Reading(ReadingKind.SIGN, ("force",), factor=-1.0)
    html = make_page(diagnosis_read_as(record, reading)).html()
    for text in (
        "model, file as read",
        "model, file corrected",
        "In the file force has the opposite sign.",
        "Multiply force by −1 (rubbing.csv), and diagnose it again",
    ):
        assert text in html
    for text in ("<th>Memory</th>", "measured, corrected", "with the cause", "What the terms add"):
        assert text not in html


def test_every_set_is_listed_once_by_its_best_fit(dry):
    """A set is fitted again in the noise that it leaves."""
    twice = replace(dry, found=replace(dry.found, fits=2 * dry.found.fits))
    html = make_page(twice).html()
    assert f"{2 * len(dry.found.fits)} fits of sets of terms" in html
    assert html.count(">friction over velocity, a tanh(x/w)</td>") == 1


def test_the_page_of_laws_has_the_map(dry):
    entries = [
        LawEntry(Term("friction", "velocity", Shape.DRY), 140.0),
        LawEntry(Term("friction", "elongation", Shape.CUBE), 3.25),
        LawEntry(Term("spring_force", "force", Shape.CUBE), -2.0),
    ]
    html = make_page(LawMap(dry, tuple(entries)), "ppy laws rubbing.csv").html()
    (table,) = re.findall(r'<table class="heat">.*?</table>', html, re.S)
    assert re.findall(r'<th scope="col"><span>(\w+)</span>', table) == ["velocity", "elongation"]
    assert re.findall(r'<th scope="row">(\w+)</th>', table) == ["friction"]
    assert "friction over velocity, a tanh(x/w): 140.0" in table
    bare = make_page(LawMap(dry, tuple(entries[2:])), "").html()
    assert "No law gains by a term of any signal" in bare
    assert '<table class="heat">' not in bare
