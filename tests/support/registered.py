"""Packages of components that are registered for a while, as if they were installed."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

from fmus.kit import registry

_CACHED = (registry.packages, registry.models, registry.component, registry._merged)


class _EntryPoint:
    """An entry point that gives an object, or raises it."""

    dist = None

    def __init__(self, name: str, package: Any):
        self.name = name
        self.module = name
        self.value = f"{name}:PACKAGE"
        self._package = package

    def load(self) -> Any:
        if isinstance(self._package, Exception):
            raise self._package
        return self._package


@contextmanager
def registered(**packages: Any) -> Iterator[None]:
    """Register packages by name, beside those that are installed.

    Parameters
    ----------
    packages : ComponentPackage, or Exception
        What loading the entry point of this name gives, or raises.
    """
    installed = importlib.metadata.entry_points
    others = [_EntryPoint(name, package) for name, package in packages.items()]

    def entry_points(group: str) -> list[Any]:
        return [*installed(group=group), *(others if group == registry.GROUP else ())]

    with patch("importlib.metadata.entry_points", entry_points):
        _forget()
        try:
            yield
        finally:
            _forget()


def _forget() -> None:
    for function in _CACHED:
        function.cache_clear()
