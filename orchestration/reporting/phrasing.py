"""Options as who reads of them writes them: in a shell, or in Python.

A message that names an option is made with `option`: ``--map U=voltage`` where the command line
runs, ``mapping={'U': 'voltage'}`` where somebody has imported the package. Python names an option
as its keyword argument is called; here is which flags are called otherwise.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

FLAGS = {
    "mapping": "--map",
    "settings": "--set",
    "kind": "--design",
    "path_orders": "--orders",
    "folder": "--out",
}
_METHODS = {"fmu": "fmu", "effect_out": "effect"}  # of a result, which are options in a shell
_shell = False


@contextmanager
def in_shell() -> Iterator[None]:
    """Name options as a shell has them while the context lasts."""
    global _shell
    before, _shell = _shell, True
    try:
        yield
    finally:
        _shell = before


def flag(name: str) -> str:
    """Return how an option is called on the command line."""
    return FLAGS.get(name, f"--{name.replace('_', '-')}")


def option(name: str, value: Any = None) -> str:
    """Return an option, with a value if there is one, as it is written.

    Parameters
    ----------
    name : str
        As Python has it.
    value : object, optional
        A text, a number, a switch, a list of names, or a dictionary of pairs.
    """
    if _shell:
        return _flag_with(name, value)
    if name in _METHODS:
        return f"{_METHODS[name]}({'' if value is None else repr(value)})"
    return f"{name}={'' if value is None else repr(value)}"


def _flag_with(name: str, value: Any) -> str:
    if value is None or value is True:
        return flag(name)
    if value is False:
        return flag(f"no_{name}")
    if isinstance(value, Mapping):
        pairs = (f"{key}={one}" for key, one in value.items())
        return " ".join(f"{flag(name)} {shlex.quote(pair)}" for pair in pairs)
    text = ",".join(map(str, value)) or "none" if isinstance(value, list | tuple) else str(value)
    return f"{flag(name)} {shlex.quote(text)}"
