"""Claims: two effects hidden at once are two causes, both at work, and are counted by the causes
that name them.

`python -m studies.judging.hidden --two 60` draws such records and diagnoses them.
"""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from studies.clean.records import draw
from studies.hidden.records import HiddenCase, cases, cases_of_two, draw_hidden, left, left_beside
from studies.hidden.variations import OUTSIDE, USUAL
from studies.judging import answers, hidden, hidden_two
from studies.judging.floor import BASE, Fitted
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
    """What does not hang on the outputs adds up, each with its own memory and as large as by
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
    assert min(left_beside(drawn)) > answers.LEAST


def test_a_place_has_one_change():
    change = static("voltage", lambda x: x)
    with pytest.raises(ValueError, match="two changes at voltage of Motor"):
        altered("Motor", change, change)


@pytest.mark.slow
def test_what_is_left_beside_the_other():
    """Where one adds to the output whatever the other does, as much as alone; and nothing of what
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
    assert resistance < 0.1 < answers.LEAST < drift


@pytest.mark.slow
def test_records_that_do_not_count_are_not_diagnosed(monkeypatch):
    def fits(cls, drawn, effects, settings):
        both = len(drawn.plant.changes) == 2
        return {BASE: Fitted(0.0, 1.0), name: Fitted(0.0, 5.0 if both is one_alone else 50.0)}, 0.0

    monkeypatch.setattr(hidden_two, "diagnosed", lambda *a: pytest.fail("it was diagnosed"))
    monkeypatch.setattr(hidden_two, "fitted_alone", fits)
    name, one_alone = "sensor_lag(voltage)", False
    row = hidden_two.judge(_TWO)
    assert (hidden_two.left_out(row), row["alike"]) == ("alike", [name])
    name, one_alone = "sensor_drift(voltage)", True  # although it is one of the two
    row = hidden_two.judge(_TWO)
    assert (hidden_two.left_out(row), row["alone"]) == ("one alone", [name])
    assert "sensor_drift(voltage)" in hidden_two.answer_line(row)
    monkeypatch.setattr(hidden_two, "left_beside", lambda drawn: [1.29, 9.0])
    assert hidden_two.left_out(hidden_two.judge(_TWO)) == "too little"


def _row(case=_TWO, **more):
    return (
        asdict(case)
        | {
            "pair": "drift + resistance",
            "widths": 5.0,
            "seconds": 1.0,
            "verdict": "cause",
            "groups": [["a", "b"], ["d"]],
            "right": [["b"], ["d"]],
            "related": ["b", "c", "d"],
            "alike": [],
            "alone": [],
        }
        | more
    )


@pytest.mark.parametrize(
    ("more", "what", "false"),
    [
        ({}, "one", ["a"]),  # what cannot be told from it counts only where the verdict says so
        ({"verdict": "ambiguous"}, "both", []),
        ({"groups": [["d"], ["b"]]}, "both", []),
        ({"groups": [["d"], ["c"]]}, "one", []),
        ({"groups": [["d"], ["b"], ["x"]]}, "both", ["x"]),
        ({"groups": [["x"], ["y"]]}, "none", ["x", "y"]),
        ({"groups": [["d", "b"]], "verdict": "ambiguous"}, "one", []),  # no cause stands for both
        ({"groups": [["d", "b"], ["b"]], "verdict": "ambiguous"}, "both", []),
        ({"groups": []}, "none", []),
        ({"groups": [], "verdict": "refused"}, "refused", []),
    ],
)
def test_rules_of_naming_two(more, what, false):
    row = _row(**more)
    assert hidden_two.named(row) == what
    assert hidden_two.false_causes(row) == false


@pytest.mark.slow
def test_a_page_tells_of_two_at_once(tmp_path):
    kept, page = tmp_path / "5.jsonl", tmp_path / "page.md"
    drawn = cases_of_two(4, 5)
    said = {}, {"verdict": "ambiguous"}, {"groups": [["x"]]}, {"widths": 1.0}
    rows = [_row(case, **more) for case, more in zip(drawn, said, strict=True)]
    kept.with_stem("5-two").write_text(
        "".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8"
    )
    hidden.STUDY.main(
        ["--records", "0", "--two", "4", "--seed", "5", "--kept", str(kept), "--out", str(page)]
    )
    text = page.read_text(encoding="utf-8")
    assert "--records 0 --two 4 --seed 5" in text
    section = text.partition("## Two at once\n")[2]
    assert "4 records: 1 (25.0 %) leave too little" in section
    assert (
        "Both are named in 1 (33.3 %), one in 1 (33.3 %), none in 1 (33.3 %); false causes in 2"
        " (66.7 %)." in section
    )
    assert str(drawn[2]) in section
    assert str(drawn[1]) not in section
