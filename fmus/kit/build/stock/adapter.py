"""The adapter that makes a component a slave of pythonfmu; a stock archive contains it.

It stands for the front-end in C of the Python build, and has the same memory (``fmi/engine.h``) and
the same :class:`fmus.kit.slave.Slave`, so that both compute the same. pythonfmu reports every
exception of the adapter as Fatal.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable
from functools import partial
from math import inf, isfinite
from typing import TYPE_CHECKING, Any, ClassVar

from pythonfmu import Boolean, Fmi2Slave, Integer, Real, String

if TYPE_CHECKING:
    from fmus.kit.component import Component
    from fmus.kit.declare import ParameterDeclaration

kept: list[dict[str, Any]] = []
_KINDS = {"real": Real, "integer": Integer, "boolean": Boolean}
# positions of the internals, behind the variables, in the order of fmi/engine.h
_START_TIME = 1
_TOLERANCE = 2
_PARAMETERS_CHANGED = 3
_SMALLEST_TOLERANCE = 1e-12


class ComponentSlave(Fmi2Slave):  # type: ignore[misc]
    """A slave of pythonfmu; the subclass in an archive names the component.

    Attributes
    ----------
    model : type[Component]
    create : callable
        Makes the :class:`fmus.kit.slave.Slave` for a memory; see
        :func:`fmus.kit.build.package.python_package`.
    """

    model: ClassVar[type[Component]]
    create: ClassVar[Callable[..., Any]]

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        layout = self.model.layout
        self.modelName = self.model.name
        self.first_input = len(layout.parameters)
        self.first_state = self.first_input + len(layout.inputs)
        self.first_output = self.first_state + len(layout.states) + len(layout.discretes)
        self.size = len(layout.names)
        index = {name: i for i, name in enumerate(layout.names)}
        # index of the parameter for the start value of each state
        self.starts = [index[layout.start_of[v.name]] for v in (*layout.states, *layout.discretes)]
        self.memory = self._new_memory()
        self.texts = [text.start for text in layout.texts]
        self.time = 0.0
        self.started = False
        self.stale = True  # whether outputs and derivatives must be computed before they are read
        self.slave = self.create(memoryview(self.memory), b"")
        self._restart()
        self._register_variables()

    def _new_memory(self) -> array[float]:
        """Return the memory of a new instance, in the order of ``fmi/engine.h``."""
        layout = self.model.layout
        defaults = [float(v.start) for v in (*layout.parameters, *layout.inputs)]
        computed = [0.0] * (self.size - self.first_state)
        # hint, start time, tolerance, parameters changed
        internals = [inf, 0.0, self.model.tolerance, 1.0]
        counters = [0.0] * len(layout.sampled)
        return array("d", [*defaults, *computed, *internals, *counters])

    def _register_variables(self) -> None:
        """Register the variables with pythonfmu, with their getters and setters."""
        layout = self.model.layout
        kinds = [_KINDS[v.type] for v in layout.variables] + [Real] * len(layout.states)
        for i, (name, kind) in enumerate(zip(layout.names, kinds, strict=True)):
            setter = partial(self._write, i) if i < self.first_state else None
            self.register_variable(
                kind(name, getter=partial(self._read, i), setter=setter), nested=False
            )
        for i, text in enumerate(layout.texts):
            read = partial(self.texts.__getitem__, i)
            write = partial(self.texts.__setitem__, i)
            self.register_variable(String(text.name, getter=read, setter=write), nested=False)

    def _restart(self) -> None:
        """Mark parameters as changed; before the end of initialization, restart the states."""
        self.memory[self.size + _PARAMETERS_CHANGED] = 1.0
        self.stale = True
        if not self.started:
            for i, start in enumerate(self.starts, self.first_state):
                self.memory[i] = self.memory[start]

    def _write(self, i: int, value: float) -> None:
        """Set a parameter or an input."""
        if not isfinite(value):
            raise ValueError(f"{self.vars[i].name} = {value} is not finite")
        if self.started and i < self.first_input:
            parameter = self.model.layout.parameters[i]
            if not parameter.tunable:
                raise ValueError(f"{parameter.name} cannot be set after initialization")
            self._check_range(parameter, value)
        self.memory[i] = float(value)
        self.stale = True
        if i < self.first_input:
            self._restart()

    def _read(self, i: int) -> float:
        """Return a value, computing outputs and derivatives if anything has changed."""
        if self.stale and i >= self.first_output:
            self._check_result(
                self.slave.evaluate(self.time) or self.slave.differentiate(self.time)
            )
            self.stale = False
        return self.memory[i]

    def _check_range(self, parameter: ParameterDeclaration, value: float) -> None:
        """Raise an error for a parameter out of its range."""
        if not parameter.min <= value <= parameter.max:
            self._check_result(
                f"parameter '{parameter.name}' = {value:.10g} {parameter.unit} is outside"
                f" [{parameter.min:g}, {parameter.max:g}]"
            )

    def _check_result(self, message: str | None) -> None:
        """Raise an error for a message, or for a value that is not finite.

        A % is doubled, because pythonfmu passes the text on as a format.
        """
        values = self.memory[self.first_input : self.size]
        if message or not all(map(isfinite, values)):
            raise RuntimeError(
                (message or f"a value is not finite at {self.time:.10g} s").replace("%", "%%")
            )

    def setup_experiment(
        self, start_time: float, stop_time: float | None, tolerance: float | None
    ) -> None:
        """Take the start time (s), and a tolerance that asks for more accuracy than the default."""
        self.time = start_time
        self.memory[self.size + _START_TIME] = start_time
        if tolerance:
            bounded = min(max(tolerance, _SMALLEST_TOLERANCE), self.model.tolerance)
            self.memory[self.size + _TOLERANCE] = bounded

    def exit_initialization_mode(self) -> None:
        """Check the ranges of parameters, and initialize the slave."""
        for parameter, value in zip(self.model.layout.parameters, self.memory, strict=False):
            self._check_range(parameter, value)
        self._check_result(self.slave.initialize())
        self.started = True
        self.stale = True

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance by a step in s.

        An error is raised, because pythonfmu ends a simulation without a message if a step returns
        False.
        """
        self._check_result(self.slave.advance(current_time, step_size))
        self.time = current_time + step_size
        self.stale = True
        return True

    def _get_fmu_state(self) -> dict[str, Any]:
        """Return a copy of the state of the instance."""
        return {
            "memory": list(self.memory),
            "texts": list(self.texts),
            "at": [self.time, self.started],
        }

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        """Restore a copy of the state of the instance."""
        self.memory[:] = array("d", state["memory"])
        self.texts[:] = state["texts"]
        self.time, self.started = state["at"]
        self.memory[self.size + _PARAMETERS_CHANGED] = 1.0
        self.stale = True
