"""Reading of experiments: from a TOML file, by the name of one that ships, or out of a result.

A system's file is read as the experiment that runs it as it is.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Sequence
from pathlib import Path, PureWindowsPath
from typing import TYPE_CHECKING, Any

from fmus.kit.errors import UserError, suggestion
from fmus.kit.files import is_file, is_folder
from orchestration.experiment.library import shipped
from orchestration.experiment.model import Experiment, NoiseTable, parse
from orchestration.experiment.stimulus import KINDS
from orchestration.experiment.values import read_toml
from orchestration.reporting import option
from orchestration.system.ssp import ENDINGS

if TYPE_CHECKING:
    import xarray

_TOML = ".toml"
_INNER = {  # keys that the entries of a table can have
    "inputs": {key for kind in KINDS for key in kind.model_fields},
    "noise": set(NoiseTable.model_fields),
}


def read(name_or_path: str, settings: Sequence[str] = ()) -> Experiment:
    """Read an experiment.

    Parameters
    ----------
    name_or_path : str
        Name of one that ships, a ``.toml`` file, a system (``.ssp``, ``.ssd``), or a result
        (``.nc``, ``.parquet``) whose experiment is wanted again. Inputs from files are then those
        that the result holds, so that the files need not be there any more. Of an incomplete result
        it is the part that was computed, unless there are settings.
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
    if not is_file(path):
        hint = suggestion(name_or_path, known) if not path.suffix else ""
        # by its path, which is there where the name is empty, too
        reason = "a folder" if is_folder(path) else "no such file or experiment"
        raise UserError(f"{path}: {reason}{hint}")
    given = _tables(path, not settings)
    for setting in settings:
        _set(given, setting)
    return parse(given, name_or_path, str(path.parent))


def is_result(path: Path) -> bool:
    """Return True for the file of a result, which can be made again and compared."""
    return is_file(path) and path.suffix.lower() not in (_TOML, *ENDINGS)


def _tables(path: Path, unchanged: bool) -> dict[str, Any]:
    """Return the tables of an experiment's file, of a system's or of a result's."""
    if path.suffix.lower() == _TOML:
        return read_toml(path)
    if path.suffix.lower() in ENDINGS:
        return {"system": path.name}
    return _from_result(path, unchanged)


def _from_result(path: Path, unchanged: bool) -> dict[str, Any]:
    """Return the tables of a result's experiment; unchanged, only the part that was computed."""
    from orchestration.experiment import results

    result = results.read(path)
    given: dict[str, Any] = json.loads(result.attrs["experiment"])
    is_part = unchanged and not result.attrs["complete"]
    if is_part:
        if result.time.size < 2:
            raise UserError(
                f"{path}: incomplete, with its first point only; there is nothing to repeat"
                f" ({option('settings')} starts anew)"
            )
        given["duration"] = float(result.time[-1])
    subject = given.get("system") or given["component"]
    if Path(subject).suffix.lower() in (".fmu", *ENDINGS) and not given.get("effects"):
        given.pop("runtime", None)  # a result names one for every subject; here nothing is built
    for name, stimulus in given.get("inputs", {}).items():
        # random levels and chirps of a shorter duration are others, not the beginning of these
        if stimulus["kind"] == "file" or is_part:
            given["inputs"][name] = {"kind": "file", "file": str(path.absolute()), "column": name}
    for table, key, _ in _files(given):
        beside = path.parent / PureWindowsPath(table[key]).name  # whatever system it was written on
        if not is_file(path.parent / table[key]) and is_file(beside):
            table[key] = str(beside.absolute())
    return given


def _files(given: dict[str, Any]) -> list[tuple[dict[str, Any], str, str]]:
    """Return where an experiment names files: the table, its key, and what the file is."""
    places = [(given, kind, kind) for kind in ("component", "system")]
    places += [
        (table, "file", f"record for {name}") for name, table in given.get("inputs", {}).items()
    ]
    return [place for place in places if Path(str(place[0].get(place[1]) or "")).suffix]


def files(experiment: Experiment) -> dict[str, Path]:
    """Return the files that an experiment reads, by what they are."""
    return {what: Path(table[key]) for table, key, what in _files(experiment.model_dump())}


def movable(result: xarray.Dataset, folder: Path) -> xarray.Dataset:
    """Name the files of a result's experiment that lie in a folder as they are seen from there.

    The result can then be moved together with them, and is the same wherever it was made.
    """
    given = json.loads(result.attrs["experiment"])
    for table, key, _ in _files(given):
        path = Path(table[key]).parent.resolve() / Path(table[key]).name
        if path.is_relative_to(folder.resolve()):
            table[key] = path.relative_to(folder.resolve()).as_posix()
    return result.assign_attrs(experiment=json.dumps(given))


def _set(given: dict[str, Any], setting: str) -> None:
    """Put a setting ``key=value`` into the tables of an experiment."""
    key, equals, text = (part.strip() for part in setting.partition("="))
    if not equals or not key or not text:
        raise UserError(
            f"{option('settings', setting)}: write key=value, e.g. duration=20s or R1=0.61"
        )
    place = _place(key, given)
    table: Any = given
    for part in place[:-1]:
        table = table.setdefault(part, {})
        if not isinstance(table, dict):
            raise UserError(
                f"{option('settings', {key: text})}: {part} is a value, not a table with keys"
            )
    table[place[-1]] = _value(text)


def _place(key: str, given: dict[str, Any]) -> list[str]:
    """Split a key at those of its dots that part tables; names of variables have dots, too.

    ``inputs.bench.current.value`` is a key of the table of the input ``bench.current``, but
    ``inputs.bench.current`` that input itself. What begins with no table is a parameter.
    """
    table, _, inner = key.partition(".")
    if table not in Experiment.model_fields:
        return ["parameters", key]
    if not inner:
        return [table]
    name, _, last = inner.rpartition(".")
    entries = given.get(table)
    has_entry = isinstance(entries, dict) and name in entries
    if name and (has_entry or last in _INNER.get(table, ())):
        return [table, name, last]
    return [table, inner]


def _value(text: str) -> Any:
    """Read a value as TOML does; what is none is a text, so that 610mohm needs no quotes."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text
