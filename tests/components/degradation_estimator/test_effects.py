"""Effects of the estimator: the base model to the bit at neutral, and the base model on what they
sample elsewhere.
"""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

import fmus
from fmus.degradation_estimator.effects import EFFECTS
from fmus.degradation_estimator.model import DegradationEstimator
from fmus.kit import stack
from fmus.kit.record.compiled import CompiledModel
from tests.support.builds import check_that_bad_values_are_refused, check_that_builds_agree
from tests.support.completeness import Listed, check_described
from tests.support.laws import check_neutral

R1, R2, C, PERIOD = 0.43, 2.35, 2.70, 0.1  # ohm, ohm, F, s
ACTIVE = Listed(
    "ACTIVE",
    __name__,
    {
        "lead_resistance": {"resistance_of_leads": 0.08},
        "voltage_gain": {"voltage_gain_error": 0.03},
        "sampling_skew": {"voltage_skew": 0.3},
    },
    "values of its parameters at which it acts",
)
TIME = PERIOD * np.arange(3001)
CURRENT = np.where(TIME % 5.0 < 2.5, 0.9, -0.9)
effects = pytest.mark.parametrize("name", EFFECTS)


def across(current, r1=R1, r2=R2, c=C, leads=0.0):
    """Voltage of R2 across R1 and C in series, a held current after its change, behind leads: exact
    sampling.
    """
    pole, gain = np.exp(-PERIOD / ((r1 + r2) * c)), r1 * r2 / (r1 + r2)
    return lfilter([gain, (1.0 - pole) * r2 - gain], [1.0, -pole], current) + leads * current


laid = cache(lambda *names: stack(DegradationEstimator, *(EFFECTS[name] for name in names)))
compiled = cache(CompiledModel)


def estimated(cls, voltage, **parameters):
    """Signals after each sample."""
    return compiled(cls).run(TIME, {"current": CURRENT, "voltage": voltage}, parameters).signals


def random_values(cls, seed):
    rng = np.random.default_rng(seed)
    values = {
        p.name: float(p.start) * rng.uniform(0.5, 2.0)
        for p in cls.layout.parameters
        if p.type == "real"
    }
    for v in (*cls.layout.inputs, *cls.layout.discretes):
        values[v.name] = float(rng.normal()) if v.type == "real" else float(rng.integers(2))
    return values | {
        "a": -rng.uniform(0.5, 1.0),
        "samples": float(rng.integers(3)),
        "reversals": float(rng.integers(9)),
    }


def test_catalogue():
    assert fmus.effects("degradation_estimator") == EFFECTS
    check_described("degradation_estimator", EFFECTS)


@settings(max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    chosen=st.sampled_from([*((name,) for name in EFFECTS), tuple(EFFECTS)]),
)
def test_neutral_is_bit_identical(seed, chosen):
    cls = stack(DegradationEstimator, *(EFFECTS[name] for name in chosen))
    values = random_values(cls, seed) | {EFFECTS[name].neutral: 0.0 for name in chosen}
    check_neutral(DegradationEstimator, cls, values)


def test_neutral_runs_are_the_base_run():
    voltage = across(CURRENT)
    base, all_of_them = (estimated(cls, voltage) for cls in (DegradationEstimator, laid(*EFFECTS)))
    for name, values in base.items():
        np.testing.assert_array_equal(all_of_them[name], values)


SAMPLED = {
    "lead_resistance": lambda v: v + 0.08 * CURRENT,
    "voltage_gain": lambda v: 1.03 * v,
    "sampling_skew": lambda v: 0.7 * v + 0.3 * np.append(0.0, v[:-1]),
}


@effects
def test_an_effect_is_the_base_model_on_what_it_samples(name):
    voltage = across(CURRENT) + 1e-3 * np.random.default_rng(1).standard_normal(TIME.size)
    found = estimated(laid(name), voltage, **ACTIVE[name])
    expected, plain = (
        estimated(DegradationEstimator, SAMPLED[name](voltage)),
        estimated(DegradationEstimator, voltage),
    )
    for output in ("R1", "R2", "C", "impedance", "impedance_change", "voltage_limit"):
        assert found[output] == pytest.approx(expected[output], rel=1e-9, abs=1e-9)
    assert abs(found["b0"][-1] / plain["b0"][-1] - 1.0) > 0.01


