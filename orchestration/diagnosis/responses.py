"""Linear responses of the outputs of a model along a course, and their projection.

With additions w(t) to laws the changes of the states follow ``dx' = A dx + B w`` and those of the
outputs ``dy = C dx + D w``, with the Jacobians of the course held over each step. Where discrete
states are updated within it, the derivatives are those of the step as it was run.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fmus.kit.arrays import Array
from orchestration.diagnosis.law_model import Linearisation, Record

_SMALL = 0.5  # norm of a matrix whose series is summed
_ORDER = 12  # of that series: the rest is below rounding


@dataclass(frozen=True, eq=False)
class Response:
    """Responses of the outputs at some samples of a record.

    Attributes
    ----------
    to_drives : ndarray, shape (m, ny, columns)
        To additions to the laws, SI.
    to_coordinates : ndarray, shape (m, ny, p + k)
        To free parameters and values of the terms.
    to_start : ndarray, shape (m, ny, nx)
        To the states and memories at the start.
    """

    to_drives: Array
    to_coordinates: Array
    to_start: Array


def respond(
    record: Record, part: Linearisation, drive: Array, law_of: Array, stride: int
) -> Response:
    """Return the responses at every so many samples.

    Parameters
    ----------
    record : Record
    part : Linearisation
        Along the course of the record.
    drive : ndarray, shape (n, columns)
        In SI of its law; taken in straight lines between samples where an input is smooth.
    law_of : ndarray of int, shape (columns,)
        The law of each column.
    stride : int
    """
    nx = part.rates.shape[1]
    own = part.rates.shape[2] - nx
    if part.steps is None or part.steps_by_laws is None:
        transitions, driven_by = steps_along(part, np.diff(record.time))
        by_own = driven_by @ _finite(part.rates[:-1, :, :own])
        rows = part.rates_by_laws.shape[1]  # memories of terms have no laws
        by_laws = driven_by[:, :, :rows] @ _finite(part.rates_by_laws[:-1])
    else:
        by_own, transitions = np.split(_finite(part.steps), [own], axis=2)
        by_laws = _finite(part.steps_by_laws)
    between = drive[:-1]
    if any(record.smooth):
        between = 0.5 * (drive[:-1] + drive[1:])
    state = np.zeros((nx, drive.shape[1]))
    other = np.hstack([np.zeros((nx, own)), np.eye(nx)])
    shown = -(-len(record.time) // stride), part.outputs.shape[1]
    driven = np.empty((*shown, drive.shape[1]))
    free = np.empty((*shown, own + nx))
    for k in range(len(record.time)):
        if k % stride == 0:
            row = k // stride
            by_states = part.outputs[k][:, own:]
            np.multiply(part.outputs_by_laws[k][:, law_of], drive[k], out=driven[row])
            driven[row] += by_states @ state
            np.matmul(by_states, other, out=free[row])
            free[row, :, :own] += part.outputs[k][:, :own]
        if nx and k < len(transitions):
            state = transitions[k] @ state + by_laws[k][:, law_of] * between[k]
            other = transitions[k] @ other
            other[:, :own] += by_own[k]
    return Response(driven, free[:, :, :own], free[:, :, own:])


def steps_along(part: Linearisation, durations: Array) -> tuple[Array, Array]:
    """Return what each step makes of the states, and of additions to their rates.

    Parameters
    ----------
    part : Linearisation
        Along a course of n samples.
    durations : ndarray, shape (n - 1,)
        Seconds.

    Returns
    -------
    transitions, driven : ndarray, shape (n - 1, nx, nx)
        ``exp(A h)`` and ``h phi_1(A h)``.
    """
    n, nx = len(durations), part.rates.shape[1]
    if not n or not nx:
        return np.zeros((n, nx, nx)), np.zeros((n, nx, nx))
    rates = part.rates[:-1, :, part.rates.shape[2] - nx :] * durations[:, None, None]
    transitions, means = _exponential(_finite(rates))
    return transitions, means * durations[:, None, None]


def _finite(columns: Array) -> Array:
    return np.nan_to_num(columns, posinf=0.0, neginf=0.0)


def _exponential(matrices: Array) -> tuple[Array, Array]:
    """Return the exponential of matrices (n, k, k), and its mean from no to the whole of them.

    The Taylor series of the mean, of matrices halved until they are small, and doubled again
    (Higham: Functions of Matrices, SIAM 2008, section 10.7.4).
    """
    one = np.eye(matrices.shape[1])
    largest = np.abs(matrices).sum(axis=2).max(initial=0.0)
    halvings = int(np.ceil(np.log2(max(largest / _SMALL, 1.0))))
    small = matrices / 2.0**halvings
    mean = np.broadcast_to(one, matrices.shape)
    for k in range(_ORDER, 0, -1):
        mean = one + small @ mean / (k + 1.0)
    whole = one + small @ mean
    for _ in range(halvings):
        mean = mean @ (whole + one) / 2.0
        whole = whole @ whole
    return whole, mean


@dataclass(frozen=True, eq=False)
class Projection:
    """Columns that may explain a target, free of what others can do.

    The others have a prior, standard normal in their coordinates: a ridge.

    Attributes
    ----------
    target : ndarray, shape (m,)
    columns : ndarray, shape (m, c)
    others : ndarray, shape (m, o)
    """

    target: Array
    columns: Array
    others: Array

    @cached_property
    def _factors(self) -> tuple[Array, Array]:
        """Basis (m + o, o) of the others with their prior, and the triangle (o, o)."""
        stacked = np.vstack([self.others, np.eye(self.others.shape[1])])
        basis, triangle = np.linalg.qr(stacked)
        return basis, triangle

    def _free(self, values: Array) -> Array:
        """Return values (k, m) without what the others explain, and what their prior costs.

        Returns
        -------
        ndarray, shape (k, m + o)
        """
        basis, _ = self._factors
        explained = (values @ basis[: len(self.target)]) @ basis.T
        free = np.negative(explained, out=explained)
        free[:, : len(self.target)] += values
        return free

    @cached_property
    def _columns(self) -> Array:
        """Columns (c, m + o), the others projected out."""
        return self._free(self.columns.T)

    @cached_property
    def remaining(self) -> Array:
        """Target (m + o,) less what the others explain, with what their prior costs."""
        return self._free(self.target[None])[0]

    def products(self, places: Array, with_places: Array | None = None) -> Array:
        """Return the inner products (k, l) of some columns with some, the others projected out.

        By default with themselves.
        """
        chosen = self._columns[places]
        across = chosen if with_places is None else self._columns[with_places]
        return np.asarray(chosen @ across.T)

    @cached_property
    def norms(self) -> Array:
        """Sums of squares (c,) of the columns, the others projected out."""
        return np.einsum("ij,ij->i", self._columns, self._columns)

    @cached_property
    def moments(self) -> Array:
        """Inner products (c,) with the target, the others projected out."""
        return np.asarray(self._columns @ self.remaining)

    def left(self, places: Array, coefficients: Array) -> Array:
        """Return what some columns with coefficients leave of `remaining` (m + o,)."""
        return np.asarray(self.remaining - coefficients @ self._columns[places])

    @cached_property
    def alone(self) -> Array:
        """Sums of squares (c,) of the columns, nothing projected out."""
        return np.einsum("ij,ij->j", self.columns, self.columns)

    def shift(self, places: Array, coefficients: Array) -> Array:
        """Return the values of the others (o,) beside some columns with coefficients."""
        basis, triangle = self._factors
        rest = self.target - self.columns[:, places] @ coefficients
        return np.asarray(np.linalg.solve(triangle, basis[: len(rest)].T @ rest))
