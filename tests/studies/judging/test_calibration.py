"""Claims: the logistic regression is the maximum that scipy finds, and errors of calibration are
those that one counts by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from studies.judging.calibration import (
    USED,
    calibration_error,
    fit_logistic,
    left_out_in_turn,
    log_loss,
    reliability,
    report,
)


def _data(n=300):
    rng = np.random.default_rng(1)
    x = rng.normal(size=(n, 3)) * [1.0, 5.0, 0.1] + [0.0, 2.0, 1.0]
    odds = 0.5 + 1.5 * x[:, 0] - 0.3 * (x[:, 1] - 2.0)
    return x, rng.random(n) < 1.0 / (1.0 + np.exp(-odds))


def test_the_coefficients_are_those_of_a_general_minimiser():
    x, right = _data()
    fitted = fit_logistic("abc", x, right)
    z = np.clip((x - x.mean(axis=0)) / x.std(axis=0), -3.0, 3.0)

    def cost(beta):
        odds = beta[0] + z @ beta[1:]
        return np.sum(np.log1p(np.exp(odds)) - right * odds) + 0.5 * beta[1:] @ beta[1:]

    expected = minimize(cost, np.zeros(4), tol=1e-12).x
    assert fitted.coefficients == pytest.approx(expected, abs=1e-4)


def test_separable_rows_have_finite_coefficients():
    x = np.array([[-1.0], [-0.5], [0.5], [1.0]])
    fitted = fit_logistic("a", x, x[:, 0] > 0.0)
    assert np.isfinite(fitted.coefficients).all()
    assert fitted.probability(x)[3] > 0.5 > fitted.probability(x)[0]


def test_errors_of_calibration_by_hand():
    p = np.array([0.95, 0.95, 0.95, 0.95, 0.05, 0.05])
    right = np.array([True, True, True, False, False, False])
    assert reliability(p, right) == [
        (0, 2, pytest.approx(0.05), 0.0),
        (9, 4, pytest.approx(0.95), 0.75),
    ]
    assert calibration_error(p, right) == pytest.approx((4 * 0.2 + 2 * 0.05) / 6.0)
    assert log_loss(np.array([0.5, 0.8]), np.array([True, False])) == pytest.approx(
        0.5 * (np.log(2.0) + np.log(5.0))
    )


def test_rows_of_a_plant_are_judged_by_fits_to_the_others():
    x, right = _data(40)
    groups = ["a"] * 15 + ["b"] * 25
    p = left_out_in_turn(groups, lambda these: fit_logistic("abc", x[these], right[these]), x)
    expected = fit_logistic("abc", x[15:], right[15:]).probability(x[:15])
    assert p[:15] == pytest.approx(expected)


def test_a_report_counts_groups_of_all_rows():
    """Two groups of each of thirty rows, and none of a model that is consistent."""
    rng = np.random.default_rng(2)
    values, right = rng.normal(size=(60, len(USED))), rng.random(60) < 0.7
    groups = [
        {"features": dict(zip(USED, own, strict=True)), "right": bool(r)}
        for own, r in zip(values.tolist(), right, strict=True)
    ]
    rows = [
        {"groups": groups[2 * k : 2 * k + 2], "plant": ("one", "two")[k % 2], "group": "inside"}
        for k in range(30)
    ]
    topic = report([*rows, {"groups": [], "plant": "one", "group": "clean"}])
    assert topic.title == f"Calibration on 60 groups of causes, {right.sum()} of them right"
    coefficients = dict(topic.tables[2].rows)
    features = {name: values[:, k] for k, name in enumerate(USED)}
    odds = coefficients["constant"] + sum(coefficients[n] * v for n, v in features.items())
    assert np.mean(1.0 / (1.0 + np.exp(-odds))) == pytest.approx(right.mean(), abs=1e-3)
