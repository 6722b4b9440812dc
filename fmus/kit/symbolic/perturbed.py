"""Something added to each law of a component, and what its rates and outputs make of that, to first order.

Along a trajectory dS/dt = A S + b w and dy = C S + d w, where w is what is added to one law as a function of time: one
simulation serves for whatever may be added.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fmus.kit.component import Component
from fmus.kit.declare import Declaration
from fmus.kit.symbolic.trace import Graph, trace

Array = NDArray[np.float64]
_NUMBERS = ca.SX, float, int


@dataclass(frozen=True)
class Jacobians:
    """Derivatives of a perturbed component at points of a trajectory, and the values of its laws there.

    Attributes
    ----------
    a : ndarray, shape (n, states, states)
        Of the rates by the states, SI.
    b : ndarray, shape (n, states, laws)
        Of the rates by what is added to the laws, SI.
    c : ndarray, shape (n, outputs, states)
        Of the outputs by the states, SI.
    d : ndarray, shape (n, outputs, laws)
        Of the outputs by what is added to the laws, SI.
    values : ndarray, shape (n, laws)
        Of the laws with nothing added, SI; of one with arguments as it is called first.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    values: Array


class PerturbedLaws:
    """A component with a symbol added to each of its laws, wherever one is called and with whatever arguments.

    What is added to a law that an effect overrides is added to what the effect makes of it. A law that gives several
    numbers is none to which one could be added; it counts as a part of those that call it.

    Parameters
    ----------
    cls : type[Component]

    Attributes
    ----------
    names : list of str
        Laws that its rates, outputs and updates come to, in the order in which they are called first.
    graph : Graph
        The component as it is.
    """

    def __init__(self, cls: type[Component]):
        self._added: dict[str, ca.SX] = {}
        self._values: dict[str, ca.SX] = {}
        self._calling: list[str] = []
        self._read: dict[str, set[str]] = {}
        self._signals = {
            v.name for v in (*cls.layout.inputs, *cls.layout.states, *cls.layout.discretes)
        } | {"time"}
        self._perturbed = trace(self._spied(cls))
        self.graph: Graph = trace(cls)
        self.names = list(self._added)

    def _spied(self, cls: type[Component]) -> type[Component]:
        """Make a class that tells which laws and signals are asked for, and adds to the laws."""
        # an input that an effect changes stands in the class, and has no value there
        own = {
            name
            for name in dir(cls)
            if callable(getattr(cls, name, None)) and not name.startswith("_")
        }
        laws = own - set(dir(Component))

        def get(one: Any, name: str) -> Any:
            value = object.__getattribute__(one, name)
            if name in self._signals and self._calling:
                self._read[self._calling[-1]].add(name)
            return self._with_addition(name, value) if name in laws else value

        return type(
            cls.__name__,
            (cls,),
            {"__getattribute__": get, "name": cls.name, "__module__": cls.__module__},
        )

    def _with_addition(self, name: str, law: Callable[..., Any]) -> Callable[..., Any]:
        def perturbed(*arguments: Any, **named: Any) -> Any:
            added = self._added.setdefault(name, ca.SX.sym(name))
            caller = self._read[self._calling[-1]] if self._calling else set()
            read = self._read.setdefault(name, set())
            read |= {
                handed for one in (*arguments, *named.values()) for handed in self._handed(one)
            }
            self._calling.append(name)
            try:
                value = law(*arguments, **named)
            finally:
                self._calling.pop()
            if not isinstance(value, _NUMBERS):
                del self._added[name]
                caller |= read
                return value
            caller.add(name)
            self._values.setdefault(name, ca.SX(value))
            return value + added

        return perturbed

    def _handed(self, argument: Any) -> list[str]:
        """The signal or the laws that an argument is."""
        if not isinstance(argument, ca.SX):
            return []
        if argument.is_symbolic() and argument.name() in self._signals:
            return [argument.name()]
        return [
            n
            for n, value in self._values.items()
            if ca.is_equal(argument, value + self._added[n], 1)
        ]

    def is_definition(self, law: str) -> bool:
        """Whether nothing can be wrong with a law.

        Parameters
        ----------
        law : str
            One of the names.

        Returns
        -------
        bool
            It is a rate that is a state, as that of a position is the velocity; or an output that reads no input, no
            state and not the time, whatever it computes from other laws and from parameters, or that is a state.

        Raises
        ------
        KeyError
            If there is no such law.
        """
        layout = self.graph.layout
        is_state = self._values[law].is_symbolic() and self._values[law].name() in {
            s.name for s in layout.states
        }
        if law in {o.name for o in layout.outputs}:
            return is_state or not self._read[law] - set(self.names)
        return is_state and law in {s.rate for s in layout.states}

    def acts_beside(self, law: str) -> set[str]:
        """Inputs and states that stand in the rates and outputs that a law acts on."""
        graph, added = self._perturbed, self._added[law]
        felt = [
            e
            for whole in (graph.rates, graph.outputs)
            for e in ca.vertsplit(whole)
            if ca.depends_on(e, added)
        ]
        return self._standing_in(ca.vertcat(ca.SX(0, 1), *felt))

    def computed_from(self, signal: str) -> set[str]:
        """Inputs and states that a signal is, or that stand in a law that it is."""
        return self._standing_in(self._values[signal]) if signal in self._values else {signal}

    def _standing_in(self, expression: ca.SX) -> set[str]:
        return {symbol.name() for symbol in ca.symvar(expression)} & self._signals

    def reads_itself(self, law: str, signal: str) -> bool:
        """Whether a signal stands in a law itself, or is handed to it, rather than in a law that it calls.

        Parameters
        ----------
        law : str
            One of the names.
        signal : str
            Input, state or law; ``time``.

        Raises
        ------
        KeyError
            If there is no such law.
        """
        return signal in self._read[law]

    def calls(self, law: str, other: str) -> bool:
        """Whether a law is computed from another, or from what that one gives to laws in between.

        Parameters
        ----------
        law, other : str
            Of what is none of the names, nothing is computed, nor is it from anything.
        """
        known = law in self._values and other in self._added
        return known and bool(ca.depends_on(self._values[law], self._added[other]))

    @cached_property
    def _function(self) -> ca.Function:
        """Jacobians and values, in the order of :class:`Jacobians`, as a function of what laws depend on."""
        graph, added = self._perturbed, ca.vertcat(ca.SX(0, 1), *self._added.values())
        expressions = [
            *(
                ca.jacobian(e, s)
                for e in (graph.rates, graph.outputs)
                for s in (graph.states, added)
            ),
            ca.vertcat(ca.SX(0, 1), *(self._values[name] for name in self.names)),
        ]
        rest = [ca.densify(ca.substitute(e, added, ca.DM.zeros(added.shape))) for e in expressions]
        return ca.Function("perturbed", graph.arguments, ca.cse(rest))

    def along(
        self,
        time: Array,
        parameters: Mapping[str, float],
        inputs: Mapping[str, Array],
        signals: Mapping[str, Array],
    ) -> Jacobians:
        """Linearise at points of a trajectory.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds.
        parameters : Mapping of str to float
            SI; those that are not given have their defaults, and others than the component's are passed over.
        inputs, signals : Mapping of str to ndarray, shape (n,)
            Inputs, and all states and discrete states, SI; an input that is not given has its start value.

        Returns
        -------
        Jacobians

        Raises
        ------
        KeyError
            If a state is not given.
        """
        layout, n = self.graph.layout, len(time)

        def rows(group: Sequence[Declaration], values: Mapping[str, Any]) -> Array:
            columns = [np.broadcast_to(np.asarray(values[v.name], dtype=float), n) for v in group]
            return np.array(columns).reshape(len(group), n)

        fixed = {p.name: p.start for p in layout.parameters} | dict(parameters)
        fed = {v.name: v.start for v in layout.inputs} | dict(inputs)
        points = [
            time[np.newaxis],
            rows(layout.parameters, fixed),
            rows(layout.inputs, fed),
            rows(layout.states, signals),
            rows(layout.discretes, signals),
        ]
        found = [np.asarray(part) for part in self._function.map(n)(*points)]
        states, outputs, laws = len(layout.states), len(layout.outputs), len(self.names)
        # CasADi lays the matrices of all points side by side
        by_states, by_laws, c, d = (
            part.reshape(height, n, width).transpose(1, 0, 2)
            for part, height, width in zip(
                found[:4],
                (states, states, outputs, outputs),
                (states, laws, states, laws),
                strict=True,
            )
        )
        return Jacobians(by_states, by_laws, c, d, found[4].T)
