"""Texts of others within what is written here: a function for each language.

Names, units, descriptions and file names may hold anything. Python has `repr` and `ascii` for them,
XML `xml.etree`, JSON `json`, CSV `csv`; C and Modelica are written in one module each, which has
the function of its language (`symbolic.codegen`, `modelica.names`).
"""

from __future__ import annotations

import html as standard
import re
import shlex
import unicodedata
from collections.abc import Iterable
from keyword import iskeyword
from pathlib import Path

from .errors import UserError

# as they are written where a keyboard lacks them; others lose their accents
_SPELLED = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "æ": "ae", "ø": "oe"}) | (
    str.maketrans({"Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "Æ": "Ae", "Ø": "Oe"})
)
# GREEK SMALL LETTER THETA, LATIN CAPITAL LETTER L WITH STROKE
_LETTER = re.compile(r"\w+ (SMALL|CAPITAL) LETTER (\w+)(?: WITH .*)?")
_BARE = frozenset("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-")


def visible(text: str, keep: str = "") -> str:
    """Return a text for people, with escapes of Python for characters that are not printable.

    These move the cursor of a terminal, turn the direction of writing, cannot be seen, or are bytes
    of a file name that are no text.

    Parameters
    ----------
    text : str
    keep : str
        Characters that stay, such as ends of lines.
    """
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() or c in keep else c.encode("unicode_escape").decode() for c in text
    )


def line(text: str) -> str:
    """Return a text for people in one line, see `visible`."""
    return visible(" ".join(text.split()))


def identifier(text: str, stem: str) -> str:
    """Return a name in Python, C and FMI that resembles a text; letters are spelled in ASCII.

    Different texts may have the same name.

    Parameters
    ----------
    text : str
    stem : str
        Stands ahead of what is no name by itself, such as a number or a keyword.
    """
    composed = unicodedata.normalize("NFC", text).translate(_SPELLED)
    spelled = ""
    for character in unicodedata.normalize("NFKD", composed):
        letter = _LETTER.fullmatch(unicodedata.name(character, ""))
        if letter:
            spelled += letter[2].lower() if letter[1] == "SMALL" else letter[2].capitalize()
        elif not unicodedata.combining(character):
            spelled += character
    plain = re.sub(r"\W", "_", spelled, flags=re.ASCII).strip("_")
    is_name = plain.isidentifier() and not any(map(iskeyword, (plain, plain.capitalize())))
    return plain if is_name else f"{stem}_{plain}".strip("_")


def html(text: str) -> str:
    """Return a text for HTML, as contents of an element or as the value of an attribute."""
    return standard.escape(visible(text, keep="\n"))


def shell(words: Iterable[str | Path]) -> str:
    """Return a command for a shell of POSIX; a file whose name starts with a dash is no option."""
    return shlex.join(
        f"./{word}" if isinstance(word, Path) and str(word).startswith("-") else str(word)
        for word in words
    )


def words(command: str) -> list[str]:
    """Return the words of a command, as `shell` wrote them.

    Raises
    ------
    UserError
        If a quotation is not closed.
    """
    try:
        return shlex.split(command)
    except ValueError as error:
        raise UserError(f"{line(command)}: {error}") from error


def control(names: Iterable[str]) -> list[str]:
    """Return names of signals for python-control, where full stops become slashes."""
    return [name.replace(".", "/") for name in names]


def toml(text: str) -> str:
    """Return a basic string of TOML 1.0.

    Raises
    ------
    UserError
        If the text has bytes of a file name that are no text, which TOML cannot hold.
    """
    if any("\ud800" <= c <= "\udfff" for c in text):
        raise UserError(f"{visible(text)}: bytes that are no text cannot stand in a file of TOML")
    quoted = text.replace("\\", "\\\\").replace('"', '\\"')
    escaped = (c if c.isprintable() else rf"\U{ord(c):08X}" for c in quoted)
    return f'"{"".join(escaped)}"'


def toml_key(name: str) -> str:
    """Return a key of TOML 1.0: bare if it can be, otherwise quoted."""
    return name if name and _BARE.issuperset(name) else toml(name)
