"""Claims: scores and predicted improvements are those of least squares beside the model's own
coordinates, in noise of any colour, and the figures that the decision quotes.

Oracles: dense least squares of columns that a matrix whitens, the inverse of a root of the
covariance, written out; the prior as rows.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import cholesky, solve_triangular, toeplitz
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

from demonstrations.records import draw
from fmus.kit import Component, Input, Output, Parameter
from fmus.kit.sensors import sensor_drift
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.candidates.linearised_model import LinearisedModel, strongest
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.holdout import HELD_OUT
from orchestration.discrepancy.diagnosis import searched_parameters
from orchestration.discrepancy.selection.scoring import score
from orchestration.discrepancy.selection.search import Search
from orchestration.identify.noise import Noise
from tests.support.diagnosis import as_measured
from tests.support.scored import at, directions

DECISION = Path(__file__).parents[4] / "docs" / "decisions" / "0012-naming-causes.md"
COUNT = 300
RNG = np.random.default_rng(8)
TIME = 0.1 * np.arange(COUNT)
U = np.cumsum(RNG.standard_normal(COUNT)) * 0.3
CHANGES = np.column_stack(
    [np.sin(TIME), np.cumsum(RNG.standard_normal(COUNT)), np.where(TIME > 20.0, 1.0, -0.5)]
)
CHANGES = CHANGES.astype(np.float32).astype(float)  # as directions hold them
COLOUR = np.array([0.9, -0.3])
WHITE = np.empty(0)


class Line(Component):
    """A gain and an offset, shown in two outputs of which the second is twice the gain's."""

    name = "line"
    gain = Parameter(2.0, "1", min=1e-6, max=1e6)
    level = Parameter(0.0, "V", min=-1.0, max=1.0)
    u = Input("V")

    @Output("V")
    def y(self):
        """A line."""
        return self.gain * self.u + self.level

    @Output("V")
    def double(self):
        """Of the gain alone."""
        return 2.0 * self.gain * self.u


NAMES = ["gain", "level"]
NOISE = 0.1 * lfilter([1.0], [1.0, -0.8], RNG.standard_normal(COUNT))
RESIDUAL = 0.3 * CHANGES[:, 0] + 0.2 * U + NOISE
# by the logarithm of the gain, and by the level: a residual is measured minus simulated
JACOBIAN = np.column_stack([-2.0 * U, -np.ones(COUNT)])


def record(residual=RESIDUAL, missing=None) -> Dataset:
    y = 2.0 * U + residual
    if missing is not None:
        y = np.where(missing, np.nan, y)
    return Dataset(TIME, {"u": U}, {"y": y}, frozenset())


def size(values):
    return np.sqrt(np.mean(values**2))


def whitening(noise: Noise, counts=None):
    """The inverse of a root of the covariance of a stationary autoregression, which starts anew
    behind every gap; zero where nothing counts.
    """
    counts = np.ones(COUNT, dtype=bool) if counts is None else counts
    impulse = lfilter([1.0], np.append(1.0, -noise.coefficients), np.eye(1, 4000)[0])
    covariance = np.array([impulse[: 4000 - k] @ impulse[k:] for k in range(COUNT)])
    whole = np.zeros((COUNT, COUNT))
    ends = np.flatnonzero(np.diff(counts, prepend=False, append=False)).reshape(-1, 2)
    for first, last in ends:
        root = cholesky(toeplitz(noise.deviation**2 * covariance[: last - first]), lower=True)
        whole[first:last, first:last] = solve_triangular(root, np.eye(last - first), lower=True)
    return whole


def squares(table, target):
    """Sum of squares that least squares leaves."""
    left = target - table @ np.linalg.lstsq(table, target)[0]
    return float(left @ left)


def falls(root, change, least=-np.inf, most=np.inf, residual=RESIDUAL, jacobian=JACOBIAN):
    """Fall of the sum of squares by the best amount within bounds, all else being free."""
    table = root @ jacobian
    target = root @ residual
    column = root @ change
    free = np.linalg.lstsq(np.column_stack([table, column]), -target)[0][-1]
    amount = np.clip(free, least, most)
    return squares(table, target) - squares(table, target + amount * column)


