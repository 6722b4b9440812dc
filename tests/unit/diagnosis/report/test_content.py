"""Claims: a long course keeps its extremes, and what is shown says what a diagnosis says."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from orchestration.diagnosis.report import content, wording
from orchestration.diagnosis.terms import Memory, NamedTerm, Released, Shape, Term
from orchestration.identify.fitting import Scale
from orchestration.identify.uncertainty import Estimate


@pytest.fixture
def spiked():
    """A slow sine of a million samples with a spike, and a line that is not there for a while."""
    line = np.sin(np.linspace(0.0, 20.0, 1_000_000))
    spike, hole = line.copy(), line.copy()
    spike[777_777] = 9.0
    hole[100_000:300_000] = np.nan
    return [spike, hole]


def test_a_long_course_keeps_every_extreme_and_a_short_one_all(spiked):
    kept = content._extremes(spiked)
    assert len(kept) < 5000
    assert {0, 777_777, 999_999} <= {*kept.tolist()}
    for line in spiked:
        shown = line[kept]
        assert np.nanmax(shown) == np.nanmax(line)
        between = np.interp(np.arange(len(line)), kept, np.nan_to_num(shown))
        assert np.nanmax(np.abs(between - line)[400_000:700_000]) < 0.02
    assert content._extremes([line[:900] for line in spiked]).tolist() == [*range(900)]


def test_numbers_have_the_digits_that_a_screen_has():
    assert content._numbers(np.array([1.0 / 3.0, np.nan, np.inf])) == (0.333333, None, None)


def test_it_shows_what_was_diagnosed(dry):
    shown = content.view_of(dry, "ppy diagnose rubbing.csv")
    assert shown.command == "ppy diagnose rubbing.csv"
    assert shown.answer.headline == wording.headline(dry)
    assert [name.rstrip(" *") for name, *_ in shown.answer.parameters] == [*dry.parameters]
    assert shown.errors == tuple(rung.error for rung in dry.ladder)
    (course,) = shown.courses
    record = dry.subject.left_out[0].record
    factor = np.array(course.measured) / record.outputs[:, 0]  # of the unit that is displayed
    assert factor == pytest.approx(np.full(len(record.time), factor[0]), rel=1e-4)
    assert [line.is_final for line in course.simulated] == [False, True]
    nothing = replace(dry, conclusion=replace(dry.conclusion, verdict="consistent"))
    assert content.view_of(nothing).answer.causes == ()


def test_a_parameter_that_an_effect_brought_has_no_nominal_value(dry):
    released = [Released(n, "s", Scale(True, 1.0), 0.1, 10.0) for n in ("amount", "lag_time")]
    effect = NamedTerm(
        "friction", "velocity", Shape.LINEAR, effect="mass", released=tuple(released)
    )
    estimate = Estimate(2.0, 2.0, (1.0, 3.0), "s")
    shown = SimpleNamespace(
        cls=dry.cls,
        subject=dry.subject,
        # the name of the effect is that of a parameter of the model
        terms={"mass": effect},
        parameters=dict.fromkeys(("mass", "amount", "lag_time"), estimate),
        changed=(),
    )
    rows = {name: nominal for name, _, _, nominal in content._parameter_rows(shown)}
    assert rows == {"mass": "2 kg", "amount": "", "lag_time": ""}


def test_values_of_a_curve_say_where_they_are(dry):
    curve = Term("friction", "velocity", Shape.CURVE, middle=1.0, scale=2.0, places=(-0.5, 0.25))
    assert content._places(dry.subject.problem.model.cls, {"bend": curve}) == {
        "bend_at_0": " (velocity [m/s] = 0)",
        "bend_at_1": " (velocity [m/s] = 1.5)",
    }
    way = replace(curve, memory=Memory.INTEGRAL, places=(0.0,))
    assert content._places(dry.subject.problem.model.cls, {"bend": way}) == {
        "bend_at_0": " (the integral of velocity [(m/s)·s] = 1)"
    }


def test_what_is_noted_of_several_records_is_said_once(dry):
    notes = [("free_response", name, "no input moves") for name in ("one", "other")]
    shown = content.view_of(replace(dry, notes=(*notes, ("short", "one", "it is short"))))
    assert shown.answer.notes == ("no input moves", "it is short")
