"""Matrix functions of a linearised component, by which stiff ones are integrated over a record.

The rates are split into A x, where A is their Jacobian at the start of the record, and a remainder;
A x is solved exactly. Sampled states have been updated by then, because that comes before the first
step: a lag whose equilibrium is sampled once follows from there. Sensitivities are states too, and
their part of A is as exact: below the Jacobian J of the states themselves stands, for each
parameter, a block H with the derivatives of the sensitivities' rates by the states, and on the
diagonal J again. Such a matrix is stored as the stack of J and all H; a function of it is the same
stack of that function and of its Frechet derivatives.

The functions are phi_k(z) = sum of z^j / (j + k)! at z = h A for steps h that are halved again and
again: a series for the shortest, then doubling (Hochbruck, Ostermann: Exponential integrators, Acta
Numerica 2010, section 2.1; Skaflestad, Wright: The scaling and modified squaring method for matrix
functions related to the exponential, 2009).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.symbolic import Graph

# The first four are products of the largest eigenvalue and a time.
# Of the time between samples from which a component is stiff: below it, accuracy needs about as
# many Runge-Kutta steps as stability does.
_STIFF = 2.0
# of a Runge-Kutta step: longer ones are not accurate enough
_ACCURATE = 0.05
# of the time between samples that are not equally spaced, where an exact step is made of several
_UNEVEN = 50.0
# Of the time in which Runge-Kutta steps cost as much as one exponential step with a remainder,
# which is made three times for its error and spends most of its time in products.
WORTH = 100.0
# Runge-Kutta steps that cost as much as the matrix functions of exact steps; an exact step itself
# costs less than one of them
_SETTING_UP = 2000.0
# product of the norm of A and the shortest step: one Runge-Kutta step covers any shorter time
_SHORTEST = 0.02
_TERMS = 8  # of the series; the first term after them is below rounding
# relative difference of intervals between samples that are equal but for the rounding of a clock
ROUNDED = 1e-6
_INSPECTED = 5  # samples with whose inputs the eigenvalues are computed


@dataclass(frozen=True)
class Ladder:
    """The matrix functions for steps of ``largest / 2**k``.

    Attributes
    ----------
    largest : float
        Longest step, s.
    affine : bool
        Whether the remainder beside A x is constant during a step, or linear in time.
    worth : float
        Steps per second that cost no more than those of the Runge-Kutta method; infinite where
        steps are exact.
    matrix : ndarray, shape (1 + p, n, n)
        A, as the stack of its blocks.
    phi : ndarray, shape (levels + 2, 3, 1 + p, n, n)
        phi_1, phi_2 and phi_3 of every step, the longest first; the last two steps serve as halves
        and quarters only.
    """

    largest: float
    affine: bool
    worth: float
    matrix: Array
    phi: Array

    @property
    def levels(self) -> int:
        """Number of different steps that may be taken."""
        return len(self.phi) - 2


class Linearisation:
    """The Jacobians of a component and of its sensitivities, as functions of the parameters.

    Parameters
    ----------
    base : Graph
        The component.
    extended : Graph
        With its sensitivities, of which the parameters begin with those of the component.
    """

    def __init__(self, base: Graph, extended: Graph):
        self._base = base
        self._extended = extended
        self._nominal = np.array([state.nominal for state in base.layout.states])
        self._known_affine: dict[tuple[bool, tuple[bool, ...]], bool] = {}  # see `_affine`

    def ladder(self, time: Array, table: Array, linear: bool, parameters: Array) -> Ladder | None:
        """Compute the matrix functions for a record over which the component is stiff.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds.
        table : ndarray, shape (n, inputs)
        linear : bool
            Whether inputs are interpolated.
        parameters : ndarray
            Of the extended graph.

        Returns
        -------
        Ladder or None
            None where it is not stiff, so that the Runge-Kutta method costs least.
        """
        steps = np.diff(time)
        if not self._nominal.size or not steps.size:
            return None
        if not (np.isfinite(steps).all() and (steps > 0.0).all()):
            return None
        start = float(time[0])
        usual_step = float(np.median(steps))
        affine = self._affine(linear, self._resampled(float(time[-1] - time[0]), parameters))
        limit = self._stiffness_limit(steps, usual_step, affine)
        fastest, inputs = self._stiffest(start, table, parameters, limit / usual_step)
        if inputs is None:
            return None
        matrix = self._matrix(start, table[0], inputs, parameters)
        if not np.isfinite(matrix).all():
            return None
        # the longest step is the usual one, doubled until it reaches over any other
        doublings = math.ceil(math.log2(float(steps.max()) / usual_step) - ROUNDED)
        largest = usual_step * 2.0 ** max(0, doublings)
        halvings = max(2, math.ceil(math.log2(largest * self._norm(matrix[0]) / _SHORTEST)))
        worth = math.inf if affine else fastest / WORTH
        phi = _phi(matrix * (largest * 0.5**halvings), halvings)
        return Ladder(largest, affine, worth, matrix, phi)

    def _matrix(self, time: float, first: Array, inputs: Array, parameters: Array) -> Array:
        """Return the stack of J and all H with some inputs; sampled updates have the first ones."""
        n = self._nominal.size
        arguments = self._start(self._extended, time, first, parameters)
        arguments[2] = inputs
        matrix: Array = self._blocks(*arguments).full().reshape(-1, n, n)
        return matrix

    @staticmethod
    def _stiffness_limit(steps: Array, usual_step: float, affine: bool) -> float:
        """Return the eigenvalue times the time between samples above which a ladder costs less."""
        if not affine:
            return WORTH
        is_uneven = np.abs(steps - usual_step) > ROUNDED * usual_step
        if not np.mean(is_uneven) < 0.5:
            return _UNEVEN
        samples = len(steps)
        return 0.0 if samples >= _SETTING_UP else min(_STIFF, _ACCURATE * _SETTING_UP / samples)

    def _stiffest(
        self, time: float, table: Array, parameters: Array, limit: float
    ) -> tuple[float, Array | None]:
        """Return the largest eigenvalue at the start over some samples, and the inputs of that one.

        None in place of the inputs if all eigenvalues are below the limit.
        """
        jacobian, depends_on_inputs = self._jacobian
        samples = [0]
        if depends_on_inputs:
            samples = np.linspace(0, len(table) - 1, _INSPECTED).astype(int).tolist()
        fastest = limit
        inputs = None
        start = self._start(self._base, time, table[0], parameters)
        for k in samples:
            start[2] = table[k]
            matrix = jacobian(*start).full()
            # no eigenvalue is larger than a norm, which costs less
            if np.isfinite(matrix).all() and self._norm(matrix) > fastest:
                speed = float(np.abs(np.linalg.eigvals(matrix)).max())
                if speed > fastest:
                    fastest = speed
                    inputs = table[k]
        return fastest, inputs

    def _norm(self, jacobian: Array) -> float:
        """Return the row sum norm with every state in units of its nominal value."""
        return float(np.abs(jacobian * self._nominal / self._nominal[:, None]).sum(1).max())

    def _start(
        self, graph: Graph, time: float, inputs: Array, parameters: Array
    ) -> list[Array | float]:
        """Return the arguments of the laws at the first step, after the first sampled updates."""
        layout = graph.layout
        index = layout.parameter_index
        x = parameters[[index[layout.start_of[v.name]] for v in layout.states]]
        z = parameters[[index[layout.start_of[v.name]] for v in layout.discretes]]
        arguments: list[Array | float] = [time, parameters[: len(index)], inputs, x, z]
        for update in self._updates[graph is self._extended]:
            arguments[4] = update(*arguments).full()[:, 0]
        return arguments

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
    def _updates(self) -> tuple[list[ca.Function], list[ca.Function]]:
        """Sampled updates of the component and of the extended graph; none if J depends on none."""
        base = self._base
        jacobian = ca.jacobian(base.rates, base.states)
        if not (base.discretes.numel() and ca.depends_on(jacobian, base.discretes)):
            return [], []
        return (
            [_dense(base, update) for update in base.updates],
            [_dense(self._extended, update) for update in self._extended.updates],
        )

    @cached_property
    def _jacobian(self) -> tuple[ca.Function, bool]:
        """J, from the arguments of the component's laws, and whether it depends on the inputs."""
        base = self._base
        expression = ca.jacobian(base.rates, base.states)
        depends_on_inputs = base.inputs.numel() and ca.depends_on(expression, base.inputs)
        return _dense(base, expression), bool(depends_on_inputs)

    @cached_property
    def _blocks(self) -> ca.Function:
        """J and all H below each other, from the arguments of the extended laws."""
        own = self._extended.states[: self._nominal.size]
        return _dense(self._extended, ca.jacobian(self._extended.rates, own))

    def _affine(self, linear: bool, resampled: tuple[bool, ...]) -> bool:
        """Return whether the rates are affine in the states, with the same coefficients throughout.

        Parameters
        ----------
        linear : bool
            Whether inputs are interpolated; then the rates must be affine in these too.
        resampled : tuple of bool
            For each discrete state whether it is sampled again after the start.
        """
        key = (linear, resampled)
        if key not in self._known_affine:
            self._known_affine[key] = self._is_affine(linear, resampled)
        return self._known_affine[key]

    def _is_affine(self, linear: bool, resampled: tuple[bool, ...]) -> bool:
        """Work out what `_affine` returns and remembers."""
        graph = self._base
        if ca.depends_on(graph.rates, graph.time):
            return False
        discretes = graph.discretes[[k for k, again in enumerate(resampled) if again]]
        moving = ca.vertcat(graph.time, graph.inputs, graph.states, discretes)
        arguments = ca.vertcat(graph.states, graph.inputs) if linear else graph.states
        return not (
            arguments.numel() and ca.depends_on(ca.jacobian(graph.rates, arguments), moving)
        )


