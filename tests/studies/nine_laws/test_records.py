"""Claims: without its hidden law a plant is its model, with it the model is wrong beyond the noise,
and each law that is called right is one of the model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus.kit.symbolic import list_laws
from orchestration.diagnosis import LawModel, Record
from orchestration.diagnosis.runs import Setting
from orchestration.fmu import find_model
from studies.nine_laws import PLANTS, NineLawsCase, cases, draw_law, run


def _inputs(plant, time):
    shares = [0.5 + 0.4 * np.sin((0.05 + 0.02 * k) * time / plant.step) for k in range(2)]
    columns = [low + s * (high - low) for (low, high), s in zip(plant.ranges, shares, strict=False)]
    return np.column_stack(columns)


@pytest.mark.parametrize("law", PLANTS)
def test_a_plant_without_its_law_is_its_model(law):
    plant = PLANTS[law]
    cls = find_model(plant.model).cls
    model = LawModel(cls)
    time = plant.step * np.arange(100)
    inputs = _inputs(plant, time)
    values = [plant.parameters.get(p.name, p.start) for p in model.parameters]
    outputs = np.full((100, len(model.outputs)), np.nan)
    record = Record(time, inputs, outputs, (True,) * inputs.shape[1])
    setting = Setting(np.array(values), np.zeros(0, dtype=int), substeps=10)
    course = model.run(record, setting, np.zeros(len(model.states)))
    shown = [[o.name for o in model.outputs].index(name) for name in plant.outputs]
    drawn = run(plant, plant.parameters, 0.0, time, inputs)
    assert drawn == pytest.approx(course.outputs[:, shown], rel=1e-4, abs=1e-5 * drawn.std())
    bent = run(plant, plant.parameters, plant.strengths[0], time, inputs)
    # a cell's charge grows slowly
    assert np.max((bent - drawn).std(axis=0) / drawn.std(axis=0)) > 0.01
    laws = {one.name for one in list_laws(cls)}
    names = laws | {v.name for v in (*model.inputs, *model.states)}
    for named, signal in plant.right:
        assert named in laws
        assert signal in names


def test_a_case_is_drawn_again_and_its_two_records_differ():
    case = NineLawsCase("dead zone", 3)
    one, again = draw_law(case), draw_law(case)
    for name, column in one.fitted.items():
        assert np.array_equal(column, again.fitted[name])
        assert name == "time [s]" or not np.array_equal(column, one.held_out[name])
    other = draw_law(replace(case, seed=4))
    assert other.strength != one.strength
    assert {c.law for c in cases(2, 5)} == set(PLANTS)
    assert len(cases(2, 5)) == 18
