"""Components of the rig, each a subpackage; ``kit`` has the tools to write them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from .kit.registry import component, components, effects, models, proxies

if TYPE_CHECKING:
    COMPONENTS: dict[str, str]
    PROXIES: dict[str, str]
    MODELS: dict[str, str]

__all__ = ["COMPONENTS", "MODELS", "PROXIES", "component", "effects"]
_REGISTERED: Mapping[str, Callable[[], dict[str, str]]] = {
    "COMPONENTS": components,
    "PROXIES": proxies,
    "MODELS": models,
}


def __getattr__(name: str) -> Any:
    """Read the registry when one of its dictionaries is first used."""
    if name not in _REGISTERED:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return _REGISTERED[name]()
