"""Models of commands: searched by name, built where necessary, with notes for the user."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from fmus.kit import UserError
from orchestration.reporting.console import detail, note, progress, tell_repairs, warn

if TYPE_CHECKING:
    from fmus.kit import Component
    from orchestration.cli.commands.options import (
        BuildCommand,
        ExportModelicaCommand,
        IdentifyCommand,
        LineariseCommand,
        MeasuredOptions,
        MeasuringOptions,
        SimulateCommand,
    )
    from orchestration.cli.options import RecordsArgument
    from orchestration.fmu import Model, Signal, Value
    from orchestration.records import Record, Repair


def open_measured(
    options: MeasuredOptions, runtime: str | None = None
) -> tuple[Model, Record, dict[str, Value]]:
    """Open a model, a record of it, and values; print repairs, and the inputs without a source.

    Raises
    ------
    UserError
        If either cannot be read, or they do not fit.
    """
    from orchestration.api.options import source_of
    from orchestration.identify import read_for

    def read(declared: Model) -> list[Record]:
        return [read_for(declared, source_of(options["record"], options), options["mapping"])]

    model, (record,), parameters = _opened(options, read, runtime)
    return model, record, parameters


def open_runs(options: IdentifyCommand) -> tuple[Model, list[Record], dict[str, Value]]:
    """Open a model and all runs of its records; see `open_measured`."""
    from orchestration.api import held_out

    return _opened(options, lambda declared: held_out(options["records"], declared, options)[0])


def _opened(
    options: MeasuringOptions,
    read: Callable[[Model], list[Record]],
    runtime: str | None = None,
) -> tuple[Model, list[Record], dict[str, Value]]:
    from orchestration.api import as_measured, values_of

    found = as_measured(options["model"], options["laid_over"], runtime)
    declared = found.with_options(options)
    parameters = values_of(declared, options["settings"], options["preset"])
    records = read(declared)
    for record in records:
        check_inputs(declared, record.signals, parameters)
    tell_repairs_of(records)
    return build_model(declared, runtime), records, parameters


def record_files(options: RecordsArgument) -> list[Path]:
    """Return the files of records, with all files of a folder that have a table."""
    from orchestration.api.options import source_of
    from orchestration.records import files_of

    files = []
    for path in options["records"]:
        files += files_of(path, note, source_of(path, options).reading)
    return files


def read_inputs(
    options: LineariseCommand | SimulateCommand, inputs: Mapping[str, Signal]
) -> Record | None:
    """Read the record that drives a model or a system, if one is given, and print its repairs."""
    from orchestration.api.options import source_of
    from orchestration.records import read_record

    file = options["input_file"]
    if file is None:
        return None
    units = {name: signal.unit for name, signal in inputs.items()}
    mapping = options["mapping"]
    record = read_record(source_of(file, options), units, mapping=mapping, inputs=list(units))
    tell_repairs(record.repairs)
    return record


def tell_repairs_of(records: Sequence[Record], unsaid: Collection[str] = ()) -> None:
    """Print the repairs of records: those alike in one line, with the names of their files.

    Parameters
    ----------
    records : sequence of Record
    unsaid : collection of str
        Kinds of repairs that are not printed.
    """
    alike: dict[Repair, list[str]] = {}
    for record in records:
        run = f", run {record.label}" if record.label else ""
        for repair in record.repairs:
            if repair.kind not in unsaid:
                alike.setdefault(repair, []).append(f"{record.source.name}{run}")
    for repair, names in alike.items():
        whole = f"all {len(names)} records" if len(names) == len(records) else ", ".join(names)
        called = f"{whole}: " if len(records) > 1 else ""
        tell_repairs([replace(repair, message=f"{called}{repair.message}")])


def model_file(name: str) -> Path | None:
    """Return the file that a model or a system is read from; None for one of ours."""
    from fmus.kit import registry
    from orchestration.fmu.model import file_of_class, names_class
    from orchestration.system import NAMES

    if name in registry.models() or name in NAMES:
        return None
    return Path(file_of_class(name) if names_class(name) else name)


def open_model(name: str, runtime: str | None = None, effects: Sequence[str] = ()) -> Model:
    """Return a model or a system with its FMU; see :func:`orchestration.fmu.model.find_model`.

    Raises
    ------
    UserError
        If there is none, or it cannot be built.
    """
    from orchestration.api import as_runnable

    return build_model(as_runnable(name, effects, runtime), runtime)


def class_and_settings(
    name: str, options: BuildCommand | ExportModelicaCommand
) -> tuple[type[Component], dict[str, Value]]:
    """Return a component with effects laid over it, and settings of its parameters.

    Raises
    ------
    UserError
        If there is none, or a setting is impossible.
    """
    from orchestration.fmu.model import find_class, read_settings
    from orchestration.fmu.signal import declared_signal

    cls = find_class(name, options["laid_over"])
    known = {p.name: declared_signal(p) for p in (*cls.layout.parameters, *cls.layout.texts)}
    texts = [f"{key}={value}" for key, value in (options["settings"] or {}).items()]
    return cls, read_settings(name, texts, known)


def build_model(declared: Model, runtime: str | None = None) -> Model:
    """Build the FMU of a model that is declared, if it has none, and print notes on it."""
    from orchestration.fmu.model import built
    from orchestration.fmu.simulation import source_of, steps_of_its_own

    with progress() as tell:
        if declared.cls is not None and not declared.foreign:
            tell(f"building {declared.title} ({runtime or 'native'}) unless it is there")
        model = built(declared, runtime)
    for text in (*model.notes, *steps_of_its_own(model)):
        note(text)
    detail(f"{model.title}: {', '.join(map(str, source_of(model).files))}")
    return model


def check_inputs(model: Model, signals: Collection[str], parameters: Collection[str]) -> None:
    """Refuse inputs that are given twice; print the inputs that neither file nor setting gives.

    Parameters
    ----------
    model : Model
    signals : collection of str
        Signals of the record.
    parameters : collection of str
        Names that are set.

    Raises
    ------
    UserError
    """
    from orchestration.fmu.signal import start_of

    for name, signal in model.inputs.items():
        if name in signals and name in parameters:
            raise UserError(
                f"--set {name}: the record has a column for it; leave out one of the two"
            )
        if name not in signals and name not in parameters:
            start = start_of(signal) or "what its FMU begins with, which declares no start value"
            warn(f"no values for the input {name}; it stays at {start}")


def note_neutral(model: Model, parameters: Collection[str]) -> None:
    """Print the effects that are switched off at the start of a fit.

    A fit may not move the parameter of an effect away from the value that switches it off.

    Parameters
    ----------
    model : Model
    parameters : collection of str
        Names that are set.
    """
    from fmus.kit.effects import effect_name, unstack

    if model.cls is None or not model.effects:
        return
    for effect in unstack(model.cls)[1]:
        if effect_name(effect) in model.effects and effect.neutral not in parameters:
            start = f"{effect.neutral} = {model.parameters[effect.neutral].start:g}"
            note(
                f"a fit starts from {start}, without {effect_name(effect)}; --set starts it"
                " elsewhere"
            )
