"""The one exception a user is meant to see, and the help for a misspelt name."""

from __future__ import annotations

from collections.abc import Collection


class UserError(ValueError):
    """A mistake in what the user gave us, described in one readable line.

    The text names what is wrong, where (file, row, column or variable), which value it has and what is allowed.
    The command line prints it and exits with code 2; no traceback reaches the user.
    """


def suggestion(name: str, known: Collection[str], few: int = 20) -> str:
    """Help with a name that is not known.

    Parameters
    ----------
    name : str
        What was written.
    known : collection of str
        The names that exist.
    few : int
        Largest number of names that are listed where none is near.

    Returns
    -------
    str
        ``" (did you mean R1?)"``, ``" (there are: R1, R2)"``, or empty; to append to a message.
    """
    import difflib  # here, because this module travels inside Python FMUs, which need not wait for it

    folded = {word.casefold(): word for word in known}
    if near := difflib.get_close_matches(name.casefold(), list(folded), 1, 0.5):
        return f" (did you mean {folded[near[0]]}?)"
    return f" (there are: {', '.join(known)})" if 0 < len(known) <= few else ""
