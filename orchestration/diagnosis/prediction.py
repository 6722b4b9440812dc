"""Predictions of samples that a fit has not seen, with what its parameters leave uncertain."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fmus.kit.arrays import Array, Indices
from orchestration.diagnosis.fitting import (
    Fit,
    StartPrior,
    final_curvature,
    independent_weights,
    mean_squares,
)
from orchestration.diagnosis.runs import Course, Record

_LEAST = 1e-12  # mean square of errors, in squared spreads


@dataclass(frozen=True, eq=False)
class Prediction:
    """Errors on samples that were not fitted.

    Attributes
    ----------
    errors : ndarray, shape (n, ny)
        In spreads; NaN at gaps.
    directions : ndarray, shape (n, ny, m)
        In which the prediction is uncertain, by a standard deviation each, in spreads: the
        covariance of the outputs by uncertain parameters is ``directions @ directions.T``.
    noise : ndarray, shape (ny,)
        That the fit leaves, in spreads: of as many independent samples as there are samples.
    """

    errors: Array
    directions: Array
    noise: Array

    def part(self, first: int) -> Prediction:
        """Return the samples from a position on."""
        return replace(self, errors=self.errors[first:], directions=self.directions[first:])

    def beyond_uncertainty(self, rows: Indices) -> Array:
        """Return the errors (k, ny) of some samples, in which uncertain parameters count as such.

        With R for the covariance of a prediction, in that of the noise, these are ``R^(-1/2) e``
        times ``|R|^(1/2k)``: their mean square is the likelihood of a prediction whose noise is
        unknown, by which models are compared on samples to come (Box and Tiao: Bayesian Inference
        in Statistical Analysis, 1973, section 2.7). Without that, one that extrapolates well would
        win by the luck of its parameters.
        """
        errors = self.errors[rows] / self.noise
        known = np.isfinite(errors)
        directions = (self.directions[rows] / self.noise[:, np.newaxis])[known]
        if not directions.size or not np.isfinite(directions).all():
            return self.errors[rows]
        basis, sizes, _ = np.linalg.svd(directions, full_matrices=False)
        shares = 1.0 / np.hypot(1.0, sizes)
        own = errors[known]
        own = own + basis @ ((shares - 1.0) * (basis.T @ own))
        errors[known] = own * np.exp(-np.log(shares).sum() / len(own))
        return np.asarray(errors * self.noise)


@dataclass(frozen=True, eq=False)
class Response:
    """Outputs of a fit in a run yet to be made.

    Attributes
    ----------
    outputs : ndarray, shape (n, ny)
        SI; of those that are not measured as simulated.
    directions : ndarray, shape (n, ny, m)
        In which they are uncertain, by a standard deviation each, SI; see `Prediction`.
    """

    outputs: Array
    directions: Array


class Forecast:
    """A fit over runs yet to be made, with what its records leave uncertain.

    Parameters
    ----------
    fitted : Fit
    prior : StartPrior
        Of the start states of such a run.
    group : int
        That the runs are of; see `Record.group`.
    """

    def __init__(self, fitted: Fit, prior: StartPrior, group: int = 0):
        self.fitted = fitted
        self._prior = prior
        own = fitted.problem.coordinates(len(fitted.point.values), group)
        known = _inverse(final_curvature(fitted))[np.ix_(own, own)]
        unseen = np.zeros((0, len(own) + len(prior.mean)))
        self._root = _root(_of_new_start(known, unseen, len(prior.mean)))

    def respond(self, record: Record) -> Response | None:
        """Run over the inputs of a record; None if the run leaves its bounds.

        Parameters
        ----------
        record : Record
            Of the outputs it says which are measured.
        """
        fitted = self.fitted
        start = self._prior.mean
        course = fitted.problem.run(record, fitted.point, fitted.terms, start, True)
        if course is None:
            return None
        slopes = _slopes(fitted, record, course, self._prior)
        return Response(course.outputs, slopes @ self._root)


def predict(
    fitted: Fit, record: Record, start: Array, prior: StartPrior, begun_by: int | Record
) -> Prediction | None:
    """Run a fit over a record.

    Parameters
    ----------
    fitted : Fit
    record : Record
    start : ndarray, shape (nx,)
    prior : StartPrior
        Of these start states.
    begun_by : int or Record
        Position of the fitted record that this one goes on, or the beginning of this one, by which
        its start is known.

    Returns
    -------
    Prediction or None
        None if the run leaves its bounds.
    """
    problem = fitted.problem
    course = problem.run(record, fitted.point, fitted.terms, start, True)
    if course is None:
        return None
    errors = (record.outputs - course.outputs) / problem.spread
    slopes = _slopes(fitted, record, course, prior) / problem.spread[:, np.newaxis]
    states = len(start)
    inverse = _inverse(final_curvature(fitted))
    own = problem.coordinates(len(fitted.point.values), record.group)
    weights = np.mean(independent_weights(fitted.errors), axis=0)
    if isinstance(begun_by, int):
        first = len(inverse) - states * (len(problem.records) - begun_by)
        own = np.append(own, np.arange(first, first + states))
        covariance = inverse[np.ix_(own, own)]
    else:
        count = len(begun_by.time)
        rows = (slopes[:count] * np.sqrt(weights)[:, np.newaxis])[np.isfinite(errors[:count])]
        covariance = _of_new_start(inverse[np.ix_(own, own)], rows, states)
    # where more than noise is left a model errs by more than its parameters
    squares = np.maximum(mean_squares(np.concatenate(fitted.errors)), _LEAST)
    noise = 1.0 / weights / np.sqrt(squares)
    return Prediction(errors, slopes @ _root(covariance), noise)


def _slopes(fitted: Fit, record: Record, course: Course, prior: StartPrior) -> Array:
    """Return the derivatives (n, ny, m) of the outputs by a record's coordinates, SI."""
    slopes = np.zeros((*course.outputs.shape, course.slopes.shape[2]))
    slopes[:, record.measured] = course.slopes
    places, states = fitted.problem.columns(record.group), len(prior.mean)
    slopes[:, :, : len(places)] *= fitted.problem.slopes(fitted.point.q)[places]
    slopes[:, :, slopes.shape[2] - states :] *= prior.deviation
    return slopes


def _of_new_start(covariance: Array, rows: Array, states: int) -> Array:
    """Return the covariance of parameters, values and start states that samples (n, k) show.

    Without them that of parameters and values is known; start states are in deviations of their
    prior.
    """
    known = rows.shape[1] - states
    with np.errstate(over="ignore", invalid="ignore"):
        information = rows.T @ rows
    information[:known, :known] += _inverse(covariance)
    information[known:, known:] += np.eye(states)
    return _inverse(information)


def _root(covariance: Array) -> Array:
    """Return the columns whose products are a covariance; none of one that is beyond numbers.

    Slopes of a run that nearly leaves its bounds may be.
    """
    if not np.isfinite(covariance).all():
        return np.zeros((len(covariance), 0))
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _inverse(matrix: Array) -> Array:
    """Return the inverse of a positive definite matrix whose rows have scales of their own.

    NaN if it is beyond numbers.
    """
    nothing = np.full_like(matrix, np.nan)
    if not np.isfinite(matrix).all() or not (np.diag(matrix) > 0.0).all():
        return nothing
    sizes = 1.0 / np.sqrt(np.diag(matrix))
    scales = np.outer(sizes, sizes)
    try:
        return np.asarray(np.linalg.inv(matrix * scales) * scales)
    except np.linalg.LinAlgError:  # directions that differ by less than rounding
        return nothing
