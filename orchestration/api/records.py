"""Records from Python: ``ppy.read_record``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from fmus.kit.errors import UserError
from orchestration.discrepancy.data.records import labels
from orchestration.fmu.model import Model, find_model
from orchestration.identify.comparison import read_for, read_runs_for
from orchestration.records import Record

Records = Record | str | Path | Sequence[Record | str | Path]


def read_record(
    path: str | Path, model: Model | str = "ppy_actuator", mapping: Mapping[str, str] | None = None
) -> Record:
    """Read a measured record: CSV, Parquet, LabVIEW TDMS or text, MATLAB; every repair is in ``record.repairs``.

    Parameters
    ----------
    path : str or Path
        Its columns are ``name [unit]``, the first one time.
    model : Model or str
        Whose signals it holds: a component, an FMU file, ``path/to/file.py:Class``, or what `find_model` returned.
    mapping : Mapping of str to str, optional
        Column of the file to signal of the model, such as ``{"stress": "force[N]"}``.

    Returns
    -------
    Record
        Time in s, signals in the model's units.

    Raises
    ------
    UserError
        If the file is refused (file, row and reason are named), or holds none of the model's outputs.

    Examples
    --------
    >>> import orchestration as ppy
    >>> from orchestration.rig.emulator.records import draw, write
    >>> write(draw(None, seed=1, duration=60.0), "clean.csv")
    >>> record = ppy.read_record("clean.csv", model="ppy_actuator")
    >>> sorted(record.signals)
    ['current', 'displacement', 'force', 'voltage']
    >>> record.repairs
    []
    """
    return read_for(find_model(model) if isinstance(model, str) else model, Path(path), mapping)


def matching_runs(
    records: Records,
    model: Model,
    mapping: Mapping[str, str] | None = None,
    column: str | None = None,
) -> list[Record]:
    """Return the runs of one or several records, read from files where files are given."""
    given = [records] if isinstance(records, Record | str | Path) else list(records)
    read = [
        [r] if isinstance(r, Record) else read_runs_for(model, Path(r), mapping, column)
        for r in given
    ]
    return [run for runs in read for run in runs]


def held_out(
    records: Records,
    holdout: Records | None,
    model: Model,
    mapping: Mapping[str, str] | None = None,
    column: str | None = None,
) -> tuple[list[Record], list[Record]]:
    """Return the runs to fit to, and those held out: others, or some of the first by their labels.

    Parameters
    ----------
    records : Record, file, or sequence of either
    holdout : Record, file, labels (``"7,8,9"``), or sequence of these, optional
    model : Model
    mapping : Mapping of str to str, optional
    column : str, optional
        That tells the runs of a file apart.

    Raises
    ------
    UserError
        If a file is refused, what is held out is neither a file nor a label, or nothing is left to fit to.
    """
    runs = matching_runs(records, model, mapping, column)
    if holdout is None:
        return runs, []
    named, out, others = dict(zip(labels(runs), runs, strict=True)), list[str](), list[Record]()
    for item in [holdout] if isinstance(holdout, Record | str | Path) else holdout:
        wanted = (
            [text.strip() for text in str(item).split(",")] if not isinstance(item, Record) else []
        )
        if isinstance(item, Record) or Path(item).exists() or len(named) < 2:
            others += matching_runs(item, model, mapping, column)
        elif unknown := [label for label in wanted if label not in named]:
            raise UserError(
                f"--holdout {item}: {unknown[0]} is neither a file nor one of the records {', '.join(named)}"
            )
        else:
            out += wanted
    fitted = [run for label, run in named.items() if label not in out]
    if not fitted:
        raise UserError("--holdout: every record is held out, and none is left to fit to")
    return fitted, [*(named[label] for label in dict.fromkeys(out)), *others]


def matching_record(
    record: Record | str | Path, model: Model, mapping: Mapping[str, str] | None = None
) -> Record:
    """Return a record of a model's signals, read from a file if that is what is given."""
    return record if isinstance(record, Record) else read_record(record, model, mapping)
