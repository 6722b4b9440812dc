"""Claims: a file that is misread is told from a model that is wrong, and a right one is not."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from fmus.kit import Component, Input, Output
from orchestration.diagnosis import Diagnosis, LawModel, Shape, Term, subject_of
from orchestration.diagnosis import Record as KernelRecord
from orchestration.diagnosis.conclude import conclude
from orchestration.diagnosis.misreadings import (
    _Screen,
    misreadings,
    reading_that_runs,
)
from orchestration.diagnosis.readings import Reading, ReadingKind
from orchestration.diagnosis.report import answer_of, summary, wording
from orchestration.records import Record
from tests.support.control import control_record
from tests.support.control_models import Upright
from tests.support.oscillator import CUBE, DRY, diagnosis_with, oscillator_record, unsearched

MISREADINGS = sys.modules[misreadings.__module__]
RIGHT = oscillator_record(1)


PUSH = Term("acceleration", "force", Shape.LINEAR, size=5.0, scale=5.0)


def columns(**changed: np.ndarray) -> Record:
    """Return the record of an oscillator with other columns."""
    time = changed.pop("time", RIGHT.time)
    return replace(RIGHT, time=time, signals=RIGHT.signals | changed)


def read(**changed: np.ndarray) -> list[Reading | None]:
    """Return the readings that gain on the record of an oscillator with other columns."""
    found = diagnosis_with(columns(**changed)).found
    return [subject.reading for subject in misreadings(found.subject, found.base)]


def diagnosed(record: Record, *sets: tuple[Term, ...]) -> Diagnosis:
    """Return a diagnosis by these sets of terms and by other readings of the file."""
    diagnosis = diagnosis_with(record, *sets)
    found = diagnosis.found
    others = misreadings(found.subject, found.base)
    judged = [one.judge(one.base) for one in others]
    found = found.with_fits((one for one in judged if one is not None), others)
    return replace(diagnosis, found=found, conclusion=conclude(found))


@pytest.fixture(scope="module")
def flipped() -> Diagnosis:
    return diagnosed(columns(force=-RIGHT.signals["force"]), (PUSH,), (DRY,), (CUBE,))


def test_a_force_of_the_other_sign_is_the_cause(flipped: Diagnosis) -> None:
    """Though a term that turns the force round explains it as well."""
    assert flipped.verdict == "cause"
    assert [cause.name for cause in flipped.causes] == ["reading_sign(force)"]
    turned = next(one for one in flipped.found.fits if one.terms == (PUSH,))
    assert turned.fit.misfit < 0.1 * flipped.found.base.fit.misfit
    assert flipped.terms == {}


def test_the_model_is_that_of_the_corrected_file(flipped: Diagnosis) -> None:
    low, high = flipped.parameters["damping"].interval
    # within three deviations, of which an interval has two on either side
    assert abs(0.8 - 0.5 * (low + high)) < 0.75 * (high - low)
    assert flipped.component.name == "oscillator_fitted"
    assert "force has the opposite sign" in flipped.component.remark
    assert flipped.error(flipped.final) < 0.02
    assert flipped.error(flipped.found.base) > 0.5


def test_inputs_of_a_file_that_was_misread_go_between_samples_as_fits_best() -> None:
    """Of a force of the other sign the model as it is tells neither way from the other."""
    found = unsearched(columns(force=-RIGHT.signals["force"]), interpolate=True)
    best, *_ = misreadings(found.subject, found.base)
    assert str(best.reading) == "reading_sign(force)"
    assert best.problem.records[0].smooth == (False,)
    assert best.left_out[0].record.smooth == (False,)
    assert best.base.misfit < 0.01


def test_the_fault_and_its_correction_are_said(flipped: Diagnosis) -> None:
    assert "force has the opposite sign" in wording.headline(flipped)
    assert "in oscillator_1.csv" in wording.headline(flipped)
    assert wording.next_step(flipped).startswith("multiply force by -1")
    answer = answer_of(flipped)
    (row,) = answer.causes
    assert row[1].startswith("force has the opposite sign")
    assert answer.ladder[1][0] == f"+ {row[1]}"
    figures = json.loads(json.dumps(summary.summary(flipped)))
    (cause,) = figures["causes"]
    reading = cause["reading"]
    assert (reading["kind"], reading["columns"], reading["factor"]) == ("sign", ["force"], -1.0)


def test_dry_friction_is_no_misread_file() -> None:
    diagnosis = diagnosed(oscillator_record(1, dry=1.5), (DRY,), (CUBE,))
    assert [cause.name for cause in diagnosis.causes] == ["friction(velocity)"]
    assert diagnosis.reading is None


def test_a_right_record_is_read_as_it_is() -> None:
    assert read() == []


def test_a_force_of_the_other_sign_is_a_place_of_the_other_sign() -> None:
    first, *_ = read(force=-RIGHT.signals["force"])
    assert first.cause == ("reading_sign", "force")
    assert [one.cause for one in first.instead] == [("reading_sign", "position")]


def test_a_clock_in_minutes() -> None:
    first, *_ = read(time=RIGHT.time / 60.0)
    assert (first.kind, first.unit) == (ReadingKind.CLOCK, "in min")


def test_an_offset_of_an_input_is_estimated() -> None:
    first, *_ = read(force=RIGHT.signals["force"] + 3.0)
    assert (first.kind, first.columns) == (ReadingKind.OFFSET, ("force",))
    assert first.shift == pytest.approx(-3.0, abs=0.1)


def test_a_delay_is_estimated() -> None:
    first, *_ = read(force=np.roll(RIGHT.signals["force"], 9))
    assert (first.kind, first.columns) == (ReadingKind.LATE, ("force",))
    assert first.shift == pytest.approx(0.18, abs=1e-3)


POSITION = RIGHT.signals["position"]


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        ("UNSIGNED", np.abs(POSITION - POSITION.mean())),
        pytest.param("RATE", np.gradient(POSITION, RIGHT.time), marks=pytest.mark.slow),
        pytest.param("INTEGRAL", np.cumsum(POSITION) * 0.02, marks=pytest.mark.slow),
        ("PACE", np.interp(RIGHT.time / 1.02, RIGHT.time, POSITION)),
        ("LATE", np.append(POSITION[60:], np.full(60, np.nan))),
    ],
)
def test_a_position_that_is_recorded_otherwise(kind: str, values: np.ndarray) -> None:
    first, *_ = read(position=values)
    assert (first.kind.name, first.columns) == (kind, ("position",))
    expected = {"PACE": 0.02, "LATE": -1.2}.get(kind, first.shift)
    assert first.shift == pytest.approx(expected, rel=0.02)


def test_a_position_that_was_filtered_both_ways() -> None:
    sections = butter(4, 0.06, output="sos")
    quiet = oscillator_record(1, noise=0.0, samples=450)
    filtered = sosfiltfilt(sections, quiet.signals["position"])
    first, *_ = read(position=filtered, force=quiet.signals["force"], time=quiet.time)
    assert first.kind is ReadingKind.FILTERED
    assert first.shift == pytest.approx(1.5, rel=0.2), "0.03 periods a sample, in Hz"


def test_an_early_input_of_a_model_with_one_output_is_no_reading() -> None:
    """It is a late output, which is a term."""
    screen = _Screen(diagnosis_with(RIGHT).found.subject)
    shifts = screen._shifts(Reading(ReadingKind.LATE, ("force",)))
    assert len(shifts) > 3
    assert min(shifts) > 0.0


def test_an_early_input_beside_another_is_a_reading() -> None:
    """The output is not late behind the other one."""
    subject = diagnosis_with(RIGHT).found.subject
    two = [
        replace(r, inputs=np.hstack([r.inputs, r.inputs[::-1]])) for r in subject.problem.records
    ]
    screen = _Screen(subject)
    screen.subject = replace(subject, problem=replace(subject.problem, records=tuple(two)))
    shifts = screen._shifts(Reading(ReadingKind.LATE, ("force",)))
    assert min(shifts) == -max(shifts)


def test_a_reading_with_a_value_is_not_preferred_to_terms_that_do_the_same() -> None:
    """An offset of the force is a constant force."""
    constant = Term("acceleration", "", Shape.CONSTANT, size=5.0)
    diagnosis = diagnosed(columns(force=RIGHT.signals["force"] + 3.0), (constant,))
    assert {cause.name for cause in diagnosis.causes} >= {"acceleration()"}


@pytest.mark.parametrize(("misfit", "told"), [(0.1, "in min"), (0.8, None)])
def test_a_model_that_runs_away_is_asked_in_other_readings(misfit: float, told: str | None) -> None:
    """By one it stays within its bounds; that it follows the record there is another matter."""
    subject = diagnosis_with(RIGHT).subject
    base = SimpleNamespace(misfit=misfit)

    def subject_as(reading: Reading) -> SimpleNamespace | None:
        subject = SimpleNamespace(base=base, observer=None)
        return subject if reading.unit == "in min" else None

    problem = subject.problem
    found = reading_that_runs(problem.model, problem.records, subject_as)
    assert (found and found.unit) == told


def test_predictions_are_not_asked_for_smoother_readings() -> None:
    """Of a pendulum that is pushed: any model predicts a smooth signal by its last value."""
    record = control_record("upright", "offset", seed=32, samples=200)
    columns = [values[:, None] for values in record.signals.values()]
    given = KernelRecord(record.time, *columns, (False,), "upright")
    subject = subject_of(LawModel(Upright), [given])
    assert subject is not None
    assert subject.observer is not None
    base = subject.judge(subject.base)
    assert base is not None
    smooth = {ReadingKind.RATE, ReadingKind.INTEGRAL, ReadingKind.PACE}
    gaining = {one.reading.kind for one in misreadings(subject, base) if one.reading is not None}
    assert not gaining & smooth


@pytest.mark.parametrize(("changed", "asked"), [(1.0, False), (-1.0, True)])
def test_an_output_that_the_model_follows_is_no_slope(
    changed: float, asked: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its integral has less noise, and would gain by that alone."""
    kinds: set[ReadingKind] = set()
    monkeypatch.setattr(_Screen, "best", lambda self, reading: kinds.add(reading.kind))
    read(force=changed * RIGHT.signals["force"])
    assert ReadingKind.SIGN in kinds
    assert ({ReadingKind.RATE, ReadingKind.INTEGRAL} <= kinds) is asked


