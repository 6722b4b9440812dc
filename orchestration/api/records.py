"""Records from Python: ``ppy.read_record``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from orchestration.fmu.model import Model, find_model
from orchestration.identify.comparison import read_for
from orchestration.records import Record


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


def matching_record(record: Record | str | Path, model: Model, mapping: Mapping[str, str] | None = None) -> Record:
    """Return a record of a model's signals, read from a file if that is what is given."""
    return record if isinstance(record, Record) else read_record(record, model, mapping)
