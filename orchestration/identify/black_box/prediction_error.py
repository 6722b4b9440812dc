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
from orchestration.identify.black_box.polynomials import delayed, filtered, monic

_ONE = np.ones(1)


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
        self.present_output = output[self.first :]
        self._past_outputs = self._delayed(output, 1, orders.na)
        self._past_inputs = [
            self._delayed(values, delay, count)
            for values, delay, count in zip(inputs.T, orders.nk, orders.nb, strict=True)
        ]
        # which parameters the errors are linear in: all but the coefficients of F, C and D
        every = self.coefficients(np.ones(self.size))
        f = tuple(map(np.zeros_like, every.f))
        linear = every._replace(f=f, c=0.0 * every.c, d=0.0 * every.d)
        self.linear = self.vector(linear).astype(bool)

    @property
    def size(self) -> int:
        """The number of estimated parameters: polynomials, offset and free responses."""
        return self.orders.parameters + self.offset + sum(self.orders.nf)

    def _delayed(self, values: Array, least: int, count: int) -> Array:
        """Return a signal delayed by ``least`` and more samples (count, samples)."""
        lags = range(least, least + count)
        rows = [values[self.first - lag : len(values) - lag] for lag in lags]
        return np.array(rows).reshape(count, self.samples)

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

    def _paths(self, parts: Coefficients) -> list[Array]:
        """Return the output of every path (samples,), its free response included."""
        paths = []
        for i, (b, f, transient) in enumerate(zip(parts.b, parts.f, parts.transient, strict=True)):
            driven = b @ self._past_inputs[i]
            driven[: len(transient)] += transient
            paths.append(filtered(_ONE, f, driven))
        return paths

    def _disturbance(self, parts: Coefficients, paths: list[Array]) -> Array:
        """Return v (samples,): the part of the output that the paths do not explain."""
        equation = self.present_output + parts.a[1:] @ self._past_outputs
        return equation - sum(paths) - parts.offset

    def errors(self, theta: Array) -> Array:
        """Return the prediction errors (samples,)."""
        parts = self.coefficients(theta)
        return filtered(parts.d, parts.c, self._disturbance(parts, self._paths(parts)))

    def jacobian(self, theta: Array) -> Array:
        """Return the derivatives of the prediction errors (samples, p)."""
        parts = self.coefficients(theta)
        slopes = np.empty((self.size, self.samples))
        slopes[self.linear] = self.linear_slopes(parts)
        slopes[~self.linear] = self.nonlinear_slopes(parts)
        return slopes.T

    def linear_slopes(self, parts: Coefficients) -> Array:
        """Return the derivatives of the errors by A, B, the offset and the free responses.

        They have a row for each, (count, samples), and depend on F, C and D alone, by which the
        equations of this module filter the signals.
        """
        impulse = np.eye(1, self.samples)
        driven = []
        free = []
        for regressors, f in zip(self._past_inputs, parts.f, strict=True):
            # one filter after the other: the product of polynomials with roots near one is inexact
            through_f = filtered(_ONE, f, np.vstack([impulse, regressors[:1]]))
            response, first = -filtered(parts.d, parts.c, through_f)
            # Through roots near one a filter's rounding grows to much of the signal. Rows that are
            # delayed behind the filter share it, so that it cancels where they nearly do.
            rows = np.array(delayed(first, 0, len(regressors)))
            for k, regressor in enumerate(regressors):
                for j in range(k):  # samples before the first, each with an impulse response
                    rows[k, j:] += regressor[j] * response[: self.samples - j]
            driven += [*rows]
            # impulse responses, each a sample later than the last, span every free response
            free.append(delayed(response, 0, len(f) - 1))
        constant = -filtered(parts.d, parts.c, np.ones((int(self.offset), self.samples)))
        past_outputs = filtered(parts.d, parts.c, self._past_outputs)
        return np.vstack([past_outputs, *driven, constant, *free])

    def nonlinear_slopes(self, parts: Coefficients) -> Array:
        """Return the derivatives of the errors by the coefficients of every F, C and D.

        They have a row for each coefficient, (size of F, C and D, samples).
        """
        paths = self._paths(parts)
        v = self._disturbance(parts, paths)
        e = filtered(parts.d, parts.c, v)
        by_f = [
            delayed(filtered(parts.d, parts.c, filtered(_ONE, f, w)), 1, len(f) - 1)
            for f, w in zip(parts.f, paths, strict=True)
        ]
        by_c = delayed(-filtered(_ONE, parts.c, e), 1, self.orders.nc)
        by_d = delayed(filtered(_ONE, parts.c, v), 1, self.orders.nd)
        return np.vstack([*by_f, by_c, by_d])
