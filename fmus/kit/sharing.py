"""Laws that are computed once in an evaluation although several laws call them.

On floats a law that six rates call would be computed six times. A graph does not need this: common
subexpressions are eliminated there.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any


def shared(law: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Decorate a law so that it is computed once in an evaluation.

    Its value is stored in ``_kept`` of the component, which is a dict while an integrator or a
    Python FMU evaluates laws at one set of values. Otherwise it is None, and every call computes.
    An effect that overrides the law calls the shared law through ``super()``.

    Parameters
    ----------
    law : callable
        A method without arguments whose result is not modified.

    Returns
    -------
    callable
        The method that stores its value.
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
    """Return whether a class has shared laws, inherited ones included."""
    return any(hasattr(law, "is_shared") for part in cls.__mro__ for law in vars(part).values())
