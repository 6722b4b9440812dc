"""Execution of ``ppy diagnose`` and ``ppy laws``: input files, terminal output, and files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, cast

from fmus.kit import UserError, registry
from fmus.kit.build import available_platforms
from orchestration.api import (
    DiagnosisResult,
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
)
from orchestration.cli.command import refuse
from orchestration.cli.commands.options import (
    DiagnoseCommand,
    LawsCommand,
    ReportOption,
    SystemOption,
)
from orchestration.cli.ending import end_interrupted
from orchestration.cli.models import (
    build_model,
    model_file,
    note_neutral,
    record_files,
    tell_repairs_of,
)
from orchestration.cli.options import IsolateOption, JsonOption, platform_list
from orchestration.cli.outputs import (
    check_outputs,
    same_file,
    show_and_write,
    typed_command,
    write_files,
    write_json,
)
from orchestration.fmu.model import declared_model
from orchestration.reporting import Displayable, saving, write_page
from orchestration.reporting.console import note, out, progress, tell_repairs, wrote
from orchestration.system.ssp import ENDINGS

_SYSTEM_OPTIONS = options_of(
    MappingOption, SettingsOption, JsonOption, ReportOption, SystemOption, IsolateOption
)
# options that are of one diagnosis
_OF_ONE = ("system", "compare", "each", "explain", "fmu", "experiment", "ssp")
_SO_FAR = "this was the best answer so far"
_OF_SYSTEMS = {"records", "time", "hold", *_SYSTEM_OPTIONS}
Tell = Callable[[str], None]
Writer = Callable[[Path, Tell], list[Path]]


def run_diagnosis(options: DiagnoseCommand) -> DiagnosisResult:
    """Run ``ppy diagnose``; the report repeats the command.

    Raises
    ------
    UserError
        If a record or the model cannot be used, an effect is unknown, or something could not be
        written.
    """
    explained = options["explain"]
    if explained and len(explained) != 2:
        raise UserError(
            f"--explain {','.join(explained)}: it takes two candidates, not {len(explained)}"
        )
    result = _made(diagnose, options, only(DiagnoseKeywords, options))
    if explained:
        out.print()
        out.print(*result.explain(*explained).overview(), sep="\n")

    def experiment(path: Path, tell: Tell) -> list[Path]:
        if result.experiment is None:
            is_open = result.verdict in ("ambiguous", "unexplained")
            reason = "there is no experiment" if is_open else "there are no causes to distinguish"
            note(f"{reason}: {path} was not written")
            return []
        return [result.experiment.to_toml(path)]

    write_all(
        options,
        report=_report(result),
        fmu=_fmu(result, options),
        experiment=experiment,
        ssp=lambda path, tell: [result.system(path)],
    )
    if result.is_interrupted:
        end_interrupted(_SO_FAR)
    return result


def run_each(options: DiagnoseCommand, workers: int) -> list[str]:
    """Run ``ppy diagnose --workers``; the page repeats the command. Return all verdicts.

    Raises
    ------
    UserError
        If the model cannot be used, no record can, or an option is given that is of one record.
    SystemExit
        After the results, if some records could not be diagnosed or Ctrl-C was pressed.
    """
    reason = "is of one diagnosis; --workers makes several"
    refuse(DiagnoseCommand, options, reason, _OF_ONE)
    files = record_files(options)
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
    write_files(options, report=partial(write_page, found, command=typed_command()))
    if found.missing:
        end_interrupted(f"{len(found.missing)} of {len(files)} records were not diagnosed")
    if found.failures:
        raise SystemExit(2)
    return [one.verdict for one in found.values()]


def _made(
    work: Callable[..., DiagnosisResult],
    options: DiagnoseCommand | LawsCommand,
    chosen: DiagnoseKeywords | LawsKeywords,
) -> DiagnosisResult:
    """Return the result of a function of the API by its keywords; print it, and write its JSON.

    All output files are checked first, and the model before any remark is printed.
    """
    name = options["model"] or registry.default_model()
    check_files(options, model_file(name))
    declared = declared_model(name, options["laid_over"])
    refuse_without_laws(declared, chosen)
    note_neutral(declared, options["settings"] or {})
    records, holdouts = held_out(options["records"], declared, options)
    # of a channel that is constant the diagnosis says what follows from it
    tell_repairs_of((*records, *holdouts), unsaid=("constant",))
    model = build_model(declared)
    with progress() as tell:
        how = {**chosen, "holdout": holdouts or None, "progress": tell}
        result = work(records, model, **how)
    result = result.as_typed(typed_command(), _written(options))
    show_and_write(result, options)
    return result


def _fmu(result: DiagnosisResult, options: DiagnoseCommand | LawsCommand) -> Writer:
    """Return a function that writes the extended model; ``all`` platforms have a compiler here."""

    def fmu(path: Path, tell: Tell) -> list[Path]:
        platforms = platform_list(options["platforms"]) or available_platforms()
        return result.fmu(path, platforms, tell)

    return fmu


def run_laws(options: LawsCommand) -> None:
    """Run ``ppy laws``; the report repeats the command.

    Raises
    ------
    UserError
        If a record or the model cannot be used, an effect is unknown, or something could not be
        written.
    """
    result = _made(laws, options, only(LawsKeywords, options))
    writers: dict[str, Writer] = {
        "effect_out": lambda path, tell: [result.effect(path)],
        "fmu": _fmu(result, options),
    }
    if not result.causes:
        writers = dict.fromkeys(writers, _without_causes)
    write_all(options, report=_report(result), **writers)
    if result.is_interrupted:
        end_interrupted(_SO_FAR)


def _without_causes(path: Path, tell: Tell) -> list[Path]:
    """Say that a file is not written, as there is nothing to write."""
    note(f"no law is found to lack anything: {path} was not written")
    return []


def run_system(options: DiagnoseCommand, system: str) -> None:
    """Run ``ppy diagnose --system``; the report repeats the command.

    Raises
    ------
    UserError
        If the record or the system cannot be used, or an option is given that is of one model only.
    """
    of_models = (name for name in options if name not in _OF_SYSTEMS)
    reason = "is about one model; --system tells which member to name with --model"
    refuse(DiagnoseCommand, options, reason, of_models)
    record, *others = options["records"]
    if others:
        raise UserError("a second record is about one model; --system takes one")
    file = {"the system": Path(system)} if Path(system).suffix.lower() in ENDINGS else {}
    check_outputs(options, {"the record": record, **file})
    chosen = only(DiagnoseKeywords, options)
    with progress() as tell:
        chosen["progress"] = tell
        result = diagnose(record, system=system, **chosen).as_typed(typed_command(), {})
    tell_repairs(result.record.repairs)
    show_and_write(result, options)
    write_all(options, report=_report(result))


def check_files(options: DiagnoseCommand | LawsCommand, model: Path | None = None) -> None:
    """Refuse paths that cannot be written, or that would overwrite another file.

    Parameters
    ----------
    options : DiagnoseCommand or LawsCommand
    model : Path, optional
        File of the model.

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
    roles = {"record": records, "later record": later, "record held out": unseen}
    for role, paths in roles.items():
        for k, path in enumerate(paths, 1):
            number = f" ({k})" if k > 1 else ""
            read[f"the {role}{number}"] = path
    if model is not None:
        kind = "FMU" if model.suffix == ".fmu" else "file"
        read[f"the {kind} of --model"] = model
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


def _written(options: DiagnoseCommand | LawsCommand) -> dict[str, str]:
    """Return the files of a model or an experiment that a command writes, by option."""
    given = cast("Mapping[str, Any]", options)
    names = ("fmu", "ssp", "experiment")
    return {name: str(given[name]) for name in names if given.get(name) is not None}


def _report(result: Displayable) -> Writer:
    """Return a function that writes the report of a result."""

    def report(path: Path, tell: Tell) -> list[Path]:
        tell("drawing the report")
        return [result.report(path)]

    return report


def write_all(options: DiagnoseCommand | LawsCommand, **writers: Writer) -> None:
    """Write all files that options name, even after a failure; then raise the first failure.

    Parameters
    ----------
    options : DiagnoseCommand or LawsCommand
    **writers : callable
        By name of an option: writes its file, calls its second argument with progress, and returns
        the files that it wrote.
    """
    given = cast("Mapping[str, Any]", options)
    failures: list[Exception] = []
    written: list[Path] = []
    with progress() as tell:
        for name, write in writers.items():
            try:
                written += write(given[name], tell) if given[name] is not None else []
            except Exception as error:
                failures.append(error)
    for path in written:
        wrote(path)
    if failures:
        raise failures[0]
