"""Evidence for a curve.

Oracles: likelihoods of a Gaussian vector with and without a curve in it, by SciPy; ridge equations
solved as least squares; a Monte Carlo in plain loops; and the table that a model has.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import cumulative_simpson
from scipy.linalg import eigh
from scipy.stats import multivariate_normal

from fmus.kit import smooth_table
from orchestration.discrepancy.laws.evidence import (
    KNOTS,
    Band,
    Basis,
    Curve,
    RegressorColumns,
    RegressorStack,
)

SAMPLES = 120
SIZES = 11  # of the bending part, that are tried
FLAT = 1e4  # times the variance of one sample, of what is straight


def signal(seed, samples=SAMPLES, crossing=True):
    x = np.random.default_rng(seed).uniform(-1.0, 2.0, samples)
    return x if crossing else x + 1.5


def own_parameters(seed, x, count=2):
    """Orthonormal columns of what a model can do by itself."""
    whole = np.column_stack([np.random.default_rng(seed).normal(size=(len(x), count))])
    return np.linalg.qr(whole)[0]


class Case:
    """A basis over a signal, what its hats do, and something to be explained."""

    def __init__(self, seed, size=1.0, crossing=True, own=None, gain=1.0):
        self.x = signal(seed, crossing=crossing)
        self.basis = Basis.over(self.x)
        self.hats = gain * self.basis(self.x)
        own = own_parameters(seed + 1, self.x) if own is None else np.linalg.qr(own(self.x))[0]
        self.z = self.hats - own @ (own.T @ self.hats)
        noise = np.random.default_rng(seed + 2).normal(size=len(self.x))
        y = noise + size * (np.tanh(3.0 * self.x) + 0.3 * self.x**2)
        self.y = y - own @ (own.T @ y)
        self.columns = RegressorColumns(
            self.basis, self.z.T @ self.z, self.hats.T @ self.hats, len(self.x)
        )
        self.score = self.z.T @ self.y
        self.curve = self.columns.best(self.score)


CASES = [
    (0, 0.0, True),
    (1, 0.5, True),
    (2, 2.0, True),
    (3, 10.0, True),
    (4, 0.3, False),
    (5, 3.0, False),
    (6, 3e3, True),
]
several = pytest.mark.parametrize(
    "case", CASES, ids=lambda c: f"{c[1]}-{'through' if c[2] else 'above'}-zero"
)


def evidence(y, z, prior):
    """Twice the logarithm of how much likelier y, or each row of it, is with a curve of this prior
    than without.
    """
    nothing = np.eye(len(z))
    likelier, plain = (
        multivariate_normal.logpdf(y, np.zeros(len(z)), covariance)
        for covariance in (nothing + z @ prior @ z.T, nothing)
    )
    return 2.0 * (likelier - plain)


def family(one):
    """Priors, made here anew: straight ones, with and without a step, and such that bend, by sizes;
    and their price.
    """
    bends = bending(one.basis)
    sizes = np.geomspace(1e-2, 1e8, SIZES) / (np.trace(one.z @ bends @ one.z.T) / len(bends))
    for part in one.basis.plain:
        straight = FLAT * part @ one_sample(one.z @ part, one.hats @ part) @ part.T
        free = part.shape[1] * np.log(FLAT)  # so that it costs what it does in BIC
        yield straight, -free
        for size in sizes:
            yield straight + size * bends, np.log(SAMPLES) - free


def is_bending(basis, prior):
    """Whether a prior expects more than a straight line with a step."""
    part = basis.plain[-1]
    rest = prior - part @ np.linalg.lstsq(part, prior, rcond=None)[0]
    return np.abs(rest).max() > 1e-9 * np.abs(prior).max()


@several
def test_the_gain_is_the_evidence(case):
    one = Case(*case)
    _, price = min(family(one), key=lambda pair: np.abs(pair[0] - one.curve.prior).max())
    exact = evidence(one.y, one.z, one.curve.prior) - price
    assert one.curve.gain == pytest.approx(exact, rel=1e-5, abs=1e-5)


@several
def test_a_straight_line_has_the_price_of_bic(case):
    """However strong it is: the criterion of the same line by least squares, its parameters being
    its own.
    """
    one = Case(*case)
    part = one.basis.plain[0]
    columns = one.z @ part
    for strength in (1.0, 1e3):
        y = one.y + strength * columns @ [3.0, -2.0]
        left = y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0]
        bic = y @ y - left @ left - 2.0 * np.log(SAMPLES)
        assert one.columns.best(one.z.T @ y).gain >= bic * (1.0 - 1e-5) - 0.1


@several
def test_no_prior_of_the_family_has_more_evidence(case):
    """Every size of the bending part, with and without a step, made here anew; the best one is
    returned.
    """
    one = Case(*case)
    gains = [evidence(one.y, one.z, prior) - price for prior, price in family(one)]
    assert one.curve.gain == pytest.approx(max(gains), rel=1e-5, abs=1e-5)


def bending(basis):
    """Covariance of an integrated Wiener process: of its values, from that of its slope, by
    Simpson's rule.
    """
    u = (basis.knots - basis.knots[0]) / (basis.knots[-1] - basis.knots[0])
    kernel = np.empty((len(u), len(u)))
    fine = np.linspace(0.0, 1.0, 2001)
    for i, s in enumerate(u):
        for j, t in enumerate(u):
            product = np.clip(s - fine, 0.0, None) * np.clip(t - fine, 0.0, None)
            kernel[i, j] = cumulative_simpson(product, x=fine)[-1]
    line = np.vander(u, 2)
    off = np.eye(len(u)) - line @ np.linalg.solve(line.T @ line, line.T)
    kernel = off @ kernel @ off
    return kernel / (np.trace(kernel) / len(u))


def one_sample(free, alone):
    """Covariance of coordinates of which one sample tells as much as their prior, where nothing is
    the model's own.
    """
    assert np.linalg.eigvalsh(np.linalg.solve(alone.T @ alone, free.T @ free)).min() > 1e-3
    return len(free) * np.linalg.inv(free.T @ free)


@several
def test_values_and_covariance_are_those_of_ridge_equations(case):
    """As least squares with rows for the prior, in coordinates of unit variance."""
    one = Case(*case)
    strength, axes = np.linalg.eigh(one.curve.prior)
    root = axes[:, strength > 1e-12 * strength.max()] * np.sqrt(
        strength[strength > 1e-12 * strength.max()]
    )
    whole = np.vstack([one.z @ root, np.eye(root.shape[1])])
    found = np.linalg.lstsq(whole, np.append(one.y, np.zeros(root.shape[1])), rcond=None)[0]
    size = max(np.abs(one.curve.values).max(), 1e-6)
    assert one.curve.values == pytest.approx(root @ found, abs=1e-5 * size)
    q, r = np.linalg.qr(whole)
    spread = root @ np.linalg.solve(r, np.eye(len(r)))
    covariance = spread @ spread.T
    assert one.curve.covariance == pytest.approx(covariance, abs=1e-5 * np.abs(covariance).max())
    assert q.shape[1] == len(r)


@several
def test_the_price_is_what_is_not_explained(case):
    """Twice the fall of half the sum of squares with its prior, less the gain."""
    one = Case(*case)
    left = one.y - one.z @ one.curve.values
    held = (
        one.curve.values
        @ np.linalg.pinv(one.curve.prior, hermitian=True, rcond=1e-12)
        @ one.curve.values
    )
    fall = one.y @ one.y - left @ left - held
    assert one.curve.gain + one.curve.complexity == pytest.approx(fall, rel=1e-5, abs=1e-5)
    assert one.curve.complexity > 0.0


def test_a_step_at_zero_is_preferred_where_there_is_one():
    x = signal(6)
    basis = Basis.over(x)
    z = basis(x)
    y = 3.0 * np.sign(x) + np.random.default_rng(7).normal(size=SAMPLES)
    found = RegressorColumns(basis, z.T @ z, z.T @ z, SAMPLES).best(z.T @ y)
    assert np.interp(0.2, basis.knots, found.values) == pytest.approx(3.0, abs=0.5)
    assert np.interp(-0.2, basis.knots, found.values) == pytest.approx(-3.0, abs=0.5)
    assert not is_bending(basis, found.prior), "a constant, a slope and a step are enough"


LINE = Basis(np.array([0.0, 4.0]))  # which cannot bend


def on_a_line(own):
    """What is found of y = 10 + 20 x where the model has columns of its own, which are
    orthonormal.
    """
    x = signal(8, crossing=False)
    hats = LINE(x)
    z, y = hats - own @ (own.T @ hats), 10.0 + 20.0 * x
    return RegressorColumns(LINE, z.T @ z, hats.T @ hats, SAMPLES).best(
        z.T @ (y - own @ (own.T @ y))
    )


def test_what_is_the_models_own_is_no_part_of_a_curve():
    """A slope, and a constant, that parameters of the model can do as well are not expected, nor
    found, nor paid.
    """
    x = signal(8, crossing=False)
    one, both = (np.linalg.qr(np.vander(x, k))[0] for k in (1, 2))
    found = on_a_line(both)
    assert (found.gain, found.complexity) == (0.0, 0.0)
    assert not found.prior.any()
    assert not found.values.any()
    assert not found.covariance.any()
    found = on_a_line(one)
    assert found.complexity == pytest.approx(np.log(SAMPLES), rel=1e-5), (
        "that of one parameter in BIC"
    )
    assert np.linalg.matrix_rank(found.prior) == 1
    assert np.diff(found.values) == pytest.approx(80.0, rel=0.02), "which tells no constant"
    found = on_a_line(np.zeros((SAMPLES, 1)))
    assert found.complexity == pytest.approx(2.0 * np.log(SAMPLES), rel=1e-5)
    assert found.values == pytest.approx([10.0, 90.0], rel=0.02)


@pytest.mark.parametrize(("share", "rank"), [(1e-1, 2), (2e-3, 2), (5e-4, 1), (1e-6, 1)])
def test_a_slope_of_which_little_is_left(share, rank):
    """It has the price of one parameter, or it is the model's."""
    x = signal(9, crossing=False)
    hats = LINE(x)
    slope = (x - x.mean()) / np.linalg.norm(x - x.mean())
    z = hats - (1.0 - np.sqrt(share)) * np.outer(slope, slope @ hats)
    found = RegressorColumns(LINE, z.T @ z, hats.T @ hats, SAMPLES).best(np.zeros(2))
    assert np.linalg.matrix_rank(found.prior, tol=1e-9 * np.abs(found.prior).max()) == rank
    assert found.complexity == pytest.approx(rank * np.log(SAMPLES), rel=1e-5)


