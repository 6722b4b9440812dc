"""Claims: a prediction is as uncertain as linear regression says, and as likely as SciPy says."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import multivariate_normal

from orchestration.diagnosis import prediction
from orchestration.diagnosis.fitting import StartPrior, effective_samples, independent_weights
from orchestration.diagnosis.local_values import LocalValues
from orchestration.diagnosis.prediction import Prediction, predict
from orchestration.diagnosis.subject import subject_of
from tests.support.diagnosed_mass import START, exact, mass, pushed
from tests.support.diagnosed_vessels import vessels

TRUTH = np.array([2.5, 24.0, 2.2])


def fitted_mass():
    """Return the subject of a record of the mass, and the whole record."""
    record = pushed(240)
    noise = 0.005 * np.random.default_rng(1).standard_normal((240, 1))
    states = exact(record, tuple(TRUTH), START, record.inputs[:, 0])
    record = replace(record, outputs=states[:, :1] + noise)
    return subject_of(mass(), [record]), record


def jacobian(record, values, start, deviation):
    """Differentiate the exact solution by the logarithms of the parameters, and by the start."""
    columns = []
    for k in range(3):
        sides = [
            exact(
                record,
                tuple(values * np.exp(s * 1e-4 * (np.arange(3) == k))),
                start,
                record.inputs[:, 0],
            )
            for s in (1.0, -1.0)
        ]
        columns.append((sides[0] - sides[1])[:, 0] / 2e-4)
    for k in range(2):
        sides = [
            exact(
                record, tuple(values), start + s * 1e-4 * (np.arange(2) == k), record.inputs[:, 0]
            )
            for s in (1.0, -1.0)
        ]
        columns.append((sides[0] - sides[1])[:, 0] / 2e-4 * deviation[k])
    return np.array(columns).T


def test_a_prediction_is_as_uncertain_as_linear_regression_says() -> None:
    """Covariance J (J' W J + prior)^-1 J' from differences of the exact solution."""
    subject, record = fitted_mass()
    problem, point = subject.problem, subject.base.point
    values = problem.parameters(point.q)[:3]
    by_all = jacobian(record, values, point.starts[0], problem.starts[0].deviation)
    by_all /= problem.spread
    prior = np.append(problem.slopes(point.q) / values * problem.deviation, np.ones(2))
    (weight,) = independent_weights(subject.base.errors)[0]
    information = weight * by_all[:160].T @ by_all[:160] + np.diag(prior**-2.0)
    expected = by_all @ np.linalg.inv(information) @ by_all.T
    made = predict(subject.base, record, point.starts[0], problem.starts[0], 0)
    covariance = made.directions[:, 0] @ made.directions[:, 0].T
    assert covariance == pytest.approx(expected, abs=2e-3 * expected.max())
    assert made.noise == pytest.approx(weight**-0.5)


def test_the_beginning_of_another_record_says_where_it_starts() -> None:
    """More of its beginning leaves less uncertain; with none its start is as the prior says."""
    subject, record = fitted_mass()
    prior = StartPrior(START, np.array([0.05, 0.5]))

    def uncertain(count: int) -> float:
        made = predict(subject.base, record, START, prior, record.part(0, count))
        return float(np.sqrt(np.mean(made.directions[40:100] ** 2)))

    assert uncertain(40) < 0.5 * uncertain(6) < 0.5 * uncertain(2)
    first = predict(subject.base, record, START, prior, record.part(0, 0)).directions[0, 0]
    assert np.linalg.norm(first) == pytest.approx(0.05 / subject.problem.spread[0], rel=1e-6)


@pytest.mark.parametrize("is_followed", [True, False])
def test_a_local_value_is_as_uncertain_as_its_own_record_leaves_it(is_followed: bool) -> None:
    """The first record is a sixteenth of the second, by which its stiffness is hardly told."""
    records = []
    for group, count in enumerate((15, 240)):
        record = replace(pushed(count), group=group)
        noise = 0.005 * np.random.default_rng(group).standard_normal((count, 1))
        states = exact(record, tuple(TRUTH), START, record.inputs[:, 0])
        records.append(replace(record, outputs=states[:, :1] + noise))
    local = LocalValues(("short", "long"), each=("stiffness",))
    subject = subject_of(mass(), records, interpolate=False, local=local)
    point, priors = subject.base.point, subject.problem.starts
    widths = []
    for group in (0, 1):
        record = replace(records[1], group=group)
        by = group if is_followed else record.part(0, 1)
        made = predict(subject.base, record, point.starts[group], priors[group], by)
        widths.append(np.sqrt(np.mean(made.directions**2)))
    assert widths[0] > 3.0 * widths[1]


def test_errors_beyond_uncertainty_are_as_likely_as_those_of_the_whole_covariance() -> None:
    """Of two outputs with gaps, against SciPy's density at the scale of the noise that is best."""
    random = np.random.default_rng(3)
    errors = random.standard_normal((30, 2)) * (0.5, 2.0)
    errors[4:9, 0] = np.nan
    directions = random.standard_normal((30, 2, 3)) * np.array([3.0, 0.3, 0.01])
    made = Prediction(errors, directions, np.array([0.5, 2.0]))
    rows = np.arange(5, 30)
    got = made.beyond_uncertainty(rows) / made.noise
    known = np.isfinite(errors[rows])
    assert np.array_equal(np.isfinite(got), known)
    e = (errors[rows] / made.noise)[known]
    own = (directions[rows] / made.noise[:, None])[known]
    covariance = np.eye(e.size) + own @ own.T
    variance = e @ np.linalg.solve(covariance, e) / e.size
    density = multivariate_normal(np.zeros(e.size), variance * covariance).logpdf(e)
    of_mean_square = -0.5 * e.size * np.log(2.0 * np.pi * np.e * np.mean(got[known] ** 2))
    assert of_mean_square == pytest.approx(density, rel=1e-9)


def test_more_than_noise_is_no_uncertainty_of_parameters() -> None:
    """Of slow residuals the noise is larger by as much as fewer samples are independent."""
    subject, record = fitted_mass()
    slow = lfilter([1.0], [1.0, -0.9], np.random.default_rng(4).standard_normal((160, 1)), axis=0)
    fitted = replace(subject.base, errors=(slow,))
    made = predict(fitted, record, START, subject.problem.starts[0], 0)
    share = effective_samples(slow[:, 0]) / 160.0
    assert share < 0.3
    assert made.noise == pytest.approx(np.sqrt(np.mean(slow**2)) / share)


def test_without_uncertainty_errors_are_those_of_the_run() -> None:
    errors = np.array([[0.1], [np.nan], [0.3]])
    made = Prediction(errors, np.zeros((3, 1, 0)), np.ones(1))
    assert np.array_equal(made.beyond_uncertainty(np.arange(3)), errors, equal_nan=True)
    assert np.array_equal(made.part(1).errors, errors[1:], equal_nan=True)


def test_slopes_beyond_numbers_leave_the_errors_as_they_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A run that nearly leaves its bounds may have such."""
    subject, record = fitted_mass()
    endless = np.full_like(subject.base.curvature, np.inf)
    monkeypatch.setattr(prediction, "final_curvature", lambda fitted: endless)
    for begun_by in (0, record.part(0, 20)):
        made = predict(subject.base, record, START, subject.problem.starts[0], begun_by)
        assert made.directions.shape[2] == 0
        assert np.array_equal(made.beyond_uncertainty(np.arange(9)), made.errors[:9])


def test_an_output_that_is_not_measured_is_not_predicted() -> None:
    """Of two vessels, of which the second alone is measured."""
    model, record, _, course = vessels()
    noise = 0.01 * np.random.default_rng(0).standard_normal(course.outputs.shape)
    seen = replace(record, outputs=(course.outputs + noise) * (np.nan, 1.0))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # what is not measured has no mean
        subject = subject_of(model, [seen])
    point = subject.base.point
    made = predict(subject.base, seen, point.starts[0], subject.problem.starts[0], 0)
    assert not made.directions[:, 0].any()
    assert made.directions[:, 1].any()
    assert np.isnan(made.beyond_uncertainty(np.arange(20))[:, 0]).all()
