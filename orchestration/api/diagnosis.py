"""Diagnosis from Python: ``ppy.diagnose``, and ``ppy.laws``, which only searches the laws."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Unpack

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
from orchestration.diagnosis import Options as DiagnosisOptions
from orchestration.diagnosis import diagnose as diagnose_by_terms
from orchestration.diagnosis import law_map
from orchestration.diagnosis.changes import find_changes
from orchestration.diagnosis.foreign import FmuDiagnosis, diagnose_fmu
from orchestration.fmu import Model
from orchestration.fmu.signal import numeric
from orchestration.records import refuse_same
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
    refuse_useless_options(subject, options)
    measured, unseen = held_out(
        record, options["holdout"], subject, options["mapping"], options["runs"]
    )
    chosen = _chosen(subject, options, fit=options["fit"], laws=options["laws"])
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
        return DiagnosisResult(diagnosis, command, around=around)
    changed = find_changes(diagnosis, later, chosen, options["progress"])
    return DiagnosisResult(diagnosis, command, changed)


def _chosen(
    subject: Model, options: DiagnoseKeywords | LawsKeywords, **more: Any
) -> DiagnosisOptions:
    """Return the options of the search that `diagnose` and `laws` share, and more of one."""
    return DiagnosisOptions(
        hold=options["hold"],
        each=options["each"],
        given=numeric(values_of(subject, options["settings"])),
        effects=options["effects"],
        interpolate=options["interpolate"],
        time=optional_seconds(options["time"]),
        excitation=registry.excitation(subject.name),
        **more,
    )


def refuse_useless_options(subject: Model, options: DiagnoseKeywords) -> None:
    """Raise an error for options of `diagnose` that have no effect on a model.

    Raises
    ------
    UserError
        With the option and the reason.
    """
    if subject.cls is None and options["compare"] is not None:
        raise UserError(f"compare: {subject.without_equations}; diagnose each record by itself")


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
    chosen = _chosen(subject, options)
    diagnosis = diagnose_by_terms(measured, subject, unseen, chosen, options["progress"])
    command = equivalent_command(
        "laws",
        _word_of(model, subject),
        measured,
        unseen,
        declared=LawsOptions,
        options=options,
    )
    return DiagnosisResult(diagnosis, command, law_map=law_map.map_laws(diagnosis))


def _word_of(model: Model | str | Path | None, subject: Model) -> str:
    """Return a model as a word of the command line: as it was given, or its name."""
    return str(model) if isinstance(model, str | Path) else subject.name
