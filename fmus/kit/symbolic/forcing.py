"""First-order response of a component to an effect, along a trajectory without the effect.

With the change S of the component's states, dS/dt = A S + w and dy = C S + v. The effect, of any
size, adds w to the rates and v to the outputs along the trajectory; states of the effect itself
are integrated there. One simulation of the component serves for all effects, without compiling.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.component import Component
from fmus.kit.declare import Declaration
from fmus.kit.effects import Effect, stack
from fmus.kit.interrupt import uninterrupted
from fmus.kit.symbolic.tracing import Graph, trace

Values = Mapping[str, float]
_Numbers = Mapping[str, Any]  # floats, or arrays with a value for each setting
_Laws = tuple[list[Any], list[Any]]  # rates and outputs
# states of an effect itself by name, (k, n), or (k, 1) if constant
_EffectTrajectory = dict[str, Array]
_GAMMA = 1.0 - 0.5**0.5  # makes the Rosenbrock method ROS2 for several states L-stable
_NEAR_ZERO = 1e-6  # replaces smaller arguments of the functions phi
_LITTLE = 1e-6  # step of a switch for a numerical derivative, relative to its nominal value
_EVEN = 1e-9  # relative difference below which steps have the same length
_AT_ONCE = 64  # number of steps in one call of a function


@dataclass(frozen=True)
class Points:
    """Points of a trajectory.

    Attributes
    ----------
    time : ndarray, shape (1, n)
        Seconds.
    inputs, states : ndarray, shape (k, n)
        In the order of the layout, SI.
    """

    time: Array
    inputs: Array
    states: Array

    @property
    def arguments(self) -> list[Array]:
        """Arrays in the order of a graph's arguments, without parameters."""
        return [self.time, self.inputs, self.states]


class ComponentAlong:
    """A component without discrete states, whose laws are evaluated along a trajectory.

    Parameters
    ----------
    cls : type[Component]
    parameters : Mapping of str to float
        Values, SI; other parameters have their defaults.
    begin, end : Points
        Begin and end of the step after each sample. The end is just before the next sample; that of
        the last step has no meaning.
    """

    def __init__(self, cls: type[Component], parameters: Values, begin: Points, end: Points):
        self.cls = cls
        self.begin = begin
        self.end = end
        self.parameters = _with_defaults(cls, parameters)

    @cached_property
    def laws(self) -> tuple[_Laws, _Laws]:
        """Rates and outputs at begin and end of every step, as arrays or numbers."""
        begin, end = (_evaluate(self.cls, at, self.parameters) for at in (self.begin, self.end))
        return begin, end

    @cached_property
    def steps(self) -> Array:
        """Length and arguments at begin and end of every step, a row a step.

        Lengths that differ only by rounding are replaced by their mean.
        """
        lengths = (self.end.time - self.begin.time)[:, :-1]
        if np.ptp(lengths) <= _EVEN * lengths.max():
            lengths[:] = lengths.mean()
        sides = [values[:, :-1] for at in (self.begin, self.end) for values in at.arguments]
        return np.ascontiguousarray(np.vstack([lengths, *sides]).T)


@dataclass(frozen=True)
class Forcing:
    """Additions of an effect to rates and outputs along a trajectory, in k settings.

    Attributes
    ----------
    begin, end : ndarray, shape (n, states, k)
        Additions to the rates at begin and end of every step.
    shown : ndarray, shape (n, outputs, k)
        Additions to the outputs at the begin of every step.
    """

    begin: Array
    end: Array
    shown: Array


