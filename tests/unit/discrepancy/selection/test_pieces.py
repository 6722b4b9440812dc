"""Claims: a record that was cut, shuffled or joined is told, with the instants; others are not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import Diagnosis, Verdict, diagnose
from orchestration.discrepancy.note import MIXED_UP, Note, NoteCode
from orchestration.discrepancy.report import wording
from orchestration.discrepancy.selection.pieces import (
    _are_smooth_else,
    _beyond_usual_answers,
    _joints,
    _jumps,
)
from orchestration.discrepancy.selection.search import Search
from tests.support.pace import slow_but
from tests.support.wired_motor import COUNT, FRICTION, STEP, Motor, wired

KINDS = {NoteCode.PIECED, NoteCode.OTHER_SPECIMEN}


def diagnosed(data: Dataset) -> tuple[Diagnosis, list[Note]]:
    diagnosis = diagnose(Motor, data, [FRICTION])
    return diagnosis, [note for note in diagnosis.notes if note.code in MIXED_UP]


def rows(data: Dataset, order: np.ndarray) -> Dataset:
    """Return rows of a record by an even clock."""
    return replace(data.where(order), time=STEP * np.arange(len(order)))


def slow(count: int = COUNT, gain: float = 1.0, noise: float = 1e-3, seed: int = 4) -> Dataset:
    """A motor of first order under a slow wave, exactly by its impulse response."""
    rng = np.random.default_rng(seed)
    time = STEP * np.arange(count)
    drive = np.sin(0.31 * time) + np.sin(0.83 * time + 1.0)
    response = 3.0 * gain * (1.0 - np.exp(-STEP / 0.8)) * np.exp(-time / 0.8)
    shown = np.append(0.0, np.convolve(drive, response)[: count - 1])
    shown = shown + noise * rng.standard_normal(count)
    return Dataset(time, {"drive": drive}, {"shown": shown})


def cut(data: Dataset) -> Dataset:
    """Return a record without the samples from 400 to before 520."""
    return rows(data, np.delete(np.arange(len(data.time)), np.s_[400:520]))


@pytest.mark.parametrize("course", [wired, slow])
def test_a_record_that_was_cut_is_told_where(course: Callable[..., Dataset]):
    diagnosis, (note,) = diagnosed(cut(course(noise=1e-3)))
    assert note.code is NoteCode.PIECED
    assert note.facts["instants"] == pytest.approx([40.0], abs=STEP)
    assert note.facts["instead"] < 0.5 * note.facts["share"]
    assert diagnosis.verdict is Verdict.UNEXPLAINED
    assert diagnosis.causes == []
    assert wording.sentence(diagnosis).startswith("Outputs jump at 40 s")


def test_pieces_in_the_wrong_order_are_told_where():
    pieces = np.array_split(np.arange(COUNT), 6)
    _, (note,) = diagnosed(rows(slow(), np.concatenate([pieces[k] for k in (3, 0, 5, 2, 4, 1)])))
    assert note.code is NoteCode.PIECED
    # the last third is held out
    ends = STEP * 250.0 * np.arange(1, 4)
    assert all(np.min(np.abs(ends - instant)) <= STEP for instant in note.facts["instants"])


def test_two_specimens_in_one_record_are_told():
    """The second has twice the gain, and was elsewhere when it was joined."""
    one = slow()
    other = rows(slow(gain=2.0, seed=5), np.roll(np.arange(COUNT), 37))
    half = COUNT // 2

    def joined(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.concatenate([a[:half], b[half:]])

    drive = joined(one.inputs["drive"], other.inputs["drive"])
    shown = joined(one.measured["shown"], other.measured["shown"])
    _, (note,) = diagnosed(Dataset(one.time, {"drive": drive}, {"shown": shown}))
    assert note.code is NoteCode.OTHER_SPECIMEN
    assert note.facts["instants"] == pytest.approx([STEP * half], abs=STEP)


@pytest.mark.slow
@pytest.mark.parametrize(
    "fault", slow_but(["none", "outliers", "far outliers", "offset", "late"], "none", "late")
)
def test_what_is_in_one_piece_is_not_told_to_be_in_several(fault):
    data = slow()
    shown = data.measured["shown"].copy()
    if fault == "outliers":
        shown[[200, 500, 800]] += 2.0
    if fault == "far outliers":  # they make the most of the error
        shown[[200, 500, 800]] += 40.0
    if fault == "offset":  # a sensor that slips, after which the motor is where it was
        shown[600:] += 1.0
    if fault == "late":
        shown = np.append(np.zeros(12), shown[:-12])
    _, notes = diagnosed(replace(data, measured={"shown": shown}))
    assert not KINDS & {note.code for note in notes}


def test_where_blocks_are_held_out_no_piece_begins():
    """A pulse is answered late, which the model does not know, and blocks of it were not fitted."""
    drive = np.zeros(COUNT)
    drive[300:900] = 1.0
    late = np.append(np.zeros(25), drive[:-25])
    decay = np.exp(-STEP / 0.8)
    shown = lfilter([0.0, 3.0 * (1.0 - decay)], [1.0, -decay], late)
    shown += 1e-3 * np.random.default_rng(6).standard_normal(COUNT)
    shown[320:340] = np.nan
    shown[920:940] = np.nan
    record = Dataset(STEP * np.arange(COUNT), {"drive": drive}, {"shown": shown})
    base = Search(record, Motor, ["gain", "drag"]).nominal()
    assert _joints(_jumps(base, record)) == []


@pytest.mark.parametrize(
    ("force", "smooth"), [("held", False), ("held with noise", False), ("joined", True)]
)
def test_an_input_that_is_held_between_its_steps_was_not_cut_there(force, smooth):
    """The current beside it goes smoothly all the time."""
    time = 0.1 * np.arange(1000)
    noise = 0.01 * np.random.default_rng(1).standard_normal(1000)
    levels = np.repeat([1.0, 3.0, 2.0, 4.0, 1.5], 200)
    courses = {
        "held": levels,
        "held with noise": levels + noise,
        "joined": np.sin(0.9 * time + np.pi * np.repeat(np.arange(5), 200)),
    }
    data = Dataset(time, {"current": np.sin(time), "force": courses[force]}, {"y": noise})
    steps = np.array([200, 400, 600, 800])
    assert _are_smooth_else(data, steps) is smooth


def test_the_answer_to_a_step_is_held_against_those_to_steps_of_the_same_input():
    """A load steps four times and is answered tenfold; the third time something else jumps too."""
    samples = np.arange(4000)
    loads = [500, 1500, 2500, 3500]
    currents = range(200, 4000, 200)
    data = Dataset(
        0.1 * samples,
        {
            "current": np.where(samples // 200 % 2, 1.0, -1.0),
            "load": np.searchsorted(loads, samples, side="right") % 2 * 1.0,
        },
        {"y": np.zeros(4000)},
    )
    sizes = np.ones(4000)
    sizes[currents] = 2.0
    sizes[loads] = 20.0
    sizes[2500] = 200.0
    beyond = _beyond_usual_answers(sizes, data, np.array(sorted([*currents, *loads])))
    assert np.flatnonzero(beyond > 1.0).tolist() == [2500]
