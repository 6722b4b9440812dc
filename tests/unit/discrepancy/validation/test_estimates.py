"""Claims: parameters that differ, that no specimen can have, or that a wrong form of the model
makes
uncertain, are recognised; parameters that a record does not determine are noted.

The oracles are figures by hand, and the scatter of estimates between records.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from fmus.kit import Parameter
from orchestration.discrepancy.candidates import Candidate
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.note import NoteCode
from orchestration.discrepancy.selection.search import Search
from orchestration.discrepancy.selection.stepwise import Selection, Step
from orchestration.discrepancy.validation.estimates import (
    by_likelihood_ratio,
    identifiability_notes,
    implausible,
    misfit_spread,
    parameter_estimates,
    shape_spread,
    significantly_changed,
    straight_parts,
    undetermined_effects,
)
from orchestration.fmu.model import families
from orchestration.identify.uncertainty.estimate import Estimate, is_significantly_different
from studies.plants.models.motor import EFFECTS, Motor
from tests.support.regression_model import GAIN, OTHERS, SPREAD, STEP, Amplifier

RECORDS, STRETCHES, LENGTH = 60, 24, 50


def shifted_amplifier(nominal: float, size: float, least: float):
    """An amplifier with a level beside its gain, of a nominal value near zero in a large unit."""

    class Shifted(Amplifier):
        """What goes in, times a gain, and a level."""

        name = "shifted"
        level = Parameter(nominal, "V", min=least, max=1e6, nominal=size, doc="level")

        def amplified(self):
            """Proportional, and a level."""
            return self.gain * self.signal + self.level

    return Shifted


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("level", "nominal", "size", "least", "changed"),
    [
        (0.5, 0.0, 1.0, -1e6, True),
        (0.5, 0.0, 1e4, -1e6, True),  # a small part of its unit, but a quarter of the output
        (0.5, 1e-3, 1.0, 0.0, True),
        (0.0, 0.0, 1.0, -1e6, False),
        (
            0.03,
            0.0,
            1e-4,
            -1e6,
            False,
        ),  # hundreds of its unit, but little more than 1 % of the output
        (0.01, 1e-3, 1.0, 0.0, False),  # ten times nominal, and three standard errors
        (0.5, 0.4, 1.0, 0.0, True),
    ],
)
def test_what_is_nominally_zero_changes_by_what_it_does(level, nominal, size, least, changed, seed):
    """The level is known to SPREAD / sqrt(1000) = 3 mV, and the output is 2 V."""
    random = np.random.default_rng(seed)
    signal = random.standard_normal(1000)
    shown = GAIN * signal + level + SPREAD * random.standard_normal(1000)
    data = Dataset(STEP * np.arange(1000), {"signal": signal}, {"shown": shown})
    search = Search(data, shifted_amplifier(nominal, size, least), ["gain", "level"])
    assert significantly_changed(search.nominal(), ["gain", "level"]) == ["level"] * changed


@pytest.mark.parametrize(
    ("change", "error", "differs"),
    [
        (0.30, 0.05, True),
        (-0.30, 0.05, True),
        (0.30, 0.07, False),  # 4.3 standard errors
        (0.025, 0.001, True),
        (0.015, 0.001, False),  # fifteen standard errors, but a percent and a half
    ],
)
def test_a_parameter_differs_surely_and_noticeably_or_not_at_all(change, error, differs):
    assert is_significantly_different(change, error) is differs


@pytest.mark.parametrize(
    ("ratio", "odd"), [(20.0, False), (50.0, True), (1.0 / 20.0, False), (1.0 / 50.0, True)]
)
def test_a_parameter_fifty_times_nominal_is_that_of_no_specimen(ratio, odd):
    ends = (1.8 * ratio, 2.2 * ratio)
    values = {
        "R": Estimate(2.0 * ratio, 2.0, ends, "ohm"),
        "zero": Estimate(5.0, 0.0, (4.0, 6.0), "V"),
    }
    assert implausible(values, ["R", "zero"]) == ({"R": pytest.approx(ratio)} if odd else {})


@pytest.mark.parametrize("ends", [(0.0, math.inf), (math.nan, math.nan), (2.1, 1e9), (59.0, 1e9)])
def test_a_parameter_that_may_be_that_of_a_specimen_is_not_out_of_all_reason(ends):
    assert implausible({"R": Estimate(100.0, 2.0, ends, "ohm")}, ["R"]) == {}
    reciprocal = tuple(4.0 / end if end else math.inf for end in reversed(ends))
    assert implausible({"R": Estimate(0.04, 2.0, reciprocal, "ohm")}, ["R"]) == {}


def fitted(cubic, seed):
    """A signal that is now large and now small, of which the truth has the cube too."""
    random = np.random.default_rng(seed)
    signal = np.repeat(random.uniform(0.3, 2.0, STRETCHES), LENGTH) * random.standard_normal(
        STRETCHES * LENGTH
    )
    shown = GAIN * signal + cubic * signal**3 + SPREAD * random.standard_normal(signal.size)
    search = Search(
        Dataset(STEP * np.arange(signal.size), {"signal": signal}, {"shown": shown}),
        Amplifier,
        ["gain"],
    )
    return search.nominal()


@pytest.mark.slow
@pytest.mark.parametrize("cubic", [0.3])
def test_the_spread_is_that_from_record_to_record(cubic):
    models = [fitted(cubic, seed) for seed in range(RECORDS)]
    scatter = np.std([m.fit.q[0] for m in models], ddof=1)
    told = np.array(
        [np.hypot(misfit_spread(m)[0], m.fit.covariance.standard_errors[0]) for m in models]
    )
    assert (
        np.median([m.fit.covariance.standard_errors[0] for m in models]) < 0.5 * scatter
    )  # of the fit alone
    assert np.sqrt(np.mean(told**2)) == pytest.approx(scatter, rel=0.35)


def test_a_model_of_the_right_form_is_known_as_well_as_its_fit_says():
    models = [fitted(0.0, seed) for seed in range(20)]
    ratio = [misfit_spread(m)[0] / m.fit.covariance.standard_errors[0] for m in models]
    assert np.median(ratio) < 0.7


def test_an_interval_is_that_of_the_regression():
    model = fitted(0.0, 1)
    signal = model.problem.inputs["signal"]
    half = 1.96 * SPREAD / np.linalg.norm(signal)
    estimate = parameter_estimates(model)["gain"]
    low, high = estimate.interval
    assert high - low == pytest.approx(2.0 * half, rel=0.1)
    wider = parameter_estimates(model, 3.0 * model.fit.covariance.standard_errors)["gain"].interval
    assert np.ptp(wider) == pytest.approx(np.sqrt(10.0) * (high - low), rel=0.05)


@pytest.mark.parametrize("size", [1.0, 1e-4])
def test_a_parameter_that_a_record_does_not_determine_is_noted(size):
    random = np.random.default_rng(2)
    signal = size * random.standard_normal(1000)
    shown = GAIN * signal + SPREAD * random.standard_normal(1000)
    data = Dataset(STEP * np.arange(1000), {"signal": signal}, {"shown": shown})
    notes = identifiability_notes(Search(data, Amplifier, ["gain"]).nominal(), ["gain"])
    told = [note.facts["names"] for note in notes if note.code is NoteCode.UNDETERMINED]
    assert told == ([("gain",)] if size < 1.0 else [])


@pytest.mark.parametrize("seed", range(4))
def test_an_effect_is_undetermined_where_least_squares_does_not_know_its_sign(seed):
    """The oracle is the interval of a linear regression."""
    asymmetric, cubic = OTHERS[1:]
    random = np.random.default_rng(seed)
    signal = random.standard_normal(400)
    noise = SPREAD * random.standard_normal(signal.size)
    sizes = 0.5, 0.002  # the cube: about one standard error
    table = np.column_stack([signal, np.abs(signal), signal**3])
    shown = table @ [GAIN, *sizes] + noise
    search = Search(
        Dataset(STEP * np.arange(signal.size), {"signal": signal}, {"shown": shown}),
        Amplifier,
        ["gain"],
    )
    candidate = Candidate((), Amplifier).with_effect(asymmetric).with_effect(cubic)
    model = search.fit_from(candidate, search.nominal())
    least = np.linalg.lstsq(table, shown)[0]
    variance = np.mean((shown - table @ least) ** 2)
    errors = np.sqrt(np.diag(variance * np.linalg.inv(table.T @ table)))
    expected = [
        effect
        for effect, value, error in zip((asymmetric, cubic), least[1:], errors[1:], strict=True)
        if abs(value) < 1.96 * error
    ]
    assert undetermined_effects(model, parameter_estimates(model)) == expected


def test_an_interval_by_likelihood_ratio_is_the_usual_one_where_all_is_linear():
    """There the likelihood ratio of a Gaussian mean of known spread is its square in errors."""
    mean, neutral, error = 3.0, 1.0, 0.4
    wide = Estimate(mean, neutral, (-9.0, 15.0), "V")
    low, high = by_likelihood_ratio(wide, neutral, ((mean - neutral) / error) ** 2).interval
    assert (low, high) == pytest.approx((mean - 1.96 * error, mean + 1.96 * error), abs=1e-4)


def test_a_part_of_another_shape_that_is_not_seen_may_be_in_the_truth():
    """By linear regression: the gain moves with the part, the evidence goes with its square."""
    asymmetric, cubic = OTHERS[1:]
    random = np.random.default_rng(2)
    signal = random.uniform(-1.7, 1.7, 600)  # no heavy tails in what a shape leaves
    shown = GAIN * signal + 0.05 * signal**3 + SPREAD * random.standard_normal(600)
    data = Dataset(STEP * np.arange(600), {"signal": signal}, {"shown": shown})
    search = Search(data, Amplifier, ["gain"])
    base = search.nominal()
    chosen = search.fit_from(base.candidate.with_effect(cubic), base)
    other = search.fit_from(base.candidate.with_effect(asymmetric), base)
    gains = {chosen.effect_name: 900.0, other.effect_name: 600.0}
    step = Step(chosen, 900.0, 900.0, 0.0, [], [], shapes=[other], gains=gains)
    selection = Selection(base, [step])
    one, two = (
        np.linalg.lstsq(np.column_stack([signal, shape]), shown)[0][0]
        for shape in (signal**3, np.abs(signal))
    )
    whole = abs(np.log(two / one))
    part = np.sqrt(100.0 / (100.0 + 300.0))
    place = chosen.problem.names.index("gain")
    for structured, share in ((False, part), (True, 1.0)):
        spread = shape_spread(chosen, selection, structured)
        assert spread[place] == pytest.approx(share * whole / 1.96, rel=0.05)
        assert not np.delete(spread, place).any()


def test_only_a_slope_over_the_signal_of_a_curve_is_its_straight_part():
    """The oracle is the laws as they are written: friction ``d w``, current ``(u - K w) / R``."""
    parameters = ["resistance", "constant", "inertia", "damping"]
    known = families(Motor) | EFFECTS
    curves = {
        "coulomb_friction": ("damping",),
        "cubic_leakage(winding_current, voltage)": (),  # R divides the whole law
        "quadratic_drag(winding_current, omega)": ("constant",),
        "force_offset": (),  # of no signal
        "sliding_friction(friction)": (),  # it remembers
    }
    found = straight_parts([known[name] for name in curves], Motor, parameters)
    assert found == {name: slopes for name, slopes in curves.items() if slopes}