class EffectForcing:
    """An effect on a component, evaluated along a trajectory of the component without the effect.

    Parameters
    ----------
    component : ComponentAlong
    effect : type[Effect]
        Without discrete states.
    """

    def __init__(self, component: ComponentAlong, effect: type[Effect]):
        self._component = component
        self._cls = stack(component.cls, effect)
        self._switch = effect.neutral
        self._parameters = _with_defaults(self._cls, component.parameters)
        layout = self._cls.layout
        known = component.cls.layout
        self._states = _indices_of(layout.states, known.states)
        self._effect_states = [i for i in range(len(layout.states)) if i not in self._states]
        self._outputs = _indices_of(layout.outputs, known.outputs)

    def of(self, settings: Sequence[Values]) -> Forcing:
        """Evaluate the effect in k settings along the trajectory.

        For a setting whose switch is neutral the result is the derivative by the switch.

        Parameters
        ----------
        settings : sequence of Mapping of str to float
            Parameters of the effect, SI.

        Returns
        -------
        Forcing
        """
        active, divisors = self._with_active_switch(settings)
        columns = {name: np.array([[one[name]] for one in active]) for name in active[0]}
        parameters = self._parameters | columns
        trajectory = self._effect_trajectory(parameters, len(settings))
        component = self._component
        at_begin, at_end = component.laws
        begin, shown = self._additions(component.begin, at_begin, parameters, trajectory, divisors)
        end, _ = self._additions(component.end, at_end, parameters, _at_end(trajectory), divisors)
        return Forcing(begin, end, shown)

    def _with_active_switch(
        self, settings: Sequence[Values]
    ) -> tuple[list[dict[str, float]], Array]:
        """Return the settings, a step added to neutral switches, and divisors, shape (k,).

        The divisor is the step, so that the quotient is a derivative; it is 1 for other settings.
        """
        layout = self._cls.layout
        switch = layout.parameters[layout.parameter_index[self._switch]]
        neutral = float(switch.start)
        size = _LITTLE * switch.nominal
        little = size if neutral + size <= switch.max else -size
        active = [dict(values) for values in settings]
        divisors = np.ones(len(settings))
        for k, values in enumerate(active):
            if values[self._switch] == neutral:
                values[self._switch] = neutral + little
                divisors[k] = little
        return active, divisors

    def _additions(
        self,
        at: Points,
        base: _Laws,
        parameters: _Numbers,
        trajectory: _EffectTrajectory,
        divisors: Array,
    ) -> tuple[Array, Array]:
        """Return additions to rates and outputs, divided by the divisors, each (n, rows, k)."""
        known = self._component.cls
        rates, outputs = _evaluate(self._cls, at, parameters, known, trajectory)
        base_rates, base_outputs = base
        return (
            _difference([rates[i] for i in self._states], base_rates, divisors, at),
            _difference([outputs[i] for i in self._outputs], base_outputs, divisors, at),
        )

    def _effect_trajectory(self, parameters: _Numbers, count: int) -> _EffectTrajectory:
        """Return the states of the effect in `count` settings."""
        layout = self._cls.layout
        names = [layout.states[i].name for i in self._effect_states]
        start = {
            name: np.broadcast_to(parameters[layout.start_of[name]], (count, 1)) for name in names
        }
        if start and self._component.begin.time.shape[1] > 1:
            return self._integrate(parameters, start, count)
        return start

    @uninterrupted()
    def _integrate(
        self, parameters: _Numbers, start: _EffectTrajectory, count: int
    ) -> _EffectTrajectory:
        """Return the states of the effect, integrated in all settings at once.

        The method is a Rosenbrock method of order 2 for any time constant. For a single state it
        is exponential, and exact if the rate is linear in the state and its arguments are linear in
        time (Hochbruck, Ostermann: Acta Numerica 19, 2010). For several states it is L-stable
        (Verwer and others: SIAM J. Sci. Comput. 20, 1999). The Jacobian is that at the end of a
        step, so that an element that starts to yield within the step has yielded at its end.
        """
        graph = trace(self._cls)
        columns = [
            np.broadcast_to(np.asarray(parameters[p.name], float), (count, 1))
            for p in graph.layout.parameters
        ]
        numbers = np.hstack(columns)
        # the step of one setting, copied for all settings, whose numbers it contains
        step = self._step_function(graph)
        states = ca.SX.sym("states", len(start), count)
        symbols, known = _symbols_of_row(self._component.steps)
        copies = [step(states[:, k], ca.DM(numbers[k]), known) for k in range(count)]
        function = ca.Function("all", [ca.vec(states), symbols], ca.cse([ca.vertcat(*copies)]))
        at_start = np.hstack(list(start.values())).ravel()
        path = np.ascontiguousarray(_integrate_steps(function, at_start, self._component.steps).T)
        by_setting = path.reshape(count, len(start), -1)
        return {name: by_setting[:, i] for i, name in enumerate(start)}

    def _step_function(self, graph: Graph) -> ca.Function:
        """Return the function for a step of the states of the effect.

        Its arguments are these states, the parameters, and a row of `ComponentAlong.steps`.
        """
        at_begin = ca.vertcat(graph.time, graph.inputs, _entries(graph.states, self._states))
        at_end = ca.SX.sym("end", at_begin.numel())
        h = ca.SX.sym("h")
        states = _entries(graph.states, self._effect_states)
        rates = _entries(graph.rates, self._effect_states)
        (end_rates,) = ca.substitute([rates], [at_begin], [at_end])
        result = _rosenbrock(states, rates, end_rates, h)
        row = ca.vertcat(h, at_begin, at_end)
        return ca.Function("step", [states, graph.parameters, row], [result])


def _at_end(trajectory: _EffectTrajectory) -> _EffectTrajectory:
    """Return the values at the end of every step: those at the begin of the next one."""
    return {n: np.hstack([values[:, 1:], values[:, -1:]]) for n, values in trajectory.items()}


def _symbols_of_row(rows: Array) -> tuple[ca.SX, ca.SX]:
    """Return symbols for the m arguments of a step, and the same with numbers for constant ones.

    A constant argument is the same in all n steps, whose arguments are the rows (n, m), such as the
    length of the steps in an even record.
    """
    symbols = ca.SX.sym("arguments", rows.shape[1])
    arguments = ca.SX(symbols)
    for i in np.flatnonzero(np.ptp(rows, axis=0) == 0.0):
        arguments[int(i)] = rows[0, i]
    return symbols, arguments


