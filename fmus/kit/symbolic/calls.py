"""Record of the calls of a component's laws: the signals that they read, and their values."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

from fmus.kit.component import Component


class Calls:
    """Recorder of the calls of a component's laws, in their order.

    Parameters
    ----------
    cls : type[Component]
    signals : collection of str
        Inputs and states whose use is recorded.

    Attributes
    ----------
    one : Component
        Instance whose calls are recorded.
    reads : dict of str to set of str
        Signals that each law reads itself, not through another law.
    values : dict of str to list
        Values of each law without arguments.
    """

    def __init__(self, cls: type[Component], signals: Collection[str]):
        self.reads: dict[str, set[str]] = {}
        self.values: dict[str, list[Any]] = {}
        self._running: list[str] = []

        def get(instance: Any, name: str) -> Any:
            """Return an attribute, recording a signal and wrapping a law."""
            value = object.__getattribute__(instance, name)
            if name in signals:
                if self._running:
                    self.reads[self._running[-1]].add(name)
                return value
            is_law = callable(value) and not name.startswith("_") and not hasattr(Component, name)
            return self._recorded(name, value) if is_law else value

        self.instance = type(cls.__name__, (cls,), {"__getattribute__": get})()

    def _recorded(self, name: str, law: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that calls a law and records the call."""

        def call(*arguments: Any) -> Any:
            self._running.append(name)
            self.reads.setdefault(name, set())
            try:
                value = law(*arguments)
            finally:
                self._running.pop()
            if not arguments:
                self.values.setdefault(name, []).append(value)
            return value

        return call
