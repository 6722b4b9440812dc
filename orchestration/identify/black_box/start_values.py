"""Start values of a search for a polynomial model: a long ARX model, reduced path by path.

A long ARX model needs no start and, being long, describes any paths and any colour of the noise.
Its paths are reduced to the orders of the model, weighted by its noise: by the iterated least
squares of Steiglitz and McBride (IEEE Trans. Automatic Control 10, 1965), which is asymptotically
efficient on the simulation of such a model (Everitt, Galrinho, Hjalmarsson: Automatica 89, 2018),
and by instrumental variables (Söderström and Stoica: Instrumental Variable Methods, 1983; Ljung,
section 7.6). The disturbance gives the noise model (Hannan and Rissanen: Biometrika 69, 1982).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from fmus.kit.arrays import Array
from orchestration.identify.black_box.orders import Orders
from orchestration.identify.black_box.polynomials import (
    delayed,
    filtered,
    monic,
    solve_least_squares,
    stabilised,
)
from orchestration.identify.black_box.prediction_error import PredictionError
from orchestration.identify.black_box.variable_projection import ReducedPredictionError

_ONE = np.ones(1)
_ROUNDS = 20  # of Steiglitz and McBride
# order of a long model: at least, for each order of the model, and samples for each parameter
_LONG_LEAST = 15
_LONG_TIMES = 4
_LONG_SAMPLES = 10


class _LongModel(NamedTuple):
    """A long ARX model of a record.

    Attributes
    ----------
    a : ndarray
        Monic and stable: it whitens the disturbance.
    paths : ndarray, shape (n, m)
        Simulated response of the output to every input.
    disturbance : ndarray, shape (n,)
        The output less all responses.
    innovations : ndarray, shape (n,)
    """

    a: Array
    paths: Array
    disturbance: Array
    innovations: Array


def denominators(problem: PredictionError) -> Iterator[list[Array]]:
    """Estimate F of every path, where each has its own, and yield them, the likely best first.

    All are stable.
    """
    long = _fit_long_model(problem)
    inputs = range(len(problem.orders.nb))
    yield [_steiglitz_mcbride(problem, long, i) for i in inputs]
    yield [_instrumental_variables(problem, long, i) for i in inputs]
    yield [_steiglitz_mcbride(problem, long, i, rounds=1) for i in inputs]


def noise_numerator(problem: PredictionError) -> Array:
    """Estimate C of an ARMAX model by extended least squares, and stabilise it.

    The regression is ``y = A, B terms + sum_k c_k e(t-k) + e``, with the innovations of a long ARX
    model for e.
    """
    e = _fit_long_model(problem).innovations[problem.first :]
    # with F, C and D of one, regressors of A, B and the offset are the slopes of minus the error
    slopes = problem.linear_slopes(problem.coefficients(np.zeros(problem.size)))
    rows = np.vstack([-slopes, delayed(e, 1, problem.orders.nc)])
    solution = solve_least_squares(rows.T, problem.present_output)
    return stabilised(monic(solution[len(slopes) :]))


def _fit_long_model(problem: PredictionError) -> _LongModel:
    """Fit an ARX model of high order, and simulate its paths."""
    inputs = problem.inputs
    output = problem.output
    n = problem.orders
    m = inputs.shape[1]
    order = max(_LONG_LEAST, _LONG_TIMES * n.highest)
    order = max(1, min(order, len(output) // (_LONG_SAMPLES * (m + 1)) - max(n.nk)))
    nb = tuple(order + n.nb[i] for i in range(m))
    arx = PredictionError(inputs, output, Orders(order, nb, 0, 0, (0,) * m, n.nk))
    parts = arx.coefficients(ReducedPredictionError(arx).theta(np.empty(0)))
    a = stabilised(parts.a)
    responses = [
        filtered(np.r_[np.zeros(k), b], a, u)
        for b, k, u in zip(parts.b, n.nk, inputs.T, strict=True)
    ]
    paths = np.stack(responses, axis=1)
    disturbance = output - paths.sum(axis=1)
    disturbance -= disturbance.mean()
    return _LongModel(a, paths, disturbance, filtered(a, _ONE, disturbance))


def _regressors(problem: PredictionError, i: int, signal: Array, inputs: Array) -> Array:
    """Return the regressors of ``F y = B u``: a delayed signal and the input (n, nf + nb)."""
    n = problem.orders
    return np.vstack([delayed(-signal, 1, n.nf[i]), delayed(inputs, n.nk[i], n.nb[i])]).T


def _steiglitz_mcbride(
    problem: PredictionError, long: _LongModel, i: int, rounds: int = _ROUNDS
) -> Array:
    """Reduce a path of the long model to F, by the iteration of Steiglitz and McBride.

    Each round fits ``F w = B u`` with both signals filtered by A/F of the round before.
    """
    nf = problem.orders.nf[i]
    first = problem.first
    f = _ONE
    for _ in range(rounds if nf else 0):
        signal = filtered(long.a, f, long.paths[:, i])
        columns = _regressors(problem, i, signal, filtered(long.a, f, problem.inputs[:, i]))
        f = stabilised(monic(solve_least_squares(columns[first:], signal[first:])[:nf]))
    return f


def _instrumental_variables(problem: PredictionError, long: _LongModel, i: int) -> Array:
    """Estimate F of a path by instrumental variables, and stabilise it.

    The instruments are the simulated responses of the long model, which are free of noise.
    """
    nf = problem.orders.nf[i]
    first = problem.first
    noisy = filtered(long.a, _ONE, long.paths[:, i] + long.disturbance)
    clean = filtered(long.a, _ONE, long.paths[:, i])
    u = filtered(long.a, _ONE, problem.inputs[:, i])
    columns = _regressors(problem, i, noisy, u)[first:]
    instruments = _regressors(problem, i, clean, u)[first:]
    # Z'X theta = Z'y, with instruments Z that do not correlate with the noise in X and y
    solution = solve_least_squares(instruments.T @ columns, instruments.T @ noisy[first:])
    return stabilised(monic(solution[:nf]))


def hannan_rissanen(v: Array, nc: int, nd: int) -> tuple[Array, Array]:
    """Return C and D of ``D v = C e``, by least squares on the innovations of an autoregression.

    Parameters
    ----------
    v : ndarray, shape (n,)
    nc, nd : int
        Orders of C and D.

    Returns
    -------
    c, d : ndarray
        Monic and stable.
    """
    if not nc + nd:
        return _ONE, _ONE
    e = innovations(v, nc + nd)
    rows = np.vstack([delayed(-v, 1, nd), delayed(e, 1, nc)])
    solution = solve_least_squares(rows.T, v)
    return stabilised(monic(solution[nd:])), stabilised(monic(solution[:nd]))


def innovations(v: Array, order: int) -> Array:
    """Return the innovations (n,) of a long autoregression of a signal.

    Parameters
    ----------
    v : ndarray, shape (n,)
    order : int
        That of the noise model to be started; the autoregression is several times as long.
    """
    long = max(1, min(max(_LONG_LEAST, _LONG_TIMES * order), len(v) // _LONG_SAMPLES))
    past = delayed(v, 1, long).T
    return v - past @ solve_least_squares(past[long:], v[long:])
