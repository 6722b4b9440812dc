"""``ppy info RECORD``: columns, rate and gaps of a record, and the ``--map`` that a model needs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from fmus.kit import UserError, quoting
from orchestration.cli.outputs import check_outputs, write_json
from orchestration.reporting import option, plain_table
from orchestration.reporting.console import out

if TYPE_CHECKING:
    from orchestration.cli.commands.options import InfoCommand
    from orchestration.fmu import Model
    from orchestration.records import FileOverview, Proposal

_MODELS = (".fmu", ".py", ".ssp")
_RECORDS = (
    *(".csv", ".txt", ".dat", ".lvm", ".mpt", ".dta", ".tdms", ".mat", ".parquet", ".nc", ".gz"),
    *(".xlsx", ".xls", ".ods", ".h5", ".hdf5", ".mf4", ".feather"),
)


def is_record(name: str) -> bool:
    """Return whether a name is one of a record and not of a model."""
    from fmus.kit import registry
    from orchestration.fmu.model import names_class

    path = Path(name)
    if name in registry.models() or names_class(name) or path.suffix.lower() in _MODELS:
        return False
    return path.is_file() or path.suffix.lower() in _RECORDS


def record_info(options: InfoCommand) -> None:
    """Run ``ppy info`` for a record.

    Raises
    ------
    UserError
        If the file is of no known form, or there is no such model.
    """
    from orchestration.api.options import source_of
    from orchestration.fmu.model import declared_model
    from orchestration.records import read_overview

    file = Path(options["model"])
    check_outputs(options, {"the record": file})
    if options["laid_over"] and options["of_model"] is None:
        raise UserError("--with: name the model of the record with --model")
    overview = read_overview(source_of(file, options))
    name = options["of_model"]
    model = None if name is None else declared_model(name, options["laid_over"])
    _show(overview)
    figures = overview.to_dict()
    if model is not None:
        signals = {**model.inputs, **model.outputs}.values()
        proposal = overview.proposal({signal.name: signal.unit for signal in signals})
        _show_proposal(options, model, proposal)
        figures |= {"map": proposal.mapping, "matched": proposal.matched, "open": proposal.open}
    write_json(options["json"], figures)


def _show(overview: FileOverview) -> None:
    """Print the clock, the columns, and the peculiarities of a record."""
    out.print(overview.path.name, style="bold", end="  ")
    out.print(f"{overview.rows} rows")
    clock = overview.clock
    if clock is not None:
        kind = "" if clock.is_even else ", unevenly"
        rate = f"{clock.step:.4g} s ({1.0 / clock.step:.4g} Hz){kind}"
        span = f"{clock.duration:.6g} s from {clock.start:.6g} s"
        out.print(f"time is '{clock.column}': {span}, {clock.samples} samples every {rate}")
    table = plain_table(None, "column", "unit", "smallest", "largest", "missing", "")
    for column in overview.columns:
        is_number = column.content == "numbers"
        guess = f"{column.guess}?" if column.guess else "none"
        table.add_row(
            column.name or "(no name)",
            column.unit or guess,
            f"{column.smallest:.6g}" if is_number else "",
            f"{column.largest:.6g}" if is_number else "",
            str(column.missing or ""),
            "" if is_number else f"{column.content} {column.example}".strip(),
        )
    out.print(table)
    for note in overview.notes:
        out.print(f"noted: {note}", style="dim")


def _show_proposal(options: InfoCommand, model: Model, proposal: Proposal) -> None:
    """Print the columns of a model's signals, and the command that follows."""
    out.print(f"\nfor {model.title}", style="bold")
    known = {**model.inputs, **model.outputs}
    for signal, column in proposal.matched.items():
        out.print(f"  {signal} [{known[signal].unit}] is probably '{column}'")
    guessed = {}
    for signal, columns in proposal.open.items():
        role = "input" if signal in model.inputs else "output"
        listed = ", ".join(f"'{name}'" for name in columns)
        pair = option("mapping", {"COLUMN": signal})
        may_be = f"may be {listed}: {pair}" if columns else "has no column"
        if columns and role == "input":
            guessed[columns[0]] = signal
        out.print(f"  {role} {signal} [{known[signal].unit}] {may_be}")
    model_words = ["--model", str(options["of_model"])]
    if options["laid_over"]:
        model_words += ["--with", ",".join(options["laid_over"])]
    words = quoting.shell(["ppy", "compare", Path(options["model"]), *model_words])
    if any(name in proposal.matched for name in model.outputs):
        given = option("mapping", guessed) if guessed else ""
        command = " ".join(filter(None, (words, proposal.options(), given)))
        condition = " and ".join(f"{signal} is '{column}'" for column, signal in guessed.items())
        begin = f"next, if {condition}" if condition else "next"
        out.print(f"{begin}: {command}")
    elif proposal.mapping:
        out.print(f"columns: {proposal.options()}")