def test_a_bend_beside_a_line_that_is_the_models_own():
    one = Case(8, 10.0, crossing=False, own=lambda x: LINE(x))
    for part in one.basis.plain[0].T:
        assert abs(part @ one.curve.prior @ part) < 1e-9 * np.trace(one.curve.prior)
    assert one.curve.gain > 10.0


def test_a_law_that_does_nothing_gains_nothing():
    basis = Basis(np.linspace(0.0, 1.0, 9))
    found = RegressorColumns(basis, np.zeros((9, 9)), np.zeros((9, 9)), SAMPLES).best(np.zeros(9))
    assert found.gain == 0.0
    assert not found.values.any()


@settings(max_examples=20)
@given(st.floats(1e-6, 1e6), st.integers(0, 20))
def test_units_do_not_matter(factor, seed):
    """Columns in another unit of the law, and a signal in another unit."""
    one, other = Case(seed, 2.0), Case(seed, 2.0, gain=factor)
    assert other.curve.gain == pytest.approx(one.curve.gain, rel=1e-5, abs=1e-5)
    size = np.abs(one.curve.values).max()
    assert factor * other.curve.values == pytest.approx(one.curve.values, abs=1e-4 * size)
    scaled = Basis(factor * one.basis.knots)
    assert scaled.bending == pytest.approx(one.basis.bending, abs=1e-9)