# --- scores
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("coefficients", [WHITE, COLOUR[:1], COLOUR], ids=["white", "AR1", "AR2"])
def test_scores_are_those_of_dense_least_squares(coefficients):
    noise = Noise(coefficients, 0.2)
    model = LinearisedModel(at(Line, record(), NAMES, noise={"y": noise}))
    in_colour, in_white = model.score_statistics(directions({"y": CHANGES}))
    for k, change in enumerate(CHANGES.T):
        assert in_colour[k] == pytest.approx(falls(whitening(noise), change), rel=1e-5)
        alone = np.eye(COUNT) / size(RESIDUAL)
        assert in_white[k] == pytest.approx(falls(alone, change), rel=1e-5)


@pytest.mark.parametrize("bounds", [(-0.1, 0.1), (0.0, 5.0), (1.0 / 3.0, 3.0)])
def test_an_amount_stays_within_its_bounds(bounds):
    noise = Noise(COLOUR, 0.2)
    model = LinearisedModel(at(Line, record(), NAMES, noise={"y": noise}))
    found = model.score_statistics(directions({"y": CHANGES}, *bounds))
    roots = whitening(noise), np.eye(COUNT) / size(RESIDUAL)
    for one, root in zip(found, roots, strict=True):
        expected = [falls(root, change, *bounds) for change in CHANGES.T]
        assert one == pytest.approx(expected, rel=1e-5, abs=1e-7)
    if bounds[0] > 0.0:
        assert min(found[1]) < 0.0  # so much of it makes things worse


def test_gaps_count_for_nothing():
    missing = (TIME > 7.0) & (TIME < 9.0) | (np.arange(COUNT) % 43 == 20)
    noise = Noise(COLOUR, 0.2)
    data = record(missing=missing)
    model = LinearisedModel(at(Line, data, NAMES, noise={"y": noise}))
    found, in_white = model.score_statistics(directions({"y": CHANGES[~missing]}))
    kept = np.diag((~missing).astype(float))
    for k, change in enumerate(CHANGES.T):
        expected = falls(whitening(noise, ~missing), change)
        assert found[k] == pytest.approx(expected, rel=1e-5)
        alone = kept / size(RESIDUAL[~missing])
        assert in_white[k] == pytest.approx(falls(alone, change), rel=1e-5)


def test_outliers_of_heavy_tails_hardly_count():
    """Two samples of next to no weight, however far they are off."""
    far = np.zeros(COUNT, dtype=bool)
    far[[40, 200]] = True
    weights = np.where(far, 1e-16, 1.0)
    noise = {"y": Noise(COLOUR, 0.2, 3.0)}
    results = []
    for off in (5.0, 500.0):
        residual = RESIDUAL + off * far
        model = LinearisedModel(
            at(Line, record(residual), NAMES, noise=noise, weights={"y": weights})
        )
        found, _ = model.score_statistics(directions({"y": CHANGES}))
        predicted = model.predicted_improvement(directions({"y": CHANGES}), 0)
        results.append([*found, predicted.fall, predicted.amount])
    near = np.where(far, 0.0, 1.0)
    expected = [
        falls(
            whitening(noise["y"]),
            near * change,
            residual=near * RESIDUAL,
            jacobian=near[:, np.newaxis] * JACOBIAN,
        )
        for change in CHANGES.T
    ]
    assert results[0][:3] == pytest.approx(expected, rel=1e-4)
    # the size of white noise, in which the prediction begins, is of all samples
    assert results[1] == pytest.approx(results[0], rel=1e-3)


