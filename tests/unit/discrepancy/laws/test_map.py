"""Claims: the law and the signal that the plant has more are among the first of the map."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.laws.base import search_of
from orchestration.discrepancy.laws.evidence import RegressorColumns
from orchestration.discrepancy.laws.linear import LinearisedRecord, Sides, reach
from orchestration.discrepancy.laws.map import LawMap
from orchestration.discrepancy.laws.signals import signal_along


@pytest.mark.slow
def test_the_map_has_the_right_law_and_signal_among_the_first(drag, spring):
    for (_, diagnosis), law, signal in ((drag, "friction", "omega"), (spring, "gravity", "angle")):
        found = LawMap(search_of(diagnosis), diagnosis.selection.base)
        entries = found.entries()
        right = [
            e
            for e in entries
            if (e.law, e.signal.name, e.signal.memory, e.kind) == (law, signal, "", "add")
        ]
        assert right[0] in entries[:8]
        assert right[0].curve.gain > max(10.0 * found.chance, 0.95 * entries[0].curve.gain)


@pytest.mark.slow
def test_of_laws_that_do_the_same_each_is_multiplied(spring):
    """A torque may be added anywhere in a balance, but a friction that grows with the angle is no
    other gravity.
    """
    found = LawMap(search_of(spring[1]), spring[1].selection.base)
    assert {"gravity", "friction", "acceleration"} in [
        set(laws) for laws in found.candidates.values()
    ]
    multiplied = {(e.law, e.signal.name) for e in found.entries() if e.kind == "multiply"}
    assert {("gravity", "angle"), ("friction", "angle"), ("acceleration", "angle")} <= multiplied


def by_itself(law_map, record, entry):
    """Score one entry by its own columns, run by run, sample by sample of the basis."""
    course = law_map.courses[entry.driven]
    responses = {}
    for run, simulated, response in course.parts:
        sides = signal_along(entry.signal, simulated, response.values)
        begin, end = entry.basis(sides.begin), entry.basis(sides.end)
        if entry.kind == "multiply":
            value = response.values[entry.law]
            begin, end = begin * value.begin[:, None], end * value.end[:, None]
        for output, rows in response(entry.law, Sides(begin, end)).items():
            whole = responses.setdefault(output, np.zeros((law_map._n, len(entry.basis.knots))))
            whole[run.samples] = rows
    columns = record({o: rows[law_map._present[o]] for o, rows in responses.items()})
    free, own = record.free(columns), record.own(columns)
    products = free.T @ free
    found = RegressorColumns(entry.basis, products, products + own.T @ own, record.samples)
    likeliest = found.best(free.T @ record.residual)
    ((curve, step),) = record.within_reach([likeliest], columns.T[None])
    return curve, free @ curve.values, step


@pytest.mark.slow
def test_signals_that_are_scored_together_are_as_each_by_itself(drag):
    law_map = LawMap(search_of(drag[1]), drag[1].selection.base)
    entries = law_map.entries()
    assert {e.kind for e in entries} == {"add", "multiply"}
    assert len({len(e.basis.knots) for e in entries}) > 1
    for entry in entries[::7]:
        record = LinearisedRecord(
            law_map.courses[entry.driven],
            law_map._fitted.fit.prior_precision,
            law_map._present,
            law_map.floor,
            reach(law_map._powers),
        )
        curve, effect, step = by_itself(law_map, record, entry)
        assert entry.curve.gain == pytest.approx(curve.gain, rel=1e-6, abs=1e-4)
        assert entry.curve.values == pytest.approx(curve.values, rel=1e-4, abs=1e-9)
        assert entry.step == pytest.approx(step, rel=1e-4, abs=1e-6)
        assert abs(entry.direction @ effect) == pytest.approx(np.linalg.norm(effect), rel=1e-6)
