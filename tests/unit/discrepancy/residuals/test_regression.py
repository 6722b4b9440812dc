"""What all signals together explain of a residual."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.residuals.regression import regress
from orchestration.discrepancy.residuals.regressors import RegressorKind
from tests.support.residuals import COLOURS, EVERY, N, bench, noise

FEW = 1000  # samples that were measured


@COLOURS
@pytest.mark.slow
def test_false_alarms_are_as_rare_as_they_say(colour):
    alarms, present = 0, np.arange(N) < FEW
    for seed in range(20):
        plain = [s for s in bench(seed) if s.kind is not RegressorKind.SQUARE]
        alarms += regress(noise(colour, seed, FEW), present, plain).significant
    assert alarms <= 2  # of 20, at 1 %


def test_all_signals_together_explain_what_each_alone_does_not():
    signals = bench(9)
    charge = next(s for s in signals if s.name == "charge").values
    hidden = (charge / charge.std()) ** 3
    hidden -= np.polyval(np.polyfit(charge, hidden, 1), charge)
    hidden *= 1.5 / hidden.std()
    regression = regress(noise(0.0, 4) + hidden, EVERY, signals)
    assert regression.significant
    assert regression.rms == pytest.approx(1.5, rel=0.15)
    assert np.corrcoef(regression.fitted, hidden)[0, 1] > 0.97