def test_scores_of_several_outputs_add_up():
    other = 0.05 * RNG.standard_normal(COUNT)
    data = Dataset(
        TIME, {"u": U}, {"y": 2.0 * U + RESIDUAL, "double": 4.0 * U + other}, frozenset()
    )
    noise = {"y": Noise(COLOUR, 0.2), "double": Noise(WHITE, 0.05)}
    model = LinearisedModel(at(Line, data, NAMES, noise=noise))
    both = directions({"y": CHANGES, "double": CHANGES[:, ::-1]})
    found, _ = model.score_statistics(both)
    table = np.vstack([JACOBIAN, np.column_stack([-4.0 * U, np.zeros(COUNT)])])
    residual = np.concatenate([RESIDUAL, other])
    one, two = whitening(noise["y"]), whitening(noise["double"])
    root = np.block([[one, np.zeros((len(one), COUNT))], [np.zeros((len(two), COUNT)), two]])
    for k in range(3):
        change = np.concatenate([CHANGES[:, k], CHANGES[:, 2 - k]])
        assert found[k] == pytest.approx(falls(root, change, residual=residual, jacobian=table))


def test_what_the_model_can_make_itself_scores_nothing():
    own = np.column_stack([U, np.ones(COUNT), 3.0 * U - 2.0]).astype(np.float32)
    model = LinearisedModel(at(Line, record(), NAMES, noise={"y": Noise(COLOUR, 0.2)}))
    for one in model.score_statistics(directions({"y": own})):
        assert one == pytest.approx(0.0, abs=1e-3)
    shares = model.identifiable_shares(directions({"y": own}))
    assert shares == pytest.approx(0.0, abs=1e-6)
    assert model.predicted_improvement(directions({"y": own}), 0).fall == pytest.approx(
        model.predicted_improvement(directions({"y": own}, 0.0, 0.0), 0).fall
    )


def test_a_model_without_coordinates_is_scored_alone():
    model = LinearisedModel(at(Line, record()))
    _, in_white = model.score_statistics(directions({"y": CHANGES}))
    expected = (CHANGES.T @ RESIDUAL) ** 2 / np.sum(CHANGES**2, axis=0) / size(RESIDUAL) ** 2
    assert in_white == pytest.approx(expected, rel=1e-5)


def test_an_effect_without_a_setting_has_no_scores():
    model = LinearisedModel(at(Line, record(), NAMES))
    nothing = directions({"y": np.empty((COUNT, 0))})
    for one in model.score_statistics(nothing):
        assert one.shape == (0,)
    assert model.identifiable_shares(nothing).shape == (0,)


def test_the_strongest_is_taken_once_in_every_kind_of_noise():
    assert strongest([np.array([1.0, 5.0, 2.0]), np.array([0.0, 7.0, 3.0])]) == [1]
    assert strongest([np.array([1.0, 5.0, 2.0]), np.array([9.0, 7.0, 3.0])]) == [1, 0]
    assert strongest([np.empty(0), np.empty(0)]) == []


# --- shares
# --------------------------------------------------------------------------------------------------


def beyond(change):
    """What the model's own coordinates cannot make of a change."""
    return change - JACOBIAN @ np.linalg.lstsq(JACOBIAN, change)[0]


def test_shares_are_those_of_projections():
    model = LinearisedModel(at(Line, record(), NAMES))
    mixed = directions({"y": np.column_stack([CHANGES, CHANGES[:, 0] + 4.0 * U, 1.0 + U])})
    shares = model.identifiable_shares(mixed)
    columns = mixed.gradient["y"].astype(float).T
    left = [beyond(column) for column in columns]
    expected = [o @ o / (c @ c) for o, c in zip(left, columns, strict=True)]
    assert shares == pytest.approx(expected, rel=1e-5, abs=1e-6)
    for k in range(3):
        confounded = model.confounded_shares(mixed, k)(mixed)
        for other in range(4):
            common = (left[k] @ left[other]) ** 2
            power = (left[k] @ left[k]) * (left[other] @ left[other])
            assert confounded[other] == pytest.approx(common / power, rel=1e-4, abs=1e-6)
        assert confounded[4] == pytest.approx(0.0, abs=1e-6)
    assert model.confounded_shares(mixed, 0)(mixed)[3] == pytest.approx(1.0, rel=1e-4)


