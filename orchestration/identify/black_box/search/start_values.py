"""Where a search for a polynomial model starts: a long ARX model, reduced path by path.

A long ARX model needs no start and, being long, describes any paths and any colour of the noise. Its paths are reduced
to the orders that are asked for, weighted by the noise it found: by the iterated least squares of Steiglitz and McBride
(IEEE Trans. Automatic Control 10, 1965), which on what such a model simulates is asymptotically efficient (Everitt,
Galrinho, Hjalmarsson: Automatica 89, 2018), and by instrumental variables (Söderström and Stoica: Instrumental Variable
Methods, 1983; Ljung, section 7.6). What is left gives the noise model (Hannan and Rissanen: Biometrika 69, 1982).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestration.identify.black_box.orders import Orders
from orchestration.identify.black_box.polynomials import filtered, monic, solved, stabilised
from orchestration.identify.black_box.prediction_error import Coefficients, PredictionError

Array = NDArray[np.float64]
_ONE = np.ones(1)
_ROUNDS = 20  # of Steiglitz and McBride
_LONG = (
    15,
    4,
    10,
)  # order of the long model: at least, for each order asked for, samples for each of its parameters


class _LongModel(NamedTuple):
    """A long ARX model of a record.

    Attributes
    ----------
    a : ndarray
        Monic and stable: it whitens.
    paths : ndarray, shape (n, m)
        What every input does to the output.
    rest : ndarray, shape (n,)
        What none does: the disturbance.
    innovations : ndarray, shape (n,)
    """

    a: Array
    paths: Array
    rest: Array
    innovations: Array


def least_squares(problem: PredictionError) -> Array:
    """Return the parameters of an ARX model, for which least squares is the whole search (Ljung, section 7.3).

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
    """Give starting points (p,) for a search, the likely best first; all of them admissible."""
    long = _long(problem)
    yield from _shared(problem, long) if problem.orders.na else _separate(problem, long)


