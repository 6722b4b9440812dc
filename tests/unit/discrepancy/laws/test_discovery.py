"""Claims: what a law lacks is found, in records of plants that share no code with the models; in
clean ones nothing is.

The oracle is the plant: its hidden curve, and its parameters.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, Parameter
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import diagnose
from orchestration.discrepancy.laws import discovery
from orchestration.discrepancy.laws.discovery import discover
from orchestration.discrepancy.laws.map import LawMap
from orchestration.discrepancy.laws.plausible import Plausibility
from tests.support.lacking import FRICTION, diagnosed, motor
from tests.support.pace import slow_but

pytestmark = pytest.mark.timeout(120)
FEW = 8  # entries of a map


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


@pytest.mark.slow
def test_a_curve_and_what_the_model_has_are_the_plants_law(drag, found_drag):
    drawn, _ = drag
    best = found_drag.corrections[0]
    knots, values = best.entry.basis.knots, best.fitted.curve.values
    whole = best.fitted.values["damping"] * knots + values
    truth = drawn.truth["damping"] * knots + np.array([FRICTION(x) for x in knots])
    inner = (knots > 0.9 * knots[0]) & (knots < 0.9 * knots[-1])
    assert whole[inner] == pytest.approx(truth[inner], abs=0.03 * np.abs(truth).max())


@pytest.mark.slow
@each
def test_it_is_confirmed_by_what_no_fit_has_seen(plant, request):
    best = request.getfixturevalue(plant).corrections[0]
    assert best.confirmed
    before, after = best.errors
    assert all(after[o] < 0.5 * before[o] for o in before)


@pytest.mark.slow
def test_what_is_likelier_and_simulates_worse_is_not_confirmed(found_drag):
    best = found_drag.corrections[0]
    before, after = best.errors
    assert best.confirmed
    assert not replace(best, errors=(after, before)).confirmed


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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


class Beacon(Component):
    """A constant that no law changes, beside a gain that does nothing."""

    name = "beacon"
    gain = Parameter(2.0, "1", min=1e-6, max=1e6)
    signal = Input("V")

    @Output("V")
    def shown(self):
        """Always the same."""
        return 2.5


def test_where_no_law_changes_what_was_measured_none_lacks_anything():
    time = 0.1 * np.arange(400)
    signal = np.sin(time)
    noise = np.random.default_rng(1).normal(size=400)
    data = Dataset(time, {"signal": signal}, {"shown": 3.0 * signal + 0.1 * noise})
    assert discover(diagnose(Beacon, data, [])).corrections == []


@pytest.mark.parametrize(
    ("confirmed", "taken"), [((False, True, True), 1), ((False, False, False), 0), ((True,), 0)]
)
def test_the_first_correction_that_unseen_data_confirm_is_taken_or_else_the_best(confirmed, taken):
    corrections = [SimpleNamespace(confirmed=one) for one in confirmed]
    in_turn = range(len(corrections))
    assert discovery._first_confirmed(corrections.__getitem__, in_turn) is corrections[taken]


def test_a_correction_that_cannot_be_fitted_is_passed_over():
    fitted = SimpleNamespace(confirmed=False)
    assert discovery._first_confirmed([None, fitted].__getitem__, range(2)) is fitted
    assert discovery._first_confirmed(lambda _: None, range(2)) is None
