"""The paired predictive score, held against SciPy's densities, closed forms and data drawn again
and again.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from orchestration.discrepancy.candidates.paired_scores import PairedInnovations, paired_score
from tests.support.cubic_regression import BLOCKS, COUNT, PER_BLOCK, drawn_scores, regression


def log_density(model):
    """By SciPy, but for the constant."""
    cov = np.eye(COUNT) + model.jacobian @ model.covariance @ model.jacobian.T
    return multivariate_normal(np.zeros(COUNT), cov).logpdf(model.values)


@pytest.mark.parametrize("strength", [0.0, 2.0])
def test_blocks_add_up_to_the_density_of_the_whole(strength):
    simpler, richer = regression(1, strength)
    found = paired_score(simpler, richer, BLOCKS).gain
    assert found == pytest.approx(log_density(richer) - log_density(simpler), rel=1e-9)
    assert found == pytest.approx(
        paired_score(simpler, richer, np.zeros(COUNT, dtype=int)).gain, rel=1e-9
    )


def test_what_data_determine_to_all_digits_leaves_a_density():
    """As in a simulation: one innovation hangs on a parameter 1e15 times as much as another on
    another one, and both are turned, so that their information is singular to working precision.
    """
    turn = np.array([[0.8, 0.6], [-0.6, 0.8]])
    slopes = np.array([1e12, 1e-3])
    values = np.array([0.0, 0.7])
    richer = PairedInnovations(values, np.diag(slopes) @ turn, np.eye(2))
    simpler = PairedInnovations(values, np.zeros((2, 1)), np.zeros((1, 1)))
    variances = 1.0 + slopes**2
    exact = 0.5 * (values**2 * (1.0 - 1.0 / variances) - np.log(variances)).sum()
    found = paired_score(simpler, richer, np.zeros(2, dtype=int)).gain
    assert found == pytest.approx(exact, rel=1e-9)


def test_what_is_expected_of_parameters_that_are_known_is_half_the_square_of_the_difference():
    """With S the sum of squares of what predictions differ by, the gain has the mean S / 2 and the
    variance S.
    """
    rng = np.random.default_rng(3)
    noise, difference = rng.normal(size=(2, COUNT))
    known = np.zeros((COUNT, 1)), np.zeros((1, 1))
    score = paired_score(
        PairedInnovations(noise + difference, *known), PairedInnovations(noise, *known), BLOCKS
    )
    total = difference @ difference
    assert score.gain == pytest.approx(0.5 * total + noise @ difference)
    assert score.expected == pytest.approx(0.5 * total)
    assert score.expected_error == pytest.approx(np.sqrt(total))
    by_block = (noise * difference).reshape(-1, PER_BLOCK).sum(axis=1)
    among = np.std(
        by_block + 0.5 * (difference**2).reshape(-1, PER_BLOCK).sum(axis=1), ddof=1
    ) * np.sqrt(len(by_block))
    assert score.standard_error == pytest.approx(
        max(min(np.linalg.norm(by_block), among), np.sqrt(total))
    )
    mirrored = paired_score(
        PairedInnovations(noise, *known), PairedInnovations(noise + difference, *known), BLOCKS
    )
    assert mirrored.gain == -score.gain
    assert mirrored.standard_error == pytest.approx(score.standard_error), (
        "about what the better of the two lets expect"
    )


def test_what_is_expected_with_uncertain_parameters_is_the_divergence_of_two_densities():
    """Of one block, written down with whole matrices."""
    simpler, richer = regression(5, 2.0)
    score = paired_score(simpler, richer, np.zeros(COUNT, dtype=int))
    c0, c1 = (np.eye(COUNT) + m.jacobian @ m.covariance @ m.jacobian.T for m in (simpler, richer))
    between, ratio = simpler.values - richer.values, np.linalg.solve(c0, c1)
    weighed = np.linalg.solve(c0, between)
    logarithms = np.linalg.slogdet(c0)[1] - np.linalg.slogdet(c1)[1]
    expected = 0.5 * (np.trace(ratio) - COUNT + between @ weighed + logarithms)
    off = ratio - np.eye(COUNT)
    assert score.expected == pytest.approx(expected, rel=1e-8)
    assert score.expected_error**2 == pytest.approx(
        weighed @ c1 @ weighed + 0.5 * np.trace(off @ off), rel=1e-8
    )


@pytest.mark.slow
def test_the_standard_error_is_how_the_gain_scatters():
    """Of an effect that is there: the error of 400 gains about what was expected of each, over what
    is told of it.
    """
    scores = drawn_scores(2.0, range(400))
    off = [(s.gain - s.expected) / s.standard_error for s in scores]
    assert abs(np.mean(off)) < 0.15
    assert 0.75 < np.std(off) < 1.1


def test_noise_with_a_memory_makes_the_error_larger():
    """A moving sum of eight samples: the variance of its sums is 8 times that of independent noise
    as large.
    """
    rng, smooth = np.random.default_rng(0), np.ones(8) / np.sqrt(8.0)
    known, slow = (np.zeros((2400, 1)), np.zeros((1, 1))), np.full(2400, 0.2)
    ratios = []
    for _ in range(20):
        noise = np.convolve(rng.normal(size=2407), smooth, "valid")
        blocks = np.arange(2400) // 100
        score = paired_score(
            PairedInnovations(noise + slow, *known), PairedInnovations(noise, *known), blocks
        )
        ratios.append(score.standard_error / score.expected_error)
    assert np.mean(ratios) == pytest.approx(np.sqrt(8.0), rel=0.15)


def test_an_effect_that_acts_in_one_block_alone_is_as_sure_as_its_size():
    """All of the gain is in one of ten blocks, which tells more of it than that the blocks
    differ.
    """
    noise, known = (
        np.random.default_rng(2).normal(size=COUNT),
        (np.zeros((COUNT, 1)), np.zeros((1, 1))),
    )
    once = np.where(BLOCKS == 4, 5.0, 0.0)
    score = paired_score(
        PairedInnovations(noise + once, *known), PairedInnovations(noise, *known), BLOCKS
    )
    assert score.standard_error == pytest.approx(np.sqrt(25.0 * PER_BLOCK), rel=0.5)
    assert score.gain > 5.0 * score.standard_error
