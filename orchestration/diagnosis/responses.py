"""Linear responses of the outputs of a model along a course, and their projection.

With additions w(t) to laws the changes of the states follow ``dx' = A dx + B w`` and those of the
outputs ``dy = C dx + D w``, with the Jacobians of the course held over each step. Where discrete
states are updated within it, the derivatives are those of the step as it was run. An observer
corrects the states after each sample, by ``dx -= G dy``.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path

import numpy as np

from fmus.kit.arrays import Array, Indices, Mask
from fmus.kit.build import cached_library, load_library
from fmus.kit.build.toolchain import host_platform
from orchestration.diagnosis.law_model import with_vectors
from orchestration.diagnosis.runs import Linearisation, Record

_SOURCE = Path(__file__).with_name("responses.c")
_AT_ONCE = 64  # columns that are projected at once: as many as a cache holds
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


@dataclass(frozen=True, eq=False)
class Drives:
    """Columns of additions, each a value times an amount, which many share.

    Attributes
    ----------
    values : ndarray, shape (r, n)
    amounts : ndarray, shape (q, n)
        SI of the law at a value of 1.
    rows : ndarray of int, shape (3, columns)
        What each column adds to, its row of the values, and that of the amounts.
    """

    values: Array
    amounts: Array
    rows: Indices

    def part(self, first: int, last: int) -> Drives:
        """Return the drives over some of the samples."""
        return replace(
            self,
            values=np.ascontiguousarray(self.values[:, first:last]),
            amounts=np.ascontiguousarray(self.amounts[:, first:last]),
        )


def respond(
    record: Record, part: Linearisation, drives: Drives, stride: int, out: Array | None = None
) -> Response:
    """Return the responses at every so many samples.

    Parameters
    ----------
    record : Record
    part : Linearisation
        Along the course of the record.
    drives : Drives
        Of laws; taken in straight lines between samples where an input is smooth.
    stride : int
    out : ndarray, shape (columns, ny, m), optional
        That takes the responses to the drives.
    """
    nx = part.rates.shape[1]
    own = part.rates.shape[2] - nx
    by_own, by_laws, transitions = corrected(part, *_steps(record, part, own))
    stepped = Stepped(transitions, part.outputs[:, :, own:], stride, any(record.smooth))
    at_rest = np.zeros((nx, drives.rows.shape[1]))
    driven = stepped.responses(at_rest, by_laws, part.outputs_by_laws, drives, out)
    # start values make the last of the additions, which does nothing
    nothing = [(0, 0), (0, 0), (0, 1)]
    directly = np.pad(part.outputs[:, :, :own], nothing)
    start = np.hstack([np.zeros((nx, own)), np.eye(nx)])
    one = np.ones((1, len(record.time)))
    rows = np.zeros((3, own + nx), dtype=int)
    rows[0] = np.minimum(np.arange(own + nx), own)
    free = stepped.responses(start, np.pad(by_own, nothing), directly, Drives(one, one, rows))
    return Response(driven, free[:, :, :own], free[:, :, own:])


def corrected(
    part: Linearisation, by_own: Array, by_laws: Array, transitions: Array
) -> tuple[Array, Array, Array]:
    """Return the steps behind the corrections of an observer, whose gain is that of each sample."""
    if part.gains is None:
        return by_own, by_laws, transitions
    followed = transitions @ part.gains[:-1]
    by_parameters, by_states = np.split(part.outputs[:-1], [by_own.shape[2]], axis=2)
    return (
        by_own - followed @ by_parameters,
        by_laws - followed @ part.outputs_by_laws[:-1],
        transitions - followed @ by_states,
    )


def _steps(record: Record, part: Linearisation, own: int) -> tuple[Array, Array, Array]:
    """Return the states at the next sample (n - 1, nx, ...) by parameters, laws, and states."""
    if part.steps is not None and part.steps_by_laws is not None:
        by_own, transitions = np.split(_finite(part.steps), [own], axis=2)
        return by_own, _finite(part.steps_by_laws), transitions
    transitions, driven = steps_along(part, np.diff(record.time))
    rows = part.rates_by_laws.shape[1]  # memories of terms have no laws
    by_laws = driven[:, :, :rows] @ _finite(part.rates_by_laws[:-1])
    return driven @ _finite(part.rates[:-1, :, :own]), by_laws, transitions


class _Responses(ctypes.Structure):
    """Responses as ``responses.c`` computes them."""

    _fields_ = (
        *((n, ctypes.c_int) for n in ("n", "nx", "ny", "nw", "columns", "stride", "smooth")),
        *((n, ctypes.c_void_p) for n in ("transitions", "driven", "shown", "direct", "start")),
        *((n, ctypes.c_void_p) for n in ("values", "amounts", "addition", "value", "amount")),
        ("out", ctypes.c_void_p),
        *((n, ctypes.c_ssize_t) for n in ("of_column", "of_output")),
    )


@cache
def _library() -> ctypes.CDLL:
    sources = {_SOURCE.name: with_vectors(_SOURCE.read_text()).encode()}
    library = load_library(cached_library(sources, _SOURCE.name, host_platform()))
    library.respond.restype = ctypes.c_int
    return library


@dataclass(frozen=True, eq=False)
class Stepped:
    """Steps along a course, and the outputs at every so many samples.

    Attributes
    ----------
    transitions : ndarray, shape (n - 1, nx, nx)
    shown : ndarray, shape (n, ny, nx)
    stride : int
    smooth : bool
        Whether additions go in straight lines between samples.
    """

    transitions: Array
    shown: Array
    stride: int
    smooth: bool

    def responses(
        self, start: Array, driven: Array, direct: Array, drives: Drives, out: Array | None = None
    ) -> Array:
        """Return the responses (m, ny, columns).

        Parameters
        ----------
        start : ndarray, shape (nx, columns)
            Of the states.
        driven : ndarray, shape (n - 1, nx, nw)
            States at the next sample by additions.
        direct : ndarray, shape (n, ny, nw)
            Outputs by additions.
        drives : Drives
        out : ndarray, shape (columns, ny, m), optional
            That takes them.
        """
        n, ny, nx = self.shown.shape
        columns = drives.rows.shape[1]
        if out is None:
            out = np.empty((columns, ny, -(-n // self.stride)))
        assert out.shape == (columns, ny, -(-n // self.stride))
        assert drives.values.shape[1] == drives.amounts.shape[1] == n
        matrices = [self.transitions, driven, self.shown, direct, start]
        matrices += [drives.values, drives.amounts]
        arrays = [np.ascontiguousarray(a, dtype=float) for a in matrices]
        arrays += [np.ascontiguousarray(a, dtype=np.int32) for a in drives.rows]
        sizes = (n, nx, ny, direct.shape[2], columns, self.stride, self.smooth)
        addresses = [a.ctypes.data for a in (*arrays, out)]
        given = _Responses(*sizes, *addresses, *(a // out.itemsize for a in out.strides[:2]))
        if _library().respond(ctypes.byref(given)):
            raise MemoryError("no memory for responses")
        return out.transpose(2, 1, 0)


def kalman_gains(
    start: Array, transitions: Array, shown: Array, pushes: Array, variance: Array, measured: Mask
) -> Array:
    """Return the gains (n, nx, ny) of a Kalman filter; zero of outputs that are not measured.

    Parameters
    ----------
    start : ndarray, shape (nx, nx)
        Covariance.
    transitions : ndarray, shape (n - 1, nx, nx)
    shown : ndarray, shape (n, ny, nx)
    pushes : ndarray, shape (n - 1, nx, k)
        By independent disturbances of unit variance.
    variance : ndarray, shape (ny,)
        Of the white noise of each output.
    measured : ndarray of bool, shape (n, ny)
    """
    n, ny, nx = shown.shape
    arrays = [np.ascontiguousarray(a, dtype=float) for a in (start, transitions, shown, pushes)]
    arrays += [np.ascontiguousarray(variance, dtype=float), np.ascontiguousarray(measured)]
    out = np.zeros((n, nx, ny))
    addresses = [ctypes.c_void_p(a.ctypes.data) for a in (*arrays, out)]
    if _library().gains(n, nx, ny, pushes.shape[2], *addresses):
        raise MemoryError("no memory for gains")
    return out


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
        """Return values (k, m) less their regression on the others, and its cost: (k, m + o)."""
        basis, _ = self._factors
        measured = basis[: len(self.target)]
        free = np.empty((len(values), len(basis)))
        for first in range(0, len(values), _AT_ONCE):
            rows = slice(first, first + _AT_ONCE)
            np.matmul(values[rows] @ -measured, basis.T, out=free[rows])
            free[rows, : len(measured)] += values[rows]
        return free

    @cached_property
    def _columns(self) -> Array:
        """Columns (c, m + o), the others projected out."""
        return self._free(self.columns.T)

    @cached_property
    def remaining(self) -> Array:
        """Target (m + o,) less what the others explain, with what their prior costs."""
        return self._free(self.target[None])[0]

    def products(self, places: Array) -> Array:
        """Return the inner products (..., k, k) of sets of columns (..., k) with themselves.

        The others are projected out.
        """
        return self.products_within(places, slice(None))

    def products_within(self, places: Array, rows: slice) -> Array:
        """Return the part of `products` that some rows have."""
        chosen = self._columns[places, rows]
        return np.asarray(chosen @ chosen.swapaxes(-1, -2))

    def across(self, places: Array) -> Array:
        """Return the inner products (k, c) of some columns with all, the others projected out."""
        return np.asarray(self._columns[places] @ self._columns.T)

    def moments_within(self, rows: slice) -> Array:
        """Return the part of `moments` that some rows have."""
        return np.asarray(self._columns[:, rows] @ self.remaining[rows])

    @cached_property
    def norms(self) -> Array:
        """Sums of squares (c,) of the columns, the others projected out."""
        return np.einsum("ij,ij->i", self._columns, self._columns)

    @cached_property
    def moments(self) -> Array:
        """Inner products (c,) with the target, the others projected out."""
        return np.asarray(self._columns @ self.remaining)

    @cached_property
    def alone(self) -> Array:
        """Sums of squares (c,) of the columns, nothing projected out."""
        return np.einsum("ij,ij->j", self.columns, self.columns)

    def shift(self, places: Array, coefficients: Array) -> Array:
        """Return the values of the others (o,) beside some columns with coefficients."""
        basis, triangle = self._factors
        rest = self.target - self.columns[:, places] @ coefficients
        return np.asarray(np.linalg.solve(triangle, basis[: len(rest)].T @ rest))