def test_the_circuit_behind_leads_and_a_wrong_scale():
    """R2 is larger by the leads, and the estimate that of the circuit with them; a scale is that of
    impedances.
    """
    voltage = across(CURRENT)
    truth = estimated(DegradationEstimator, across(CURRENT, leads=0.08))
    leads = estimated(laid("lead_resistance"), voltage, **ACTIVE["lead_resistance"])
    assert leads["R2"][-1] == pytest.approx(R2 + 0.08, rel=1e-4)
    for name in ("R1", "R2", "C"):
        assert leads[name][-1] == pytest.approx(truth[name][-1], rel=1e-9)
    at_once = R1 * R2 / (R1 + R2) + 0.08
    assert leads["R1"][-1] == pytest.approx(at_once * (R2 + 0.08) / (R2 + 0.08 - at_once), rel=1e-4)
    gain = estimated(laid("voltage_gain"), voltage, **ACTIVE["voltage_gain"])
    found = [gain[name][-1] for name in ("R1", "R2", "C")]
    assert found == pytest.approx([1.03 * R1, 1.03 * R2, C / 1.03], rel=1e-4)


def test_a_sample_that_is_late_by_a_period_is_the_one_before():
    voltage = across(CURRENT)
    late = estimated(laid("sampling_skew"), voltage, voltage_skew=1.0)
    expected = estimated(DegradationEstimator, np.append(0.0, voltage[:-1]))
    for name in ("b0", "b1", "a"):
        np.testing.assert_array_equal(late[name], expected[name])
    assert late["b0"][-1] < 0.2 * R1 * R2 / (R1 + R2)  # the current acts at the next sample only


@pytest.mark.slow
@effects
def test_the_slope_at_neutral_is_exact_and_not_zero(name):
    """A score test starts there: sensitivities of the compiled record beside central
    differences.
    """
    cls, voltage = laid(name), across(CURRENT)
    neutral = EFFECTS[name].neutral
    exact = (
        CompiledModel(cls, [neutral])
        .run(TIME, {"current": CURRENT, "voltage": voltage})
        .sensitivities["R2"][-1, 0]
    )
    lowest = EFFECTS[name].declared[neutral].min
    step = 1e-5
    ends = [
        estimated(cls, voltage, **{neutral: s})["R2"][-1]
        for s in (step, -step if lowest < 0.0 else 0.0)
    ]
    assert exact == pytest.approx(
        (ends[0] - ends[1]) / (step if lowest == 0.0 else 2.0 * step), rel=2e-2
    )
    assert abs(exact) > 0.1


def test_builds_agree_on_all_effects(tmp_path):
    cls = stack(DegradationEstimator, *EFFECTS.values(), name="everything")
    values = {k: v for one in ACTIVE.values() for k, v in one.items()} | {
        "settling_time": 1.0,
        "minimum_swing": 0.01,
    }
    ranges = {"current": (-1.0, 1.0), "voltage": (-1.0, 1.0)}
    still = (
        "R1",
        "R2",
        "C",
        "impedance",
        "impedance_change",
        "voltage_limit",
    )  # of noise there may be no circuit
    check_that_builds_agree(cls, values, ranges, tmp_path, still=still)


@pytest.mark.parametrize(
    ("name", "bad", "allowed"),
    [
        ("sampling_skew", {"voltage_skew": 1.2}, "[0, 1]"),
        ("sampling_skew", {"voltage_skew": -0.1}, "[0, 1]"),
        ("voltage_gain", {"voltage_gain_error": -1.0}, "[-0.99, 100]"),
        ("lead_resistance", {"resistance_of_leads": 1e4}, "[-1000, 1000] ohm"),
    ],
)
def test_bad_values_are_refused(tmp_path, name, bad, allowed):
    check_that_bad_values_are_refused(laid(name), bad, allowed, tmp_path)
