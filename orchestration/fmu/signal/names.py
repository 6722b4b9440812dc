"""Names of variables in the words of a command: any text may be a name in somebody else's FMU."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence

_SIGN = r"\s*=\s*"


def split_assignment(text: str, known: Iterable[str]) -> tuple[str, str] | None:
    """Split ``name=value`` after the longest known name, else at the first ``=``.

    Parameters
    ----------
    text : str
    known : iterable of str
        Names, in which there may be such signs, too.

    Returns
    -------
    tuple of str, or None
        Name and value without outer spaces; None without a sign of equality.
    """
    plain, equals, value = (part.strip() for part in text.partition("="))
    if not equals:
        return None
    found = (plain, value)
    for name in known:
        if "=" in name and len(name) > len(found[0]):
            parts = [re.escape(part.strip()) for part in name.split("=")]
            match = re.fullmatch(_SIGN.join([*parts, "(.*)"]), text.strip(), re.DOTALL)
            if match:
                found = (name, match[1].strip())
    return found


def join_names(words: Sequence[str], known: Collection[str]) -> list[str]:
    """Return names from the words between commas: the longest known ones, with commas in them.

    Parameters
    ----------
    words : sequence of str
    known : collection of str

    Returns
    -------
    list of str
        A word that begins no known name stands for itself.
    """
    spelt = {_without_spaces(name): name for name in known}
    names: list[str] = []
    rest = list(words)
    while rest:
        for count in range(len(rest), 0, -1):
            name = spelt.get(_without_spaces(",".join(rest[:count])))
            if name is not None:
                break
        names.append(rest[0] if name is None else name)
        del rest[:count]
    return names


def _without_spaces(name: str) -> str:
    return re.sub(r"\s*,\s*", ",", name.strip())
