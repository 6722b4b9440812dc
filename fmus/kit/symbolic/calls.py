"""Record of the calls of a component's laws, and their values."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fmus.kit.component import Component


class Calls:
    """Recorder of the calls of a component's laws.

    Parameters
    ----------
    cls : type[Component]

    Attributes
    ----------
    instance : Component
        Instance whose calls are recorded.
    names : list of str
        Laws in the order of their first calls.
    values : dict of str to list
        Values of each law without arguments.
    """

    def __init__(self, cls: type[Component]):
        self.names: list[str] = []
        self.values: dict[str, list[Any]] = {}

        def get(instance: Any, name: str) -> Any:
            """Return an attribute, wrapping a law."""
            value = object.__getattribute__(instance, name)
            is_law = callable(value) and not name.startswith("_") and not hasattr(Component, name)
            return self._recorded(name, value) if is_law else value

        self.instance = type(cls.__name__, (cls,), {"__getattribute__": get})()

    def _recorded(self, name: str, law: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that calls a law and records the call."""

        def call(*arguments: Any) -> Any:
            if name not in self.names:
                self.names.append(name)
            value = law(*arguments)
            if not arguments:
                self.values.setdefault(name, []).append(value)
            return value

        return call