def plain_choices(case):
    """Every prior that a curve may have, and its price, one after the other."""
    basis, columns = case.basis, case.columns
    power = np.trace(columns.free @ basis.bending) / len(basis.knots)
    for part in basis.plain:
        free, alone = (part.T @ each @ part for each in (columns.free, columns.alone))
        share, axes = eigh(free, alone)
        seen = share > 1e-3
        root = (part @ axes[:, seen]) * np.sqrt(FLAT * SAMPLES / share[seen])
        for size in (0.0, *(np.geomspace(1e-2, 1e8, SIZES) / power)):
            prior = root @ root.T + size * basis.bending
            inner = np.eye(len(prior)) + columns.free @ prior
            price = np.linalg.slogdet(inner)[1] - seen.sum() * np.log(FLAT)
            yield prior, inner, price + (np.log(SAMPLES) if size else 0.0)


@pytest.mark.parametrize("crossing", [True, False])
def test_several_curves_at_once_are_as_one_by_one(crossing):
    """Oracle: the gain of every prior of every curve, written out."""
    drawn = [Case(seed, 0.3 * 2.0**seed, crossing) for seed in range(9)]
    several = [case for case in drawn if len(case.score) == len(drawn[0].score)]
    assert len(several) > 2
    stack = RegressorStack(
        [case.basis for case in several],
        np.array([case.columns.free for case in several]),
        np.array([case.columns.alone for case in several]),
        SAMPLES,
    )
    noise = np.random.default_rng(9).normal(size=(SAMPLES, 7))
    scores = np.array([case.z.T @ noise for case in several])
    found = stack.best(np.array([case.score for case in several]))
    by_chance = stack.by_chance(scores)
    for case, curve, gains, score in zip(several, found, by_chance, scores, strict=True):
        tried = []
        of_noise = []
        for prior, inner, price in plain_choices(case):
            covariance = prior @ np.linalg.inv(inner)
            tried.append((case.score @ covariance @ case.score - price, covariance @ case.score))
            of_noise.append(np.sum(score * (covariance @ score), axis=0) - price)
        gain, values = max(tried, key=lambda one: one[0])
        assert curve.gain == pytest.approx(gain, rel=1e-6, abs=1e-4)
        assert curve.values == pytest.approx(values, rel=1e-5, abs=1e-6)
        assert gains == pytest.approx(np.max(of_noise, axis=0), rel=1e-6, abs=1e-4)


