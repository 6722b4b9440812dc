"""How surely parameters of a model that has not the form of the truth are known: as they scatter between records."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.selection.search import Search
from orchestration.discrepancy.validation.misfit import misfit_spread
from tests.support.regression_model import GAIN, SPREAD, STEP, Amplifier

RECORDS, STRETCHES, LENGTH = 60, 24, 50


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