def test_nothing_has_no_share():
    model = LinearisedModel(at(Line, record(), NAMES))
    nothing = directions({"y": np.zeros((COUNT, 2))})
    assert not model.identifiable_shares(nothing).any()
    assert not model.confounded_shares(directions({"y": CHANGES}), 0)(nothing).any()
    for one in model.score_statistics(nothing):
        assert not one.any()


# --- predictions
# --------------------------------------------------------------------------------------------------


def white_record(seed=4):
    noise = 0.05 * np.random.default_rng(seed).standard_normal(COUNT)
    return noise + 0.3 * CHANGES[:, 0] + 0.1 * U + 0.2


def predicted(residual, k=0, bounds=(-1e9, 1e9), **options):
    model = LinearisedModel(at(Line, record(residual), NAMES, **options))
    return model.predicted_improvement(directions({"y": CHANGES}, *bounds), k)


def in_white_noise(monkeypatch_order, residual, **options):
    """Predict with white noise given, as of a colour that is known."""
    fitted = at(Line, record(residual), NAMES, **options)
    fitted.problem.colour = {"y": monkeypatch_order}
    return LinearisedModel(fitted)


def test_in_white_noise_the_fall_is_of_the_likelihood_of_a_regression():
    residual = white_record()
    model = in_white_noise(WHITE, residual)
    found = model.predicted_improvement(directions({"y": CHANGES}), 0)
    table = np.column_stack([JACOBIAN, CHANGES[:, 0]])
    exact = np.linalg.lstsq(table, -residual)[0]
    assert found.amount == pytest.approx(exact[-1], rel=1e-5)
    assert found.step == pytest.approx(exact[:2], rel=1e-5)
    before, after = residual @ residual, squares(table, residual)
    assert found.fall == pytest.approx(COUNT * np.log(before / after), rel=1e-5)


def test_in_a_known_colour_the_fall_is_of_whitened_squares():
    residual = RESIDUAL
    model = in_white_noise(COLOUR, residual)
    found = model.predicted_improvement(directions({"y": CHANGES}), 0)
    root = whitening(Noise(COLOUR, 1.0))
    table = root @ np.column_stack([JACOBIAN, CHANGES[:, 0]])
    exact = np.linalg.lstsq(table, -root @ residual)[0]
    assert found.amount == pytest.approx(exact[-1], rel=1e-4)
    assert found.step == pytest.approx(exact[:2], rel=1e-4)
    whitened = root @ residual
    before, after = whitened @ whitened, squares(table, whitened)
    assert found.fall == pytest.approx(COUNT * np.log(before / after), rel=1e-4)


def autoregression(values):
    """Yule and Walker's fit of the likeliest order by BIC, of at most four, behind the criterion
    of its innovations.
    """
    n = len(values)
    covariance = np.array([values[: n - k] @ values[k:] for k in range(5)]) / n
    best = [(n * np.log(covariance[0]), WHITE)]
    for order in range(1, 5):
        matrix = toeplitz(covariance[:order])
        taps = np.linalg.solve(matrix, covariance[1 : order + 1])
        variance = covariance[0] - taps @ covariance[1 : order + 1]
        best.append((n * np.log(variance) + order * np.log(n), taps))
    _, taps = min(best, key=lambda one: one[0])
    whitened = whitening(Noise(taps, 1.0)) @ values
    return n * np.log(whitened @ whitened / n) + len(taps) * np.log(n), taps


@pytest.mark.parametrize("coloured", [True, False])
def test_the_colour_is_estimated_from_what_a_change_leaves(coloured):
    """A slow change that looks like noise with a long memory: three rounds of a weighted
    regression, then the criterion before and after. In white noise a colour is saved as well.
    """
    residual = RESIDUAL if coloured else white_record()
    table = np.column_stack([JACOBIAN, CHANGES[:, 0]])
    taps = WHITE
    for _ in range(3):
        root = whitening(Noise(taps, 1.0))
        exact = np.linalg.lstsq(root @ table, -root @ residual)[0]
        after, taps = autoregression(residual + table @ exact)
    before, taps_before = autoregression(residual)
    found = predicted(residual)
    assert len(taps_before) > 0
    assert (len(taps) > 0) == coloured
    assert found.amount == pytest.approx(exact[-1], rel=1e-4)
    assert found.step == pytest.approx(exact[:2], rel=1e-4)
    assert found.fall == pytest.approx(before - after, rel=1e-4)
    assert found.fall > 10.0