def test_by_chance_is_a_monte_carlo():
    one = Case(10)
    noise = np.random.default_rng(11).normal(size=(SAMPLES, 12))
    noise[:, :3] += 4.0 * np.sign(one.x)[:, None]  # and such as steps, or bends
    noise[:, 3:6] += 9.0 * np.sin(3.0 * one.x)[:, None]
    found = one.columns.by_chance(one.z.T @ noise)
    every = [evidence(noise.T, one.z, prior) - price for prior, price in family(one)]
    for b in range(noise.shape[1]):
        best = -np.inf
        for gains in every:
            best = max(best, gains[b])
        assert found[b] == pytest.approx(best, rel=1e-4, abs=1e-4)


def test_noise_hardly_ever_gains():
    """Bayes: less than one in a hundred where there is nothing."""
    one = Case(12)
    noise = np.random.default_rng(13).normal(size=(SAMPLES, 2000))
    assert np.mean(one.columns.by_chance(one.z.T @ noise) > 2.0 * np.log(100.0)) < 0.01


# --- knots and columns
# ------------------------------------------------------------------------------------------------


@settings(max_examples=100)
@given(
    st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=60, unique_by=lambda x: round(x, 3)),
    st.integers(0, 99),
)
def test_a_basis_is_that_of_the_table_in_a_model(values, seed):
    basis = Basis.over(np.array(values))
    rng = np.random.default_rng(seed)
    heights = rng.normal(size=len(basis.knots))
    low, high = basis.knots[[0, -1]]
    x = np.concatenate([values, basis.knots, rng.uniform(low - 1.0, high + 1.0, 50)])
    columns, knots = basis(x), [float(knot) for knot in basis.knots]
    exact = [float(smooth_table(float(one), knots, list(heights))) for one in x]
    assert columns @ heights == pytest.approx(exact, rel=1e-6, abs=1e-6)
    assert columns.sum(axis=1) == pytest.approx(np.ones(len(x)), abs=1e-6)
    assert basis(basis.knots) == pytest.approx(np.eye(len(knots)), abs=1e-9)


