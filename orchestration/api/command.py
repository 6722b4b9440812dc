"""The command line that does what a call from Python did, for reports to repeat."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from orchestration.api.declaration import words_of
from orchestration.discrepancy.data import record_labels
from orchestration.records import Record


def equivalent_command(
    command: str,
    model: str,
    records: Sequence[Record],
    holdouts: Sequence[Record],
    *,
    declared: type,
    options: Mapping[str, object],
) -> list[str]:
    """Return the words of the command that does what a call from Python did.

    Parameters
    ----------
    command : str
        Such as ``diagnose``.
    model : str
        As the command line names it.
    records, holdouts : sequence of Record
        What was fitted to, and what was held out of it or beside it.
    declared : TypedDict
        Class of the options that the command takes.
    options : Mapping of str to object
        Their values.
    """
    fitted = {record.source for record in records}
    # some runs of a file may be held out of the others: then both are read from it, and told apart
    # by their labels
    read = [*records, *(held for held in holdouts if held.source in fitted)]
    held_labels = [
        label
        for label, record in zip(record_labels(read), read, strict=True)
        if any(record is held for held in holdouts)
    ]
    held_files = dict.fromkeys(str(h.source) for h in holdouts if h.source not in fitted)
    holdout = [",".join(held_labels)] if held_labels else []
    later = options.get("compare")
    values = {
        **options,
        "holdout": [*holdout, *held_files] or None,
        "compare": later.source if isinstance(later, Record) else later,
    }
    files = dict.fromkeys(str(record.source) for record in read)
    return ["ppy", command, *files, "--model", model, *words_of(declared, values)]
