"""Claims: parts of records, of settings and of linearisations are of what they are named after."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from orchestration.diagnosis.runs import Linearisation, Record, Setting
from orchestration.diagnosis.terms import Memory, Shape, Term


def record() -> Record:
    time = 0.1 * np.arange(10)
    outputs = np.column_stack([np.sin(time), np.full(10, np.nan)])
    return Record(time, np.cos(time)[:, np.newaxis], outputs, (True,), "record")


def test_a_part_of_a_record_is_of_its_samples() -> None:
    whole = record()
    part = whole.part(2, 9, 3)
    assert part.time == pytest.approx(whole.time[[2, 5, 8]])
    assert part.inputs == pytest.approx(whole.inputs[[2, 5, 8]])
    assert whole.first.time.tolist() == [0.0]


@pytest.mark.parametrize(
    ("wave", "period"),
    [
        (lambda t: np.sign(np.sin(2.0 * np.pi * t / 5.0)), 50),
        (lambda t: np.sin(2.0 * np.pi * t / 5.0) + 0.3 * np.sin(2.0 * np.pi * t / 2.5), 50),
        (lambda t: np.sin(0.2 * t**2), None),
        (lambda t: np.random.default_rng(2).choice([-1.0, 1.0], 60).repeat(10), None),
        (lambda t: np.zeros(600), None),
        (lambda t: t, None),
    ],
    ids=["square", "two sines", "chirp", "random", "still", "ramp"],
)
@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_phases_count_from_one_period_of_the_inputs_to_the_next(wave, period, noise) -> None:
    time = 0.1 * np.arange(600)
    values = wave(time)
    values = values + noise * values.std() * np.random.default_rng(1).standard_normal(600)
    inputs = values[:, np.newaxis]
    phases = Record(time, inputs, np.zeros((600, 1)), (True,)).phases
    if period is None:
        assert phases is None
    else:
        assert phases is not None
        assert phases.tolist() == (np.arange(600) % period).tolist()


def test_curves_through_inputs_that_cannot_be_so_have_no_slopes() -> None:
    time = np.arange(6.0)
    inputs = np.sin(time)[:, np.newaxis]
    curved = Record(time, inputs, np.zeros((6, 1)), (True,), curved=True)
    assert curved.bends is not None
    assert curved.bends[2:4, 0] == pytest.approx(np.cos(time[2:4]), abs=0.1)
    assert (
        replace(curved, inputs=np.where(time[:, np.newaxis] == 2.0, np.nan, inputs)).bends is None
    )


def test_a_period_between_samples_is_known_after_many() -> None:
    time = np.arange(5000.0)
    wave = np.sin(2.0 * np.pi * time / 20.1)[:, np.newaxis]
    phases = Record(time, wave, np.zeros((5000, 1)), (True,)).phases
    assert phases is not None
    away = np.abs(phases - time % 20.1)
    assert np.minimum(away, 20.1 - away).max() < 2.0


def test_an_output_without_any_value_is_not_measured() -> None:
    assert record().measured.tolist() == [True, False]


def test_each_term_has_its_values() -> None:
    lagging = Term("friction", "velocity", Shape.DRY, Memory.LAG, (0.5,))
    plain = Term("spring", "place", Shape.SQUARE)
    setting = Setting(np.zeros(0), np.zeros(0, dtype=int), (lagging, plain), np.arange(4.0))
    values = {term: own.tolist() for term, own in setting.by_term()}
    assert values == {lagging: [0.0, 1.0, 2.0], plain: [3.0]}
    assert setting.memories == 1


def test_weights_of_outputs_leave_what_an_observer_corrects() -> None:
    """Gains are by errors of outputs, which the weights make larger."""
    random = np.random.default_rng(1)
    rates, outputs, by_laws = (random.normal(size=(3, 2, 4)) for _ in range(3))
    gains = random.normal(size=(3, 2, 2))
    part = Linearisation(rates, outputs, by_laws, by_laws, np.zeros((3, 1)), gains=gains)
    weighed = part.weighed(np.array([2.0, 5.0]))
    assert weighed.gains is not None
    assert weighed.gains @ weighed.outputs == pytest.approx(gains @ outputs)
    second = part.of_outputs(np.array([False, True]))
    assert second.outputs.shape == (3, 1, 4)
    assert second.gains is not None
    assert second.gains.shape == (3, 2, 1)