@settings(max_examples=100)
@given(st.lists(st.floats(-1e3, 1e3).map(lambda x: round(x, 9)), min_size=1, max_size=60))
def test_knots_span_the_signal_and_rise(values):
    values = np.array(values)
    knots = Basis.over(values).knots
    assert knots[0] == values.min()
    assert knots[-1] == values.max()
    assert (np.diff(knots) > 0.0).all()
    if len(np.unique(values)) <= KNOTS:
        assert np.array_equal(knots, np.unique(values))
    else:
        assert len(knots) <= KNOTS + 3


def test_knots_are_denser_where_a_signal_has_been_more_often():
    often = np.append(np.linspace(1.0, 2.0, 900), np.linspace(2.0, 10.0, 100))
    knots = Basis.over(often).knots
    assert len(knots) == KNOTS
    assert np.sum(knots < 5.5) > KNOTS // 2 + 2
    assert len(Basis.over(often, 7).knots) == 7
    few = np.arange(1.0, KNOTS + 1.0) ** 2
    assert np.array_equal(Basis.over(np.repeat(few, 3)).knots, few)


def test_there_may_be_a_step_where_a_signal_goes_through_zero():
    knots = Basis.over(np.linspace(-1.0, 3.0, 999)).knots
    near = knots[np.abs(knots) < 0.03]
    assert near == pytest.approx([-0.02, 0.0, 0.02])
    assert len(Basis.over(np.linspace(-1.0, 3.0, 999)).plain) == 2
    assert len(Basis.over(np.linspace(1.0, 3.0, 999)).plain) == 1
    assert len(Basis(np.array([-1.0, 0.0, 1.0])).plain) == 1, "too few knots"
    step = Basis(np.array([-2.0, -0.01, 0.0, 0.01, 3.0])).plain[1][:, 2]
    assert step.tolist() == [-1.0, -1.0, 0.0, 1.0, 1.0]


def test_what_bends_is_no_line():
    for knots in (
        np.linspace(0.0, 1.0, 12),
        np.sort(np.random.default_rng(1).uniform(-3.0, 5.0, 16)),
    ):
        basis = Basis(knots)
        assert basis.bending == pytest.approx(bending(basis), abs=1e-5)
        assert np.vander(knots, 2).T @ basis.bending == pytest.approx(
            np.zeros((2, len(knots))), abs=1e-9
        )
        assert np.trace(basis.bending) == pytest.approx(len(knots))


def test_values_that_round_off_tells_apart_are_one_knot():
    """Such as of a state that decays to nothing: slopes between them would be no numbers."""
    basis = Basis.over(np.array([1e-311, 0.0, 1e-289, 4e-22, 10.0]))
    assert basis.knots == pytest.approx([0.0, 10.0])
    assert basis(np.array([4e-22, 2.5])) == pytest.approx(np.array([[1.0, 0.0], [0.75, 0.25]]))


def test_two_knots_have_nothing_to_bend():
    basis = Basis(np.array([0.0, 1.0]))
    z = basis(signal(3, crossing=False) / 3.5)
    found = RegressorColumns(basis, z.T @ z, z.T @ z, SAMPLES).best(z.T @ np.ones(SAMPLES))
    assert isinstance(found, Curve)
    assert found.values == pytest.approx([1.0, 1.0], abs=0.02)


@pytest.mark.parametrize("end", [0.16, 1.6, 70.0])
def test_nothing_bends_where_the_constant_is_the_models_own(end):
    """All of the products is then rounding, in the direction of a curve that would be no line."""
    basis = Basis(np.array([0.0, end]))
    z = basis(np.linspace(0.0, end, SAMPLES))
    free = z - z @ np.full((2, 2), 0.5)
    regressors = RegressorColumns(basis, free.T @ free, z.T @ z, SAMPLES)
    slope = free @ np.array([-1.0, 1.0])
    curve = regressors.best(free.T @ slope)
    assert np.ptp(curve.values) == pytest.approx(2.0, rel=1e-2)
    assert np.isfinite(regressors.by_chance(free.T @ np.ones((SAMPLES, 3)))).all()
    assert basis.bending.tolist() == [[0.0, 0.0], [0.0, 0.0]]


