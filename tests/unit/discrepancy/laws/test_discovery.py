"""Claims: what a law lacks is found, in records of plants that share no code with the models; in
clean ones nothing is.

The oracle is the plant: its hidden curve, and its parameters.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from orchestration.discrepancy.laws import discovery
from orchestration.discrepancy.laws.base import search_of
from orchestration.discrepancy.laws.discovery import discover
from orchestration.discrepancy.laws.fit import CurveFit
from orchestration.discrepancy.laws.fitting import Fitting
from orchestration.discrepancy.laws.linear.unknown_input import estimate_unknown_input
from orchestration.discrepancy.laws.map import LawMap
from orchestration.discrepancy.laws.plausible import Plausibility
from studies.clean.records import KINDS, conditions, draw
from studies.hidden.curves import hard_sinh, power
from studies.plants.change import static
from studies.plants.library import PLANTS, altered
from tests.support.lacking import diagnosed, motor
from tests.support.pace import slow_but

pytestmark = pytest.mark.timeout(120)
HIDDEN = power(0.04, 150.0, 2.0)
FEW = 8  # entries of a map


@pytest.fixture(scope="module")
def drag(tmp_path_factory):
    path = tmp_path_factory.mktemp("drag") / "motor.csv"
    drawn = motor(path, HIDDEN)
    return drawn, diagnosed(path, drawn.plant.model)


@pytest.fixture(scope="module")
def spring(tmp_path_factory):
    """A pendulum with so much more of a spring that its model runs out of phase."""
    path = tmp_path_factory.mktemp("spring") / "pendulum.csv"
    case = conditions(PLANTS["Pendulum"], KINDS[0], 2, np.random.default_rng(2))
    drawn = draw(case, plant=altered("Pendulum", static("gravity", hard_sinh(0.6, 0.3))))
    drawn.write(path)
    return drawn, diagnosed(path, drawn.plant.model)


each = pytest.mark.parametrize("plant", slow_but(["found_drag", "found_spring"], "found_drag"))


@pytest.fixture(scope="module")
def found_drag(drag):
    """Of the entries that tell most; that all of a map are fitted is shown where a diagnosis asks
    for laws.
    """
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(
            LawMap, "entries", lambda self, known=LawMap.entries: known(self)[: 2 * FEW]
        )
        return discover(drag[1])


@pytest.fixture(scope="module")
def found_spring(spring):
    return discover(spring[1])


def widths(drawn, residual):
    """Noise widths that are left, by output."""
    return {o: float(np.sqrt(np.mean(e**2))) / drawn.deviation[o] for o, e in residual.items()}


def test_a_free_course_lets_a_model_follow_where_its_own_run_tells_nothing(spring):
    drawn, diagnosis = spring
    base = diagnosis.selection.base
    assert widths(drawn, base.fit.residual)["position"] > 20.0
    search = search_of(diagnosis)
    found = LawMap(search, base)
    course = estimate_unknown_input(search, base, found.laws, "acceleration")
    assert widths(drawn, course.unexplained)["position"] < 1.5


def test_a_course_is_what_the_plant_has_more(drag):
    drawn, diagnosis = drag
    base = diagnosis.selection.base
    found = LawMap(search_of(diagnosis), base)
    (_, course, _), followed = found.courses["acceleration"].parts[0], found.courses["acceleration"]
    assert max(widths(drawn, base.fit.residual).values()) > 5.0
    assert all(width < 1.3 for width in widths(drawn, followed.unexplained).values())
    assert np.ptp(course.states["omega"].begin) == pytest.approx(
        np.ptp(drawn.clean["speed"]), rel=0.1
    )


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


def test_a_curve_and_what_the_model_has_are_the_plants_law(drag, found_drag):
    drawn, _ = drag
    best = found_drag.corrections[0]
    knots, values = best.entry.basis.knots, best.fitted.curve.values
    whole = best.fitted.values["damping"] * knots + values
    truth = drawn.truth["damping"] * knots + np.array([HIDDEN(x) for x in knots])
    inner = (knots > 0.9 * knots[0]) & (knots < 0.9 * knots[-1])
    assert whole[inner] == pytest.approx(truth[inner], abs=0.03 * np.abs(truth).max())


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


@each
def test_it_is_confirmed_by_what_no_fit_has_seen(plant, request):
    best = request.getfixturevalue(plant).corrections[0]
    assert best.confirmed
    before, after = best.errors
    assert all(after[o] < 0.5 * before[o] for o in before)


def test_what_is_likelier_and_simulates_worse_is_not_confirmed(found_drag):
    best = found_drag.corrections[0]
    before, after = best.errors
    assert best.confirmed
    assert not replace(best, errors=(after, before)).confirmed


@each
def test_what_is_told_stands_there_once(plant, request):
    """Of lags with several constants one is fitted, since its constant is fitted too."""
    told = [one.entry.key for one in request.getfixturevalue(plant).corrections]
    assert len(told) == len(set(told))


@pytest.mark.parametrize("seed", slow_but([1, 2, 3], 1))
def test_nothing_is_found_where_nothing_is_hidden(tmp_path, seed):
    drawn = motor(tmp_path / "motor.csv", None, seed)
    found = discover(diagnosed(tmp_path / "motor.csv", drawn.plant.model))
    assert not [one for one in found.corrections if one.confirmed]


def test_a_fit_starts_from_the_nearest_of_its_starts(drag):
    """Of values far off and of those that go with the curve the latter are taken, in whatever order
    they come.
    """
    _, diagnosis = drag
    base, search = diagnosis.selection.base, search_of(diagnosis)
    found = LawMap(search, base)
    best = found.entries()[0]
    far = {"damping": 1e3 * base.fit.values["damping"]}
    fit = CurveFit(search, base, Fitting(search, base, found).effect(best), best.basis)
    fits = [
        fit.settled(fit.first(starts, best.curve, found.floor))
        for starts in ([found.beside(best)], [far, found.beside(best)], [found.beside(best), far])
    ]
    assert fits[1].criterion == pytest.approx(fits[0].criterion, abs=0.1)
    assert fits[2].criterion == pytest.approx(fits[0].criterion, abs=0.1)


def test_a_fit_begins_with_less_of_a_curve_where_the_map_is_far_off(drag):
    """From a curve three thousand times as large, and the other way, it ends where it ends from the
    right one.
    """
    _, diagnosis = drag
    base, search = diagnosis.selection.base, search_of(diagnosis)
    found = LawMap(search, base)
    best = next(e for e in found.entries() if e.key == ("friction", "omega", "", "add"))
    fit = CurveFit(search, base, Fitting(search, base, found).effect(best), best.basis)
    much = replace(best.curve, values=-3000.0 * best.curve.values)
    right, wrong = (
        fit.settled(fit.first([base.fit.values], c, found.floor)) for c in (best.curve, much)
    )
    assert base.fit.bic - right.criterion > 200.0
    assert wrong.criterion == pytest.approx(right.criterion, abs=2.0)


@pytest.mark.parametrize(
    ("others", "much"),
    [
        (("acceleration", "load", "", "add"), discovery._FAR),
        pytest.param(("friction", "voltage", "", "multiply"), np.inf, marks=pytest.mark.slow),
    ],
)
def test_the_first_order_may_be_wrong(drag, monkeypatch, others, much):
    """Where much is left all signals are tried as they are, and always those that stand beside a
    law.
    """
    monkeypatch.setattr(discovery, "_FAR", much)
    monkeypatch.setattr(
        LawMap,
        "entries",
        lambda self, known=LawMap.entries: [e for e in known(self) if not e.signal.memory][:FEW],
    )
    monkeypatch.setattr(
        Plausibility, "worth_a_fit", lambda self, entries: [e for e in entries if e.key == others]
    )
    best = discover(drag[1]).corrections[0]
    assert best.entry.key[:2] == ("friction", "omega")


def test_of_several_that_a_record_cannot_tell_apart_the_others_are_told_beside_the_first(
    found_drag,
):
    best = found_drag.corrections[0]
    assert (best.entry.law, best.entry.signal.name, best.entry.signal.memory) == (
        "friction",
        "omega",
        "",
    )
    told = [(e.law, e.signal.name, e.signal.memory) for e in best.alike]
    assert len(told) == len(set(told))
    assert ("friction", "omega", "") not in told


def test_shapes_are_told_in_the_order_of_their_criterion(found_drag):
    best = found_drag.corrections[0]
    above = [criterion for _, criterion in best.shapes]
    assert above == sorted(above)
    assert best.shape in ("", best.shapes[0][0])


@pytest.mark.parametrize(
    ("gain", "behind", "told"),
    [
        (100.0, 5.9, True),
        (100.0, 6.1, False),
        (2000.0, 19.0, True),
        (2000.0, 21.0, False),
        (2000.0, -3.0, True),
    ],
)
def test_a_shape_is_told_where_it_is_about_as_good_as_the_curve(gain, behind, told):
    """A curve of a thousand samples bends after everything; one per cent of what it gains buys a
    name.
    """
    shape = SimpleNamespace(fit=SimpleNamespace(bic=-gain + behind))
    found = discovery._nearest(
        [("cubic", shape), ("linear", shape)], SimpleNamespace(criterion=-gain), 0.0
    )
    assert found == (("cubic", shape) if told else None)
