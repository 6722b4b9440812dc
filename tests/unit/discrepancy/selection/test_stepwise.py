"""How much evidence an effect needs before it is named, where that evidence is known beforehand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lsim, lti

from fmus.kit.inputs import backlash, dead_zone, input_lag
from fmus.kit.sensors import (
    measurement_effects,
    sensor_gain,
    sensor_lag,
    sensor_offset,
    transport_delay,
)
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.selection import stepwise
from orchestration.discrepancy.selection.scoring import score
from orchestration.discrepancy.selection.search import Search
from orchestration.discrepancy.selection.stepwise import Selection, Step, place_of, select
from studies.plants.models.cell import EFFECTS, Cell
from tests.support.regression_model import (
    ASYMMETRY,
    COUNT,
    OFFSET,
    OTHERS,
    Amplifier,
    asymmetric_record,
    divided_record,
    offset_record,
)

VERY_STRONG = 10.0  # fall of BIC (Kass and Raftery, J. Am. Stat. Assoc. 90, 1995)
PARAMETER = float(np.log(COUNT))  # that BIC asks of each
MARGIN = 2.5  # what a likelihood that knows less than everything may differ by


def named(ratio, effects, seed):
    search = Search(offset_record(ratio, seed), Amplifier, ["gain"])
    return [step.chosen.effect_name for step in select(search, effects).steps]


@pytest.mark.parametrize("seed", [1, 2])
def test_evidence_that_is_not_very_strong_names_nothing(seed):
    assert named(VERY_STRONG + PARAMETER - MARGIN, [OFFSET], seed) == []


@pytest.mark.parametrize("seed", [1, 2])
def test_very_strong_evidence_names_an_effect(seed):
    assert named(VERY_STRONG + PARAMETER + MARGIN, [OFFSET], seed) == ["force_offset"]


@pytest.mark.parametrize("seed", [1, 2])
def test_looking_at_many_effects_has_its_price(seed):
    """Of k of them the best is named for twice ln k more."""
    price = 2.0 * np.log(1 + len(OTHERS))
    assert price > MARGIN
    enough_for_one = VERY_STRONG + PARAMETER + 0.5 * price
    assert named(enough_for_one, [OFFSET, *OTHERS], seed) == []
    assert "force_offset" in named(enough_for_one + price + MARGIN, [OFFSET, *OTHERS], seed)


@pytest.mark.parametrize("seed", [1, 2])
def test_what_the_model_itself_can_do_is_no_evidence_for_more(seed):
    """A base model that stopped at a lesser optimum; an effect that does nothing comes with the
    better one.
    """
    search = Search(offset_record(0.0, seed), Amplifier, ["gain"])
    best = search.nominal()
    lesser = replace(best, fit=replace(best.fit, deviance=best.fit.deviance + 60.0))
    assert select(search, [OFFSET], score(search, lesser, [OFFSET])).steps == []


@pytest.mark.parametrize("seed", [1, 2])
def test_noise_that_is_larger_where_an_effect_acts_makes_it_less_sure(seed):
    """A third: the fourth moment of a Gaussian signal, which the noise is as large as, is three."""
    enough = VERY_STRONG + PARAMETER + MARGIN
    assert named_asymmetry(enough, seed, varying=False) == ["asymmetric_friction"]
    search = Search(
        asymmetric_record(3.0 * (enough - 2.0 * MARGIN), seed, True), Amplifier, ["gain"]
    )
    selection = select(search, [ASYMMETRY])
    assert (selection.steps, selection.unsure) == ([], {"asymmetric_friction"})
    assert named_asymmetry(3.0 * enough, seed, varying=True) == ["asymmetric_friction"]


def named_asymmetry(ratio, seed, varying):
    search = Search(asymmetric_record(ratio, seed, varying), Amplifier, ["gain"])
    return [step.chosen.effect_name for step in select(search, [ASYMMETRY]).steps]


STRONG = 6.0  # difference of BIC (Kass and Raftery)


@pytest.mark.parametrize(
    ("gap", "alternatives"), [(STRONG - MARGIN, ["asymmetric_friction"]), (STRONG + MARGIN, [])]
)
@pytest.mark.parametrize("seed", [1, 2])
def test_another_effect_is_an_alternative_unless_there_is_strong_evidence_between_them(
    gap, alternatives, seed
):
    search = Search(divided_record(60.0, gap, seed), Amplifier, ["gain"])
    (step,) = select(search, [OFFSET, ASYMMETRY]).steps
    assert step.chosen.effect_name == "force_offset"
    assert [other.effect_name for other in step.alternatives] == alternatives


@pytest.mark.parametrize("near", [49.0, 51.0], ids=["nominal is near", "nominal is far"])
@pytest.mark.parametrize("off", [1.01, 1.03], ids=["as near as the free run", "farther off"])
def test_effects_are_scored_where_the_model_is_less_likely_or_nearer(monkeypatch, near, off):
    """By 50 of minus twice the logarithm near nominal, and by 2 % of the error at the free run."""
    search = Search(offset_record(30.0, 1), Amplifier, ["gain"])
    base = search.nominal()
    farther = {o: off * e for o, e in base.free_run.residual.items()}
    base = replace(base, fit=replace(base.fit, residual=farther))
    nominal = replace(base, fit=replace(base.fit, deviance=base.fit.deviance + near))
    monkeypatch.setattr(Search, "near_nominal", lambda self, prior_std: nominal)
    monkeypatch.setattr(stepwise, "score", lambda search, model, effects: model.fit)
    scored = stepwise._scored_elsewhere(search, base, [OFFSET])
    expected = [nominal.fit] if near > 50.0 else []
    assert scored == expected + ([base.free_run] if off > 1.02 else [])


LATE = 2  # samples
OHMIC, POLARISATION, TIME_CONSTANT = 0.04, 0.025, 18.7  # ohm, ohm, s


def late_cell_record(seed, period=0.5, count=800, settled=400):
    """A cell that is measured late, by SciPy's exact solution for a current of straight lines."""
    random = np.random.default_rng(seed)
    time = period * np.arange(count + settled)
    frequencies = 0.003, 0.007, 0.013, 0.023, 0.037, 0.053  # Hz
    current = sum(np.sin(2 * np.pi * (f * time + random.random())) for f in frequencies)
    _, relaxed, _ = lsim(lti([1.0], [TIME_CONSTANT, 1.0]), current, time)
    voltage = np.roll(3.3 - OHMIC * current - POLARISATION * relaxed, LATE)
    voltage += 1e-4 * random.standard_normal(time.size)
    return Dataset(
        time[:count],
        {"current": current[settled:]},
        {"voltage": voltage[settled:]},
        linear=True,
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_a_cause_that_was_missed_at_first_is_named_alone_where_it_needs_no_other(monkeypatch, seed):
    """A second pair follows a delay closely, and what is left of it is less than a tenth."""
    delay = next(e for e in measurement_effects(Cell) if e.id == "transport_delay")
    search = Search(late_cell_record(seed), Cell, ["ocv", "R0", "R1", "tau1", "relaxed_start"])
    plain = stepwise.ranked
    looked = []

    def with_poor_first_fits(*given, **fits):
        looked.append(given)
        search, below, scored, effects, *rest = given
        if len(looked) == 1:
            effects = [e for e in effects if e is not delay]
        return plain(search, below, scored, effects, *rest, **fits)

    monkeypatch.setattr(stepwise, "ranked", with_poor_first_fits)
    (step,) = select(search, [EFFECTS["second_kelvin"], delay]).steps
    assert step.chosen.effect is delay
    assert step.alternatives == []
    values = step.chosen.fit.values
    assert values["voltage_delay"] == pytest.approx(LATE * 0.5, abs=0.02)
    assert values["R0"] == pytest.approx(OHMIC, rel=0.02)
    assert values["tau1"] == pytest.approx(TIME_CONSTANT, rel=0.05)


def test_what_acts_where_a_cause_does_is_its_shape():
    gain, offset, lag, delay = (
        make(Amplifier, "shown")
        for make in (sensor_gain, sensor_offset, sensor_lag, transport_delay)
    )
    friction, cubic = OTHERS[0], OTHERS[2]  # of one law over one signal
    effects = gain, lag, offset, friction
    models = [SimpleNamespace(effect=effect) for effect in effects]
    steps = [Step(model, 20.0, 20.0, 0.0, [], []) for model in models]
    groups = Selection(models[0], steps).by_cause
    assert [[step.chosen.effect for step in group] for group in groups] == [
        [gain, offset],
        [lag],
        [friction],
    ]
    assert place_of(friction) == place_of(cubic)
    assert place_of(lag) == place_of(delay)
    assert place_of(OFFSET) == OFFSET, "it is of no signal, and has no other shapes"


def test_inputs_are_places_and_what_is_late_is_another_matter():
    slow, uneven, dead = (make(Amplifier, "signal") for make in (input_lag, backlash, dead_zone))
    assert place_of(uneven) == place_of(dead) != place_of(slow)
