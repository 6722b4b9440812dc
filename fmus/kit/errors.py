"""The exception for mistakes of a user, and a hint for misspelt names."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import TypeVar

Value = TypeVar("Value")


class UserError(ValueError):
    """A mistake in a user's input, described in one line.

    The text says what is wrong, where (file, row, column or variable), which value is there and
    what is allowed. The command line prints it and exits with code 2, without a traceback.
    """


class DeclarationError(UserError):
    """A mistake in a declaration of a class body.

    Parameters
    ----------
    text : str
        Message, with the names of class and variable.
    owner : str
        Name of the class.
    variable : str
    """

    def __init__(self, text: str, owner: str, variable: str):
        super().__init__(text)
        self.owner = owner
        self.variable = variable


@contextmanager
def error_context(where: str) -> Iterator[None]:
    """Begin the message of a UserError that is raised in this context with a place or a name."""
    try:
        yield
    except UserError as error:
        raise UserError(f"{where}: {error}") from error


def find(name: str, known: Mapping[str, Value], missing: str) -> Value:
    """Return the value of a name.

    Parameters
    ----------
    name : str
    known : Mapping of str to object
    missing : str
        Beginning of the message if there is none, such as ``pump: no input``.

    Raises
    ------
    UserError
        With a similar name, if there is one.
    """
    if name not in known:
        raise UserError(f"{missing} named {name!r}{suggestion(name, known)}")
    return known[name]


def suggestion(name: str, known: Collection[str], few: int = 20) -> str:
    """Return a hint for a name that is not known.

    Parameters
    ----------
    name : str
        The unknown name.
    known : collection of str
        The names that exist.
    few : int
        Largest number of names that are listed if none is similar.

    Returns
    -------
    str
        ``" (did you mean R1?)"``, ``" (there are: R1, R2)"``, or empty; to append to a message.
    """
    # imported here, because Python FMUs contain this module and must load quickly
    import difflib

    folded = {word.casefold(): word for word in known}
    similar = difflib.get_close_matches(name.casefold(), list(folded), 1, 0.5)
    if similar:
        return f" (did you mean {folded[similar[0]]}?)"
    if 0 < len(known) <= few:
        return f" (there are: {', '.join(known)})"
    return ""
