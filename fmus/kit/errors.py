"""The exception for mistakes of a user, and the hint for a misspelt name."""

from __future__ import annotations

from collections.abc import Collection


class UserError(ValueError):
    """A mistake in what the user gave us, described in one readable line.

    The text names what is wrong, where (file, row, column or variable), which value it has and what
    is allowed. The command line prints it and exits with code 2; no traceback reaches the user.
    """


class DeclarationError(UserError):
    """A mistake in a declaration of a class body.

    Parameters
    ----------
    text : str
        With the names of class and variable.
    owner : str
        Name of the class.
    variable : str
    """

    def __init__(self, text: str, owner: str, variable: str):
        super().__init__(text)
        self.owner = owner
        self.variable = variable


def suggestion(name: str, known: Collection[str], few: int = 20) -> str:
    """Return a hint for a name that is not known.

    Parameters
    ----------
    name : str
        What was written.
    known : collection of str
        The names that exist.
    few : int
        Largest number of names that are listed where none is similar.

    Returns
    -------
    str
        ``" (did you mean R1?)"``, ``" (there are: R1, R2)"``, or empty; to append to a message.
    """
    # here, because this module travels inside Python FMUs, which need not wait for it
    import difflib

    folded = {word.casefold(): word for word in known}
    similar = difflib.get_close_matches(name.casefold(), list(folded), 1, 0.5)
    if similar:
        return f" (did you mean {folded[similar[0]]}?)"
    if 0 < len(known) <= few:
        return f" (there are: {', '.join(known)})"
    return ""
