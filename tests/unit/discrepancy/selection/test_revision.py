"""Effects judged together: the set that is named is the best of all sets, which here can be
computed by regression.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import chain, combinations

import numpy as np
import pytest

from fmus.kit.functions import cos
from fmus.kit.sensors import measurement_effects
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.selection import revision
from orchestration.discrepancy.selection.revision import (
    _at_fewest_places,
    _chain,
    explaining,
    needed,
    revised,
    without_effect,
)
from orchestration.discrepancy.selection.scoring import score
from orchestration.discrepancy.selection.search import Search
from orchestration.discrepancy.selection.stepwise import select
from tests.support.pace import slow_but
from tests.support.regression_model import (
    COUNT,
    GAIN,
    OFFSET,
    SPREAD,
    STEP,
    Amplifier,
    offset_record,
    shaped,
)

SHARE = 0.3  # of what only the mixture does
# Polynomials of a Gaussian signal without a mean, which an autoregression might take for noise
# (Hermite).
SHAPES = {
    "even": lambda s: s * s - 1.0,
    "odd": lambda s: s * s * s - 3.0 * s,
    "far": lambda s: np.cos(40.0 * s) if isinstance(s, np.ndarray) else cos(40.0 * s),
    "mixture": lambda s: (
        (s * s - 1.0) + (s * s * s - 3.0 * s) + SHARE * (s * s * s * s - 6.0 * s * s + 3.0)
    ),
}


EFFECTS = [shaped(name, SHAPES[name]) for name in SHAPES if name != "far"]


def columns(signal):
    """What the model and each effect does to the output."""
    return {"": signal} | {name: shape(signal) for name, shape in SHAPES.items() if name != "far"}


def best_set(data):
    """Of all sets of effects the one of the least BIC, with the price of having looked at so
    many.
    """
    there = columns(data.inputs["signal"])
    names = [name for name in there if name]

    def bic(chosen):
        table = np.column_stack([there[""], *(there[n] for n in chosen)])
        left = data.measured["shown"] - table @ np.linalg.lstsq(table, data.measured["shown"])[0]
        return COUNT * np.log(np.mean(left**2)) + len(chosen) * (
            np.log(COUNT) + 2.0 * np.log(len(names))
        )

    sets = chain.from_iterable(combinations(names, k) for k in range(len(names) + 1))
    return set(min(sets, key=bic))


def record(parts, seed):
    """A record with so much of every effect, in noise widths."""
    random = np.random.default_rng(seed)
    signal = random.standard_normal(COUNT)
    hidden = sum(SPREAD * size * columns(signal)[name] for name, size in parts.items())
    shown = GAIN * signal + hidden + SPREAD * random.standard_normal(COUNT)
    return Dataset(STEP * np.arange(COUNT), {"signal": signal}, {"shown": shown})


@pytest.mark.slow
@pytest.mark.parametrize("seed", slow_but([2, 3, 4], 2))
def test_what_was_taken_for_the_sum_of_two_causes_does_not_stay_beside_them(seed):
    data = record({"even": 1.0, "odd": 0.58}, seed)
    search = Search(data, Amplifier, ["gain"])
    forward = select(search, EFFECTS)
    assert forward.steps[0].chosen.effect_name == "mixture"  # otherwise this record shows nothing
    together = revised(search, forward, EFFECTS)
    assert {step.chosen.effect_name for step in together.steps} == best_set(data) == {"even", "odd"}
    assert all(step.gain > 10.0 for step in together.steps)


@pytest.mark.slow
def test_only_what_came_near_is_tried_in_the_place_of_another(monkeypatch):
    far, asked = shaped("far", SHAPES["far"]), list[set[str]]()
    data = record({"even": 1.0, "odd": 0.58}, 2)
    search = Search(data, Amplifier, ["gain"])
    forward = select(search, [*EFFECTS, far])
    assert forward.steps[0].gains["far"] < 0.0 < forward.steps[0].gain
    plain = revision.ranked
    monkeypatch.setattr(
        revision, "ranked", lambda *given: asked.append({e.id for e in given[3]}) or plain(*given)
    )
    together = revised(search, forward, [*EFFECTS, far])
    assert {step.chosen.effect_name for step in together.steps} == {"even", "odd"}
    assert asked
    assert all("far" not in names for names in asked)


@pytest.mark.parametrize("seed", slow_but([2, 3], 2))
def test_what_is_needed_stays(seed):
    data = record({"mixture": 1.0, "odd": -0.8}, seed)
    search = Search(data, Amplifier, ["gain"])
    together = revised(search, select(search, EFFECTS), EFFECTS)
    assert (
        {step.chosen.effect_name for step in together.steps} == best_set(data) == {"mixture", "odd"}
    )


@pytest.mark.parametrize("order", [1, -1])
def test_physics_takes_the_credit_where_a_sensor_explains_no_more(order):
    """An offset of what is shown is one of how it is measured, to the last digit."""
    sensor = next(e for e in measurement_effects(Amplifier) if e.id == "sensor_offset")
    search = Search(offset_record(60.0, 1), Amplifier, ["gain"])
    (step,) = select(search, [sensor, OFFSET][::order]).steps
    assert step.chosen.effect_name == "force_offset"
    assert [other.effect_name for other in step.alternatives] == ["sensor_offset(shown)"]


def test_what_explains_hardly_anything_of_what_is_wrong_is_not_named():
    """A wave that no effect makes, and a little of one that does: shares of the variance."""
    random = np.random.default_rng(5)
    signal = 1.7 * np.sin(
        2.0 * np.pi * np.arange(COUNT) / 97.0
    )  # slow: so is the wave, which noise is not
    even = SHAPES["even"](signal)
    wave = np.cos(8.0 * signal)
    wave -= (
        np.column_stack([signal, even]) @ np.linalg.lstsq(np.column_stack([signal, even]), wave)[0]
    )

    def found(share):
        size = np.sqrt(share / (1.0 - share) * np.mean(wave**2) / np.mean(even**2))
        shown = (
            GAIN * signal
            + 3.0 * SPREAD * (wave + size * even)
            + SPREAD * random.standard_normal(COUNT)
        )
        search = Search(
            Dataset(STEP * np.arange(COUNT), {"signal": signal}, {"shown": shown}),
            Amplifier,
            ["gain"],
        )
        forward = select(search, EFFECTS[:1])
        assert [step.chosen.effect_name for step in forward.steps] == [
            "even"
        ]  # otherwise this record shows nothing
        return explaining(search, forward)

    little, much = found(0.05), found(0.3)
    assert (little.steps, little.unsure, [e.effect_name for e, _ in little.rejected]) == (
        [],
        {"even"},
        ["even"],
    )
    assert len(much.steps) == 1


def test_what_only_changes_the_noise_is_no_cause():
    """Of two models the likelier is no nearer to the record."""
    data = record({"even": 1.0}, 2)
    search = Search(data, Amplifier, ["gain"])
    base = search.nominal()
    (step,) = select(search, EFFECTS[:1], score(search, base, EFFECTS[:1])).steps
    assert step.chosen.is_nearer_than(base)
    assert not base.is_nearer_than(step.chosen)
    farther = replace(
        step.chosen,
        fit=replace(step.chosen.fit, residual={"shown": 1.01 * base.fit.residual["shown"]}),
    )
    assert farther.fit.bic < base.fit.bic
    assert not farther.is_nearer_than(base)


def test_what_brings_the_free_run_no_nearer_is_rejected_as_unsure(monkeypatch):
    search = Search(record({"even": 1.0}, 2), Amplifier, ["gain"])
    monkeypatch.setattr(FittedCandidate, "is_nearer_than", lambda self, base: False)
    selection = select(search, EFFECTS[:1])
    assert (selection.steps, selection.unsure) == ([], {"even"})


@pytest.mark.parametrize("at_one_place", [True, False])
def test_what_may_be_the_shape_of_a_cause_is_named_as_that(monkeypatch, at_one_place):
    """A record of two shapes cannot tell the second from what acts where the first does."""
    even, odd, mixture = EFFECTS
    places = {even: "even", odd: "odd", mixture: "even" if at_one_place else "mixture"}
    monkeypatch.setattr(revision, "place_of", places.get)
    search = Search(record({"even": 1.0, "odd": 0.5}, 6), Amplifier, ["gain"])
    selection = chained(search, "even", "odd")
    first, second = selection.steps
    other = search.fit_with([even, mixture], first.chosen)
    gains = second.gains | {other.effect_name: 19.0}
    untold = replace(second, alternatives=[other], gains=gains)
    named, step = _at_fewest_places(search, replace(selection, steps=[first, untold])).steps
    assert named.chosen.effect_name == "even"
    expected = ("mixture", ["odd"]) if at_one_place else ("odd", ["mixture"])
    assert (step.chosen.effect_name, [e.effect_name for e in step.alternatives]) == expected
    assert step.gains[step.alternatives[0].effect_name] > 0.0


@pytest.mark.parametrize("sizes", [(1.0, 0.4), (0.5, 1.0)])
def test_the_weightiest_comes_first(sizes):
    """What takes away more beside the other; the criterion without each is a regression's."""
    data = record(dict(zip(("even", "odd"), sizes, strict=True)), 6)
    search = Search(data, Amplifier, ["gain"])
    forward = select(search, [EFFECTS[0], EFFECTS[1]])
    there = columns(data.inputs["signal"])

    def left(names):
        table = np.column_stack([there[n] for n in ("", *names)])
        return np.linalg.lstsq(table, data.measured["shown"])[1][0]

    weightiest = max(
        ("even", "odd"), key=lambda name: left([n for n in ("even", "odd") if n != name])
    )
    turned = _chain(
        search, forward, search.fit_with(forward.best.candidate.effects[::-1], forward.best)
    )
    assert [s.chosen.effect_name for s in turned.steps] != [
        s.chosen.effect_name for s in forward.steps
    ]
    for selection in (forward, turned):
        assert revised(search, selection, EFFECTS[:2]).steps[0].chosen.effect_name == weightiest


