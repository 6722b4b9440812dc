"""Execution of ``ppy diagnose`` and ``ppy laws``: input files, terminal output, and files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, cast

from fmus.kit import UserError, registry
from fmus.kit.build import available_platforms
from orchestration.api import (
    DiagnosisResult,
    SystemResult,
    diagnose,
    fmu_paths,
    held_out,
    laws,
    refuse_without_laws,
)
from orchestration.api.declaration import only, options_of
from orchestration.api.options import (
    DiagnoseKeywords,
    LawsKeywords,
    MappingOption,
    SettingsOption,
    source_of,
)
from orchestration.cli.command import refuse
from orchestration.cli.commands.options import (
    DiagnoseCommand,
    LawsCommand,
    ReportOption,
    SystemOption,
)
from orchestration.cli.ending import end_interrupted
from orchestration.cli.models import build_model, model_file, note_neutral, tell_repairs_of
from orchestration.cli.options import IsolateOption, JsonOption, platform_list
from orchestration.cli.outputs import check_outputs, same_file, write_json
from orchestration.fmu import Model
from orchestration.fmu.model import declared_model
from orchestration.records import Record, files_of
from orchestration.reporting import saving, write_page
from orchestration.reporting.console import note, out, progress, tell_repairs, wrote
from orchestration.system.ssp import ENDINGS

_SYSTEM_OPTIONS = options_of(
    MappingOption, SettingsOption, JsonOption, ReportOption, SystemOption, IsolateOption
)
# options that are of one diagnosis
_OF_ONE = ("system", "compare", "each", "explain", "fmu", "experiment", "ssp")
_SO_FAR = "this was the best answer so far"
_OF_SYSTEMS = {"records", "time", "hold", *_SYSTEM_OPTIONS}
Writer = Callable[[Path, Callable[[str], None]], list[Path]]


class Judged(NamedTuple):
    """A model and the records that it is diagnosed on."""

    model: Model
    records: list[Record]
    holdouts: list[Record]


def run_diagnosis(options: DiagnoseCommand, command: str) -> DiagnosisResult:
    """Run ``ppy diagnose``; the report repeats the command.

    Raises
    ------
    UserError
        If a record or the model cannot be used, an effect is unknown, or something could not be
        written.
    """
    _check_explained(options)
    result = _made(diagnose, options, only(DiagnoseKeywords, options), command)
    if options["explain"]:
        out.print()
        out.print(*result.explain(*options["explain"]).overview(), sep="\n")

    def fmu(path: Path, tell: Callable[[str], None]) -> list[Path]:
        return result.fmu(path, _platforms(options), tell)

    def experiment(path: Path, tell: Callable[[str], None]) -> list[Path]:
        if result.experiment is None:
            is_open = result.verdict in ("ambiguous", "unexplained")
            reason = "there is no experiment" if is_open else "there are no causes to distinguish"
            note(f"{reason}: {path} was not written")
            return []
        return [result.experiment.to_toml(path)]

    write_all(
        [
            (_report(result), options["report"]),
            (fmu, options["fmu"]),
            (experiment, options["experiment"]),
            (lambda path, tell: [result.system(path)], options["ssp"]),
        ]
    )
    if result.is_interrupted:
        end_interrupted(_SO_FAR)
    return result


def run_each(options: DiagnoseCommand, workers: int, command: str) -> list[str]:
    """Run ``ppy diagnose --workers``; the page repeats the command. Return all verdicts.

    Raises
    ------
    UserError
        If the model cannot be used, no record can, or an option is given that is of one record.
    SystemExit
        After the results, if some records could not be diagnosed or Ctrl-C was pressed.
    """
    reason = "is of one diagnosis; --workers makes several"
    refuse(DiagnoseCommand, options, _OF_ONE, reason)
    files = []
    for path in options["records"]:
        files += files_of(path, note, source_of(path, options).reading)
    read: dict[str, Path | None] = {f"the record {file}": file for file in files}
    check_outputs(options, read)
    name = options["model"] or registry.default_model()
    declared = declared_model(name, options["laid_over"])
    note_neutral(declared, options["settings"] or {})
    chosen = only(DiagnoseKeywords, options)
    with progress() as tell:
        chosen["progress"] = tell
        found = diagnose(files, build_model(declared), workers=workers, **chosen)
    out.print(*found.overview(), sep="\n")
    write_json(options["json"], saving.kept(found))
    page = options["report"]
    if page is not None:
        wrote(write_page(found, page, command))
    if found.missing:
        end_interrupted(f"{len(found.missing)} of {len(files)} records were not diagnosed")
    if found.failures:
        raise SystemExit(2)
    return [one.verdict for one in found.values()]


def _made(
    work: Callable[..., DiagnosisResult],
    options: DiagnoseCommand | LawsCommand,
    chosen: DiagnoseKeywords | LawsKeywords,
    command: str,
) -> DiagnosisResult:
    """Return the result of a function of the API by its keywords; print it, and write its JSON."""
    judged = open_judged(options, partial(refuse_without_laws, options=chosen))
    with progress() as tell:
        how = {**chosen, "holdout": judged.holdouts or None, "progress": tell}
        result = work(judged.records, judged.model, **how)
    result = result.as_typed(command, _written(options))
    _show(result, options["json"])
    return result


def _check_explained(options: DiagnoseCommand) -> None:
    """Refuse ``--explain`` with anything but two candidates."""
    names = options["explain"]
    if names and len(names) != 2:
        raise UserError(f"--explain {','.join(names)}: it takes two candidates, not {len(names)}")


def _platforms(options: DiagnoseCommand | LawsCommand) -> list[str]:
    """Return the platforms to build an FMU for; ``all`` are those with a compiler here."""
    return platform_list(options["platforms"]) or available_platforms()


def run_laws(options: LawsCommand, command: str) -> DiagnosisResult:
    """Run ``ppy laws``; the report repeats the command.

    Raises
    ------
    UserError
        If a record or the model cannot be used, an effect is unknown, or something could not be
        written.
    """
    result = _made(laws, options, only(LawsKeywords, options), command)

    def is_found(path: Path) -> bool:
        if not result.causes:
            note(f"no law is found to lack anything: {path} was not written")
        return bool(result.causes)

    def effect(path: Path, tell: Callable[[str], None]) -> list[Path]:
        return [result.effect(path)] if is_found(path) else []

    def fmu(path: Path, tell: Callable[[str], None]) -> list[Path]:
        return result.fmu(path, _platforms(options), tell) if is_found(path) else []

    write_all(
        [
            (_report(result), options["report"]),
            (effect, options["effect_out"]),
            (fmu, options["fmu"]),
        ]
    )
    if result.is_interrupted:
        end_interrupted(_SO_FAR)
    return result


def run_system(options: DiagnoseCommand, system: str, command: str) -> SystemResult:
    """Run ``ppy diagnose --system``; the report repeats the command.

    Raises
    ------
    UserError
        If the record or the system cannot be used, or an option is given that is of one model only.
    """
    of_models = (name for name in options if name not in _OF_SYSTEMS)
    reason = "is about one model; --system tells which member to name with --model"
    refuse(DiagnoseCommand, options, of_models, reason)
    record, *others = options["records"]
    if others:
        raise UserError("a second record is about one model; --system takes one")
    file = {"the system": Path(system)} if Path(system).suffix.lower() in ENDINGS else {}
    check_outputs(options, {"the record": record, **file})
    chosen = only(DiagnoseKeywords, options)
    with progress() as tell:
        chosen["progress"] = tell
        result = diagnose(record, system=system, **chosen).as_typed(command, {})
    tell_repairs(result.record.repairs)
    _show(result, options["json"])
    write_all([(_report(result), options["report"])])
    return result


def open_judged(options: DiagnoseCommand | LawsCommand, check: Callable[[Model], None]) -> Judged:
    """Open the model and the records, after a check that all output files can be written.

    Parameters
    ----------
    options : DiagnoseCommand or LawsCommand
    check : callable
        Raises UserError for a model that does not fit the options, before any remark is printed.

    Raises
    ------
    UserError
        If a file could not be written, or the model or a record cannot be read.
    """
    name = options["model"] or registry.default_model()
    file = model_file(name)
    check_files(options, [] if file is None else [file])
    declared = declared_model(name, options["laid_over"])
    check(declared)
    note_neutral(declared, options["settings"] or {})
    records, holdouts = held_out(options["records"], declared, options)
    # of a channel that is constant the diagnosis says what follows from it
    tell_repairs_of((*records, *holdouts), unsaid=("constant",))
    return Judged(build_model(declared), records, holdouts)


def check_files(options: DiagnoseCommand | LawsCommand, sources: Sequence[Path] = ()) -> None:
    """Refuse paths that cannot be written, or that would overwrite another file.

    Parameters
    ----------
    options : DiagnoseCommand or LawsCommand
    sources : sequence of Path
        Files of the model.

    Raises
    ------
    UserError
    """
    given = cast("Mapping[str, Any]", options)
    records: Sequence[Path] = given["records"]
    later: Sequence[Path] = given.get("compare") or ()
    # a holdout may also be labels of several records, which are no files
    unseen = [
        Path(text) for text in given["holdout"] or () if len(records) == 1 or Path(text).exists()
    ]
    read: dict[str, Path | None] = {}
    for k, path in enumerate(records):
        read[f"the record{_number_after_first(k)}"] = path
    for role, paths in (("later record", later), ("record held out", unseen)):
        for k, path in enumerate(paths):
            read[f"the {role}{_number_after_first(k)}"] = path
    for source in sources:
        kind = "FMU" if source.suffix == ".fmu" else "file"
        read[f"the {kind} of --model"] = source
    fmus = {} if given["fmu"] is None else fmu_paths(given["fmu"], ())
    more = {f"--fmu ({kind})": path for kind, path in fmus.items()}
    check_outputs(given, read, more, experiment=(".toml",), effect_out=(".py",), ssp=(".ssp",))
    for name, paths, reason in (
        ("--compare", later, "nothing in it can have changed"),
        ("--holdout", unseen, "nothing would be held out"),
    ):
        for path in paths:
            if any(same_file(record, path) for record in records):
                raise UserError(f"{name} {path}: this is the record itself; {reason}")


def _number_after_first(k: int) -> str:
    """Return the number of an item in brackets from 2 on; empty for the first."""
    return f" ({k + 1})" if k else ""


def _written(options: DiagnoseCommand | LawsCommand) -> dict[str, str]:
    """Return the files of a model or an experiment that a command writes, by option."""
    given = cast("Mapping[str, Any]", options)
    names = ("fmu", "ssp", "experiment")
    return {name: str(given[name]) for name in names if given.get(name) is not None}


def _show(result: DiagnosisResult | SystemResult, path: Path | None) -> None:
    """Print a result, and write it as JSON if wanted."""
    out.print(*result.overview(), sep="\n")
    write_json(path, result.to_dict())


def _report(result: DiagnosisResult | SystemResult) -> Writer:
    """Return a function that writes the report of a result."""

    def report(path: Path, tell: Callable[[str], None]) -> list[Path]:
        tell("drawing the report")
        return [result.report(path)]

    return report


def write_all(writers: Sequence[tuple[Writer, Path | None]]) -> None:
    """Write all files that are wanted, even after a failure; then raise the first failure.

    Parameters
    ----------
    writers : sequence of tuple
        Function that writes a file, calls its second argument with progress, and returns the files
        that it wrote; and the path to write to, or None if the file is not wanted.
    """
    failures: list[Exception] = []
    written: list[Path] = []
    with progress() as tell:
        for write, path in writers:
            try:
                written += write(path, tell) if path is not None else []
            except Exception as error:
                failures.append(error)
    for path in written:
        wrote(path)
    if failures:
        raise failures[0]
