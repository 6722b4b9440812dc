"""Claims: pieces that were put together are told where they meet, and a whole record is not cut."""

from __future__ import annotations

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from orchestration.diagnosis.joints import Pieced, pieced
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.runs import Record
from orchestration.diagnosis.subject import Subject, subject_of
from tests.support.oscillator import oscillator_record
from tests.support.oscillator_model import Oscillator

JOINTS = sys.modules[pieced.__module__]


@pytest.fixture(scope="module")
def model() -> LawModel:
    return LawModel(Oscillator)


def joined(*parts: tuple[int, int, int, float]) -> Record:
    """Return parts of records of an oscillator after one another: seed, first, last, damping."""
    forces, positions = [], []
    for seed, first, last, damping in parts:
        signals = oscillator_record(seed, damping=damping).signals
        forces.append(signals["force"][first:last])
        positions.append(signals["position"][first:last])
    force, position = map(np.concatenate, (forces, positions))
    time = 0.02 * np.arange(len(force))
    return Record(time, force[:, np.newaxis], position[:, np.newaxis], (False,), "record")


def as_pieces(model: LawModel, record: Record) -> Pieced | None:
    subject = subject_of(model, [record])
    assert subject is not None

    def subject_as(own: list[Record], local: object) -> Subject | None:
        return subject_of(model, own, local=local)

    return pieced(subject, [record], subject_as)


def test_a_record_that_was_cut_and_closed_up_is_two(model: LawModel) -> None:
    """A hundred samples are missing after 5 s."""
    found = as_pieces(model, joined((1, 0, 250, 0.8), (1, 350, 700, 0.8)))
    assert found is not None
    assert found.times == pytest.approx((5.0,))
    assert not found.is_of_others
    assert [len(piece.time) for piece in found.records] == [250, 350]
    assert [piece.label for piece in found.records] == ["record.1", "record.2"]
    assert all(piece.time[0] == 0.0 for piece in found.records)
    assert found.records[1].begin == pytest.approx(-5.0)
    assert found.note[0] == "pieced"
    assert "at t = 5 s" in found.note[2]


def test_pieces_in_the_wrong_order_are_as_many_records(model: LawModel) -> None:
    found = as_pieces(model, joined((1, 433, 700, 0.8), (1, 0, 433, 0.8)))
    assert found is not None
    assert found.times == pytest.approx((5.34,))
    assert found.subject.base.misfit < 0.02


def test_two_specimens_have_parameters_of_their_own(model: LawModel) -> None:
    found = as_pieces(model, joined((1, 0, 350, 0.3), (2, 350, 700, 3.0)))
    assert found is not None
    assert found.is_of_others
    assert found.note[0] == "other_specimen"
    names = found.subject.problem.names
    assert {"damping@record.1", "damping@record.2"} <= set(names)


@pytest.mark.parametrize("dry", [0.0, 1.5])
def test_a_whole_record_is_not_cut(dry: float, model: LawModel) -> None:
    """Though with dry friction the model is wrong, and the force jumps each half second."""
    signals = oscillator_record(3, dry=dry).signals
    columns = (signals[name][:, np.newaxis] for name in ("force", "position"))
    record = Record(0.02 * np.arange(700), *columns, (False,), "record")
    assert as_pieces(model, record) is None


def test_single_values_far_off_are_no_joints(model: LawModel) -> None:
    record = joined((1, 0, 700, 0.8))
    outputs = record.outputs.copy()
    outputs[[150, 320]] += 0.4
    assert as_pieces(model, replace(record, outputs=outputs)) is None


@pytest.mark.parametrize(("slow", "is_noise"), [(0.0, True), (5.0, False)])
def test_pieces_of_which_more_than_noise_is_left_are_those_of_the_plant(
    slow: float, is_noise: bool
) -> None:
    """Noise of 1, and a slow error of so many times that."""
    noise = np.random.default_rng(1).normal(size=500)
    error = noise + slow * np.sin(np.arange(500) / 50.0)
    subject = SimpleNamespace(base=SimpleNamespace(errors=[error[:, np.newaxis]]))
    assert JOINTS._leaves_noise(subject) == is_noise
