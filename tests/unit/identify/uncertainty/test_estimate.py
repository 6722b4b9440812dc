"""Claims: draws have the distribution of the estimates, and impossible distributions are refused.

Oracles: sample moments, and the normal quantile of a 95 % interval.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.identify.uncertainty import (
    Estimate,
    is_significantly_different,
    joint_distribution,
)

ESTIMATES = {
    "gain": Estimate(2.0, 1.0, (2.0 / np.exp(0.196), 2.0 * np.exp(0.196)), "1"),
    "shift": Estimate(-1.0, 0.0, (-1.98, -0.02), "V"),
}


def test_draws_have_the_moments_of_the_estimates():
    drawn = joint_distribution(ESTIMATES, {("gain", "shift"): 0.6}, ["gain"]).draws(40000, seed=3)
    moved = np.stack([np.log(drawn["gain"]), drawn["shift"]])
    assert moved.mean(axis=1) == pytest.approx([np.log(2.0), -1.0], abs=0.01)
    assert moved.std(axis=1) == pytest.approx([0.1, 0.5], rel=0.02)
    assert np.corrcoef(moved)[0, 1] == pytest.approx(0.6, abs=0.02)


def test_contradicting_correlations_are_refused():
    three = ESTIMATES | {"lag": ESTIMATES["shift"]}
    pairs = {("gain", "shift"): 0.9, ("gain", "lag"): 0.9, ("shift", "lag"): -0.9}
    with pytest.raises(UserError, match="contradict each other"):
        joint_distribution(three, pairs, ["gain"]).draws(1)


def test_an_open_interval_cannot_be_drawn_from():
    open_ended = {"gain": Estimate(2.0, 1.0, (1.0, np.inf), "1")}
    with pytest.raises(UserError, match="does not determine gain"):
        joint_distribution(open_ended, {}, [])


@pytest.mark.parametrize(
    ("change", "error", "expected"),
    [(0.1, 0.01, True), (0.1, 0.03, False), (0.01, 1e-6, False), (-0.1, 0.01, True)],
)
def test_a_change_is_significant_if_it_is_sure_and_noticeable(change, error, expected):
    assert is_significantly_different(change, error) is expected
