"""Claims: rows that terminal and page share have the numbers of the diagnosis, each once."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fmus.kit.sensors import sensor_lag, transport_delay
from orchestration.discrepancy.diagnosis import diagnose
from orchestration.discrepancy.report.tables import (
    error_table,
    least_squares_table,
    run_errors,
    tried_effects,
)
from orchestration.discrepancy.selection import Selection, Step
from tests.support.several import Cell, several

R0 = {p.name: p for p in Cell.layout.parameters}["R0"]


@pytest.fixture(scope="module")
def diagnosis():
    """Of six records of one cell, two of which are held out."""
    return diagnose(Cell, several(), [])


def test_errors_by_record_are_those_of_a_simulation(diagnosis):
    """The oracle is a free run of the fitted model over every record, and NumPy."""
    errors = run_errors(SimpleNamespace(diagnosis=diagnosis, gain=None, files="all"))
    assert [(e.label, e.held_out) for e in errors] == [
        *((label, False) for label in "abcd"),
        *((label, True) for label in "ef"),
    ]
    best, data = diagnosis.selection.best, diagnosis.estimation
    run = best.problem.model.run(data.time, data.inputs, best.parameters, runs=data.runs)
    for record, error in zip(data.runs, errors, strict=False):
        y = data.measured["voltage"][record.samples]
        misses = y - run.signals["voltage"][record.samples]
        expected = np.linalg.norm(misses) / np.linalg.norm(y - y.mean())
        assert error.nrmse == {"voltage": pytest.approx(expected, rel=1e-6)}
        assert error.samples == len(y)


def test_a_table_of_errors_has_a_row_for_every_part(diagnosis):
    head, rows = error_table(diagnosis)
    assert head[:2] == ["output", "where"]
    assert [row[:2] for row in rows] == [["voltage", "fitted"], ["voltage", "held out"]]
    fitted = {name: errors["voltage"] for name, errors in diagnosis.fitted_errors.items()}
    assert head[2:] == ["as it is", "parameters refitted"]
    errors = [fitted[name] for name in ("untouched", "refitted")]
    told = [float(cell.removesuffix(" %")) for cell in rows[0][2:]]
    assert told == pytest.approx([100.0 * error for error in errors], rel=5e-2)


def test_plain_least_squares_is_told_where_it_leaves_another_error():
    fitted = {"least_squares": {"u": 0.10, "i": 0.20}, "refitted": {"u": 0.12, "i": 0.203}}
    judged = {"least_squares": {"u": 0.30, "i": np.nan}, "refitted": {"u": 0.30, "i": 0.2}}
    of = SimpleNamespace(fitted_errors=fitted, judged_errors=judged)
    head, rows = least_squares_table(of)
    assert head == ["output", "where", "plain least squares", "parameters refitted"]
    assert rows == [["u", "fitted", "10.0 %", "12.0 %"], ["i", "held out", "–", "20.0 %"]]
    del fitted["least_squares"], judged["least_squares"]
    assert least_squares_table(of)[1] == []


def test_where_nothing_was_tried_there_is_no_evidence(diagnosis):
    assert tried_effects(diagnosis) == []


def test_what_corrects_the_shape_of_a_cause_is_told_as_that(diagnosis):
    models = [diagnosis.selection.base]
    for effect in (sensor_lag(Cell, "voltage"), transport_delay(Cell, "voltage")):
        candidate = models[-1].candidate.with_effect(effect)
        models.append(replace(models[-1], candidate=candidate))
    base, *extended = models
    selection = Selection(base, [Step(model, 20.0, 20.0, 0.0, [], []) for model in extended])
    cause, shape = tried_effects(replace(diagnosis, selection=selection))
    assert (cause.candidate.effect_name, cause.verdict) == ("sensor_lag(voltage)", "named")
    assert (shape.candidate.effect_name, shape.verdict) == ("transport_delay(voltage)", "shape")
    assert shape.reason == "of a lag of the voltage sensor"
