"""The stretch of a long record that a search sees: lively, or where a model is worst."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.data import stretch as stretches
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.stretch import (
    longer_stretch,
    searched_stretch,
    stretch_notes,
    worst_stretch,
)
from orchestration.discrepancy.note import NoteCode


@pytest.fixture(autouse=True)
def sizes(monkeypatch):
    """A record of two thousand samples is a long one."""
    monkeypatch.setattr(stretches, "LONG", 500)
    monkeypatch.setattr(stretches, "_SIZES", (200, 400))


def record(moving: slice = slice(None), samples: int = 2000) -> Dataset:
    """An input that steps at every sample of a part, and an output that is noise."""
    random = np.random.default_rng(7)
    u = np.zeros(samples)
    u[moving] = random.choice([-1.0, 1.0], samples)[moving]
    return Dataset(0.1 * np.arange(samples), {"u": u}, {"y": random.standard_normal(samples)})


def span(data: Dataset) -> tuple[float, int]:
    """Where a stretch begins, s, and its samples."""
    return float(data.time[0]), len(data.time)


def test_a_short_record_is_searched_as_it_is():
    data = record(samples=500)
    assert searched_stretch(data) is data
    assert stretch_notes(data, data) == []


def test_a_lively_record_is_searched_where_it_begins():
    assert span(searched_stretch(record())) == (0.0, 200)


def test_a_record_that_rests_at_first_is_searched_where_it_moves():
    first, count = span(searched_stretch(record(slice(1000, None))))
    assert (count, first >= 85.0) == (200, True)


def test_a_stretch_has_samples_of_every_output():
    data = record()
    data.measured["z"] = np.where(data.time < 100.0, np.nan, data.measured["y"])
    first, count = span(searched_stretch(data))
    assert (count, first > 80.0) == (200, True)


def test_where_an_output_is_nowhere_all_is_searched():
    data = record()
    data.measured["z"] = np.where(np.arange(2000) % 300, np.nan, 0.0)
    assert searched_stretch(data) is data


def test_another_stretch_is_searched_only_where_a_model_is_clearly_worse():
    data = record()
    stretch = data.part(0, 200)
    even = np.random.default_rng(3).chisquare(1, 2000)
    assert worst_stretch(data, stretch, even) is stretch
    worse = even * np.where((data.time >= 120.0) & (data.time < 145.0), 9.0, 1.0)
    assert 118.0 <= worst_stretch(data, stretch, worse).time[0] <= 127.0


def test_a_moment_is_no_course():
    data = record()
    stretch = data.part(0, 200)
    errors = np.ones(2000)
    errors[1500:1510] = 1e6
    assert worst_stretch(data, stretch, errors) is stretch


def test_a_longer_stretch_ends_where_the_record_does():
    data = record()
    assert span(longer_stretch(data, data.part(200, 400))) == (20.0, 800)
    assert span(longer_stretch(data, data.part(1800, 2000))) == (pytest.approx(120.0), 800)
    assert len(longer_stretch(data, data.part(0, 1000)).time) == 2000


def test_a_note_says_what_the_search_saw():
    data = record()
    (note,) = stretch_notes(data, data.part(200, 400))
    assert note.code is NoteCode.SEARCHED_IN_PART
    assert note.facts == {"samples": 200, "of": 2000, "first": 20.0, "last": pytest.approx(39.9)}
