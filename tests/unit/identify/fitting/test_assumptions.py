"""Claims: a fit takes priors, ties, bounds, known noise, weights and robust losses.

Oracles: normal equations of linear models, solved on paper; likelihoods minimised by SciPy's
simplex.
"""

import numpy as np
import pytest
from scipy.optimize import minimize

from fmus.kit import UserError
from orchestration.identify.fitting import FitData
from tests.support.linear_fits import SIGMA, Rise, columns, fitted, noisy, plane_data


def test_a_prior_counts_as_the_measurement_that_it_is():
    x = columns()
    y = noisy(x, [2.0, -1.0, 0.5])
    fit = fitted([plane_data(x, y)], priors={"a": (2.5, 0.02)}, noise={"y": SIGMA})
    precision = x.T @ x / SIGMA**2 + np.diag([1 / 0.02**2, 0, 0])
    expected = np.linalg.solve(precision, x.T @ y / SIGMA**2 + [2.5 / 0.02**2, 0, 0])
    deviations = np.sqrt(np.diag(np.linalg.inv(precision)))
    assert [*fit.values.values()] == pytest.approx(expected, rel=1e-7)
    ends = np.array([*fit.intervals.values()])
    assert (ends[:, 1] - ends[:, 0]) / 2 == pytest.approx(1.959964 * deviations, rel=1e-6)


def test_a_tie_leaves_one_parameter():
    x = columns()
    y = noisy(x, [2.0, 3.2, 0.5])
    fit = fitted([plane_data(x, y)], ["a", "c"], ties={"b": (1.6, "a")})
    joined = np.column_stack([x[:, 0] + 1.6 * x[:, 1], x[:, 2]])
    expected = np.linalg.lstsq(joined, y)[0]
    assert [fit.values["a"], fit.values["c"]] == pytest.approx(expected, rel=1e-7)
    assert fit.values["b"] == pytest.approx(1.6 * expected[0])
    assert fit.tied["b"].interval[1] == pytest.approx(1.6 * fit.intervals["a"][1])


def test_a_value_stays_within_its_bounds():
    x = columns()
    y = noisy(x, [2.0, -1.0, 0.5])
    fit = fitted([plane_data(x, y)], bounds={"a": (0.0, 1.5)})
    assert fit.values["a"] == pytest.approx(1.5, rel=1e-6)
    assert any("a ended at the limit" in text for text in fit.warnings)


@pytest.mark.parametrize(("loss", "freedom"), [("student", 4.0), ("cauchy", 1.0)])
def test_a_robust_loss_resists_outliers(loss, freedom):
    x = np.column_stack([np.zeros((101, 2)), np.ones(101)])
    y = np.random.default_rng(5).normal(2.0, 0.1, 101)
    y[::10] += 40.0
    assert fitted([plane_data(x, y)], ["c"], loss="squares").values["c"] == pytest.approx(y.mean())

    def deviance(at):  # of Student's t distribution, location and scale
        square = ((y - at[0]) / at[1]) ** 2
        return (freedom + 1) * np.log1p(square / freedom).sum() + 2 * len(y) * np.log(at[1])

    best = minimize(deviance, [2.0, 0.1], method="Nelder-Mead", options={"xatol": 1e-9}).x
    robust = fitted([plane_data(x, y)], ["c"], loss=loss).values["c"]
    assert robust == pytest.approx(best[0], rel=1e-3)
    assert robust == pytest.approx(np.median(y), abs=0.1)


def test_weights_are_those_of_weighted_least_squares():
    x = columns()
    sizes = np.linspace(0.1, 3.0, len(x))
    y = x @ [2.0, -1.0, 0.5] + sizes * np.random.default_rng(7).normal(size=len(x))
    fit = fitted([plane_data(x, y)], weights={"y": 1 / sizes}, loss="squares")
    expected = np.linalg.lstsq(x / sizes[:, None], y / sizes)[0]
    assert [*fit.values.values()] == pytest.approx(expected, rel=1e-7)


def test_noise_that_is_too_small_is_told():
    x = columns()
    fit = fitted([plane_data(x, noisy(x, [2.0, -1.0, 0.5]))], noise={"y": SIGMA / 3})
    assert any("times the noise that was given" in text for text in fit.warnings)


def test_an_interval_of_a_curved_model_is_called_too_narrow():
    """A time constant five times as long as the record."""
    time = np.linspace(0.0, 1.0, 51)
    y = 1.0 - np.exp(-time / 5.0) + np.random.default_rng(2).normal(0, 0.002, 51)
    fit = fitted([FitData(time, {}, {"y": y})], ["gain", "tau"], Rise)
    assert [
        text.partition(":")[0] for text in fit.likelihood.narrow_warnings() if "tau" in text
    ] == ["the interval of tau is too narrow above"]
    assert fit.profile("tau").interval[1] > 1.05 * fit.intervals["tau"][1]


def test_intervals_of_a_linear_model_are_not_called_too_narrow():
    x = columns()
    fit = fitted([plane_data(x, noisy(x, [2.0, -1.0, 0.5]))])
    assert fit.warnings == []
    assert fit.likelihood.narrow_warnings() == []


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"each": ("a",)}, "each a: there is only one record"),
        ({"bounds": {"z": (0.0, 1.0)}}, "bounds z: it is not fitted; fitted are a, b, c"),
        ({"bounds": {"a": (2.0, 1.0)}}, "bounds a: 2 … 1 is no range"),
        ({"priors": {"a": (1.0, 0.0)}}, "prior a: the deviation is 0; it must be above zero"),
        ({"ties": {"b": (2.0, "a")}}, "tie b: it is fitted, too; leave out one of the two"),
        ({"noise": {"z": 1.0}}, "noise z: it was not measured; there are y"),
        ({"scales": {"a": "logarithmic"}}, "scale a: a logarithm needs a start above zero"),
    ],
)
def test_what_cannot_be_assumed_is_refused(given, told):
    x = columns()
    with pytest.raises(UserError, match="^" + told.replace("(", r"\(")):
        fitted([plane_data(x, noisy(x, [2.0, -1.0, 0.5]))], **given)


@pytest.mark.slow
def test_intervals_hold_the_truth_as_often_as_they_say():
    truth = np.array([2.0, -1.0, 0.5])
    held = 0
    for seed in range(200):
        x = columns(60, 1000 + seed)
        fit = fitted([plane_data(x, noisy(x, truth, seed))], loss="squares")
        low, high = np.array([*fit.intervals.values()]).T
        held += np.sum((low <= truth) & (truth <= high))
    assert 0.93 <= held / 600 <= 0.97


def test_weights_of_other_samples_are_refused_in_a_line():
    x = columns()
    data = plane_data(x, noisy(x, [2.0, -1.0, 0.5]))
    for records in ([data], [data._replace(label="one"), data._replace(label="other")]):
        with pytest.raises(UserError, match=r"^weights of y: there are 7, of \d+ samples$"):
            fitted(records, weights={"y": np.ones(7)})
