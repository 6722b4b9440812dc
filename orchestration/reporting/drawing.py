"""Pictures and pages of results, by their type.

A result is a value and does not know how it is shown: the modules ``picture`` and ``page`` beside
the one that defines its class register functions for it. They are loaded when a result of that
class is first shown, as most commands show none.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import singledispatch
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from fmus.kit import UserError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from orchestration.reporting.html import Page


@singledispatch
def draw(result: object) -> Figure:
    """Draw a result with the function that is registered for its type.

    Parameters
    ----------
    result : object

    Returns
    -------
    matplotlib.figure.Figure
        Made without pyplot.

    Raises
    ------
    UserError
        If there is nothing to draw.
    """
    figure: Figure = registered(draw, type(result), "picture")(result)
    return figure


@singledispatch
def make_page(result: object, command: str = "") -> Page:
    """Make the page of a result with the function that is registered for its type.

    Parameters
    ----------
    result : object
    command : str
        That made the result, to be repeated.

    Raises
    ------
    UserError
        If there is no page of such a result.
    """
    page: Page = registered(make_page, type(result), "page")(result, command)
    return page


def registered(functions: Any, kind: type, module: str) -> Callable[..., Any]:
    """Return the function for a type, registered by a module beside one of its classes."""
    for cls in kind.__mro__:
        package = cls.__module__.rpartition(".")[0]
        if package and find_spec(f"{package}.{module}"):
            import_module(f"{package}.{module}")
        function: Callable[..., Any] = functions.dispatch(kind)
        if function is not functions.dispatch(object):
            return function
    raise UserError(f"{kind.__name__}: this has no {module}")
