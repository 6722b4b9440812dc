"""The tests of what is left, all of them, on what a perfect model leaves of a record."""

from __future__ import annotations

import numpy as np

from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.residuals.analysis import ResidualAnalysis, analyse
from orchestration.discrepancy.residuals.regressors import make_regressors
from orchestration.identify.noise.model import estimate_noise
from tests.support.noises import Clean

UNITS = {"u": "V", "y": "V", "fast": "V", "slow": "V"}


def analysed(record: Clean, added: np.ndarray | float = 0.0) -> ResidualAnalysis:
    """Its residual as a diagnosis analyses it, with something added to what was measured."""
    measured = record.measured + added
    residual = measured - record.simulated
    signals = make_regressors(
        record.time, {"u": record.input}, record.states, {"y": record.simulated}, UNITS
    )
    data = Dataset(record.time, {"u": record.input}, {"y": measured})
    return analyse(
        "y", residual, estimate_noise(residual, np.ones(residual.size, dtype=bool)), data, signals
    )


def found(analysis: ResidualAnalysis) -> list[str]:
    """Names of the tests that would decide a verdict."""
    names = [
        type(item).__name__
        for item in (*analysis.lines[:1], *analysis.level_shifts[:1], *analysis.structure)
    ]
    return sorted(set(names))