# --- bands of curves; oracle: curves that are drawn, as sums of white noise in plain steps
# --------------------------------------------------------------------------------------------------

FINE = np.linspace(0.0, 1.0, 2001)
BAND_KNOTS = np.array([0.0, 0.1, 0.25, 0.4, 0.6, 0.7, 0.85, 1.0])
BAND_BASIS = Basis(3.0 + 2.0 * BAND_KNOTS)
BAND_X = 3.0 + 2.0 * FINE[::20]


def wandering(rng, draws):
    """Twice integrated white noise at `FINE`, (draws, n)."""
    step = FINE[1]
    rates = np.cumsum(rng.normal(0.0, np.sqrt(step), (draws, len(FINE))), axis=1)
    return np.cumsum(rates, axis=1) * step


def through_knots(curves):
    return curves[:, [round(k * (len(FINE) - 1)) for k in BAND_KNOTS]]


def test_what_is_left_between_knots():
    curves = wandering(np.random.default_rng(1), 4000)
    values = through_knots(curves)
    mean_variance = np.mean(np.diag(BAND_BASIS.bending))
    assert mean_variance == pytest.approx(1.0)
    straight = np.column_stack([np.ones(len(BAND_KNOTS)), BAND_KNOTS])
    bent = values - (straight @ np.linalg.lstsq(straight, values.T, rcond=None)[0]).T
    unit = np.mean(np.var(bent, axis=0))  # that a mean variance of 1 at the knots has
    xs = [float(x) for x in BAND_BASIS.knots]
    told = np.array(
        [[smooth_table(float(x), xs, list(map(float, v))) for x in BAND_X] for v in values[:400]]
    )
    left = (curves[:400, ::20] - told) / np.sqrt(unit)
    expected = np.sqrt(np.diag(BAND_BASIS.left_between(BAND_X)))
    assert np.sqrt(np.mean(left**2, axis=0)) == pytest.approx(
        expected, rel=0.2, abs=0.02 * expected.max()
    )
    assert np.sqrt(np.diag(BAND_BASIS.left_between(BAND_BASIS.knots))) == pytest.approx(
        0.0, abs=1e-6
    )


@pytest.mark.parametrize("noise", [0.01, 0.05])
def test_the_band_holds_whole_curves(noise):
    """Of curves that bend as much as is expected, in noise in which what the knots leave does not
    stand out.
    """
    rng, held, whole = np.random.default_rng(2), 0, 200
    curves = wandering(rng, whole)
    at = np.arange(0, len(FINE), 5)
    x = 3.0 + 2.0 * FINE[at]
    columns = BAND_BASIS(x)
    for curve in curves:
        y = curve[at] + rng.normal(0.0, noise, len(at))
        z = columns / noise
        products = z.T @ z
        found = RegressorColumns(BAND_BASIS, products, products, len(at)).best(z.T @ y / noise)
        _, low, high = Band(BAND_BASIS, found)(BAND_X)
        inside = (curve[::20] >= low) & (curve[::20] <= high)
        held += bool(np.mean(inside) >= 0.9)
    assert held >= 0.9 * whole


def test_what_goes_together_has_the_band_of_a_point():
    straight = np.outer(BAND_BASIS.knots, BAND_BASIS.knots)
    values, low, high = Band(
        BAND_BASIS, Curve(0.0, 2.0 * BAND_BASIS.knots, 0.01 * straight, straight, 0.0)
    )(BAND_X)
    assert values == pytest.approx(2.0 * BAND_X)
    assert high - low == pytest.approx(2.0 * 1.96 * 0.1 * BAND_X, rel=0.1)


def test_what_is_known_has_no_band():
    nothing = np.zeros((len(BAND_KNOTS), len(BAND_KNOTS)))
    values, low, high = Band(
        BAND_BASIS, Curve(0.0, np.ones(len(BAND_KNOTS)), nothing, nothing, 0.0)
    )(BAND_X)
    assert values == pytest.approx(1.0)
    assert low == pytest.approx(high)
