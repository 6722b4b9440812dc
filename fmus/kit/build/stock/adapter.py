"""A component as a slave of pythonfmu: the adapter that travels in a stock archive.

It does for pythonfmu what the front-end in C does for the Python build, over the same memory (``fmi2/engine.h``) and
the same :class:`fmus.kit.slave.Slave`, so that both compute the same. What it raises, pythonfmu reports as Fatal.
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

kept: list[dict[str, Any]] = []
_KINDS = {"real": Real, "integer": Integer, "boolean": Boolean}


class ComponentSlave(Fmi2Slave):  # type: ignore[misc]
    """One instance; the class that an archive defines says of which component.

    Attributes
    ----------
    model : type[Component]
    create : callable
        Makes the :class:`fmus.kit.slave.Slave` over a memory; see :func:`fmus.kit.build.package.python_package`.
    """

    model: ClassVar[type[Component]]
    create: ClassVar[Callable[..., Any]]

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.modelName, layout = self.model.name, self.model.layout
        self.first_input = len(layout.parameters)
        self.first_state = self.first_input + len(layout.inputs)
        self.first_output = self.first_state + len(layout.states) + len(layout.discretes)
        self.size, index = len(layout.names), {name: i for i, name in enumerate(layout.names)}
        self.starts = [index[layout.start_of[v.name]] for v in (*layout.states, *layout.discretes)]
        values = [float(v.start) for v in (*layout.parameters, *layout.inputs)]
        values += [0.0] * (self.size - self.first_state)
        # hint, start time, tolerance, parameters changed, and a counter for each sampled group
        self.memory = array(
            "d", [*values, inf, 0.0, self.model.tolerance, 1.0, *(0.0 for _ in layout.sampled)]
        )
        self.texts = [text.start for text in layout.texts]
        self.time, self.started, self.stale = 0.0, False, True
        self.slave = self.create(memoryview(self.memory), b"")
        self._restart()
        kinds = [_KINDS[v.type] for v in layout.variables] + [Real] * len(layout.states)
        for i, (name, kind) in enumerate(zip(layout.names, kinds, strict=True)):
            setter = partial(self._write, i) if i < self.first_state else None
            self.register_variable(
                kind(name, getter=partial(self._read, i), setter=setter), nested=False
            )
        for i, text in enumerate(layout.texts):
            ends = partial(self.texts.__getitem__, i), partial(self.texts.__setitem__, i)
            self.register_variable(String(text.name, getter=ends[0], setter=ends[1]), nested=False)

    def _restart(self) -> None:
        """States follow their start parameters until initialization ends; nothing is known of parameters any more."""
        self.memory[self.size + 3], self.stale = 1.0, True
        if not self.started:
            for i, start in enumerate(self.starts, self.first_state):
                self.memory[i] = self.memory[start]

    def _write(self, i: int, value: float) -> None:
        if not isfinite(value) or (self.started and i < self.first_input):
            raise ValueError(
                f"{self.vars[i].name} = {value} is not finite, or a parameter after initialization"
            )
        self.memory[i], self.stale = float(value), True
        if i < self.first_input:
            self._restart()

    def _read(self, i: int) -> float:
        if self.stale and i >= self.first_output:
            self._checked(self.slave.evaluate(self.time) or self.slave.differentiate(self.time))
            self.stale = False
        return self.memory[i]

    def _checked(self, message: str | None) -> None:
        """Raise what went wrong, a % doubled: pythonfmu hands the text on as a format."""
        values = self.memory[self.first_input : self.size]
        if message or not all(map(isfinite, values)):
            raise RuntimeError(
                (message or f"a value is not finite at {self.time:.10g} s").replace("%", "%%")
            )

    def setup_experiment(
        self, start_time: float, stop_time: float | None, tolerance: float | None
    ) -> None:
        """Take times in s, and a relative tolerance that may ask for more accuracy than the component's own."""
        self.time = self.memory[self.size + 1] = start_time
        if tolerance:
            self.memory[self.size + 2] = min(max(tolerance, 1e-12), self.model.tolerance)

    def exit_initialization_mode(self) -> None:
        """Refuse parameters out of range, and begin."""
        for v, value in zip(self.model.layout.parameters, self.memory, strict=False):
            if not v.min <= value <= v.max:
                self._checked(
                    f"parameter '{v.name}' = {value:.10g} {v.unit} is outside [{v.min:g}, {v.max:g}]"
                )
        self._checked(self.slave.initialize())
        self.started = self.stale = True

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance by a step in s; an error is raised, for a step that is declined ends a simulation without a word."""
        self._checked(self.slave.advance(current_time, step_size))
        self.time, self.stale = current_time + step_size, True
        return True

    def _get_fmu_state(self) -> dict[str, Any]:
        return {
            "memory": list(self.memory),
            "texts": list(self.texts),
            "at": [self.time, self.started],
        }

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        self.memory[:], self.texts[:] = array("d", state["memory"]), state["texts"]
        (self.time, self.started), self.memory[self.size + 3], self.stale = state["at"], 1.0, True