def test_bounds_of_the_amount_and_of_the_coordinates_hold():
    residual = white_record()
    assert predicted(residual, bounds=(-0.1, 0.1)).amount == pytest.approx(-0.1)
    assert predicted(residual, bounds=(1.0 / 3.0, 3.0)).amount == pytest.approx(1.0 / 3.0)
    far = predicted(residual + 3.0)  # the level ends at one
    assert far.step[1] == pytest.approx(1.0)
    held = predicted(residual, bounds=(0.0, 0.0))
    assert held.amount == 0.0
    assert held.fall > 0.0  # by the model's own coordinates


@pytest.mark.parametrize("away", [0.0, 0.3])
def test_a_prior_counts_like_rows_of_the_regression(away):
    """The gain near its start, the level free; the model stands away from the prior's mean."""
    residual = white_record()
    precision = 5e4
    prior = [precision, 0.0]
    q = np.array([np.log(2.0) + away, 0.0])
    fitted = at(Line, record(residual), NAMES, q=q, prior=prior)
    fitted.problem.colour = {"y": WHITE}
    found = LinearisedModel(fitted).predicted_improvement(directions({"y": CHANGES}), 1)
    gain = 2.0 * np.exp(away)
    error = residual + (2.0 - gain) * U
    table = np.column_stack([-gain * U, -np.ones(COUNT), CHANGES[:, 1]])
    deviation = size(error)
    for _ in range(3):
        rows = np.vstack([table / deviation, [[np.sqrt(precision), 0.0, 0.0]]])
        target = np.append(error / deviation, np.sqrt(precision) * away)
        exact = np.linalg.lstsq(rows, -target)[0]
        deviation = size(error + table @ exact)
    assert found.amount == pytest.approx(exact[-1], rel=1e-4)
    assert found.step == pytest.approx(exact[:2], rel=1e-4)
    before = 2.0 * COUNT * np.log(size(error)) + precision * away**2
    after = 2.0 * COUNT * np.log(deviation) + precision * (away + exact[0]) ** 2
    assert found.fall == pytest.approx(before - after, rel=1e-4)


def test_the_predicted_amount_is_the_best_of_all():
    """The likelihood, for every amount, of a regression in white noise: a search on its own."""
    residual = white_record()

    def criterion(amount):
        return COUNT * np.log(squares(JACOBIAN, residual + amount * CHANGES[:, 0]) / COUNT)

    best = minimize_scalar(criterion, bracket=(-1.0, 0.0, 1.0), tol=1e-10)
    model = in_white_noise(WHITE, residual)
    found = model.predicted_improvement(directions({"y": CHANGES}), 0)
    assert found.amount == pytest.approx(best.x, rel=1e-4)
    assert found.fall == pytest.approx(
        COUNT * np.log(residual @ residual / COUNT) - best.fun, rel=1e-5
    )


# --- as written down
# --------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_colour_of_the_base_swallows_a_drift_as_the_decision_says():
    ((scored, improved),) = re.findall(
        r"scored ([\d.]+), and ([\d.]+) with", DECISION.read_text(encoding="utf-8")
    )
    drawn = draw("sensor_drift", 1)
    first = as_measured(drawn).part(0, round(drawn.time.size * (1.0 - HELD_OUT)))
    search = Search(first, PpyActuator, searched_parameters(PpyActuator))
    looked_at = score(search, search.nominal(), [sensor_drift(PpyActuator, "voltage")])
    model = LinearisedModel(looked_at.model)
    (drift,) = looked_at.directions.values()
    falls = [model.score_statistics(drift)[0][0], model.predicted_improvement(drift, 0).fall]
    assert falls == pytest.approx([float(scored), float(improved)], rel=0.02)
