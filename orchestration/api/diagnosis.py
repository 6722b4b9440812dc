"""Diagnosis from Python: ``ppy.diagnose``, and ``ppy.laws``, which only searches the laws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Unpack

from fmus.kit import UserError, registry
from fmus.kit.extras import require
from orchestration.api.command import equivalent_command
from orchestration.api.declaration import takes
from orchestration.api.forms import optional_seconds
from orchestration.api.options import (
    DiagnoseKeywords,
    DiagnoseOptions,
    LawsKeywords,
    LawsOptions,
)
from orchestration.api.records import Records, held_out, matching_record
from orchestration.api.results import DiagnosisResult
from orchestration.api.simulation import as_declared, values_of
from orchestration.api.term_results import TermDiagnosisResult
from orchestration.diagnosis import Options as TermOptions
from orchestration.diagnosis import diagnose as diagnose_by_terms
from orchestration.diagnosis import law_map
from orchestration.diagnosis.changes import find_changes
from orchestration.diagnosis.foreign import FmuDiagnosis, diagnose_fmu
from orchestration.discrepancy import UnusableRecordError, before_after, pipeline
from orchestration.discrepancy.report import wording
from orchestration.fmu import Model, Value
from orchestration.fmu.model import built
from orchestration.fmu.signal import numeric
from orchestration.records import Record, refuse_same
from orchestration.reporting import option


@takes(DiagnoseKeywords)
def diagnose(
    record: Records, model: Model | str | Path | None = None, **options: Unpack[DiagnoseKeywords]
) -> DiagnosisResult:
    """Find the causes of a model's error on a record, extend the model, and validate the extension.

    Several records have the same parameters, and each has its own start states.

    Parameters
    ----------
    record : Record, str, Path, DataFrame, Mapping of str to array_like, or sequence of these
        From `read_record`, or an argument of it. A file whose clock restarts has several records,
        numbered from 1.
    model : Model, str or Path, optional
        A component, ``path/to/file.py:Class``, any FMU, or a result of `find_model`; by default
        the first of ``ppy list``.

    Returns
    -------
    DiagnosisResult

    Raises
    ------
    UserError
        If a record or the model cannot be used, or an effect or a parameter is unknown.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> from demonstrations.records import draw, write
    >>> write(draw("strain_saturation", seed=1, duration=300.0), "hidden.csv")
    >>> result = ppy.diagnose("hidden.csv", effects=["strain_saturation", "double_layer"])
    >>> result.causes
    ['strain_saturation']
    >>> low, high = result.parameters["R1"].interval
    """
    require("threadpoolctl")
    subject = as_declared(model)
    progress = options["progress"]
    mapping = options["mapping"]
    measured, unseen = held_out(record, options["holdout"], subject, mapping, options["runs"])
    refuse_useless_options(subject, options)
    if _is_by_terms(subject, options):
        return _run_new_engine(subject, measured, unseen, model, options)
    given = values_of(subject, options["settings"])
    diagnosis_options = _pipeline_options(subject, given, options)
    compare = options["compare"]
    later = None if compare is None else matching_record(compare, subject, mapping)
    subject = built(subject)
    try:
        result = pipeline.diagnose(measured, subject, unseen, diagnosis_options, progress)
    except UnusableRecordError as error:
        raise _unusable_error(measured, error) from error
    command = equivalent_command(
        "diagnose",
        _word_of(model, subject),
        measured,
        unseen,
        declared=DiagnoseOptions,
        options={**options, "compare": later},
    )
    if later is None:
        return DiagnosisResult(result, command=command)
    try:
        compared = before_after.compare(result, later, diagnosis_options, progress)
    except UnusableRecordError as error:
        raise _unusable_error([later], error) from error
    more = [note for note in compared.notes if note not in result.notes]
    with_notes = replace(result, notes=[*result.notes, *more])
    return DiagnosisResult(with_notes, compared.changes, compared.later, command)


def _is_by_terms(subject: Model, options: DiagnoseKeywords) -> bool:
    """Return whether the new engine is asked: an FMU without equations has no other."""
    return options["engine"] != "old" or subject.cls is None


def refuse_useless_options(subject: Model, options: DiagnoseKeywords) -> None:
    """Raise an error for options of `diagnose` that have no effect on a model.

    Raises
    ------
    UserError
        With the option and the reason.
    """
    if subject.cls is None and options["compare"] is not None:
        raise UserError(f"compare: {subject.without_equations}; diagnose each record by itself")
    if options["fit"] and not _is_by_terms(subject, options):
        raise UserError(
            f"fit: {subject.name} has equations, and all its parameters are fitted; hold leaves"
            " some out"
        )


def _run_new_engine(
    subject: Model,
    measured: Sequence[Record],
    unseen: Sequence[Record],
    model: Model | str | Path | None,
    options: DiagnoseKeywords,
) -> TermDiagnosisResult:
    """Diagnose a model with equations by terms of its laws."""
    chosen = TermOptions(
        hold=options["hold"],
        fit=options["fit"],
        each=options["each"],
        given=numeric(values_of(subject, options["settings"])),
        effects=options["effects"],
        laws=options["laws"],
        interpolate=options["interpolate"],
        time=optional_seconds(options["time"]),
        excitation=registry.excitation(subject.name),
    )
    compare = options["compare"]
    later = None if compare is None else matching_record(compare, subject, options["mapping"])
    refuse_same([*measured, *unseen], subject.outputs)
    if later is not None:
        refuse_same([*measured, *unseen, later], subject.outputs, option("compare"))
    around: FmuDiagnosis | None = None
    if subject.cls is None:
        settings = values_of(subject, options["settings"])
        around = diagnose_fmu(measured, subject, unseen, settings, chosen, options["progress"])
        diagnosis = around.diagnosis
    else:
        diagnosis = diagnose_by_terms(measured, subject, unseen, chosen, options["progress"])
    command = equivalent_command(
        "diagnose",
        _word_of(model, subject),
        measured,
        unseen,
        declared=DiagnoseOptions,
        options={**options, "compare": later},
    )
    if later is None:
        return TermDiagnosisResult(diagnosis, command, around=around)
    changed = find_changes(diagnosis, later, chosen, options["progress"])
    return TermDiagnosisResult(diagnosis, command, changed)


def _pipeline_options(
    subject: Model, given: Mapping[str, Value], options: DiagnoseKeywords
) -> pipeline.DiagnosisOptions:
    """Return the options of the pipeline that correspond to those of `diagnose`."""
    excitation = registry.excitation(subject.name)
    return pipeline.DiagnosisOptions(
        given=numeric(given),
        effects=options["effects"],
        hold=options["hold"],
        each=options["each"],
        interpolate=options["interpolate"],
        limits=excitation.ranges if excitation else None,
        highest_frequency=excitation.bandwidth if excitation else float("inf"),
        time=optional_seconds(options["time"]),
    )


def refuse_without_laws(subject: Model) -> None:
    """Raise an error if the laws of a model are not known.

    Raises
    ------
    UserError
        With the option of `diagnose` to use instead.
    """
    if subject.cls is None:
        raise UserError(
            f"{subject.without_equations}, which has no laws to search; diagnose corrects its"
            f" inputs and outputs, and with {option('effects', [])} does nothing else"
        )


@takes(LawsKeywords)
def laws(
    record: Records, model: Model | str | Path | None = None, **options: Unpack[LawsKeywords]
) -> DiagnosisResult:
    """Search the laws of a model for missing dependences on signals, without names of effects.

    It is the search of `diagnose`, in which every law may depend on every input, state and law, on
    the time, and on memories of these, with a map of what each law gains over each signal.

    Parameters
    ----------
    record : Record, str, Path, DataFrame, Mapping of str to array_like, or sequence of these
        From `read_record`, or an argument of it. A file whose clock restarts has several records,
        numbered from 1.
    model : Model, str or Path, optional
        A component, ``path/to/file.py:Class``, or a result of `find_model`; by default the first
        of ``ppy list``.

    Returns
    -------
    DiagnosisResult
        With `law_map`.

    Raises
    ------
    UserError
        If a record or the model cannot be used, or an effect or a parameter is unknown.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> from demonstrations.records import draw, write
    >>> write(draw(None, seed=1, duration=60.0), "right.csv")
    >>> ppy.laws("right.csv").causes
    []
    """
    require("threadpoolctl")
    subject = as_declared(model)
    refuse_without_laws(subject)
    measured, unseen = held_out(
        record, options["holdout"], subject, options["mapping"], options["runs"]
    )
    refuse_same([*measured, *unseen], subject.outputs)
    chosen = TermOptions(
        hold=options["hold"],
        each=options["each"],
        given=numeric(values_of(subject, options["settings"])),
        effects=options["effects"],
        interpolate=options["interpolate"],
        time=optional_seconds(options["time"]),
        excitation=registry.excitation(subject.name),
    )
    diagnosis = diagnose_by_terms(measured, subject, unseen, chosen, options["progress"])
    command = equivalent_command(
        "laws",
        _word_of(model, subject),
        measured,
        unseen,
        declared=LawsOptions,
        options=options,
    )
    return TermDiagnosisResult(diagnosis, command, law_map=law_map.map_laws(diagnosis))


def _word_of(model: Model | str | Path | None, subject: Model) -> str:
    """Return a model as a word of the command line: as it was given, or its name."""
    return str(model) if isinstance(model, str | Path) else subject.name


def _unusable_error(records: Sequence[Record], error: UnusableRecordError) -> UserError:
    """Return the error for records in which no output can be diagnosed."""
    reasons = "; ".join(wording.message(note) for note in error.notes)
    return UserError(
        f"{pipeline.file_names(records)}: no output can be both fitted and unseen: {reasons}"
    )
