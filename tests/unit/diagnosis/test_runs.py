"""Claims: parts of records, of settings and of linearisations are of what they are named after."""

from __future__ import annotations

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
