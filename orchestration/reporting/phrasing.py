"""Names of options in messages: as flags for the shell, or as keyword arguments for Python.

Messages name options through `option`, which returns ``--map U=voltage`` on the command line and
``mapping={'U': 'voltage'}`` in Python. Options have the names of their keyword arguments; `FLAGS`
lists the flags that differ from them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from fmus.kit import quoting

FLAGS = {
    "mapping": "--map",
    "settings": "--set",
    "controller_settings": "--controller-set",
    "units": "--unit",
    "kind": "--design",
    "path_orders": "--orders",
    "folder": "--out",
    "begin": "--from",
    "end": "--to",
}
# options of the shell that are methods of a result in Python
_METHODS = {"fmu": "fmu", "effect_out": "effect"}
_shell = False


@contextmanager
def in_shell() -> Iterator[None]:
    """Name options by their flags while the context lasts."""
    global _shell
    previous = _shell
    _shell = True
    try:
        yield
    finally:
        _shell = previous


def flag(name: str) -> str:
    """Return the flag of an option on the command line."""
    return FLAGS.get(name, f"--{name.replace('_', '-')}")


def option(name: str, value: Any = None) -> str:
    """Return an option, with its value if given, as users type it.

    Parameters
    ----------
    name : str
        Name of the keyword argument in Python.
    value : object, optional
        A text, number, truth value, list of names, or dictionary.
    """
    if _shell:
        return _flag_with(name, value)
    text = "" if value is None else repr(value)
    return f"{_METHODS[name]}({text})" if name in _METHODS else f"{name}={text}"


def _flag_with(name: str, value: Any) -> str:
    """Return an option as a flag, with its value quoted for the shell."""
    if value is None or value is True:
        return flag(name)
    if value is False:
        return flag(f"no_{name}")
    if isinstance(value, Mapping):
        return " ".join(f"{flag(name)} {quoting.shell([f'{key}={v}'])}" for key, v in value.items())
    text = str(value)
    if isinstance(value, list | tuple):
        text = ",".join(map(str, value)) or "none"
    return f"{flag(name)} {quoting.shell([text])}"
