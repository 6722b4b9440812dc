"""Diagnosis from Python: ``ppy.diagnose``, and ``ppy.laws``, which only searches the laws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Unpack, cast, overload

from fmus.kit import UserError, registry
from fmus.kit.extras import require
from orchestration.api.batch import Diagnoses, diagnose_each, named_records
from orchestration.api.command import equivalent_command
from orchestration.api.declaration import options_of, stated_of, takes, words_of
from orchestration.api.forms import optional_seconds
from orchestration.api.options import (
    DiagnoseKeywords,
    DiagnoseOptions,
    EachOption,
    LawsKeywords,
    LawsOptions,
    MappingOption,
)
from orchestration.api.records import Data, Records, held_out, listed, matching_record, one_record
from orchestration.api.results import DiagnosisResult
from orchestration.api.simulation import as_declared, values_of
from orchestration.api.system_results import SystemResult
from orchestration.diagnosis import Options as DiagnosisOptions
from orchestration.diagnosis import diagnose as diagnose_by_terms
from orchestration.diagnosis import law_map
from orchestration.diagnosis.changes import changes_in_time
from orchestration.diagnosis.foreign import FmuDiagnosis, diagnose_fmu
from orchestration.diagnosis.systems import SystemOptions, diagnose_system
from orchestration.experiment.subjects import find_system
from orchestration.fmu import Model
from orchestration.fmu.signal import numeric
from orchestration.identify.comparison import with_measured
from orchestration.records import refuse_same
from orchestration.reporting import flag, option
from orchestration.system import System

_OF_SYSTEMS = (*options_of(MappingOption), "settings", "hold", "time", "progress")


@overload
def diagnose(
    record: Records, model: Model | str | Path | None = None, **options: Unpack[DiagnoseKeywords]
) -> DiagnosisResult: ...


@overload
def diagnose(
    record: Data, *, system: System | str | Path, **options: Unpack[DiagnoseKeywords]
) -> SystemResult: ...


@overload
def diagnose(
    record: Records,
    model: Model | str | Path | None = None,
    *,
    workers: int,
    **options: Unpack[DiagnoseKeywords],
) -> Diagnoses: ...


@takes(EachOption, DiagnoseKeywords)
def diagnose(
    record: Records,
    model: Model | str | Path | None = None,
    *,
    system: System | str | Path | None = None,
    workers: int | None = None,
    **options: Unpack[DiagnoseKeywords],
) -> DiagnosisResult | SystemResult | Diagnoses:
    """Find the causes of a model's error on a record, extend the model, and validate the extension.

    Several records have the same parameters, and each has its own start states; with `workers`
    each is diagnosed by itself.

    Parameters
    ----------
    record : Record, str, Path, DataFrame, Mapping of str to array_like, or sequence of these
        From `read_record`, or an argument of it. A file whose clock restarts has several records,
        numbered from 1.
    model : Model, str or Path, optional
        A component, ``path/to/file.py:Class``, any FMU, or a result of `find_model`; by default
        the first of ``ppy list``.
    system : System, str or Path, optional
        In place of a model: a system, its name, or its ``.ssp`` file, of which the members are
        judged on one record. Names of columns, settings and `hold` are ``member.variable``; further
        options but `time` and `progress` are of one model.

    Returns
    -------
    DiagnosisResult
        Of a model.
    SystemResult
        Of a system.
    Diagnoses
        With `workers`: a mapping of records to results, with ``failures`` of those that cannot be
        used; after Ctrl-C of those that are done.

    Raises
    ------
    UserError
        If a record, the model or the system cannot be used, or an effect or a parameter is unknown.

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
    if workers is not None:
        _refuse_of_all(system, options)
        alone = {**options, "progress": _silent}
        one = partial(_diagnose_alone, model, alone)
        tell = options["progress"]
        return diagnose_each(named_records(listed(record), options, tell), one, workers, tell)
    if system is not None:
        return _of_system(record, model, system, options)
    subject = as_declared(model).with_units(options["units"] or {})
    refuse_without_laws(subject, options)
    measured, unseen = held_out(record, subject, options)
    subject = with_measured(subject, *measured)
    chosen = _chosen(subject, options, fit=options["fit"], laws=options["laws"])
    compared = cast("Sequence[Data]", options["compare"] or ())
    later = [matching_record(one, subject, options) for one in compared]
    refuse_same([*measured, *unseen], subject.outputs)
    if later:
        refuse_same([*measured, *unseen, *later], subject.outputs, option("compare"))
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
    if not later:
        return DiagnosisResult(diagnosis, command, around=around)
    changed = changes_in_time(diagnosis, later, chosen, options["progress"])
    return DiagnosisResult(diagnosis, command, changed)


def _silent(text: str) -> None:
    """Report no progress of one record among several."""


def _diagnose_alone(
    model: Model | str | Path | None, options: Mapping[str, Any], record: Data
) -> DiagnosisResult:
    """Diagnose one record; a function of a module, as another process calls it."""
    result: DiagnosisResult = diagnose(record, model, **options)
    return result


def _refuse_of_all(system: System | str | Path | None, options: DiagnoseKeywords) -> None:
    """Raise UserError for an option that is about all records, or about a system."""
    given = {"system": system, "compare": options["compare"], "each": options["each"]}
    unfit = next((name for name, value in given.items() if value), None)
    if unfit is not None:
        raise UserError(
            f"{option(unfit)} is about all records; {option('workers')} diagnoses each by itself"
        )


def _of_system(
    record: Records,
    model: Model | str | Path | None,
    system: System | str | Path,
    options: DiagnoseKeywords,
) -> SystemResult:
    """Diagnose the members of a system on one record."""
    values = cast("Mapping[str, object]", options)
    given = stated_of(DiagnoseKeywords, values)
    unfit = ["model"] if model is not None else []
    unfit += [name for name in given if name not in _OF_SYSTEMS]
    if unfit:
        raise UserError(
            f"{option(unfit[0])} is about one model; a system tells which of its members to name"
        )
    source = one_record(record, options)
    found = system if isinstance(system, System) else find_system(str(system))
    chosen = SystemOptions(
        options["mapping"] or {},
        options["settings"] or {},
        options["hold"],
        optional_seconds(options["time"]),
    )
    judged = diagnose_system(source, found, chosen, options["progress"])
    word = str(system) if isinstance(system, str | Path) else found.name
    words = words_of(DiagnoseOptions, values)
    return SystemResult(
        judged,
        ["ppy", "diagnose", str(judged.record.source), flag("system"), word, *words],
    )


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


def refuse_without_laws(subject: Model, options: DiagnoseKeywords | LawsKeywords) -> None:
    """Raise an error if the laws of a model are not known, and options of a search need them.

    Raises
    ------
    UserError
        With the alternative to these options.
    """
    if subject.cls is not None:
        return
    given = cast("Mapping[str, object]", options)
    if "compare" not in given:
        raise UserError(
            f"{subject.without_equations}, which has no laws to search; diagnose corrects its"
            f" inputs and outputs, and with {option('effects', [])} does nothing else"
        )
    if given["compare"] is not None:
        raise UserError(f"compare: {subject.without_equations}; diagnose each record by itself")


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
    refuse_without_laws(subject, options)
    measured, unseen = held_out(record, subject, options)
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