def _long(problem: PredictionError) -> _LongModel:
    inputs, output, wanted = problem.inputs, problem.output, problem.orders
    at_least, times, samples = _LONG
    m = inputs.shape[1]
    order = max(at_least, times * wanted.highest)
    order = max(1, min(order, len(output) // (samples * (m + 1)) - max(wanted.nk)))
    nb = tuple(order + wanted.nb[i] for i in range(m))
    arx = PredictionError(inputs, output, Orders(order, nb, 0, 0, (0,) * m, wanted.nk))
    found = arx.coefficients(least_squares(arx))
    a = stabilised(found.a)
    paths = np.stack(
        [
            filtered(np.r_[np.zeros(k), b], a, u)
            for b, k, u in zip(found.b, wanted.nk, inputs.T, strict=True)
        ],
        axis=1,
    )
    rest = output - paths.sum(axis=1)
    rest -= rest.mean()
    return _LongModel(a, paths, rest, filtered(a, _ONE, rest))


def _separate(problem: PredictionError, long: _LongModel) -> Iterator[Array]:
    """Start values where every path has a denominator of its own (output error, Box-Jenkins)."""
    for reduce in (_steiglitz_mcbride, _instruments):
        paths = [reduce(problem, long, i) for i in range(len(problem.orders.nb))]
        yield _with_noise(problem, paths)
    yield _with_noise(
        problem, [_steiglitz_mcbride(problem, long, i, 1) for i in range(len(problem.orders.nb))]
    )


def _regressors(problem: PredictionError, i: int, signal: Array, inputs: Array) -> Array:
    """Columns of ``F y = B u``: what a signal was before, and the input (n, nf + nb)."""
    n = problem.orders
    columns = [-_delayed(signal, k + 1) for k in range(n.nf[i])]
    return np.stack([*columns, *(_delayed(inputs, n.nk[i] + k) for k in range(n.nb[i]))], axis=1)


def _delayed(values: Array, lag: int) -> Array:
    return np.concatenate([np.zeros(min(lag, len(values))), values[: max(len(values) - lag, 0)]])


def _steiglitz_mcbride(
    problem: PredictionError, long: _LongModel, i: int, rounds: int = _ROUNDS
) -> tuple[Array, Array]:
    """Reduce a path of the long model to B and F."""
    nf, first = problem.orders.nf[i], problem.first
    f, b = _ONE, np.zeros(problem.orders.nb[i])
    for _ in range(rounds if nf else 1):
        signal = filtered(long.a, f, long.paths[:, i])
        columns = _regressors(problem, i, signal, filtered(long.a, f, problem.inputs[:, i]))
        solution = solved(columns[first:], signal[first:])
        f, b = stabilised(monic(solution[:nf])), solution[nf:]
    return b, f


def _instruments(problem: PredictionError, long: _LongModel, i: int) -> tuple[Array, Array]:
    """B and F of a path by instrumental variables: the outputs of the long model, which no noise is in."""
    nf, first = problem.orders.nf[i], problem.first
    whitened = [filtered(long.a, _ONE, x) for x in (long.paths[:, i] + long.rest, long.paths[:, i])]
    u = filtered(long.a, _ONE, problem.inputs[:, i])
    columns, instruments = (_regressors(problem, i, signal, u)[first:] for signal in whitened)
    solution = solved(instruments.T @ columns, instruments.T @ whitened[0][first:])
    return solution[nf:], stabilised(monic(solution[:nf]))


def _with_noise(problem: PredictionError, paths: list[tuple[Array, Array]]) -> Array:
    """Add the noise model that what these paths leave asks for."""
    n = problem.orders
    b, f = tuple(p[0] for p in paths), tuple(p[1] for p in paths)
    still = tuple(np.zeros(count) for count in n.nf)
    white = monic(np.zeros(n.nc)), monic(np.zeros(n.nd))
    rest = problem.disturbance(problem.vector(Coefficients(_ONE, b, f, *white, 0.0, still)))
    offset = float(rest.mean())
    c, d = _hannan_rissanen(rest - offset, n.nc, n.nd)
    return problem.vector(Coefficients(_ONE, b, f, c, d, offset, still))


def _hannan_rissanen(v: Array, nc: int, nd: int) -> tuple[Array, Array]:
    """C and D of ``D v = C e``: by least squares on innovations that a long autoregression gives."""
    if not nc + nd:
        return _ONE, _ONE
    e = innovations(v, nc + nd)
    columns = np.stack(
        [-_delayed(v, k + 1) for k in range(nd)] + [_delayed(e, k + 1) for k in range(nc)], axis=1
    )
    solution = solved(columns, v)
    return stabilised(monic(solution[nd:])), stabilised(monic(solution[:nd]))


def innovations(v: Array, order: int) -> Array:
    """Return what a long autoregression does not foretell of a signal (n,), for a noise model of that order."""
    at_least, times, samples = _LONG
    order = max(1, min(max(at_least, times * order), len(v) // samples))
    past = np.stack([_delayed(v, k + 1) for k in range(order)], axis=1)
    return v - past @ solved(past[order:], v[order:])


def _shared(problem: PredictionError, long: _LongModel) -> Iterator[Array]:
    """Start values where all share the denominator A (ARMAX): extended least squares, and ARX."""
    n = problem.orders
    inputs = [problem.past_inputs(i) for i in range(len(n.nb))]
    past = [_delayed(long.innovations, k + 1)[problem.first :] for k in range(n.nc)]
    e = np.array(past).reshape(n.nc, problem.samples).T
    plain = np.hstack([-problem.past_outputs(), *inputs, np.ones((problem.samples, 1))])
    output = problem.output[problem.first :]
    for columns in (np.hstack([plain, e]), plain):
        solution = solved(columns, output)
        ends = np.cumsum([n.na, *n.nb])
        a, *b, end = np.split(solution, ends)
        c = np.r_[end[1:], np.zeros(n.nc)][: n.nc]
        ones = tuple(_ONE for _ in b)
        none = tuple(np.empty(0) for _ in b)
        yield problem.vector(
            Coefficients(monic(a), tuple(b), ones, stabilised(monic(c)), _ONE, float(end[0]), none)
        )