def _dense(graph: Graph, expression: ca.SX) -> ca.Function:
    """Make a function of a graph's arguments whose result is not sparse."""
    return ca.Function("jacobian", graph.arguments, ca.cse([ca.densify(expression)]))


def _times(a: Array, b: Array) -> Array:
    """Return the product of two matrices, each stored as the stack of its blocks."""
    product: Array = a[0] @ b
    product[1:] += a[1:] @ b[0]
    return product


def _phi(z: Array, doublings: int) -> Array:
    """Return phi_1, phi_2 and phi_3 at z and after doublings of z, the last first."""
    one = np.zeros_like(z)
    one[0] = np.eye(z.shape[-1])
    third = one / math.factorial(_TERMS + 3)
    for j in reversed(range(_TERMS)):  # Horner's scheme
        third = _times(z, third) + one / math.factorial(j + 3)
    second = _times(z, third) + 0.5 * one
    first = _times(z, second) + one
    exponential = _times(z, first) + one
    ladder = [np.stack([first, second, third])]
    for _ in range(doublings):
        third = 0.125 * (_times(exponential, third) + 0.5 * first + second + third)
        second = 0.25 * (_times(exponential, second) + first + second)
        first = 0.5 * (_times(exponential, first) + first)
        exponential = _times(exponential, exponential)
        ladder.append(np.stack([first, second, third]))
    return np.ascontiguousarray(ladder[::-1])
