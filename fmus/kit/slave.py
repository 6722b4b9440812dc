"""The Python side of a Python FMU: a component that works on the memory of an FMU instance.

The C front-end owns that memory. Every call loads its values from it and stores its results in it.
Python keeps no state between calls, so that a copy of the memory is a copy of the instance (FMU
contract, line 5).
"""

from __future__ import annotations

import _thread
import traceback
from collections.abc import Callable
from functools import cache
from typing import Any

from .component import Component
from .errors import UserError
from .integrate import Integrator

# positions of the internals, in the order of fmi/engine.h
_HINT = 0
_START_TIME = 1
_TOLERANCE = 2
_PARAMETERS_CHANGED = 3
_COUNTERS = 4


def _assign(name: str, value: str) -> str:
    """Write the assignment of a value to a variable, faster for elements than ``m.x[1] = ...``."""
    return f"m.{name} = {value}" if name.isidentifier() else f"setattr(m, {name!r}, {value})"


@cache
def _compile_assignments(*statements: str) -> Callable[[Component, Any], None]:
    """Make a function that executes assignments between a component ``m`` and the memory ``y``.

    A loop over the variables takes twice as long. All instances share the function, because
    compiling would take most of the time of creating one.
    """
    namespace: dict[str, Any] = {}
    exec("def transfer(m, y):\n    " + ("; ".join(statements) or "pass"), namespace)
    transfer: Callable[[Component, Any], None] = namespace["transfer"]
    return transfer


class Slave:
    """The state and the laws of one FMU instance.

    Parameters
    ----------
    cls : type[Component]
        The component.
    memory : memoryview
        Doubles in the order of :class:`fmus.kit.layout.Layout`, then derivatives, then the
        internals ``hint, start time, tolerance, parameters changed`` and a counter for each sampled
        group (``fmi/engine.h``).
    texts : memoryview
        Text parameters, which laws do not use.
    """

    def __init__(self, cls: type[Component], memory: Any, texts: Any = b""):
        layout = cls.layout
        first_input = len(layout.parameters)
        first_state = first_input + len(layout.inputs)
        first_output = first_state + len(layout.states) + len(layout.discretes)
        load = [
            _assign(v.name, f"y[{i}]" + (" != 0.0" if v.type == "boolean" else ""))
            for i, v in enumerate(layout.variables)
        ]
        store = [f"y[{i}] = m.{v.name}" for i, v in enumerate(layout.variables)]
        self._load_parameters = _compile_assignments(*load[:first_input])
        self._load = _compile_assignments(*load[first_input:first_output])
        self._store = _compile_assignments(*store[first_state:first_output])
        self._first_output = first_output
        self._internals = len(layout.names)
        self.memory = memory
        self.component = cls()
        self.integrator = Integrator(self.component)
        self._first_derivative = first_output + len(layout.outputs)
        self._outputs = self.component.laws([o.name for o in layout.outputs])

    def initialize(self) -> str | None:
        """Compute the outputs at the end of initialization; return the message of an error."""
        # the host may have set the tolerance last
        self.memory[self._internals + _PARAMETERS_CHANGED] = 1.0
        return self.evaluate(0.0)

    def evaluate(self, time: float) -> str | None:
        """Compute the outputs from the memory.

        Parameters
        ----------
        time : float
            Time, s.

        Returns
        -------
        str or None
            Message of an error; no exception of a law reaches the host.
        """
        return self._compute(time, self._outputs, self._first_output)

    def differentiate(self, time: float) -> str | None:
        """Compute the derivatives of the states from the memory; see :meth:`evaluate`."""
        return self._compute(time, self.integrator.rates, self._first_derivative)

    def _compute(self, time: float, laws: list[Callable[[], Any]], first: int) -> str | None:
        """Store the values of laws in the memory, from position ``first`` on."""
        try:
            memory = self.memory
            component = self.component
            if memory[self._internals + _PARAMETERS_CHANGED]:
                self._load_all_parameters()
            self._load(component, memory)
            component.time = time
            component._kept = {}
            for index, law in enumerate(laws, first):
                memory[index] = law()
        except BaseException as error:
            return describe_error(error)
        finally:
            self.component._kept = None
        return None

    def advance(self, time: float, step: float) -> str | None:
        """Advance the states by one communication step.

        Parameters
        ----------
        time, step : float
            Start and length of the step, s; a step of 0 s makes the updates that are due.

        Returns
        -------
        str or None
            Message of an error.
        """
        try:
            memory = self.memory
            component = self.component
            integrator = self.integrator
            internals = self._internals
            if memory[internals + _PARAMETERS_CHANGED]:
                self._load_all_parameters()
            self._load(component, memory)
            integrator.hint = memory[internals + _HINT]
            if integrator.groups:
                integrator.start_time = memory[internals + _START_TIME]
                first = internals + _COUNTERS
                integrator.counters = memory[first : first + len(integrator.groups)].tolist()
            integrator.advance(time, step)
            self._store(component, memory)
            memory[internals + _HINT] = integrator.hint
            for index, count in enumerate(integrator.counters, internals + _COUNTERS):
                memory[index] = count
        except BaseException as error:
            return describe_error(error)
        return None

    def warning(self) -> str | None:
        """Return a warning about a successful step: None, as laws give no warnings."""
        return None

    def terminate(self) -> None:
        """End the simulation: nothing to do, as laws have no resources."""

    def close(self) -> None:
        """Release the memory before the front-end frees it."""
        self.memory.release()

    def _load_all_parameters(self) -> None:
        """Load the parameters and the tolerance, which change rarely."""
        self._load_parameters(self.component, self.memory)
        self.integrator.tolerance = self.memory[self._internals + _TOLERANCE]
        self.memory[self._internals + _PARAMETERS_CHANGED] = 0.0


def describe_error(error: BaseException) -> str:
    """Return the message of an error for the host; pass on a Ctrl-C to it.

    Parameters
    ----------
    error : BaseException

    Returns
    -------
    str
        One line.
    """
    if isinstance(error, UserError):
        return str(error)
    frame = traceback.extract_tb(error.__traceback__)[-1]
    text = (
        f"{type(error).__name__}: {error} (in {frame.name}, line {frame.lineno} of"
        f" {frame.filename})"
    )
    if isinstance(error, KeyboardInterrupt):
        # The host shall also get the interrupt, but after this call, which would discard it: a new
        # thread waits for Python's lock until this call ends. It must end soon after this line.
        _thread.start_new_thread(_thread.interrupt_main, ())
    return text
