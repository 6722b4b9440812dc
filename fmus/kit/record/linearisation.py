"""What makes a component stiff over a record, and the matrix functions with which its linear part is solved exactly.

The rates are split into A x, where A is their Jacobian at the start of the record, and the rest. What is sampled has
been updated by then, for that comes before the first step: a lag whose equilibrium is sampled once follows from there.
Sensitivities are states too, and their part of A is as exact: below the Jacobian J of the states themselves stands, for
each parameter, a block H with the derivatives of the sensitivities' rates by the states, and beside it J again. Such a
matrix is kept as the stack of J and all H; a function of it is the same stack of that function and of its Frechet
derivatives.

The functions are phi_k(z) = sum of z^j / (j + k)! at z = h A for steps h that are halved again and again: a series for
the shortest, then doubling (Hochbruck, Ostermann: Exponential integrators, Acta Numerica 2010, section 2.1; Skaflestad,
Wright: The scaling and modified squaring method for matrix functions related to the exponential, 2009).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fmus.kit.symbolic.trace import Graph

Array = NDArray[np.float64]
# Of the largest eigenvalue and the time between samples, from which on a component is stiff: below, accuracy asks for
# about as many steps of Runge and Kutta as stability does.
_STIFF = 2.0
# An exact step costs less than any of Runge and Kutta. To make its matrix functions costs as much as so many of theirs.
_SETTING_UP = 2000.0
_ACCURATE = 0.05  # of the largest eigenvalue and a step of Runge and Kutta: longer ones are not accurate enough
_UNEVEN = 50.0  # the same of the time between samples that are not equally spaced: a step is made of several there
# Time constants that take Runge and Kutta about as long as one exponential step with a rest beside A x, which is made
# three times over for its error and spends most of its time in products.
WORTH = 100.0
_SHORTEST = 0.02  # product of the norm of A and the shortest step: the Runge-Kutta method takes what is left in one
_TERMS = 8  # of the series, whose first that is left out is below rounding then
ROUNDED = 1e-6  # relative: intervals between samples this close are the same but for the rounding of a clock
_LOOKED_AT = 5  # samples with whose inputs the eigenvalues are looked at


@dataclass(frozen=True)
class Ladder:
    """Matrix functions for steps of ``largest / 2**k``.

    Attributes
    ----------
    largest : float
        Seconds.
    affine : bool
        Whether nothing is left beside A x that changes during a step, other than linearly with the time.
    worth : float
        Steps per second that cost no more than what Runge and Kutta need; infinite where steps are exact.
    matrix : ndarray, shape (1 + p, n, n)
        A, as the stack of its blocks.
    phi : ndarray, shape (levels + 2, 3, 1 + p, n, n)
        phi_1, phi_2 and phi_3 of every step, the longest first; the last two serve as halves and quarters only.
    """

    largest: float
    affine: bool
    worth: float
    matrix: Array
    phi: Array

    @property
    def levels(self) -> int:
        """Steps that may be taken."""
        return len(self.phi) - 2


class Linearisation:
    """Jacobians of a component and of its sensitivities.

    Parameters
    ----------
    base : Graph
        The component.
    extended : Graph
        With its sensitivities, of which the parameters begin with those of the component.
    """

    def __init__(self, base: Graph, extended: Graph):
        self._base, self._extended = base, extended
        self._nominal = np.array([state.nominal for state in base.layout.states])
        self._known: dict[tuple[bool, tuple[bool, ...]], bool] = {}  # see `_affine`

    def ladder(self, time: Array, table: Array, linear: bool, parameters: Array) -> Ladder | None:
        """Look at how stiff the component is over a record.

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
        if not (
            self._nominal.size and steps.size and np.isfinite(steps).all() and (steps > 0.0).all()
        ):
            return None
        step = float(np.median(steps))
        even = np.mean(np.abs(steps - step) > ROUNDED * step) < 0.5
        affine = self._affine(linear, self._changing(float(time[-1] - time[0]), parameters))
        limit = WORTH if not affine else self._worth_setting_up(len(steps)) if even else _UNEVEN
        fastest, inputs = self._stiffest(float(time[0]), table, parameters, limit / step)
        if inputs is None:
            return None
        n = self._nominal.size
        start = self._start(self._extended, float(time[0]), table[0], parameters)
        start[2] = inputs
        matrix = self._blocks(*start).full().reshape(-1, n, n)
        if not np.isfinite(matrix).all():
            return None
        largest = step * 2.0 ** max(0, math.ceil(math.log2(float(steps.max()) / step) - ROUNDED))
        halvings = max(2, math.ceil(math.log2(largest * self._norm(matrix[0]) / _SHORTEST)))
        worth = math.inf if affine else fastest / WORTH
        return Ladder(
            largest, affine, worth, matrix, _phi(matrix * (largest * 0.5**halvings), halvings)
        )

    @staticmethod
    def _worth_setting_up(samples: int) -> float:
        """Largest eigenvalue times the time between samples from which on exact steps cost less in all."""
        return 0.0 if samples >= _SETTING_UP else min(_STIFF, _ACCURATE * _SETTING_UP / samples)

    def _stiffest(
        self, time: float, table: Array, parameters: Array, limit: float
    ) -> tuple[float, Array | None]:
        """Largest eigenvalue at the start with the inputs of some samples, and those; None if all are below a limit."""
        jacobian, of_inputs = self._jacobian
        fastest, inputs = limit, None
        start = self._start(self._base, time, table[0], parameters)
        for k in (
            np.linspace(0, len(table) - 1, _LOOKED_AT).astype(int).tolist() if of_inputs else [0]
        ):
            start[2] = table[k]
            found = jacobian(*start).full()
            # no eigenvalue is larger than a norm, which costs less
            if np.isfinite(found).all() and self._norm(found) > fastest:
                speed = float(np.abs(np.linalg.eigvals(found)).max())
                fastest, inputs = (speed, table[k]) if speed > fastest else (fastest, inputs)
        return fastest, inputs

    def _norm(self, jacobian: Array) -> float:
        """Row sum norm with every state in units of its size."""
        return float(np.abs(jacobian * self._nominal / self._nominal[:, None]).sum(1).max())

    def _start(
        self, graph: Graph, time: float, inputs: Array, parameters: Array
    ) -> list[Array | float]:
        """Arguments of the laws of a graph as its first step begins, after the first updates of what is sampled."""
        layout = graph.layout
        index = {p.name: i for i, p in enumerate(layout.parameters)}
        groups = layout.states, layout.discretes
        x, z = (parameters[[index[layout.start_of[v.name]] for v in group]] for group in groups)
        arguments: list[Array | float] = [time, parameters[: len(index)], inputs, x, z]
        for update in self._updates[graph is self._extended]:
            arguments[4] = update(*arguments).full()[:, 0]
        return arguments

    def _changing(self, duration: float, parameters: Array) -> tuple[bool, ...]:
        """Which discrete states are sampled again after the start of a record."""
        layout = self._base.layout
        index = {p.name: i for i, p in enumerate(layout.parameters)}
        periods = (
            parameters[index[d.period]] if isinstance(d.period, str) else d.period
            for d in layout.discretes
        )
        return tuple(float(period) < duration for period in periods)

    @cached_property
    def _updates(self) -> tuple[list[ca.Function], list[ca.Function]]:
        """What happens at the sample instants, of the component and of the extended graph; none that no rate feels."""
        jacobian = ca.jacobian(self._base.rates, self._base.states)
        felt = self._base.discretes.numel() and ca.depends_on(jacobian, self._base.discretes)
        base, extended = (
            [_dense(graph, update) for update in graph.updates] if felt else []
            for graph in (self._base, self._extended)
        )
        return base, extended

    @cached_property
    def _jacobian(self) -> tuple[ca.Function, bool]:
        """J, from the arguments of the component's laws, and whether it depends on the inputs."""
        expression = ca.jacobian(self._base.rates, self._base.states)
        of_inputs = self._base.inputs.numel() and ca.depends_on(expression, self._base.inputs)
        return _dense(self._base, expression), bool(of_inputs)

    @cached_property
    def _blocks(self) -> ca.Function:
        """J and all H below each other, from the arguments of the extended laws."""
        return _dense(
            self._extended,
            ca.jacobian(self._extended.rates, self._extended.states[: self._nominal.size]),
        )

    def _affine(self, linear: bool, changing: tuple[bool, ...]) -> bool:
        """Whether the rates are affine in the states, or with interpolated inputs in both, and stay the same so.

        ``changing`` tells of each discrete state whether it changes after the start.
        """
        graph = self._base
        if (linear, changing) not in self._known:
            moving = ca.vertcat(
                graph.time,
                graph.inputs,
                graph.states,
                graph.discretes[[k for k, c in enumerate(changing) if c]],
            )
            known = ca.vertcat(graph.states, graph.inputs) if linear else graph.states
            self._known[linear, changing] = not ca.depends_on(graph.rates, graph.time) and not (
                known.numel() and ca.depends_on(ca.jacobian(graph.rates, known), moving)
            )
        return self._known[linear, changing]


def _dense(graph: Graph, expression: ca.SX) -> ca.Function:
    return ca.Function("jacobian", graph.arguments, ca.cse([ca.densify(expression)]))


def _times(a: Array, b: Array) -> Array:
    """Product of two matrices, each kept as the stack of its blocks."""
    product: Array = a[0] @ b
    product[1:] += a[1:] @ b[0]
    return product


def _phi(z: Array, doublings: int) -> Array:
    """phi_1, phi_2 and phi_3 at z and after doublings of z, the last first."""
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
