"""The command that does what a call from Python did."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from orchestration.discrepancy.data.records import labels
from orchestration.discrepancy.pipeline import Options
from orchestration.records import Record


def diagnosing(
    records: Sequence[Record],
    model: str,
    holdouts: Sequence[Record],
    later: Record | None,
    options: Options,
    settings: Mapping[str, float | str] | None = None,
    mapping: Mapping[str, str] | None = None,
    runs: str | None = None,
    command: str = "diagnose",
) -> list[str]:
    """Words of the ``ppy diagnose`` that makes the same diagnosis.

    Parameters
    ----------
    records, holdouts : sequence of Record
        What was fitted to, and what was held out of it or beside it.
    model : str
    later : Record, optional
        What was compared.
    options : Options
    settings : Mapping of str to float or str, optional
        As they were given.
    mapping : Mapping of str to str, optional
        Column to signal.
    runs : str, optional
        Column that tells runs apart.
    command : str
        Another that takes the same, such as ``laws``.
    """
    held = [record.source for record in holdouts]
    # some runs of a file may be held out of the others: then both are read from it, and told apart by their labels
    shared = {record.source for record in records} & set(held)
    read = dict.fromkeys(
        record.source for record in (*records, *(r for r in holdouts if r.source in shared))
    )
    words = ["ppy", command, *map(str, read), "--model", model]
    every = [*records, *(r for r in holdouts if r.source in shared)]
    named = dict(zip(labels(every), every, strict=True))
    out = [label for label, record in named.items() if any(record is r for r in holdouts)]
    words += ["--holdout", ",".join(out)] if out else []
    words += [
        w
        for source in dict.fromkeys(held)
        if source not in shared
        for w in ("--holdout", str(source))
    ]
    words += ["--compare", str(later.source)] if later else []
    words += ["--runs", runs] if runs else []
    words += [
        w for column, signal in (mapping or {}).items() for w in ("--map", f"{column}={signal}")
    ]
    words += [w for name, value in (settings or {}).items() for w in ("--set", f"{name}={value}")]
    if options.effects is not None:
        words += ["--effects", ",".join(options.effects) or "none"]
    for option, names in (("--hold", options.hold), ("--each", options.each)):
        words += [option, ",".join(names)] if names else []
    if options.interpolate is not None:
        words.append("--interpolate" if options.interpolate else "--no-interpolate")
    words += ["--time", f"{options.time:g}s"] if options.time is not None else []
    return words + (["--no-laws"] if command == "diagnose" and not options.laws else [])
