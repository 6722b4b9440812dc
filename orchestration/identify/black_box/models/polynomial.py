"""A polynomial model, ``A y = sum_i B_i/F_i u_i + C/D e``.

Sources: Ljung, eq. 4.33, with a denominator for every input; thesis, eq. 3.14.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.signal import tf2ss

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.identify.black_box.models.identified import IdentifiedModel
from orchestration.identify.black_box.orders import Orders
from orchestration.identify.black_box.polynomials import (
    Roots,
    filtered,
    integrates,
    roots,
    without_part_in,
)
from orchestration.identify.black_box.prediction_error import Coefficients, PredictionError


@dataclass(frozen=True)
class PolynomialModel(IdentifiedModel):
    """ARX, ARMAX, OE or Box-Jenkins, in polynomials of q^-1.

    Attributes
    ----------
    orders : Orders
    a, c, d : ndarray
        Monic.
    b, f : tuple of ndarray, length m
        Of every input; b begins with as many zeros as there are samples of delay, f is monic.
    """

    orders: Orders
    a: Array
    b: tuple[Array, ...]
    c: Array
    d: Array
    f: tuple[Array, ...]

    @property
    def coefficients(self) -> Coefficients:
        """The polynomials, B without its delay; offset and free responses are zero."""
        return Coefficients(
            a=self.a,
            b=tuple(b[k:] for b, k in zip(self.b, self.orders.nk, strict=True)),
            f=self.f,
            c=self.c,
            d=self.d,
            offset=0.0,
            transient=tuple(map(np.zeros, self.orders.nf)),
        )

    @property
    def _denominators(self) -> list[Array]:
        """The denominator A F_i of the path from every input."""
        return [np.convolve(self.a, f) for f in self.f]

    def _forced(self, deviations: Array) -> Array:
        return np.sum([*map(filtered, self.b, self._denominators, deviations.T)], axis=0)

    def _free(self, samples: int) -> Array:
        longest = max(map(len, self.b)) - 1  # inputs before the first sample are states, too
        return _free_responses(samples, self._denominators, np.ones(1), longest)

    def static_output(self, deviations: Array) -> float:
        """Return the deviation of the output at rest under deviations of the inputs (m,)."""
        level = 0.0
        for b, denominator, u in zip(self.b, self._denominators, deviations, strict=True):
            if integrates(denominator):
                level += 0.0 if u == 0.0 else np.inf
            else:
                level += float(u * b.sum() / denominator.sum())
        return level

    def _innovations(self, deviations: Array, output: Array) -> Array:
        if len(output) <= self.orders.first:
            raise UserError(
                f"{len(output)} samples: a model with {self.orders} needs at least"
                f" {self.orders.first + 1}"
            )
        problem = PredictionError(deviations, output, self.orders, offset=False)
        e = problem.errors(problem.vector(self.coefficients))
        # the unknown past adds D/(C F_i) of an impulse response to the errors, fitted to them here
        denominators = [np.convolve(self.c, f) for f in self.f if len(f) > 1]
        return without_part_in(_free_responses(len(e), denominators, self.d), e)

    def noise_response(self, samples: int) -> Array:
        """Return the impulse response (samples,) from white noise to the output."""
        impulse = np.zeros(samples)
        impulse[:1] = 1.0
        return filtered(self.c, np.convolve(self.a, self.d), impulse)

    def poles(self, which: int | str = 0) -> Roots:
        """Return the poles in z of the path from an input; see `IdentifiedModel.poles`."""
        return roots(self._denominators[self._index(which)])

    def zeros(self, which: int | str = 0) -> Roots:
        """Return the zeros in z of the path from an input, without those of delays."""
        return roots(self.b[self._index(which)])

    def _path(self, i: int) -> tuple[Array, Array]:
        return _in_z(self.b[i], self._denominators[i])

    def _noise_path(self) -> tuple[Array, Array]:
        return _in_z(self.c, np.convolve(self.a, self.d))

    def matrices(self) -> tuple[Array, Array, Array, Array]:
        """Return A, B, C and D of the paths from all inputs."""
        a, b, c, d = zip(*(tf2ss(*self._path(i)) for i in range(len(self.b))), strict=True)
        return block_diag(*a), block_diag(*b), np.hstack(c), np.hstack(d)

    def without_delays(self) -> tuple[PolynomialModel, tuple[int, ...]]:
        """Return the model of inputs that were delayed before, and their delays in samples."""
        lags = tuple(max(delay - 1, 0) for delay in self.orders.nk)
        nk = tuple(delay - lag for delay, lag in zip(self.orders.nk, lags, strict=True))
        b = tuple(b[lag:] for b, lag in zip(self.b, lags, strict=True))
        return replace(self, b=b, orders=replace(self.orders, nk=nk)), lags


def _free_responses(
    samples: int, denominators: list[Array], numerator: Array, least: int = 0
) -> Array:
    """Return a basis of the free responses, through each denominator.

    These are as many impulse responses, each a sample later than the last, as the denominator has
    states; together they span the response to any initial state.

    Parameters
    ----------
    samples : int
    denominators : list of ndarray
        Equal ones count once.
    numerator : ndarray
    least : int
        Least number of states of each.

    Returns
    -------
    ndarray, shape (samples, states)
    """
    distinct = {tuple(denominator): denominator for denominator in denominators}
    rows = [np.empty((0, samples))]
    for denominator in distinct.values():
        impulses = np.eye(min(max(len(denominator) - 1, least), samples), samples)
        rows.append(filtered(numerator, denominator, impulses))
    return np.vstack(rows).T


def _in_z(numerator: Array, denominator: Array) -> tuple[Array, Array]:
    """Return numerator and denominator in z of a quotient of polynomials in q^-1."""
    above, below = (np.trim_zeros(x, "b") for x in (numerator, denominator))
    # without roots at the origin that cancel
    size = max(len(above), len(below))
    above, below = (np.pad(x, (0, size - len(x))) for x in (above, below))
    return np.trim_zeros(above, "f"), below
