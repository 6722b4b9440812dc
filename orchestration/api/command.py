"""Commands that are equivalent to calls from Python, for reports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import cast

from orchestration.api.declaration import words_of
from orchestration.records import Record, record_labels


def equivalent_command(
    command: str,
    model: str,
    records: Sequence[Record],
    holdouts: Sequence[Record],
    *,
    declared: type,
    options: Mapping[str, object],
) -> list[str | Path]:
    """Return the words of the command that is equivalent to a call from Python.

    Parameters
    ----------
    command : str
        Name of the command, such as ``diagnose``.
    model : str
        Model as a word of the command line.
    records, holdouts : sequence of Record
        Estimation data and validation data; runs of one file may be in both.
    declared : TypedDict
        Class of the options of the command.
    options : Mapping of str to object
        Values of the options.
    """
    estimation_files = {record.source for record in records}
    # runs for validation from a file of estimation data are named by their labels
    read = [*records, *(run for run in holdouts if run.source in estimation_files)]
    labels = [
        label
        for label, record in zip(record_labels(read), read, strict=True)
        if any(record is run for run in holdouts)
    ]
    other_files = dict.fromkeys(
        str(run.source) for run in holdouts if run.source not in estimation_files
    )
    holdout = [",".join(labels)] if labels else []
    later = cast("Sequence[object]", options.get("compare") or ())
    values = {
        **options,
        "holdout": [*holdout, *other_files] or None,
        "compare": [one.source if isinstance(one, Record) else one for one in later] or None,
    }
    files = dict.fromkeys(record.source for record in read)
    return ["ppy", command, *files, "--model", model, *words_of(declared, values)]
