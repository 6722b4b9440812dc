"""Claims: two effects hidden at once are two causes, both at work."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from studies.clean.records import draw
from studies.hidden.records import HiddenCase, cases, cases_of_two, draw_hidden, left, left_beside
from studies.hidden.variations import OUTSIDE, USUAL
from studies.judging.study import LEAST
from studies.plants.change import NOTHING, static
from studies.plants.library import altered

_ADDITIVE = [
    ("Cell", "Cell, resistance, exponent", "Cell, sensor drift, growing"),
    ("Galvanostat", "Galvanostat, sensor drift, root", "Galvanostat, input lag, two in a row"),
    ("ThermalNodes", "ThermalNodes, input lag, spread", "ThermalNodes, sensor drift, settling"),
]
_TWO = HiddenCase("Cell", "triangle", "Gaussian", 5, hidden=_ADDITIVE[0][1], second=_ADDITIVE[0][2])


def test_cases_of_two_repeat_and_are_two_causes():
    drawn = cases_of_two(300, 3)
    assert drawn == cases_of_two(300, 3)
    assert [case.second for case in drawn] != [case.second for case in cases_of_two(300, 4)]
    assert {case.plant for case in drawn} == {*USUAL}
    assert {case.strength for case in drawn} == {1.0, 0.3}
    for case in drawn:
        first, second = (one.variation for one in case.alone())
        assert first.plant == second.plant == case.plant
        assert first.family != second.family
        assert OUTSIDE not in (first.family, second.family)
        assert first.place != second.place
        assert not first.right & second.right
    pairs = {frozenset(one.variation.family for one in case.alone()) for case in drawn}
    assert frozenset({"dry friction", "input lag"}) in pairs
    assert (
        frozenset({"storage inside", "conduction"}) not in pairs
    )  # one law, over and remembering one signal
    first, again = draw_hidden(drawn[3]), draw_hidden(drawn[3])
    assert all(np.array_equal(first.outputs[o], again.outputs[o]) for o in first.outputs)


def test_one_alone_is_as_it_was():
    case = cases(1, 3)[0]
    assert case.alone() == [case]
    assert _TWO.alone() == [
        replace(_TWO, second=None),
        replace(_TWO, hidden=_TWO.second, second=None),
    ]


@pytest.mark.parametrize(("plant", "first", "second"), _ADDITIVE)
def test_both_are_at_work(plant, first, second):
    """Effects that do not depend on the outputs add up, each with its own memory and as large as by
    itself.
    """
    case = HiddenCase(plant, "multisine", "Gaussian", 6, hidden=first, second=second, strength=0.3)
    both, alone = draw_hidden(case), [draw_hidden(one) for one in case.alone()]
    none = draw(case, plant=altered(plant, NOTHING))
    for output, y in none.clean.items():
        added = [one.clean[output] - y for one in alone]
        assert both.clean[output] - y == pytest.approx(sum(added), abs=1e-6 * np.ptp(y))
    assert all(any(np.std(one.clean[o] - y) > 0.0 for o, y in none.clean.items()) for one in alone)


def test_the_order_of_changes_is_nothing():
    lags = "Motor, input lag, two in a row", "Motor, sensor lag, spread"
    there, back = (
        draw_hidden(HiddenCase("Motor", "PRBS", "Gaussian", 5, hidden=first, second=second))
        for first, second in (lags, lags[::-1])
    )
    for output, y in there.clean.items():
        assert back.clean[output] == pytest.approx(y, abs=1e-9 * np.ptp(y))


def test_a_late_logger_is_late_with_what_the_other_made():
    late = HiddenCase(
        "Galvanostat",
        "PRBS",
        "Gaussian",
        5,
        hidden="Galvanostat, input lag, spread",
        second="Galvanostat, sensor delay, whole samples",
    )
    drawn = draw_hidden(late)
    y, passed = drawn.clean["current"], draw_hidden(late.alone()[0]).clean["current"]
    delay = next(k for k in range(1, 100) if np.array_equal(y[k:], passed[:-k]))
    assert 0.15 <= delay * drawn.step <= 0.4
    assert min(left_beside(drawn)) > LEAST


def test_a_place_has_one_change():
    change = static("voltage", lambda x: x)
    with pytest.raises(ValueError, match="two changes at voltage of Motor"):
        altered("Motor", change, change)


@pytest.mark.slow
def test_what_is_left_beside_the_other():
    """If one adds to the output whatever the other does, as much as alone; and nothing of what
    parameters can do.

    A resistance that a binary stimulus meets at one level each way is another resistance.
    """
    lagging = HiddenCase(
        "Galvanostat", "PRBS", "Gaussian", 5, hidden=_ADDITIVE[1][2], second=_ADDITIVE[1][1]
    )
    for case, k in ((_TWO, 0), (lagging, 1)):
        both, one = draw_hidden(case), draw_hidden(case.alone()[k])
        (output,) = both.deviation
        sizes = left_beside(both)[k] * both.deviation[output], left(one) * one.deviation[output]
        assert sizes[0] == pytest.approx(sizes[1], rel=0.1)
    resistance, drift = left_beside(draw_hidden(replace(_TWO, stimulus="PRBS")))
    assert resistance < 0.1 < LEAST < drift
