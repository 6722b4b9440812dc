"""Matrix functions of a linearised component, for exponential integration of stiff components.

The rates are split into A x and a remainder, where A is their Jacobian after the sampled updates at
the start of the record; A x is integrated exactly. With sensitivities as further states, A is a
block matrix. Its first column has the Jacobian J of the states, and below it, for each parameter, a
block H with the derivatives of the sensitivities' rates by the states; its diagonal has J in every
block. The matrix is stored as the stack of J and all H. A function of the matrix has the same
structure: the stack of the function of J and of its Frechet derivatives.

The functions are phi_k(z) = sum of z^j / (j + k)! at z = h A for steps h that are halved
repeatedly: a series for the shortest step, then doubling (Hochbruck, Ostermann: Exponential
integrators, Acta Numerica 2010, section 2.1; Skaflestad, Wright: The scaling and modified squaring
method for matrix functions related to the exponential, 2009).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property

import casadi as ca
import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.interrupt import uninterrupted
from fmus.kit.record.buffered_function import BufferedFunction
from fmus.kit.symbolic import Graph

# The first four numbers are products of the magnitude of the largest eigenvalue and a time.
# Time between samples above which a component is stiff: below it, accuracy needs about as many
# Runge-Kutta steps as stability.
_STIFF = 2.0
# Longest Runge-Kutta step that is accurate enough.
_ACCURATE = 0.05
# Time between samples that are not equally spaced, where several exact steps make an interval.
_UNEVEN = 50.0
# Time over which Runge-Kutta steps cost as much as one exponential step with a remainder, which is
# computed three times for its error; most of its cost are matrix products.
_WORTH = 100.0
# Number of Runge-Kutta steps that cost as much as the matrix functions of exact steps; an exact
# step costs less than one Runge-Kutta step.
_SETTING_UP = 2000.0
# Product of the norm of A and the shortest step: one Runge-Kutta step covers any shorter time.
_SHORTEST = 0.02
_TERMS = 8  # highest power in the series; the next term is below rounding
_ORDERS = 4  # of the functions, phi_0 to phi_3
_SERIES = np.array([[1 / math.factorial(j + k) for j in range(_TERMS + 1)] for k in range(_ORDERS)])
# relative difference of sampling intervals that comes from the rounding of a clock
_ROUNDED = 1e-6
_INSPECTED = 5  # number of samples at whose inputs the eigenvalues are computed


@dataclass(frozen=True)
class Ladder:
    """The matrix functions for steps of ``largest / 2**k``.

    Attributes
    ----------
    largest : float
        Longest step, s.
    affine : bool
        Whether the remainder is constant or linear in time during a step, so that steps are exact.
    worth : float
        Steps per second that cost as much as those of the Runge-Kutta method; infinite if steps are
        exact.
    matrix : ndarray, shape (1 + p, n, n)
        A, as the stack of its blocks.
    phi : ndarray, shape (levels + 2, 3, 1 + p, n, n)
        phi_1, phi_2 and phi_3 of every step, the longest first; the last two steps are only halves
        and quarters of others.
    """

    largest: float
    affine: bool
    worth: float
    matrix: Array
    phi: Array

    @property
    def levels(self) -> int:
        """Number of different steps."""
        return len(self.phi) - 2


@dataclass(frozen=True)
class _SampleTimes:
    """The sample times of a record, as far as a ladder depends on them."""

    samples: int  # without the first
    duration: float  # s
    usual_step: float  # s
    largest: float  # s; the usual step, doubled until it is not shorter than any other
    is_uneven: bool

    @classmethod
    def of(cls, time: Array) -> _SampleTimes | None:
        """Return the properties of sample times; None unless they increase."""
        steps = np.diff(time)
        if not (steps.size and np.isfinite(steps).all() and (steps > 0.0).all()):
            return None
        usual_step = float(np.median(steps))
        doublings = math.ceil(math.log2(float(steps.max()) / usual_step) - _ROUNDED)
        others = np.abs(steps - usual_step) > _ROUNDED * usual_step
        return cls(
            samples=len(steps),
            duration=float(time[-1] - time[0]),
            usual_step=usual_step,
            largest=usual_step * 2.0 ** max(0, doublings),
            is_uneven=float(np.mean(others)) >= 0.5,
        )

    def stiffness_limit(self, affine: bool) -> float:
        """Return the eigenvalue, 1/s, above which a ladder costs less than Runge-Kutta steps.

        `affine` tells whether steps with a ladder are exact.
        """
        if not affine:
            return _WORTH / self.usual_step
        if self.is_uneven:
            return _UNEVEN / self.usual_step
        if self.samples >= _SETTING_UP:  # even one Runge-Kutta step a sample costs more
            return 0.0
        return min(_STIFF, _ACCURATE * _SETTING_UP / self.samples) / self.usual_step


class Linearisation:
    """The Jacobians of a component and of its sensitivities, as functions of the parameters.

    Two threads must not use it at once.

    Parameters
    ----------
    base : Graph
        Graph of the component.
    extended : Graph
        Graph with sensitivities; its first parameters are those of the component.
    """

    def __init__(self, base: Graph, extended: Graph):
        self._base = base
        self._extended = extended
        nominal = np.array([state.nominal for state in base.layout.states])
        # element i, j of a matrix of states times this is that of states over their nominal values
        self._to_nominal = nominal / nominal[:, None]
        # a fit asks for the same records and discrete states again and again
        self._known_affine: dict[tuple[bool, tuple[bool, ...]], bool] = {}
        self._last_times = np.empty(0)
        self._sample_times: _SampleTimes | None = None
        # memory from which the function of `_blocks` reads its arguments
        self._start_time = np.zeros(1)
        self._parameters = np.zeros(len(extended.layout.parameters))
        self._first_inputs = np.zeros(len(base.layout.inputs))
        self._inputs = np.zeros(len(base.layout.inputs))

    def ladder(self, time: Array, table: Array, linear: bool, parameters: Array) -> Ladder | None:
        """Compute the matrix functions for a record if the component is stiff over it.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds.
        table : ndarray, shape (n, inputs)
            Inputs, SI.
        linear : bool
            Whether inputs are interpolated.
        parameters : ndarray
            Parameters of the extended graph, SI.

        Returns
        -------
        Ladder or None
            None if the component is not stiff, so that the Runge-Kutta method costs less.
        """
        sample_times = self._sample_times_of(time)
        if not self._to_nominal.size or sample_times is None:
            return None
        affine = self._is_affine(linear, self._resampled(sample_times.duration, parameters))
        matrices = self._matrices(float(time[0]), table, parameters)
        norms = np.abs(matrices[:, 0] * self._to_nominal).sum(2).max(1)
        # a norm bounds all eigenvalues, and costs less
        limit = sample_times.stiffness_limit(affine)
        candidates = np.flatnonzero(np.isfinite(norms) & (norms > limit))
        if not candidates.size:
            return None
        speeds = np.abs(np.linalg.eigvals(matrices[candidates, 0])).max(1)
        fastest = float(speeds.max())
        index = candidates[speeds.argmax()]
        matrix = matrices[index]
        if not (fastest > limit and np.isfinite(matrix).all()):
            return None
        halvings = max(2, math.ceil(math.log2(sample_times.largest * norms[index] / _SHORTEST)))
        worth = math.inf if affine else fastest / _WORTH
        phi = _phi(matrix * (sample_times.largest * 0.5**halvings), halvings)
        return Ladder(sample_times.largest, affine, worth, matrix, phi)

    def _sample_times_of(self, time: Array) -> _SampleTimes | None:
        """Return the properties of the sample times; in a fit they are those of the last call."""
        if not np.array_equal(time, self._last_times):
            self._last_times = time.copy()
            self._sample_times = _SampleTimes.of(time)
        return self._sample_times

    def _matrices(self, start: float, table: Array, parameters: Array) -> Array:
        """Return the stacks (k, 1 + p, n, n) of J and all H with the inputs of k samples."""
        blocks, depends_on_inputs = self._blocks
        count = _INSPECTED if depends_on_inputs else 1
        samples = np.linspace(0, len(table) - 1, count).astype(int).tolist()
        self._start_time[0] = start
        self._parameters[:] = parameters
        self._first_inputs[:] = table[0]
        matrices = np.empty((len(samples), blocks.result.size))
        for matrix, sample in zip(matrices, samples, strict=True):
            self._inputs[:] = table[sample]
            matrix[:] = blocks()
        return matrices.reshape(len(samples), -1, *self._to_nominal.shape)

    def _resampled(self, duration: float, parameters: Array) -> tuple[bool, ...]:
        """Return for each discrete state whether it is sampled again after the start."""
        layout = self._base.layout
        index = layout.parameter_index
        resampled = []
        for discrete in layout.discretes:
            period = discrete.period
            seconds = parameters[index[period]] if isinstance(period, str) else period
            resampled.append(float(seconds) < duration)
        return tuple(resampled)

    @cached_property
    @uninterrupted()
    def _blocks(self) -> tuple[BufferedFunction, bool]:
        """J and all H at the first step, row by row, and whether J depends on its inputs.

        They are taken after the first sampled updates, with the inputs of the first sample.
        """
        graph = self._extended
        n = len(self._to_nominal)
        blocks = ca.jacobian(graph.rates, graph.states[:n])
        depends_on_inputs = graph.inputs.numel() and ca.depends_on(blocks[:n, :], graph.inputs)
        first = ca.SX.sym("first", graph.inputs.numel())
        states, discretes = graph.start

        def at_start(expression: ca.SX, inputs: ca.SX) -> ca.SX:
            symbols = ca.vertcat(graph.inputs, graph.states, graph.discretes)
            return ca.substitute(expression, symbols, ca.vertcat(inputs, states, discretes))

        for update in graph.updates:
            discretes = at_start(update, first)
        rows = ca.densify(at_start(blocks, graph.inputs).T)  # CasADi stores by columns
        arguments = [graph.time, graph.parameters, first, graph.inputs]
        function = ca.Function("blocks", arguments, ca.cse([rows]))
        memory = [self._start_time, self._parameters, self._first_inputs, self._inputs]
        return BufferedFunction(function, memory), bool(depends_on_inputs)

    def _is_affine(self, linear: bool, resampled: tuple[bool, ...]) -> bool:
        """Return whether the rates are affine in the states, with the same coefficients throughout.

        Parameters
        ----------
        linear : bool
            Whether inputs are interpolated; then the rates must also be affine in inputs.
        resampled : tuple of bool
            Whether each discrete state is sampled again after the start.
        """
        key = (linear, resampled)
        if key not in self._known_affine:
            self._known_affine[key] = self._find_affine(linear, resampled)
        return self._known_affine[key]

    @uninterrupted()
    def _find_affine(self, linear: bool, resampled: tuple[bool, ...]) -> bool:
        """Compute the result of `_is_affine`, which stores it."""
        graph = self._base
        if ca.depends_on(graph.rates, graph.time):
            return False
        discretes = graph.discretes[[k for k, again in enumerate(resampled) if again]]
        varying = ca.vertcat(graph.time, graph.inputs, graph.states, discretes)
        arguments = ca.vertcat(graph.states, graph.inputs) if linear else graph.states
        if not arguments.numel():
            return True
        return not ca.depends_on(ca.jacobian(graph.rates, arguments), varying)


def _block_products(a: Array, b: Array) -> Array:
    """Return the products a @ b of one matrix with several, all stored as stacks of blocks.

    A product has the block J_a J_b, and for each parameter H_a J_b + J_a H_b.
    """
    product: Array = a[0] @ b
    product[:, 1:] += a[1:] @ b[:, :1]
    return product


@cache
def _doubling_coefficients(n: int) -> Array:
    """Return the coefficients 1 / (k - j)! of phi_j(z) in 2**k phi_k(2 z), times identities (n, n).

    See `_phi`. Rows are by j from 1, columns by k from 0.
    """
    shares = [
        [1 / math.factorial(k - j) if k >= j else 0.0 for k in range(_ORDERS)]
        for j in range(1, _ORDERS)
    ]
    return np.asarray(np.kron(shares, np.eye(n)), dtype=float)


def _phi(z: Array, doublings: int) -> Array:
    """Return phi_1, phi_2 and phi_3 at z and after each doubling of z, the last doubling first.

    With the row (phi_0, ..., phi_3), where phi_0 = exp, the formula

        2**k phi_k(2 z) = phi_0(z) phi_k(z) + sum of phi_j(z) / (k - j)!, j from 1 to k,

    is one product of the row with a matrix whose first rows are that row.
    """
    blocks, n, _ = z.shape
    powers = np.zeros((_TERMS + 1, *z.shape))
    powers[0, 0] = np.eye(n)
    powers[1] = z
    for m in (1, 2, 4):  # z^m times z, ..., z^m gives the next m powers
        powers[m + 1 : 2 * m + 1] = _block_products(powers[m], powers[1 : m + 1])
    width = _ORDERS * n
    rows = np.empty((doublings + 1, blocks, n, width))
    series = np.einsum("kj,jbrc->brkc", _SERIES, powers)
    rows[doublings] = series.reshape(blocks, n, width)
    doubling = np.empty((width, width))
    doubling[n:] = _doubling_coefficients(n)
    halves = np.repeat(0.5 ** np.arange(_ORDERS), n)  # 1 / 2**k
    # rates that grow without bounds overflow; a step that is not finite is halved
    with np.errstate(over="ignore", invalid="ignore"):
        for level in reversed(range(doublings)):
            row = rows[level + 1]
            doubling[:n] = row[0]
            doubled = rows[level]
            np.matmul(row.reshape(-1, width), doubling, out=doubled.reshape(-1, width))
            # the product rule for the blocks H: phi_0(z), the first factor, times their change
            doubled[1:] += row[0, :, :n] @ row[1:]
            doubled *= halves
    by_order = rows.reshape(doublings + 1, blocks, n, _ORDERS, n)[..., 1:, :]
    return np.ascontiguousarray(np.moveaxis(by_order, 3, 1))
