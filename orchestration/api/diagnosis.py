"""Diagnosis from Python: ``ppy.diagnose``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from fmus.kit.errors import UserError
from fmus.kit.sensors import MEASUREMENTS
from orchestration.api.command import diagnosing
from orchestration.api.diagnosed import DiagnosisResult
from orchestration.api.records import Records, held_out, matching_record
from orchestration.api.simulation import values_of
from orchestration.discrepancy import before_after, pipeline
from orchestration.discrepancy.foreign.surrounding import Surrounded, surround
from orchestration.discrepancy.note import UnusableRecordError
from orchestration.discrepancy.report import wording
from orchestration.fmu.model import Model, find_model
from orchestration.fmu.signal import Value, numeric
from orchestration.records import Record
from orchestration.rig import DRIVEN, HIGHEST, LIMITS

_LINEARISATIONS = 4  # of an FMU at most


def diagnose(
    record: Records,
    model: Model | str = "ppy_actuator",
    *,
    holdout: Records | None = None,
    compare: Record | str | Path | None = None,
    runs: str | None = None,
    each: Sequence[str] = (),
    effects: Sequence[str] | None = None,
    hold: Sequence[str] = (),
    settings: Mapping[str, float | str] | None = None,
    mapping: Mapping[str, str] | None = None,
    interpolate: bool | None = None,
    time: float | None = None,
    laws: bool = True,
    fit: Sequence[str] = (),
    progress: Callable[[str], None] = lambda text: None,
) -> DiagnosisResult:
    """Name what a model gets wrong on a record, extend it, and measure the gain on data it has not seen.

    Of several records the parameters are the same, and each has starting states of its own.

    Parameters
    ----------
    record : Record, str or Path, or sequence of these
        From `read_record`, or a file. A file whose clock restarts holds several records, numbered from 1.
    model : Model or str
        A component, ``path/to/file.py:Class``, any FMU, or what `find_model` returned.
    holdout : Record, str or Path, or sequence of these, optional
        Other records to judge by, or some of those given by their labels, such as ``"7,8,9"``. Without it the last
        third of the record is held out, or the last third of several records.
    compare : Record, str or Path, optional
        A later record of the same specimen: `DiagnosisResult.changes` then tells which parameters changed, and which
        effects came or went.
    runs : str, optional
        Column of a file that tells its records apart, and labels them.
    each : sequence of str
        Parameters that differ from record to record.
    effects : sequence of str, optional
        Only these, as ``id`` or ``id(output)``; an empty one only recalibrates. ``["families"]`` is all that is known
        and what fits the model's laws by their units, which is the default where a model's file lists no effects.
    hold : sequence of str
        Parameters that are known and not fitted.
    settings : Mapping of str to float or str, optional
        Values of parameters to start from, and of inputs that stayed at a value: SI, or texts with a unit.
    mapping : Mapping of str to str, optional
        Column of a file to signal of the model, for records that are given as files.
    interpolate : bool, optional
        Whether inputs go smoothly between samples, or are held; unless given, the record tells.
    time : float, optional
        Seconds that the search may take, then the best answer so far is returned, with a note; a minute for up to
        60,000 samples and in proportion beyond, unless given. With ``inf`` nothing hangs on how fast the machine is.
        With `compare` it holds for each of three searches.
    laws : bool
        Whether, where something is left that neither parameters nor effects account for, every law is asked what it
        lacks (`laws`). What unseen data confirm of it is a cause.
    fit : sequence of str
        Parameters of an FMU without equations, which is diagnosed from outside: effects of measurement on its outputs,
        and corrections of these by any of its signals.
    progress : callable
        Told what is being done.

    Returns
    -------
    DiagnosisResult

    Raises
    ------
    UserError
        If a record or the model cannot be used, or an effect or a parameter is unknown.

    Examples
    --------
    >>> import orchestration as ppy
    >>> from orchestration.rig.emulator.records import draw, write
    >>> write(draw("strain_saturation", seed=1, duration=300.0), "hidden.csv")
    >>> result = ppy.diagnose("hidden.csv", effects=["strain_saturation", "double_layer"])
    >>> result.causes
    ['strain_saturation']
    >>> low, high = result.parameters["R1"].interval
    """
    subject = find_model(model) if isinstance(model, str) else model
    rig, given = subject.name == DRIVEN, values_of(subject, settings)
    measured, judged = held_out(record, holdout, subject, mapping, runs)
    named, around = model if isinstance(model, str) else subject.name, None
    if subject.cls is None:
        if compare is not None:
            raise UserError(
                f"compare: {subject.name} is an FMU without equations; diagnose each record by itself"
            )
        effects = [*MEASUREMENTS] if effects is None else effects
    elif fit:
        raise UserError(
            f"fit: {subject.name} has equations, and all its parameters are fitted; hold leaves some out"
        )
    options = pipeline.Options(
        given={} if subject.cls is None else numeric(given),
        effects=effects,
        hold=hold,
        each=each,
        interpolate=interpolate,
        limits=LIMITS if rig else None,
        highest_frequency=HIGHEST if rig else float("inf"),
        time=time,
        laws=laws,
    )
    later = None if compare is None else matching_record(compare, subject, mapping)
    try:
        if subject.cls is None:
            result, around = _from_outside(subject, measured, judged, given, fit, options, progress)
        else:
            result = pipeline.diagnose(measured, subject, judged, options, progress)
    except UnusableRecordError as error:
        raise unusable(measured, error) from error
    command = diagnosing(measured, named, judged, later, options, settings, mapping, runs)
    command += ["--fit", ",".join(fit)] if fit else []
    if later is None:
        return DiagnosisResult(result, command=command, around=around)
    try:
        compared = before_after.compare(result, later, options, progress)
    except UnusableRecordError as error:
        raise unusable([later], error) from error
    more = [note for note in compared.notes if note not in result.notes]
    return DiagnosisResult(
        replace(result, notes=[*result.notes, *more]), compared.changes, compared.later, command
    )


def _from_outside(
    fmu: Model,
    measured: Sequence[Record],
    judged: Sequence[Record],
    given: Mapping[str, Value],
    fit: Sequence[str],
    options: pipeline.Options,
    progress: Callable[[str], None],
) -> tuple[pipeline.Result, Surrounded]:
    """Diagnose what stands behind an FMU; where its parameters move beside a correction, it is linearised anew."""
    around = surround(fmu, measured, judged, given, fit, progress)
    for left in reversed(range(_LINEARISATIONS)):
        own = replace(options, hold=[*options.hold, *around.at_rest])
        result = pipeline.diagnose(around.records, around.model, around.holdouts, own, progress)
        moved = around.moved_to(result.diagnosis.estimates)
        if not moved or not left:
            break
        around = surround(fmu, measured, judged, given, fit, progress, moved)
    return replace(result, notes=around.of_recorded(result.notes)), around


def unusable(records: Sequence[Record], error: UnusableRecordError) -> UserError:
    """What is told of records of which nothing can be judged."""
    reasons = "; ".join(wording.message(note) for note in error.notes)
    return UserError(
        f"{pipeline.file_names(records)}: no output can be both fitted and judged: {reasons}"
    )
