"""Laws that are computed once where many laws of one evaluation use them.

On floats a law that six rates call is computed six times. A graph has no need of this: there,
what is the same is found by itself.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any


def shared(law: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Let a law be computed once in an evaluation.

    Its value is kept in ``_kept`` of the component, a dict while an integrator or a Python FMU
    evaluates laws at one set of values, and None otherwise: then every call computes. An effect
    that overrides the law shares the value below it, through ``super()``.

    Parameters
    ----------
    law : callable
        A method without arguments whose result nobody changes.

    Returns
    -------
    callable
    """

    @wraps(law)
    def once(self: Any) -> Any:
        kept = self._kept
        if kept is None:
            return law(self)
        if law not in kept:
            kept[law] = law(self)
        return kept[law]

    vars(once)["is_shared"] = True
    return once


def has_shared_laws(cls: type) -> bool:
    """Return whether a class or one of its bases has laws that are shared."""
    return any(hasattr(law, "is_shared") for part in cls.__mro__ for law in vars(part).values())
