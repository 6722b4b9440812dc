"""Claims: evidence is expected of another model alone, and noise has the covariance of its
samples.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from orchestration.discrepancy.design.expected_evidence import (
    _covariance,
    at_rest,
    expected_delta_bic,
    expected_delta_bic_linear,
    respond,
)
from orchestration.identify.noise.autoregression import yule_walker
from orchestration.identify.noise.model import Noise
from tests.support.ambiguous import DULL, TIME, ambiguous


def test_a_model_expects_nothing_against_itself():
    _, selection = ambiguous("double_layer")
    model = selection.steps[0].chosen
    shown = respond(model, TIME, DULL, at_rest(model))
    assert expected_delta_bic_linear(model, model, shown, shown) == pytest.approx(0.0, abs=1.0)
    refitted = expected_delta_bic(model, model, shown, TIME, DULL, at_rest(model))
    assert refitted == pytest.approx(0.0, abs=1.0)


def test_the_covariance_of_noise_is_that_of_its_samples():
    """Closed form of AR(1); of a sum with a sine, what Yule and Walker make of many samples."""
    noise = Noise(np.array([0.9]), 2.0)
    assert _covariance(noise) == pytest.approx(4.0 / (1.0 - 0.81) * 0.9 ** np.arange(5))
    assert yule_walker(_covariance(noise), 10_000)[0] == pytest.approx([0.9])
    samples = lfilter([2.0], [1.0, -0.9], np.random.default_rng(1).standard_normal(400_000))
    lagged = np.array([samples[: samples.size - k] @ samples[k:] for k in range(5)]) / samples.size
    assert _covariance(noise) == pytest.approx(lagged, rel=0.03)