def _integrate_steps(function: ca.Function, start: Array, rows: Array) -> Array:
    """Return the states (n + 1, k) before and after n steps.

    Parameters
    ----------
    function : casadi.Function
        Returns the states after a step, from those before it and the arguments of the step.
    start : ndarray, shape (k,)
    rows : ndarray, shape (n, m)
        Arguments of the steps.
    """
    # a function of some steps is built faster than one of all, and works in place
    several: Any = function.mapaccum("several", _AT_ONCE)
    buffer, evaluate = several.buffer()
    whole = np.pad(rows, ((0, -len(rows) % _AT_ONCE), (0, 0)), mode="edge")
    path = np.empty((len(whole) + 1, start.size))
    path[0] = start
    for k in range(0, len(whole), _AT_ONCE):
        following = slice(k + 1, k + 1 + _AT_ONCE)
        buffer.set_arg(0, path[k].data)
        buffer.set_arg(1, whole[k : k + _AT_ONCE].data)
        buffer.set_res(0, path[following].data)
        evaluate()
    return path[: len(rows) + 1]


def _rosenbrock(states: ca.SX, rates: ca.SX, at_end: ca.SX, h: ca.SX) -> ca.SX:
    """Return the states after a step h, as expressions.

    For one state it is the exponential Rosenbrock-Euler method, for several it is ROS2; see
    `EffectForcing._integrate` for the sources.

    Parameters
    ----------
    states : casadi.SX
        States before the step.
    rates, at_end : casadi.SX
        Their rates, with the arguments at begin and at end of the step.
    h : casadi.SX
        Length of the step, s.
    """
    slope = ca.jacobian(at_end, states)
    if states.numel() == 1:
        first, second = _phi(h * slope)
        return states + h * (first * rates + second * (at_end - rates))
    implicit = ca.SX.eye(states.numel()) - _GAMMA * h * slope
    stage = ca.solve(implicit, rates)
    second_rates = ca.substitute([at_end], [states], [states + h * stage])[0]
    last = ca.solve(implicit, second_rates - 2.0 * stage)
    return states + h * (1.5 * stage + 0.5 * last)


def _phi(z: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return phi_1 and phi_2 of a number: (exp(z) - 1) / z and (phi_1 - 1) / z."""
    nonzero = ca.if_else(ca.fabs(z) < _NEAR_ZERO, _NEAR_ZERO, z)
    first = ca.expm1(nonzero) / nonzero
    return first, (first - 1.0) / nonzero


def _with_defaults(cls: type[Component], parameters: _Numbers) -> dict[str, Any]:
    """Return the values of all parameters of a component: given ones, and defaults."""
    declared = {p.name: p.start for p in cls.layout.parameters}
    return declared | {name: parameters[name] for name in declared if name in parameters}


def _instance_at(
    cls: type[Component],
    at: Points,
    parameters: _Numbers,
    known: type[Component],
    further: Mapping[str, Array],
) -> Component:
    """Return an instance whose variables are arrays over points.

    Parameters
    ----------
    cls : type[Component]
    at : Points
    parameters : Mapping of str to float or ndarray
    known : type[Component]
        Component whose variables the points are.
    further : Mapping of str to ndarray
        Further states of `cls`.
    """
    component = cls()
    values_by_name = component.__dict__
    values_by_name.update(parameters)
    groups = ((known.layout.inputs, at.inputs), (known.layout.states, at.states))
    for group, values in groups:
        values_by_name.update(zip((v.name for v in group), values, strict=True))
    values_by_name.update(further)
    component.time = at.time[0]
    return component


def _evaluate(
    cls: type[Component],
    at: Points,
    parameters: _Numbers,
    known: type[Component] | None = None,
    further: Mapping[str, Array] | None = None,
) -> _Laws:
    """Return rates and outputs of a component; see `_instance_at`."""
    component = _instance_at(cls, at, parameters, known or cls, further or {})
    with np.errstate(all="ignore"):  # values that are not finite are rejected where they are used
        return component.rates(), component.outputs()


def _difference(values: Sequence[Any], base: Sequence[Any], divisors: Array, at: Points) -> Array:
    """Return divided differences of rates or outputs from those without the effect.

    Parameters
    ----------
    values, base : sequence of float or ndarray
        Of m laws with the effect, each (k, n) or less, and without it, each (n,) or less.
    divisors : ndarray, shape (k,)
    at : Points
        The n points.

    Returns
    -------
    ndarray, shape (n, m, k)
    """
    shape = len(divisors), at.time.shape[1]
    result = np.zeros((shape[1], len(values), shape[0]))
    for i, (one, other) in enumerate(zip(values, base, strict=True)):
        difference = np.asarray(one, dtype=float) - np.asarray(other, dtype=float)
        if difference.any():
            result[:, i] = (np.broadcast_to(difference, shape) / divisors[:, np.newaxis]).T
    return result


def _indices_of(group: Sequence[Declaration], known: Sequence[Declaration]) -> list[int]:
    """Return the indices of known variables in a group, in the order of the known variables."""
    index = {variable.name: i for i, variable in enumerate(group)}
    return [index[variable.name] for variable in known]


def _entries(vector: ca.SX, indices: Sequence[int]) -> ca.SX:
    """Return entries of a vector as a column, which may be empty."""
    return ca.vec(vector[indices])
