"""The calls of a component's laws: which law reads which signal, and what each gives."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

from fmus.kit.component import Component


class Calls:
    """The calls of the laws of a component, in their order.

    Parameters
    ----------
    cls : type[Component]
    signals : collection of str
        Inputs and states that laws may read.

    Attributes
    ----------
    one : Component
        An instance whose laws are followed.
    reads : dict of str to set of str
        The signals that every law reads by itself.
    values : dict of str to list
        What every law gave where it takes no arguments.
    """

    def __init__(self, cls: type[Component], signals: Collection[str]):
        self.reads: dict[str, set[str]] = {}
        self.values: dict[str, list[Any]] = {}
        self._running: list[str] = []

        def get(one: Any, name: str) -> Any:
            value = object.__getattribute__(one, name)
            if name in signals:
                if self._running:
                    self.reads[self._running[-1]].add(name)
                return value
            is_law = callable(value) and not name.startswith("_") and not hasattr(Component, name)
            return self._followed(name, value) if is_law else value

        self.one = type(cls.__name__, (cls,), {"__getattribute__": get})()

    def _followed(self, name: str, law: Callable[..., Any]) -> Callable[..., Any]:
        """Return a law whose calls are noted."""

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