def test_a_unit_that_changes_parameters_alone_is_told_by_these() -> None:
    """A force that is read a thousand times too large is that of a mass as many times heavier."""
    diagnosis = diagnosed(columns(force=1e3 * RIGHT.signals["force"]))
    found = diagnosis.found
    assert diagnosis.verdict == "cause"
    (cause,) = diagnosis.causes
    assert cause.name == "reading_unit(force)"
    assert cause.reading is not None
    assert cause.reading.unit == "in mN"
    assert diagnosis.final.fit.misfit == pytest.approx(found.base.fit.misfit, rel=0.05)


@pytest.mark.parametrize(
    ("gain", "ahead", "is_hopeful"),
    [
        (2.1, [0.1, 0.1], True),
        (1.9, [0.1, 0.1], False),
        (-50.0, [-9.0, 3.1], True),
    ],
)
def test_a_reading_is_fitted_that_gains_more_than_its_words_cost(
    gain: float, ahead: list[float], is_hopeful: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Words cost 2 nats; one that is far ahead in an output is fitted too."""
    trial, as_read = (SimpleNamespace(problem=name, point=None) for name in ("trial", "as read"))
    logarithms = {"trial": -np.array(ahead), "as read": np.zeros(2)}
    monkeypatch.setattr(MISREADINGS, "_logarithms", lambda problem, point: logarithms[problem])
    implausibility = {"trial": -gain, "as read": 0.0}
    monkeypatch.setattr(MISREADINGS, "_implausibility", lambda t: implausibility[t.problem])
    assert MISREADINGS._is_hopeful(trial, as_read) == is_hopeful
    assert MISREADINGS._is_hopeful(trial, None), "where the file as it was read leaves all bounds"


class Wire(Component):
    """The output is the input as it comes in: nothing is fitted."""

    name = "wire"
    sent = Input("V")

    @Output("V")
    def received(self) -> float:
        """As sent."""
        return self.sent


def test_of_a_model_without_parameters_files_are_read_otherwise_too() -> None:
    """Twenty samples, of the other sign."""
    random = np.random.default_rng(8)
    sent = random.standard_normal((20, 1))
    received = -sent + 0.01 * random.standard_normal((20, 1))
    record = KernelRecord(np.arange(20.0), sent, received, (False,))
    subject = subject_of(LawModel(Wire), [record])
    assert subject is not None
    base = subject.judge(subject.base)
    assert base is not None
    read = misreadings(subject, base)
    assert ReadingKind.SIGN in {one.reading.kind for one in read if one.reading}
