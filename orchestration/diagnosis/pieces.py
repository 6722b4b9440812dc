"""From measured records to those of the kernel: screened by their values, and cut at gaps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.diagnosis.fitting import Point, Problem
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.runs import Record
from orchestration.records import Record as MeasuredRecord
from orchestration.records import record_labels
from orchestration.records.quality import (
    Channels,
    Fault,
    ahead_of_inputs,
    as_measured,
    assess,
    check_sizes,
)
from orchestration.records.sampling import gaps
from orchestration.reporting import option

Note = tuple[str, str, str]  # code, subject and sentence

_SHORTEST = 12  # samples of a piece between two gaps; a shorter one tells little but its start
_SUBSTEPS = (1, 8, 60)  # that are tried until a run stays within bounds
# kinds that a fit shows better: it knows the error around an outlier, and which inputs act
_BY_THE_FIT = ("outlier", "still")


def pieces_of(
    records: Sequence[MeasuredRecord],
    model: LawModel,
    given: Mapping[str, float],
    where: str = "",
    labels: Sequence[str] = (),
) -> tuple[list[Record], list[Note]]:
    """Return records as the kernel takes them, and notes on them, the most severe first.

    Parameters
    ----------
    records : sequence of MeasuredRecord
    model : LawModel
    given : Mapping of str to float
        Values of parameters and inputs, SI, which go before what was recorded.
    where : str
        With which sentences on faults begin; by default the file, of several.
    labels : sequence of str
        Of the records; by default those of `record_labels`.

    Raises
    ------
    UserError
        If a value is no measurement, or no record has an output that can be used.
    """
    pieces, faults = [], []
    notes: list[Note] = []
    named = zip(records, labels or record_labels(records), strict=True)
    for group, (record, label) in enumerate(named):
        channels, found = _screened(record, model, given)
        of = where or (f"in {record.source.name}, " if len(records) > 1 else "")
        faults += [(fault, f"{of}{fault.sentence}") for fault in found]
        notes += _notes_on_absent(record, model, given)
        cut = _cut(channels, model, float(record.time[0]), label)
        pieces += [model.simulated(replace(piece, group=group)) for piece in cut]
        if len(cut) > 1:
            text = f"{record.source.name} has gaps in its time: it is {len(cut)} records"
            notes.append(("gaps", record.label, text))
    faults.sort(key=lambda item: (not item[0].discredits, item[0].is_evidence))
    told = [(fault.code, fault.channel, text) for fault, text in faults]
    if records:
        _check_outputs(model, pieces, list(dict.fromkeys(text for _, _, text in told)))
    return pieces, list(dict.fromkeys([*told, *notes]))


def _cut(channels: Channels, model: LawModel, begin: float, label: str) -> list[Record]:
    """Return the pieces between gaps of a run that began at a time, s."""
    inputs, outputs = _columns(channels, model)
    spans = _spans(channels.time, model)
    pieces = []
    for number, (first, last) in enumerate(spans, 1):
        start = channels.time[first]
        own = channels.time[first:last] - start, inputs[first:last], outputs[first:last]
        name = f"{label}.{number}" if len(spans) > 1 else label
        held = (False,) * inputs.shape[1]
        pieces.append(Record(*own, held, name, float(begin - start)))
    return pieces


def _notes_on_absent(
    record: MeasuredRecord, model: LawModel, given: Mapping[str, float]
) -> Iterator[Note]:
    """Yield notes on inputs that a record lacks."""
    units = {v.name: v.unit for v in model.recorded}
    for name, value in absent_inputs(record, model, given).items():
        text = (
            f"{name} is not in {record.source.name}: it is taken to be {value:g} {units[name]}"
            f" throughout; {option('settings', f'{name}=...')} says otherwise"
        )
        yield "absent_input", name, text


def _check_outputs(model: LawModel, pieces: Sequence[Record], faults: Sequence[str]) -> None:
    """Raise an error unless an output can be used; sentences on faults say why."""
    where = model.cls.name
    if not pieces:
        raise UserError(f"{where}: no record has {_SHORTEST} samples between two gaps")
    if not any(piece.measured.any() for piece in pieces):
        outputs = ", ".join(output.name for output in model.outputs)
        raise UserError(f"{where}: {'; '.join(faults) or f'no record has any of {outputs}'}")


def recorded_inputs(
    record: MeasuredRecord, model: LawModel, given: Mapping[str, float]
) -> dict[str, Array]:
    """Return the inputs (n,) of a record by name: as given, as recorded, or as they start."""
    absent = absent_inputs(record, model, given)
    constant = {**absent, **{v.name: given[v.name] for v in model.recorded if v.name in given}}
    return {
        v.name: np.full(len(record.time), float(constant[v.name]))
        if v.name in constant
        else record.signals[v.name].astype(float)
        for v in model.recorded
    }


def absent_inputs(
    record: MeasuredRecord, model: LawModel, given: Mapping[str, float]
) -> dict[str, float]:
    """Return the values of inputs that a record lacks, by name."""
    known = {*given, *record.signals}
    return {v.name: float(v.start) for v in model.recorded if v.name not in known}


def _screened(
    record: MeasuredRecord, model: LawModel, given: Mapping[str, float]
) -> tuple[Channels, list[Fault]]:
    """Return a record without samples that cannot be believed, and faults.

    What the model does itself at its nominal values is no fault.
    """
    names = [output.name for output in model.outputs if output.name in record.signals]
    outputs = {name: record.signals[name] for name in names}
    channels = Channels(record.time, recorded_inputs(record, model, given), outputs)
    check_sizes(channels)
    if not outputs:
        return channels, []
    channels, resampled = as_measured(channels)
    simulated = _simulated(channels, model, given)
    by_model = ahead_of_inputs(replace(channels, outputs=simulated))
    ahead = [fault for fault in ahead_of_inputs(channels) if fault not in by_model]
    usable, found = assess(channels, simulated)
    copied = {fault.channel for fault in found if fault.kind == "copied"}
    faults = [
        fault
        for fault in (*resampled, *ahead, *found)
        if fault.kind not in _BY_THE_FIT and (fault.kind == "copied" or fault.channel not in copied)
    ]
    return usable, faults


def _simulated(channels: Channels, model: LawModel, given: Mapping[str, float]) -> dict[str, Array]:
    """Return the measured outputs (n,) of a model at its nominal values; none if it runs away.

    After each gap in time it starts anew.
    """
    problem = Problem(model, (), np.ones(len(model.outputs)), (), values=given)
    setting = problem.setting(Point(problem.mean, np.zeros(0), ()), ())
    start = problem.nominal[list(model.start_positions)]
    inputs, unknown = _columns(channels, model)
    outputs = np.full(unknown.shape, np.nan)
    for first, last in _spans(channels.time, model):
        held = (False,) * inputs.shape[1]
        time = channels.time[first:last] - channels.time[first]
        part = model.simulated(Record(time, inputs[first:last], unknown[first:last], held))
        course = None
        for substeps in _SUBSTEPS:
            course = course or model.run(part, replace(setting, substeps=substeps), start)
        if course is None:
            return {}
        substeps = model.substeps(part, setting, course)
        course = model.run(part, replace(setting, substeps=substeps), start) or course
        outputs[first:last] = course.outputs
    simulated = zip(model.outputs, outputs.T, strict=True)
    return {v.name: values for v, values in simulated if v.name in channels.outputs}


def _columns(channels: Channels, model: LawModel) -> tuple[Array, Array]:
    """Return inputs (n, nu) and measured outputs (n, ny) in the order of a model; NaN is a gap."""
    count = len(channels.time)
    inputs = np.zeros((count, len(model.inputs)))
    for j, variable in enumerate(model.inputs):
        if variable in model.recorded:
            inputs[:, j] = channels.inputs[variable.name]
    outputs = np.full((count, len(model.outputs)), np.nan)
    for j, output in enumerate(model.outputs):
        outputs[:, j] = channels.outputs.get(output.name, np.nan)
    return inputs, outputs


def _spans(time: Array, model: LawModel) -> list[tuple[int, int]]:
    """Return first and last sample of the pieces between gaps.

    The whole if most would be lost, or if a model has to run from the beginning.
    """
    if model.begins_as_declared:
        return [(0, len(time))]
    ends = [0, *(gaps(time) + 1).tolist(), len(time)]
    spans = [(first, last) for first, last in pairwise(ends) if last - first >= _SHORTEST]
    lost = len(time) - sum(last - first for first, last in spans)
    return spans if 2 * lost < len(time) else [(0, len(time))]
