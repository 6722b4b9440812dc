"""First-order response of a component to additions to its laws, along a trajectory.

If w(t) is added to one law, the changes S of the states and dy of the outputs follow dS/dt = A S +
b w and dy = C S + d w. One simulation serves for every addition.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import casadi as ca

from fmus.kit.component import Component
from fmus.kit.declare import Declaration, Started
from fmus.kit.interrupt import uninterrupted
from fmus.kit.layout import law_of
from fmus.kit.symbolic.instructions import column
from fmus.kit.symbolic.tracing import Graph, trace

_NUMBERS = ca.SX, float, int


class PerturbedLaws:
    """A component with a symbol added to the value of each of its laws at every call.

    If an effect overrides a law, the symbol is added to the value of the effect. Nothing is added
    to a law that returns several numbers; it is treated as a part of the laws that call it.

    Parameters
    ----------
    cls : type[Component]
    with_shown_states : bool
        Whether states that are outputs of the FMU are outputs here too, each behind a law of its
        name that returns it.

    Attributes
    ----------
    names : list of str
        Laws that its rates, outputs and updates call, in the order of the first calls.
    graph : Graph
        Graph of the component without additions.
    shown : tuple of Started
        States that are outputs here, behind the declared ones.
    """

    def __init__(self, cls: type[Component], *, with_shown_states: bool = False):
        self._additions: dict[str, ca.SX] = {}  # symbol that is added to each law
        self._values: dict[str, ca.SX] = {}  # value of each law at its first call
        self._calling: list[str] = []  # stack of the laws that are being called
        self._read: dict[str, set[str]] = {}  # signals and laws that each law reads
        layout = cls.layout
        variables = (*layout.inputs, *layout.states, *layout.discretes)
        self._signals = {v.name for v in variables} | {"time"}
        self._perturbed = trace(self._recording_class(cls))
        self.graph: Graph = trace(cls)
        states = [state for state in layout.states if state.output]
        discretes = [state for state in layout.discretes if state.output]
        self.shown: tuple[Started, ...] = (*states, *discretes) if with_shown_states else ()
        self._add_shown([state.name for state in (*layout.states, *layout.discretes)])
        self.names = list(self._additions)

    @uninterrupted()
    def _add_shown(self, names: Sequence[str]) -> None:
        """Add a law for each state that is shown; names are those of all states in order."""
        symbols = dict(zip(names, self._states_of(self._perturbed), strict=True))
        for name in (state.name for state in self.shown):
            self._additions[name] = ca.SX.sym(name)
            self._values[name] = symbols[name]
            self._read[name] = {name}

    @staticmethod
    def _states_of(graph: Graph) -> list[ca.SX]:
        """Return the symbols of all states of a graph, discrete ones last."""
        return [*ca.vertsplit(graph.states), *ca.vertsplit(graph.discretes)]

    def _recording_class(self, cls: type[Component]) -> type[Component]:
        """Return a subclass whose laws add their symbol to their value.

        Its instances record the signals and laws that each law reads.
        """
        # law_of rather than getattr: an input that an effect changes has no value in the class
        names = set(dir(cls)) - set(dir(Component))
        laws = {n for n in names if law_of(cls, n) is not None and not n.startswith("_")}

        def get(instance: Any, name: str) -> Any:
            """Return an attribute, recording a signal and wrapping a law."""
            value = object.__getattribute__(instance, name)
            if name in self._signals and self._calling:
                self._read[self._calling[-1]].add(name)
            return self._perturbed_law(name, value) if name in laws else value

        return type(
            cls.__name__,
            (cls,),
            {"__getattribute__": get, "name": cls.name, "__module__": cls.__module__},
        )

    def _perturbed_law(self, name: str, law: Callable[..., Any]) -> Callable[..., Any]:
        """Return a law that adds its symbol to the value, and records value and signals read."""

        def perturbed(*arguments: Any, **named: Any) -> Any:
            # added before the call, because `names` has the order of the calls
            addition = self._additions.setdefault(name, ca.SX.sym(name))
            read_by_caller = self._read[self._calling[-1]] if self._calling else set()
            read = self._read.setdefault(name, set())
            for argument in (*arguments, *named.values()):
                read |= set(self._names_of_value(argument))
            self._calling.append(name)
            try:
                value = law(*arguments, **named)
            finally:
                self._calling.pop()
            if not isinstance(value, _NUMBERS):  # several numbers, a part of the caller
                del self._additions[name]
                read_by_caller |= read
                return value
            read_by_caller.add(name)
            self._values.setdefault(name, ca.SX(value))
            return value + addition

        return perturbed

    def _names_of_value(self, argument: Any) -> list[str]:
        """Return the names of the signal, or of the laws, whose value an argument is."""
        if not isinstance(argument, ca.SX):
            return []
        if argument.is_symbolic() and argument.name() in self._signals:
            return [argument.name()]
        names = []
        for name, value in self._values.items():
            # to depth 1, because this sum is another object, with the same operands
            if ca.is_equal(argument, value + self._additions[name], 1):
                names.append(name)
        return names

    def is_definition(self, law: str) -> bool:
        """Return whether a law is a definition, which cannot be wrong.

        Parameters
        ----------
        law : str
            One of `names`.

        Returns
        -------
        bool
            True for a rate that is a state in any unit (the rate of a position is the velocity),
            and for an output that is a state or depends directly only on other laws and parameters.

        Raises
        ------
        KeyError
            If there is no such law.
        """
        layout = self.graph.layout
        if law in {s.name for s in self.shown}:
            return True
        is_state = self._is_one_of(layout.states, law)
        if law in {o.name for o in layout.outputs}:
            return is_state or not self._read[law] - set(self.names)
        return is_state and law in {s.rate for s in layout.states}

    def is_count(self, law: str) -> bool:
        """Return whether a law is the rate of the integral of an input, such as a charge.

        Raises
        ------
        KeyError
            If there is no such law.
        """
        layout = self.graph.layout
        return self._is_one_of(layout.inputs, law) and law in {s.rate for s in layout.states}

    @uninterrupted()
    def _is_one_of(self, variables: Sequence[Declaration], law: str) -> bool:
        """Return whether the value of a law is one of some variables, in any unit."""
        value = self._values[law]
        symbols = ca.symvar(value)
        if len(symbols) != 1 or symbols[0].name() not in {v.name for v in variables}:
            return False
        return bool(ca.jacobian(value, symbols[0]).is_constant())

    def computed_from(self, signal: str) -> set[str]:
        """Return the inputs and states that a law depends on; for any other signal, its name."""
        return set(self._inside[signal]) if signal in self._values else {signal}

    @cached_property
    def _inside(self) -> dict[str, frozenset[str]]:
        """Inputs and states that each law depends on."""
        return {law: frozenset(self._signals_in(value)) for law, value in self._values.items()}

    @uninterrupted()
    def _signals_in(self, expression: ca.SX) -> set[str]:
        """Return the inputs and states in an expression."""
        return {symbol.name() for symbol in ca.symvar(expression)} & self._signals

    def reads_itself(self, law: str, signal: str) -> bool:
        """Return whether a law reads a signal itself, or has it as an argument.

        Signals that are read only by laws that it calls do not count.

        Parameters
        ----------
        law : str
            One of `names`.
        signal : str
            Input, state, law, or ``time``.

        Raises
        ------
        KeyError
            If there is no such law.
        """
        return signal in self._read[law]

    @uninterrupted()
    def calls(self, law: str, other: str) -> bool:
        """Return whether a law depends on another, directly or through further laws.

        Parameters
        ----------
        law, other : str

        Returns
        -------
        bool
            False if one of them is not in `names`.
        """
        if law not in self._values or other not in self._additions:
            return False
        return bool(ca.depends_on(self._values[law], self._additions[other]))

    @uninterrupted()
    def functions(self) -> list[ca.Function]:
        """Make functions of states, inputs, time, parameters and additions to the laws.

        Discrete states are the last of the states; their rates are zero.

        Returns
        -------
        list of casadi.Function
            ``laws_of``: values of the laws without additions, and their Jacobians by states and
            parameters. ``rates_of`` and ``outputs_of``: values. ``rate_slopes_of`` and
            ``output_slopes_of``: values, and Jacobians by states, parameters and additions.
            ``update_<i>_of``: the same of all states after a tick of clock i. Jacobians are sparse.
        """
        graph = self._perturbed
        added = column(self._additions.values())
        states = ca.vertcat(graph.states, graph.discretes)
        rates = ca.vertcat(graph.rates, ca.SX(graph.discretes.numel(), 1))
        known = [states, graph.inputs, graph.time, graph.parameters, added]
        values = column(self._values[name] for name in self.names)
        laws = ca.substitute(values, added, ca.DM.zeros(added.shape))

        def function(name: str, value: ca.SX, symbols: Sequence[ca.SX]) -> ca.Function:
            results = [ca.densify(value), *(ca.jacobian(value, s) for s in symbols)]
            return ca.Function(name, known, ca.cse(results))

        of_states = (self._values[s.name] + self._additions[s.name] for s in self.shown)
        outputs = ca.vertcat(graph.outputs, *of_states)
        slopes = [states, graph.parameters, added]
        updates = [ca.vertcat(graph.states, update) for update in graph.updates]
        return [
            function("laws_of", laws, slopes[:2]),
            function("rates_of", rates, []),
            function("outputs_of", outputs, []),
            function("rate_slopes_of", rates, slopes),
            function("output_slopes_of", outputs, slopes),
            *(function(f"update_{i}_of", update, slopes) for i, update in enumerate(updates)),
        ]
