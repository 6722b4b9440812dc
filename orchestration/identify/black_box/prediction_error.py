"""Prediction errors of a polynomial model, and their exact derivatives by filtering.

For ``A y = sum_i B_i/F_i u_i + offset + C/D e`` the prediction error is

    e = D/C v,   v = A y - sum_i w_i - offset,   w_i = B_i/F_i u_i

and its derivatives are ``D/C y(t-k)`` by a_k, ``-D/(C F_i) u_i(t-k)`` by b_ik, ``D/(C F_i)
w_i(t-k)`` by f_ik, ``-1/C e(t-k)`` by c_k, ``1/C v(t-k)`` by d_k and ``-D/C 1`` by the offset.

Errors begin at the first sample for which the record has all signals of the equation. The past of
w_i before it is unknown: its free response from there, ``T_i/F_i`` of an impulse, is estimated with
the parameters. Source: Ljung, sections 10.2 and 10.3.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.kit.arrays import Array
from orchestration.identify.black_box.orders import Orders
from orchestration.identify.black_box.polynomials import filtered, is_stable, monic


class Coefficients(NamedTuple):
    """The parameters of a model as polynomials; B without its delay.

    Attributes
    ----------
    a, c, d : ndarray
        Monic polynomials.
    b, f : tuple of ndarray, length m
        Of every input; f is monic.
    offset : float
        Constant term.
    transient : tuple of ndarray, length m
        Numerators T of the free responses.
    """

    a: Array
    b: tuple[Array, ...]
    f: tuple[Array, ...]
    c: Array
    d: Array
    offset: float
    transient: tuple[Array, ...]


class PredictionError:
    """Prediction errors over one record as functions of a vector of parameters.

    Parameters
    ----------
    inputs : ndarray, shape (n, m)
        Deviations from their offsets.
    output : ndarray, shape (n,)
        Deviation likewise.
    orders : Orders
    first : int, optional
        First sample whose error counts; at least, and by default, that of the orders.
    offset : bool
        Whether the offset is estimated; else it is zero.
    """

    def __init__(
        self, inputs: Array, output: Array, orders: Orders, first: int = 0, offset: bool = True
    ):
        self.inputs = inputs
        self.output = output
        self.orders = orders
        self.offset = offset
        self.first = max(first, orders.first)
        self.samples = len(output) - self.first

    @property
    def size(self) -> int:
        """The number of estimated parameters: polynomials, offset and free responses."""
        return self.orders.parameters + self.offset + sum(self.orders.nf)

    def _past(self, values: Array, lag: int) -> Array:
        """Return a signal delayed by so many samples, from the first sample on."""
        return values[self.first - lag : len(values) - lag]

    def past_inputs(self, i: int) -> Array:
        """Return the regressors of B_i (samples, nb): input i, delayed."""
        delay = self.orders.nk[i]
        lags = range(delay, delay + self.orders.nb[i])
        return np.array([self._past(self.inputs[:, i], lag) for lag in lags]).T

    def past_outputs(self) -> Array:
        """Return the regressors of the coefficients of A: delayed outputs (samples, na)."""
        columns = [self._past(self.output, lag) for lag in range(1, self.orders.na + 1)]
        return np.array(columns).reshape(len(columns), self.samples).T

    def coefficients(self, theta: Array) -> Coefficients:
        """Split a vector of parameters (p,) into polynomials, offset and free responses."""
        n = self.orders
        position = 0

        def take(count: int) -> Array:
            nonlocal position
            position += count
            return theta[position - count : position]

        a = monic(take(n.na))
        paths = [(take(b), monic(take(f))) for b, f in zip(n.nb, n.nf, strict=True)]
        return Coefficients(
            a=a,
            b=tuple(b for b, _ in paths),
            f=tuple(f for _, f in paths),
            c=monic(take(n.nc)),
            d=monic(take(n.nd)),
            offset=float(take(1)[0]) if self.offset else 0.0,
            transient=tuple(take(count) for count in n.nf),
        )

    def vector(self, parts: Coefficients) -> Array:
        """Join polynomials, offset and free responses into a vector of parameters (p,)."""
        paths = [x for b, f in zip(parts.b, parts.f, strict=True) for x in (b, f[1:])]
        offset = np.full(int(self.offset), parts.offset)
        return np.concatenate(
            [parts.a[1:], *paths, parts.c[1:], parts.d[1:], offset, *parts.transient]
        )

    def admissible(self, theta: Array) -> bool:
        """Tell whether the predictor and the noise model are stable."""
        parts = self.coefficients(theta)
        return all(is_stable(polynomial) for polynomial in (*parts.f, parts.c, parts.d))

    def _paths(self, parts: Coefficients) -> list[Array]:
        """Return the output of every path (samples,), its free response included."""
        paths = []
        for i, (b, f, transient) in enumerate(zip(parts.b, parts.f, parts.transient, strict=True)):
            driven = self.past_inputs(i) @ b
            driven[: len(transient)] += transient
            paths.append(filtered(np.ones(1), f, driven))
        return paths

    def _disturbance(self, parts: Coefficients, paths: list[Array]) -> Array:
        """Return v (samples,): the part of the output that the paths do not explain."""
        return (
            self._past(self.output, 0)
            + self.past_outputs() @ parts.a[1:]
            - sum(paths)
            - parts.offset
        )

    def disturbance(self, theta: Array) -> Array:
        """Return v (samples,): the part of the output that the inputs do not explain."""
        parts = self.coefficients(theta)
        return self._disturbance(parts, self._paths(parts))

    def errors(self, theta: Array) -> Array:
        """Return the prediction errors (samples,)."""
        parts = self.coefficients(theta)
        return filtered(parts.d, parts.c, self._disturbance(parts, self._paths(parts)))

    def jacobian(self, theta: Array) -> Array:
        """Return the derivatives of the prediction errors (samples, p)."""
        parts = self.coefficients(theta)
        paths = self._paths(parts)
        v = self._disturbance(parts, paths)
        e = filtered(parts.d, parts.c, v)
        impulse = np.zeros(self.samples)
        impulse[0] = 1.0
        columns = [filtered(parts.d, parts.c, self.past_outputs())]
        free = []
        for i, (f, w) in enumerate(zip(parts.f, paths, strict=True)):
            denominator = np.convolve(parts.c, f)
            count = len(f) - 1
            columns.append(-filtered(parts.d, denominator, self.past_inputs(i)))
            columns.append(_lags(filtered(parts.d, denominator, w), count))
            free.append(-_lags(filtered(parts.d, denominator, impulse), count, 0))
        columns.append(-_lags(filtered(np.ones(1), parts.c, e), self.orders.nc))
        columns.append(_lags(filtered(np.ones(1), parts.c, v), self.orders.nd))
        columns.append(-filtered(parts.d, parts.c, np.ones((self.samples, int(self.offset)))))
        return np.hstack(columns + free)


def _lags(values: Array, count: int, first: int = 1) -> Array:
    """Return a signal that began at rest, delayed by ``first`` and more samples (n, count)."""
    delayed = np.zeros((len(values), count))
    for k in range(count):
        lag = k + first
        delayed[lag:, k] = values[: len(values) - lag]
    return delayed
