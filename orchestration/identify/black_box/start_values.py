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
from orchestration.identify.black_box.polynomials import filtered, monic, solved, stabilised
from orchestration.identify.black_box.prediction_error import Coefficients, PredictionError

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


def least_squares(problem: PredictionError) -> Array:
    """Return the parameters of an ARX model, found by linear least squares (Ljung, section 7.3).

    Parameters
    ----------
    problem : PredictionError
        Of orders with neither C, D nor F.

    Returns
    -------
    ndarray, shape (p,)
    """
    start = np.zeros(problem.size)
    return solved(problem.jacobian(start), -problem.errors(start))


def starts(problem: PredictionError) -> Iterator[Array]:
    """Yield starting points (p,) for a search, the likely best first; all of them admissible."""
    long = _fit_long_model(problem)
    yield from _shared(problem, long) if problem.orders.na else _separate(problem, long)


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
    parts = arx.coefficients(least_squares(arx))
    a = stabilised(parts.a)
    responses = [
        filtered(np.r_[np.zeros(k), b], a, u)
        for b, k, u in zip(parts.b, n.nk, inputs.T, strict=True)
    ]
    paths = np.stack(responses, axis=1)
    disturbance = output - paths.sum(axis=1)
    disturbance -= disturbance.mean()
    return _LongModel(a, paths, disturbance, filtered(a, _ONE, disturbance))


def _separate(problem: PredictionError, long: _LongModel) -> Iterator[Array]:
    """Yield start values where every path has its own denominator (output error, Box-Jenkins)."""
    inputs = range(len(problem.orders.nb))
    yield _with_noise(problem, [_steiglitz_mcbride(problem, long, i) for i in inputs])
    yield _with_noise(problem, [_instruments(problem, long, i) for i in inputs])
    yield _with_noise(problem, [_steiglitz_mcbride(problem, long, i, rounds=1) for i in inputs])


def _regressors(problem: PredictionError, i: int, signal: Array, inputs: Array) -> Array:
    """Return the regressors of ``F y = B u``: a delayed signal and the input (n, nf + nb)."""
    n = problem.orders
    past = [-_delayed(signal, k + 1) for k in range(n.nf[i])]
    driving = [_delayed(inputs, n.nk[i] + k) for k in range(n.nb[i])]
    return np.stack([*past, *driving], axis=1)


def _delayed(values: Array, lag: int) -> Array:
    """Return a signal delayed by so many samples; zero before."""
    return np.concatenate([np.zeros(min(lag, len(values))), values[: max(len(values) - lag, 0)]])


def _steiglitz_mcbride(
    problem: PredictionError, long: _LongModel, i: int, rounds: int = _ROUNDS
) -> tuple[Array, Array]:
    """Reduce a path of the long model to B and F, by the iteration of Steiglitz and McBride."""
    nf = problem.orders.nf[i]
    first = problem.first
    f = _ONE
    b = np.zeros(problem.orders.nb[i])
    for _ in range(rounds if nf else 1):
        signal = filtered(long.a, f, long.paths[:, i])
        columns = _regressors(problem, i, signal, filtered(long.a, f, problem.inputs[:, i]))
        solution = solved(columns[first:], signal[first:])
        f = stabilised(monic(solution[:nf]))
        b = solution[nf:]
    return b, f


def _instruments(problem: PredictionError, long: _LongModel, i: int) -> tuple[Array, Array]:
    """Return B and F of a path by instrumental variables.

    The instruments are the outputs of the long model, which hold no noise.
    """
    nf = problem.orders.nf[i]
    first = problem.first
    noisy = filtered(long.a, _ONE, long.paths[:, i] + long.disturbance)
    clean = filtered(long.a, _ONE, long.paths[:, i])
    u = filtered(long.a, _ONE, problem.inputs[:, i])
    columns = _regressors(problem, i, noisy, u)[first:]
    instruments = _regressors(problem, i, clean, u)[first:]
    solution = solved(instruments.T @ columns, instruments.T @ noisy[first:])
    return solution[nf:], stabilised(monic(solution[:nf]))


def _with_noise(problem: PredictionError, paths: list[tuple[Array, Array]]) -> Array:
    """Return parameters with B and F of every path, and a noise model of their residual."""
    n = problem.orders
    b = tuple(path[0] for path in paths)
    f = tuple(path[1] for path in paths)
    still = tuple(np.zeros(count) for count in n.nf)
    white = Coefficients(_ONE, b, f, monic(np.zeros(n.nc)), monic(np.zeros(n.nd)), 0.0, still)
    disturbance = problem.disturbance(problem.vector(white))
    offset = float(disturbance.mean())
    c, d = _hannan_rissanen(disturbance - offset, n.nc, n.nd)
    return problem.vector(white._replace(c=c, d=d, offset=offset))


def _hannan_rissanen(v: Array, nc: int, nd: int) -> tuple[Array, Array]:
    """Return C and D of ``D v = C e``, by least squares on the innovations of an autoregression."""
    if not nc + nd:
        return _ONE, _ONE
    e = innovations(v, nc + nd)
    columns = [-_delayed(v, k + 1) for k in range(nd)] + [_delayed(e, k + 1) for k in range(nc)]
    solution = solved(np.stack(columns, axis=1), v)
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
    past = np.stack([_delayed(v, k + 1) for k in range(long)], axis=1)
    return v - past @ solved(past[long:], v[long:])


def _shared(problem: PredictionError, long: _LongModel) -> Iterator[Array]:
    """Yield start values where all paths share the denominator A (ARMAX).

    The first are those of extended least squares, the second those of ARX.
    """
    n = problem.orders
    inputs = [problem.past_inputs(i) for i in range(len(n.nb))]
    past = [_delayed(long.innovations, k + 1)[problem.first :] for k in range(n.nc)]
    e = np.array(past).reshape(n.nc, problem.samples).T
    plain = np.hstack([-problem.past_outputs(), *inputs, np.ones((problem.samples, 1))])
    output = problem.output[problem.first :]
    ends = np.cumsum([n.na, *n.nb])
    for columns in (np.hstack([plain, e]), plain):
        a, *b, end = np.split(solved(columns, output), ends)
        c = np.r_[end[1:], np.zeros(n.nc)][: n.nc]
        parts = Coefficients(
            a=monic(a),
            b=tuple(b),
            f=tuple(_ONE for _ in b),
            c=stabilised(monic(c)),
            d=_ONE,
            offset=float(end[0]),
            transient=tuple(np.empty(0) for _ in b),
        )
        yield problem.vector(parts)
