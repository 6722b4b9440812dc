"""Claims: the law and the signal that the plant has more are among the first of the map."""

from __future__ import annotations

from orchestration.discrepancy.laws.base import search_of
from orchestration.discrepancy.laws.map import LawMap


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
