"""In which range of a signal a residual is larger than elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.report.wording import most_telling
from orchestration.discrepancy.residuals.operating_regions import operating_regions
from tests.support.residuals import COLOURS, EVERY, bench, noise


def regions_of(residual, signals, output="y"):
    return operating_regions(output, residual, EVERY, signals)


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
    assert most_telling([first]) == [told]


def test_a_square_has_the_regions_of_its_signal():
    assert not any("square" in r.signal for r in regions_of(noise(0.0, 2), bench(7)))