def test_effects_of_one_cause_stay_in_the_order_in_which_they_were_named(monkeypatch):
    """The odd one weighs more beside the other, as above, but is no cause of its own."""
    monkeypatch.setattr(revision, "place_of", lambda effect: "one place")
    search = Search(record({"even": 0.5, "odd": 1.0}, 6), Amplifier, ["gain"])
    selection = chained(search, "even", "odd")
    steps = revised(search, selection, EFFECTS[:2]).steps
    assert [step.chosen.effect_name for step in steps] == ["even", "odd"]


def chained(search, *names):
    """A selection of these effects, whether the record asks for them or not."""
    effects = [effect for effect in EFFECTS if effect.id in names]
    forward = select(search, effects[:1])
    return _chain(search, forward, search.fit_with(effects, forward.best))


@pytest.mark.parametrize(("small", "named"), [(0.25, {"even"}), (0.6, {"even", "odd"})])
def test_what_takes_less_than_a_tenth_of_the_error_beside_the_others_is_not_needed(small, named):
    """The shares of the error are those of a regression: even has 2 and odd 6 times its square."""
    data = record({"even": 1.5, "odd": small}, 6)
    share = 6.0 * small**2 / (2.0 * 1.5**2 + 6.0 * small**2)
    assert (share > 0.1) is ("odd" in named)
    search = Search(data, Amplifier, ["gain"])
    selection = chained(search, "even", "odd")
    assert selection.best.delta_bic(selection.steps[0].chosen, len(EFFECTS)) > 10.0
    together = needed(search, selection)
    assert {step.chosen.effect_name for step in together.steps} == named
    if "odd" not in named:
        assert [fitted.effect_name for fitted, _ in together.rejected][-1] == "odd"


def test_a_selection_without_an_effect_is_that_of_the_others():
    search = Search(record({"even": 1.0, "odd": 0.5}, 6), Amplifier, ["gain"])
    selection = chained(search, "even", "odd")
    (step,) = without_effect(search, selection, EFFECTS[0]).steps
    assert step.chosen.effect_name == "odd"
    assert without_effect(search, chained(search, "even"), EFFECTS[0]).steps == []
