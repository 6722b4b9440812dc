"""State-space models by a subspace method, past-output MOESP, with the best Kalman gain.

The gain of the predictor is found by the prediction-error method: with A and C known, ``v = C x +
e``, ``x' = A x + K e``, and K makes e smallest (Ljung, sections 4.3 and 7.2).

Sources: Verhaegen, Automatica 30 (1994); Ljung, System Identification, section 10.6; where the
noise makes a model unstable, Maciejowski, Systems & Control Letters 26 (1995).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import block_diag

from fmus.kit import UserError
from fmus.kit.arrays import Array, Mask, single_threaded
from orchestration.identify.black_box.data import InputOutputData, check_varies
from orchestration.identify.black_box.excitation import check_excitation
from orchestration.identify.black_box.gauss_newton import minimise
from orchestration.identify.black_box.models import StateSpaceModel, free_responses, states
from orchestration.identify.black_box.orders import Count, orders, whole
from orchestration.identify.black_box.polynomials import solve_least_squares
from orchestration.identify.black_box.result import Identification
from orchestration.identify.black_box.start_values import innovations

_HORIZONS = (10, 20, 40)  # block rows, of which the best are kept; at least two more than the order
_COLUMNS = 4  # samples for each row of the data matrix, at least
_WORK = 5e8  # samples times rows squared, about a second of work
_INSIDE = 1.0 - 1e-7  # largest modulus of an eigenvalue of a predictor that is called stable


class _Realisation(NamedTuple):
    """Matrices of a state-space model in innovations form, as of `StateSpaceModel`."""

    a: Array
    b: Array
    c: Array
    d: Array
    k: Array


@single_threaded
def state_space(data: InputOutputData, order: int, nk: Count = 1, first: int = 0) -> Identification:
    """Identify a state-space model in innovations form.

    Parameters
    ----------
    data : InputOutputData
    order : int
        States, at least 1, without those that keep delayed inputs.
    nk : int or sequence of int
        Delays in samples; an input with a delay of 0 acts directly on the output, too.
    first : int
        First sample whose error counts, so that models of different orders are judged by the same
        samples.

    Returns
    -------
    Identification
        Without parameters, because states have no coordinates of their own. Of several horizons of
        the method it is the one with the smallest prediction errors.

    Raises
    ------
    UserError
        If the order or a delay is impossible, samples too few, or an input is constant or does not
        excite the model.
    """
    order = whole("order", order, 1)
    delays = orders(data, nb=order, nk=nk, na=order).nk
    check_varies(data)
    weak = check_excitation(data, (2 * order,) * len(delays))
    model, residual = _best_horizon(data, order, delays, first)
    # in a canonical form A and K have as many as there are states, B as many for every input, D one
    # for every input without a delay; and there is the offset
    parameter_count = order * (2 + len(delays)) + delays.count(0) + 1
    variance = float(residual @ residual) / max(len(residual) - parameter_count, 1)
    return Identification(
        model=replace(model, noise_variance=variance),
        data=data,
        parameters=(),
        covariance=np.empty((0, 0)),
        count=parameter_count,
        residual=residual,
        converged=True,
        messages=(model.describe_operating_point(), *weak, *model.describe_instability()),
    )


def _best_horizon(
    data: InputOutputData, order: int, delays: tuple[int, ...], first: int
) -> tuple[StateSpaceModel, Array]:
    """Return the model of the horizon with the smallest prediction errors, and these."""
    operating_point = data.inputs.mean(axis=0)
    level = float(data.output.mean())
    # a state-space model without direct feedthrough has a delay of one sample already
    later = [max(delay - 1, 0) for delay in delays]
    direct = np.equal(delays, 0)
    u = _delayed(data.inputs - operating_point, later)
    y = data.output - level
    begin = max(first, *later)
    candidates = []
    for horizon in _horizons(order, len(y), u.shape[1]):
        observability = _estimate_observability(u, y, order, horizon)
        matrices, offset = _realise(u, y, observability, direct)
        model = StateSpaceModel(
            "SS",
            data.step,
            data.input_names,
            data.output_name,
            operating_point,
            level + offset,
            1.0,
            *_with_delays(matrices, later),
        )
        candidates.append((model, model.prediction_errors(data)[begin:]))
    return min(candidates, key=lambda candidate: float(candidate[1] @ candidate[1]))


def _delayed(u: Array, lags: list[int]) -> Array:
    """Return inputs (n, m) delayed by ``lags`` samples, at their first value before."""
    delayed = [
        np.pad(column, (lag, 0), mode="edge")[: len(u)]
        for column, lag in zip(u.T, lags, strict=True)
    ]
    return np.stack(delayed, axis=1)


def _horizons(order: int, samples: int, inputs: int) -> Iterator[int]:
    """Yield the numbers of block rows to try; refuse a record that is too short for any."""
    least = order + 2
    rows = 2 * (inputs + 1)  # of past and future signals, for each block row
    possible = samples // (_COLUMNS * rows)
    if possible < least:
        raise UserError(
            f"{samples} samples are too few for {order} states and {inputs} inputs: "
            f"at least {_COLUMNS * rows * least} are needed"
        )
    # a QR factorisation takes the square of all rows for every sample
    affordable = int((_WORK / samples) ** 0.5) // rows
    longest = min(possible, max(least, affordable))
    yield from np.unique(np.clip(_HORIZONS, least, longest)).tolist()


def _estimate_observability(u: Array, y: Array, order: int, horizon: int) -> Array:
    """Return the extended observability matrix (horizon, order).

    It is the range of future outputs, along future inputs, from past data; one QR factorisation
    holds all of it (Verhaegen, 1994).
    """
    inputs = np.stack([sliding_window_view(column, 2 * horizon) for column in u.T], axis=1)
    outputs = sliding_window_view(y, 2 * horizon)
    samples = len(outputs)
    future = inputs[:, :, horizon:].reshape(samples, -1)
    past = inputs[:, :, :horizon].reshape(samples, -1)
    # the column of ones takes the constant away: the mean of a record that still drifts is no
    # operating point
    rows = [np.ones((samples, 1)), future, past, outputs]
    triangle = np.asarray(np.linalg.qr(np.hstack(rows), mode="r")).T
    first = 1 + future.shape[1]
    last = first + past.shape[1] + horizon
    directions, singular, _ = np.linalg.svd(triangle[last:, first:last], full_matrices=False)
    return directions[:, :order] * np.sqrt(singular[:order])


def _realise(u: Array, y: Array, observability: Array, direct: Mask) -> tuple[_Realisation, float]:
    """Return A, B, C, D and K of an observability matrix and data, and the offset of the output.

    A and C are read off the matrix by its shift structure, the others fitted to the output.

    Parameters
    ----------
    u : ndarray, shape (n, m)
    y : ndarray, shape (n,)
    observability : ndarray, shape (horizon, order)
    direct : ndarray of bool, shape (m,)
        Inputs that act directly on the output.
    """
    order = observability.shape[1]
    a = solve_least_squares(observability[:-1], observability[1:])
    c = observability[0]
    if np.abs(np.linalg.eigvals(a)).max() >= 1.0:
        # stable by construction: zeros after the horizon, to which no unstable state could decay
        a = solve_least_squares(observability, np.vstack([observability[1:], np.zeros(order)]))
    # with A and C, the simulation is linear in B, D, the offset and the initial state
    inputs = u.shape[1]
    paths = [states(a.T, np.outer(column, c), np.zeros(order)) for column in u.T]
    through = u[:, direct]
    columns = np.hstack([*paths, through, np.ones((len(y), 1)), free_responses(a, c, len(y))])
    solution = solve_least_squares(columns, y)
    of_paths, of_through, offset, _ = np.split(
        solution, np.cumsum([order * inputs, through.shape[1], 1])
    )
    d = np.zeros(inputs)
    d[direct] = of_through
    gain = kalman_gain(a, c, y - columns @ solution)
    return _Realisation(a, of_paths.reshape(inputs, order).T, c, d, gain), float(offset[0])


def _with_delays(matrices: _Realisation, later: list[int]) -> _Realisation:
    """Return matrices with shift registers that delay every input by ``later`` samples."""
    a, b, c, d, k = matrices
    n = len(a)
    none = np.zeros(sum(later))
    extended = block_diag(a, *(np.eye(lag, k=-1) for lag in later))
    entry = np.vstack([b, np.zeros((len(none), b.shape[1]))])
    end = n
    for i, lag in enumerate(later):
        end += lag
        if lag:
            extended[:n, end - 1] = b[:, i]
            entry[:n, i] = 0.0
            entry[end - lag, i] = 1.0
    return _Realisation(extended, entry, np.r_[c, none], d, np.r_[k, none])


def kalman_gain(a: Array, c: Array, disturbance: Array) -> Array:
    """Return the gain (n,) of the stationary predictor.

    Parameters
    ----------
    a : ndarray, shape (n, n)
        Stable.
    c : ndarray, shape (n,)
    disturbance : ndarray, shape (samples,)
        Output less simulation.

    Returns
    -------
    ndarray, shape (n,)
        The better one of two searches, from no gain and from that of a long autoregression's
        innovations.
    """
    # states of the unit of the output: the gain has none then, and is no large number
    unit = float(np.linalg.norm(c))
    problem = _GainErrors(a, c / unit, disturbance)
    e = innovations(disturbance, len(a))
    effect = states(a.T, np.outer(e, c / unit), np.zeros(len(a)))
    from_innovations = solve_least_squares(effect, disturbance - e)
    starts = [start for start in (from_innovations, np.zeros(len(a))) if problem.admissible(start)]
    searches = (minimise(problem, start) for start in starts)
    return min(searches, key=lambda search: search.cost).theta / unit


class _GainErrors(NamedTuple):
    """Prediction errors as functions of the gain; see `kalman_gain`."""

    a: Array
    c: Array
    disturbance: Array

    def errors(self, gain: Array) -> Array:
        """Return the prediction errors (n,); raise UserError if the predictor is not stable."""
        if not self.admissible(gain):
            raise UserError("the predictor is not stable")
        drive = np.outer(self.disturbance, gain)
        predicted = states(self._predictor(gain), drive, np.zeros(len(gain))) @ self.c
        return self.disturbance - predicted

    def jacobian(self, gain: Array) -> Array:
        """Return the derivatives (n, p) of the prediction errors by the gain."""
        drive = np.outer(self.errors(gain), self.c)
        return -states(self._predictor(gain).T, drive, np.zeros(len(gain)))

    def admissible(self, gain: Array) -> bool:
        """Return whether the predictor is stable."""
        return bool(np.abs(np.linalg.eigvals(self._predictor(gain))).max() < _INSIDE)

    def _predictor(self, gain: Array) -> Array:
        """Return the state matrix (n, n) of the predictor."""
        return self.a - np.outer(gain, self.c)
