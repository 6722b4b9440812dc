"""Records from Python: ``ppy.read_record``."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Unpack

from fmus.kit import UserError
from orchestration.api.declaration import takes
from orchestration.api.options import MappingOption, ReadingOptions, source_of
from orchestration.api.simulation import as_measured
from orchestration.fmu import Model
from orchestration.identify import read_for, read_runs_for
from orchestration.records import Arrays, Record, Source, record_labels
from orchestration.reporting import option

Data = Record | str | Path | Arrays
Records = Data | Sequence[Data]


@takes(MappingOption)
def read_record(
    path: str | Path | Arrays,
    model: Model | str | Path | None = None,
    mapping: Mapping[str, str] | None = None,
    **options: Unpack[ReadingOptions],
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
    return read_for(as_measured(model), source_of(path, options), mapping)


def one_record(records: Records, options: Mapping[str, Any]) -> Record | Source:
    """Return the only record; of a file or arrays its source.

    Raises
    ------
    UserError
        If there are several.
    """
    first, *others = listed(records)
    if others:
        raise UserError(f"a system is diagnosed on one record, and there are {1 + len(others)}")
    return first if isinstance(first, Record) else source_of(first, options)


def matching_runs(records: Records, model: Model, options: Mapping[str, Any]) -> list[Record]:
    """Return the runs of one or several records; files are read as options of a record say."""
    runs: list[Record] = []
    for record in listed(records):
        if isinstance(record, Record):
            runs.append(record)
        elif isinstance(record, str | Path) and Path(record).is_dir():
            raise UserError(
                f"{record}: this is a folder; {option('workers')} of diagnose takes each record in"
                " it by itself"
            )
        else:
            found = source_of(record, options)
            runs += read_runs_for(model, found, options.get("mapping"), options.get("runs"))
    return runs


def listed(records: Records) -> list[Data]:
    """Return records as a list, also of one."""
    if isinstance(records, Sequence) and not isinstance(records, str):
        return list(records)
    return [records]


def held_out(
    records: Records, model: Model, options: Mapping[str, Any]
) -> tuple[list[Record], list[Record]]:
    """Return the runs for estimation and those for validation.

    Parameters
    ----------
    records : Record, file, DataFrame, arrays by name, or sequence of these
    model : Model
    options : Mapping of str to Any
        Values of `RecordOptions`. A holdout is other records for validation, or labels of some of
        `records`, such as ``"7,8,9"``.

    Raises
    ------
    UserError
        If a file cannot be read, a holdout is neither a file nor a label, or no run remains for
        estimation.
    """
    runs = matching_runs(records, model, options)
    holdout = options.get("holdout")
    if holdout is None:
        return runs, []
    by_label = dict(zip(record_labels(runs), runs, strict=True))
    labels: list[str] = []
    others: list[Record] = []
    for item in listed(holdout):
        if not isinstance(item, str | Path) or Path(item).exists() or len(by_label) < 2:
            others += matching_runs(item, model, options)
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


def matching_record(record: Data, model: Model, options: Mapping[str, Any]) -> Record:
    """Return a record of a model's signals; a file or arrays are read as `MappingOption` says."""
    if isinstance(record, Record):
        return record
    return read_for(model, source_of(record, options), options.get("mapping"))
