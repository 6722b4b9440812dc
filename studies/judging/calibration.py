"""Calibration of how sure a cause is: `python -m studies.judging.calibration ROWS.jsonl ...`.

A logistic regression of "the true cause is among the first one, two or three" on their features
(`orchestration.diagnosis.features`), fitted to rows of `studies.judging.outside` and `hidden`. It
is judged with one plant left out in turn, and its coefficients are printed for `comparison.py`.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.tables import Table, Topic
from fmus.kit.arrays import Array
from orchestration.diagnosis import Found, conclude
from orchestration.diagnosis import features as of_causes
from studies.judging.study import Row

USED = ("margin", "share", "words", "rise")
BINS = 10
_PRIOR = 1.0  # precision of a coefficient of a feature in its standard deviations
_LARGEST = 3.0  # standard deviations beyond which a feature says nothing more


@dataclass(frozen=True)
class Logistic:
    """A logistic regression with a normal prior of its coefficients.

    Attributes
    ----------
    names : tuple of str
    middle, scale : ndarray, shape (p,)
        Of the features.
    coefficients : ndarray, shape (1 + p,)
        A constant, then of each feature in its scale.
    """

    names: tuple[str, ...]
    middle: Array
    scale: Array
    coefficients: Array

    def probability(self, features: Array) -> Array:
        """Return the probabilities (n,) of features (n, p)."""
        return _sigmoid(_design(features, self.middle, self.scale) @ self.coefficients)


def groups_of(
    found: Found, conclusion: conclude.Conclusion, is_right: Callable[[Any], bool]
) -> list[Row]:
    """Return the features of the first cause, of the first two and three, and if one is right.

    None of a model that is consistent, of which no cause is claimed.
    """
    leading = () if conclusion.verdict == "consistent" else conclusion.leading
    groups = [leading[:count] for count in range(1, len(leading) + 1)]
    return [
        {"features": of_causes.features_of(found, group), "right": any(map(is_right, group))}
        for group in groups
    ]


def fit_logistic(names: Sequence[str], features: Array, right: Array) -> Logistic:
    """Fit by Newton's method; the cost is convex.

    Parameters
    ----------
    names : sequence of str
    features : ndarray, shape (n, p)
    right : ndarray of bool, shape (n,)
    """
    middle, scale = features.mean(axis=0), features.std(axis=0)
    scale = np.where(scale > 1e-9, scale, 1.0)
    design = _design(features, middle, scale)
    prior = np.append(1e-6, np.full(features.shape[1], _PRIOR))
    beta = np.zeros(design.shape[1])
    cost = _cost(design, right, beta, prior)
    for _ in range(100):
        p = _sigmoid(design @ beta)
        gradient = design.T @ (p - right) + prior * beta
        curvature = (design * (p * (1.0 - p))[:, None]).T @ design + np.diag(prior)
        step = np.linalg.solve(curvature, gradient)
        share = 1.0
        while _cost(design, right, beta - share * step, prior) > cost and share > 1e-6:
            share *= 0.5
        beta = beta - share * step
        cost = _cost(design, right, beta, prior)
        if np.abs(share * step).max() < 1e-10:
            break
    return Logistic(tuple(names), middle, scale, beta)


def _design(features: Array, middle: Array, scale: Array) -> Array:
    z = np.clip((features - middle) / scale, -_LARGEST, _LARGEST)
    return np.column_stack([np.ones(len(z)), z])


def _sigmoid(x: Array) -> Array:
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(x, -40.0, 40.0))))


def _cost(design: Array, right: Array, beta: Array, prior: Array) -> float:
    odds = design @ beta
    return float(np.sum(np.logaddexp(0.0, odds) - right * odds) + 0.5 * prior @ beta**2)


def log_loss(p: Array, right: Array) -> float:
    """Return the mean negative logarithm of the probability of what is the case, nats."""
    p = np.clip(p, 1e-6, 1.0 - 1e-6)
    return float(-np.mean(np.where(right, np.log(p), np.log1p(-p))))


def calibration_error(p: Array, right: Array) -> float:
    """Return the expected calibration error in bins of equal width.

    Naeini, Cooper, Hauskrecht: Obtaining well calibrated probabilities using Bayesian binning,
    AAAI 2015.
    """
    return sum(n * abs(mean - share) for _, n, mean, share in reliability(p, right)) / len(p)


def reliability(p: Array, right: Array) -> list[tuple[int, int, float, float]]:
    """Return of each bin that is not empty: its place, count, mean probability and share right."""
    place = np.minimum((p * BINS).astype(int), BINS - 1)
    bins = []
    for k in range(BINS):
        inside = place == k
        if inside.any():
            counted = int(inside.sum())
            bins.append((k, counted, float(p[inside].mean()), float(right[inside].mean())))
    return bins


def left_out_in_turn(
    groups: Sequence[str], fitted_on: Callable[[Array], Logistic], features: Array
) -> Array:
    """Return probabilities of rows by fits to the rows of all other groups.

    Parameters
    ----------
    groups : sequence of str
        Of each row.
    fitted_on : callable
        Fits to rows that a mask of bool (n,) chooses.
    features : ndarray, shape (n, p)
    """
    of_row = np.array(groups)
    p = np.empty(len(of_row))
    for group in np.unique(of_row):
        mine = of_row == group
        p[mine] = fitted_on(~mine).probability(features[mine])
    return p


def report(rows: Iterable[Row], names: Sequence[str] = USED) -> Topic:
    """Fit, judge with each plant left out, and return tables with the coefficients."""
    groups = [(row, group) for row in rows for group in row.get("groups", [])]
    known = [group["features"] for _, group in groups]
    features = np.array([[one[name] for name in names] for one in known], dtype=float)
    right = np.array([bool(group["right"]) for _, group in groups])
    fitted = fit_logistic(names, features, right)
    left_out = left_out_in_turn(
        [row["plant"] for row, _ in groups],
        lambda these: fit_logistic(names, features[these], right[these]),
        features,
    )
    kinds = {
        "by the weights in force": np.array([of_causes.confidence(one) for one in known]),
        "logistic, fitted": fitted.probability(features),
        "logistic, plant left out": left_out,
    }
    hidden = np.array([row.get("group") != "clean" for row, _ in groups])
    measured: list[list[str | int | float]] = [
        [
            name,
            calibration_error(p, right),
            log_loss(p, right),
            calibration_error(p[hidden], right[hidden]),
            log_loss(p[hidden], right[hidden]),
            int(np.sum(p >= 0.9)),
            int(np.sum(right[p >= 0.9])),
        ]
        for name, p in kinds.items()
    ]
    columns = ["probability", "ECE", "log loss", "ECE, wrong models", "log loss, wrong models"]
    return Topic(
        f"Calibration on {len(groups)} groups of causes, {int(right.sum())} of them right",
        [
            Table([*columns, "p >= 0.9", "of these right"], measured),
            Table(
                ["bin, plant left out", "groups", "mean p", "share right"],
                [
                    [f"{k / BINS:.1f} to {(k + 1) / BINS:.1f}", n, mean, share]
                    for k, n, mean, share in reliability(left_out, right)
                ],
            ),
            _coefficients(fitted),
        ],
    )


def _coefficients(fitted: Logistic) -> Table:
    parts = zip(fitted.names, fitted.coefficients[1:], fitted.middle, fitted.scale, strict=True)
    lines: list[list[str | int | float]] = [[name, float(c / s)] for name, c, _, s in parts]
    shift = np.sum(fitted.coefficients[1:] * fitted.middle / fitted.scale)
    lines.append(["constant", float(fitted.coefficients[0] - shift)])
    return Table(["feature", "log odds"], lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.judging.calibration", description=(__doc__ or "").split("\n\n")[0]
    )
    parser.add_argument("rows", type=Path, nargs="+", help="JSON lines of studies.judging.outside")
    chosen = parser.parse_args(arguments)
    lines = [line for path in chosen.rows for line in path.read_text("utf-8").splitlines()]
    print(report([json.loads(line) for line in lines if line.strip()]))


if __name__ == "__main__":
    main()
