"""Claims: ranges of a signal in which a residual is larger, or its mean another, are found."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.report.wording import describe_worst_regions
from orchestration.discrepancy.residuals.innovations import score_innovations
from orchestration.discrepancy.residuals.operating_regions import (
    conditional_means,
    find_operating_regions,
)
from orchestration.identify.noise.model import estimate_noise
from tests.support.residuals import COLOURS, EVERY, bench, noise


def regions_of(residual, signals, output="y"):
    return find_operating_regions(output, residual, EVERY, signals)


@COLOURS
def test_false_alarms_are_as_rare_as_they_say(colour):
    regions = [regions_of(noise(colour, seed), bench(seed)) for seed in range(60)]
    assert sum(any(r.significant for r in of_one) for of_one in regions) <= 2  # of 60, at 1 %


def test_where_a_residual_is_larger_is_told():
    signals = bench(7)
    charge = next(s for s in signals if s.name == "charge").values
    edge = np.quantile(charge, 7 / 8)
    residual = noise(0.0, 2) * np.where(charge >= edge, 3.2, 1.0)
    first = regions_of(residual, signals, "displacement")[0]
    assert (first.signal, first.high) == ("charge", np.inf)
    assert first.low == pytest.approx(edge)
    assert first.rms_ratio == pytest.approx(3.2, rel=0.1)
    assert not first.band[0] <= first.rms <= first.band[1]
    told = f"displacement is {first.rms_ratio:.1f}× worse where charge is above {edge:.3g} C"
    assert describe_worst_regions([first]) == [told]


def test_a_square_has_the_regions_of_its_signal():
    assert not any("square" in r.signal for r in regions_of(noise(0.0, 2), bench(7)))


@pytest.mark.parametrize("bias", [0.0, 0.5])
def test_a_mean_that_depends_on_a_signal_is_found_with_its_size(bias):
    signals = bench(7)
    charge = next(s for s in signals if s.name == "charge").values
    edge = np.quantile(charge, 7 / 8)
    residual = noise(0.0, 2) + np.where(charge >= edge, bias, 0.0)
    kind = estimate_noise(residual, EVERY)
    innovations = score_innovations(residual, EVERY, kind)
    means = conditional_means("displacement", residual, innovations, kind, signals)
    if not bias:
        assert not any(mean.significant for mean in means)
        return
    assert means[0].significant
    assert (means[0].signal, means[0].high) == ("charge", np.inf)
    assert means[0].low == pytest.approx(edge)
    assert means[0].mean == pytest.approx(bias, abs=0.15)
