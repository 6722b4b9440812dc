"""Where experiments come from: a TOML file, the name of one that ships, or a result, which holds its own."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fmus.kit.errors import UserError, suggestion

from .catalogue import shipped
from .model import Experiment, Noise, parse
from .stimulus import KINDS

_INNER = {"inputs": {key for kind in KINDS for key in kind.model_fields}, "noise": set(Noise.model_fields)}


def read(name_or_path: str, settings: Sequence[str] = ()) -> Experiment:
    """Read an experiment.

    Parameters
    ----------
    name_or_path : str
        Name of one that ships, a ``.toml`` file, or a result (``.nc``, ``.parquet``) whose experiment is wanted again.
        Inputs from files are then those that the result holds, so that the files need not be there any more.
    settings : sequence of str
        ``key=value`` over what the file says: a key of the file with dots between table and key
        (``inputs.current.amplitude=0.5A``), or a parameter (``R1=610mohm``).

    Raises
    ------
    UserError
        If there is no such experiment, or something in it is wrong: one line.
    """
    known = shipped()
    path = known.get(name_or_path, Path(name_or_path))
    if not path.is_file():
        hint = suggestion(name_or_path, known) if not path.suffix else ""
        raise UserError(f"{name_or_path}: {'a folder' if path.is_dir() else 'no such file or experiment'}{hint}")
    given = _from_toml(path) if path.suffix.lower() == ".toml" else _from_result(path)
    for setting in settings:
        _set(given, setting)
    return parse(given, name_or_path, str(path.parent))


def _from_toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: not a text in UTF-8") from error
    except tomllib.TOMLDecodeError as error:
        raise UserError(f"{path}: {str(error)[0].lower()}{str(error)[1:]}") from error
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error


def _from_result(path: Path) -> dict[str, Any]:
    from orchestration import results

    given: dict[str, Any] = json.loads(results.read(path).attrs["experiment"])
    for name, stimulus in given.get("inputs", {}).items():
        if stimulus["kind"] == "file":
            given["inputs"][name] = {"kind": "file", "file": str(path.absolute()), "column": name}
    return given


def _set(given: dict[str, Any], setting: str) -> None:
    key, equals, text = (part.strip() for part in setting.partition("="))
    if not equals or not key or not text:
        raise UserError(f"--set {setting!r}: write key=value, e.g. duration=20s or R1=0.61")
    place = _place(key, given)
    table: Any = given
    for part in place[:-1]:
        table = table.setdefault(part, {})
        if not isinstance(table, dict):
            raise UserError(f"--set {setting}: {part} is a value, not a table with keys")
    table[place[-1]] = _value(text)


def _place(key: str, given: dict[str, Any]) -> list[str]:
    """Split a key at those of its dots that part tables; names of variables have dots of their own."""
    table, _, rest = key.partition(".")
    if table not in Experiment.model_fields:
        return ["parameters", key]
    name, _, last = rest.rpartition(".")
    there = given.get(table)
    if name and ((isinstance(there, dict) and name in there) or last in _INNER.get(table, ())):
        return [table, name, last]
    return [table, rest] if rest else [table]


def _value(text: str) -> Any:
    """Read a value as TOML does; what is none is a text, so that 610mohm needs no quotes."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text
