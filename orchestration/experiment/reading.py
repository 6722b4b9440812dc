"""Reading of experiments: from a TOML file, by the name of one that ships, or from a result.

The file of a system is read as the experiment that runs this system with its own values.
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
_KEYS_OF_ENTRIES = {  # by table
    "inputs": {key for kind in KINDS for key in kind.model_fields},
    "noise": set(NoiseTable.model_fields),
}


def read(name_or_path: str, settings: Sequence[str] = ()) -> Experiment:
    """Read an experiment.

    Parameters
    ----------
    name_or_path : str
        Name of one that ships, a ``.toml`` file, a system (``.ssp``, ``.ssd``), or a result
        (``.nc``, ``.parquet``) whose experiment is repeated. Inputs from files are then read from
        the result, so that these files are not needed. An incomplete result gives the experiment
        of its computed part, unless there are settings.
    settings : sequence of str
        ``key=value``, which replace values of the file: a key with dots between table and key
        (``inputs.current.amplitude=0.5A``), or a parameter (``R1=610mohm``).

    Raises
    ------
    UserError
        If there is no such experiment, or a key or value in it is wrong.
    """
    known = shipped()
    path = known.get(name_or_path, Path(name_or_path))
    if not is_file(path):
        hint = suggestion(name_or_path, known) if not path.suffix else ""
        # the path, as the name may be empty
        reason = "a folder" if is_folder(path) else "no such file or experiment"
        raise UserError(f"{path}: {reason}{hint}")
    given = _read_tables(path, not settings)
    for setting in settings:
        _set(given, setting)
    return parse(given, name_or_path, str(path.parent))


def is_result(path: Path) -> bool:
    """Return True for the file of a result, which can be repeated and compared."""
    return is_file(path) and path.suffix.lower() not in (_TOML, *ENDINGS)


def _read_tables(path: Path, unchanged: bool) -> dict[str, Any]:
    """Return the tables of an experiment's file, of a system's or of a result's."""
    if path.suffix.lower() == _TOML:
        return read_toml(path)
    if path.suffix.lower() in ENDINGS:
        return {"system": path.name}
    return _tables_of_result(path, unchanged)


def _tables_of_result(path: Path, unchanged: bool) -> dict[str, Any]:
    """Return the tables of a result's experiment; with `unchanged`, of its computed part only.

    Inputs from files are read from the result. Other files are taken from its folder if they are
    not where they were.
    """
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
        given.pop("runtime", None)  # a result always names one; FMUs from files are not built
    for name, stimulus in given.get("inputs", {}).items():
        # random levels and chirps of a shorter duration are no beginning of the longer ones
        if stimulus["kind"] == "file" or is_part:
            given["inputs"][name] = {"kind": "file", "file": str(path.absolute()), "column": name}
    for table, key, _ in _file_references(given):
        # PureWindowsPath splits paths of Windows and of POSIX
        neighbour = path.parent / PureWindowsPath(table[key]).name
        if not is_file(path.parent / table[key]) and is_file(neighbour):
            table[key] = str(neighbour.absolute())
    return given


def _file_references(given: dict[str, Any]) -> list[tuple[dict[str, Any], str, str]]:
    """Return the references to files in an experiment: table, key and role of each file."""
    references = [(given, kind, kind) for kind in ("component", "system")]
    references += [
        (table, "file", f"record for {name}") for name, table in given.get("inputs", {}).items()
    ]
    # names of components, and tables without a file, have no suffix
    return [(t, key, role) for t, key, role in references if Path(str(t.get(key) or "")).suffix]


def files(experiment: Experiment) -> dict[str, Path]:
    """Return the files that an experiment reads, by their role."""
    return {
        role: Path(table[key]) for table, key, role in _file_references(experiment.model_dump())
    }


def movable(result: xarray.Dataset, folder: Path) -> xarray.Dataset:
    """Return a result in which the files of its experiment have paths relative to a folder.

    This holds for files in the folder; the result can then be moved together with them.
    """
    given = json.loads(result.attrs["experiment"])
    for table, key, _ in _file_references(given):
        path = Path(table[key]).parent.resolve() / Path(table[key]).name
        if path.is_relative_to(folder.resolve()):
            table[key] = path.relative_to(folder.resolve()).as_posix()
    return result.assign_attrs(experiment=json.dumps(given))


def _set(given: dict[str, Any], setting: str) -> None:
    """Set a value in the tables of an experiment from a text ``key=value``."""
    key, equals, text = (part.strip() for part in setting.partition("="))
    if not equals or not key or not text:
        raise UserError(
            f"{option('settings', setting)}: write key=value, e.g. duration=20s or R1=0.61"
        )
    *tables, last = _split_key(key, given)
    table: Any = given
    for name in tables:
        table = table.setdefault(name, {})
        if not isinstance(table, dict):
            raise UserError(
                f"{option('settings', {key: text})}: {name} is a value, not a table with keys"
            )
    value = _parse_value(text)
    if tables == ["parameters"] and value == text and "=" in text:
        # of a name or of a text, which only the model can tell
        last, value = (part.strip() for part in f"{last}={text}".rsplit("=", 1))
    table[last] = value


def _split_key(key: str, given: dict[str, Any]) -> list[str]:
    """Split a key into the names of tables and the last key; names of variables have dots, too.

    ``inputs.bench.current.value`` is a key of the table of the input ``bench.current``, but
    ``inputs.bench.current`` is that input itself. A key in no table is a parameter.
    """
    table, _, inner = key.partition(".")
    if table not in Experiment.model_fields:
        return ["parameters", key]
    if not inner:
        return [table]
    name, _, last = inner.rpartition(".")
    entries = given.get(table)
    has_entry = isinstance(entries, dict) and name in entries
    if name and (has_entry or last in _KEYS_OF_ENTRIES.get(table, ())):
        return [table, name, last]
    return [table, inner]


def _parse_value(text: str) -> Any:
    """Parse a value as TOML, or else keep it as a text, so that 610mohm needs no quotes."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text
