"""Records from Python: ``ppy.read_record``."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from fmus.kit import UserError
from orchestration.api.declaration import takes
from orchestration.api.options import MappingOption
from orchestration.api.simulation import as_measured
from orchestration.fmu import Model
from orchestration.identify import read_for, read_runs_for
from orchestration.records import Arrays, Record, record_labels
from orchestration.reporting import option

Data = Record | str | Path | Arrays
Records = Data | Sequence[Data]


@takes(MappingOption)
def read_record(
    path: str | Path | Arrays,
    model: Model | str | Path | None = None,
    mapping: Mapping[str, str] | None = None,
) -> Record:
    """Read a measured record: CSV, Parquet, LabVIEW TDMS or text, MATLAB, a DataFrame, arrays.

    Repairs of faulty data are listed in ``record.repairs``.

    Parameters
    ----------
    path : str, Path, DataFrame or Mapping of str to array_like, shape (n,)
        A file from an instrument, or columns by ``name [unit]``. One column is the time; in a
        DataFrame it may be the index.
    model : Model, str or Path, optional
        Model with these signals: a component, an FMU file, ``path/to/file.py:Class``, or a result
        of `find_model`; or a system, by its name or its ``.ssp`` file. By default the first of
        ``ppy list``.

    Returns
    -------
    Record
        Time in s, signals in the model's units.

    Raises
    ------
    UserError
        If the file cannot be read, with its row and the reason, or has none of the model's outputs.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> from demonstrations.records import draw, write
    >>> write(draw(None, seed=1, duration=60.0), "clean.csv")
    >>> record = ppy.read_record("clean.csv", model="ppy_actuator")
    >>> sorted(record.signals)
    ['current', 'displacement', 'force', 'voltage']
    >>> record.repairs
    []
    """
    return read_for(as_measured(model), _source(path), mapping)


def _source(data: str | Path | Arrays) -> Path | Arrays:
    return Path(data) if isinstance(data, str | Path) else data


def one_record(records: Records) -> Record | Path | Arrays:
    """Return the only record, as it was given.

    Raises
    ------
    UserError
        If there are several.
    """
    first, *others = _listed(records)
    if others:
        raise UserError(f"a system is diagnosed on one record, and there are {1 + len(others)}")
    return first if isinstance(first, Record) else _source(first)


def matching_runs(
    records: Records,
    model: Model,
    mapping: Mapping[str, str] | None = None,
    column: str | None = None,
) -> list[Record]:
    """Return the runs of one or several records; files are read."""
    runs: list[Record] = []
    for record in _listed(records):
        if isinstance(record, Record):
            runs.append(record)
        else:
            runs += read_runs_for(model, _source(record), mapping, column)
    return runs


def _listed(records: Records) -> list[Data]:
    if isinstance(records, Sequence) and not isinstance(records, str):
        return list(records)
    return [records]


def held_out(
    records: Records,
    holdout: Records | None,
    model: Model,
    mapping: Mapping[str, str] | None = None,
    column: str | None = None,
) -> tuple[list[Record], list[Record]]:
    """Return the runs for estimation and those for validation.

    Parameters
    ----------
    records : Record, file, DataFrame, arrays by name, or sequence of these
    holdout : Record, file, DataFrame, arrays by name, sequence of these, or labels, optional
        Other records for validation, or labels of some of `records`, such as ``"7,8,9"``.
    model : Model
    mapping : Mapping of str to str, optional
    column : str, optional
        Column that distinguishes the runs of a file.

    Raises
    ------
    UserError
        If a file cannot be read, a holdout is neither a file nor a label, or no run remains for
        estimation.
    """
    runs = matching_runs(records, model, mapping, column)
    if holdout is None:
        return runs, []
    by_label = dict(zip(record_labels(runs), runs, strict=True))
    labels: list[str] = []
    others: list[Record] = []
    for item in _listed(holdout):
        if not isinstance(item, str | Path) or Path(item).exists() or len(by_label) < 2:
            others += matching_runs(item, model, mapping, column)
        else:
            labels += _labels_in(str(item), by_label)
    estimation = [run for label, run in by_label.items() if label not in labels]
    if not estimation:
        raise UserError("holdout: all records are for validation, and none for estimation")
    return estimation, [*(by_label[label] for label in dict.fromkeys(labels)), *others]


def _labels_in(text: str, known: Collection[str]) -> list[str]:
    """Return the labels that a text lists; UserError if one is unknown."""
    named = [label.strip() for label in text.split(",")]
    unknown = next((label for label in named if label not in known), None)
    if unknown is not None:
        raise UserError(
            f"{option('holdout', text)}: {unknown} is neither a file nor one of the records"
            f" {', '.join(known)}"
        )
    return named


def matching_record(record: Data, model: Model, mapping: Mapping[str, str] | None = None) -> Record:
    """Return a record of a model's signals; a file or arrays are read."""
    return record if isinstance(record, Record) else read_record(record, model, mapping)
