"""Pictures and pages of results, by their type.

A result is a value that does not draw itself: functions for its class are registered by the modules
``picture`` and ``page`` of the package that defines the class. They are loaded when a result of the
class is first shown, because most commands show none.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import singledispatch
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
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
        The command that made the result, for the section on reproduction.

    Raises
    ------
    UserError
        If results of this type have no page.
    """
    page: Page = registered(make_page, type(result), "page")(result, command)
    return page


def write_page(result: object, path: str | Path, command: str = "") -> Path:
    """Write the page of a result.

    Parameters
    ----------
    result : object
    path : str or Path
        An ``.html`` file.
    command : str
        The command that made the result, for the section on reproduction.

    Returns
    -------
    Path
        That of the file.

    Raises
    ------
    UserError
        If results of this type have no page, the file cannot be written, or its name does not end
        in ``.html`` or ``.htm``.
    """
    target = Path(path)
    if target.suffix.lower() not in (".html", ".htm"):
        raise UserError(f"{target}: the name of a report ends in .html")
    make_page(result, command).write(target)
    return target


def registered(functions: Any, kind: type, module: str) -> Callable[..., Any]:
    """Import the module that registers a function for a type, and return the function.

    Parameters
    ----------
    functions : callable
        A function of `functools.singledispatch`.
    kind : type
    module : str
        Name of that module, in the package of the type or of one of its bases.

    Raises
    ------
    UserError
        If no function is registered.
    """
    for cls in kind.__mro__:
        package = cls.__module__.rpartition(".")[0]
        if package and find_spec(f"{package}.{module}"):
            import_module(f"{package}.{module}")
        function: Callable[..., Any] = functions.dispatch(kind)
        if function is not functions.dispatch(object):
            return function
    raise UserError(f"{kind.__name__}: this has no {module}")
