"""Screening of the data that a diagnosis rests on, and their division by :mod:`holdout`."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from fmus.kit import Component, UserError
from fmus.kit.arrays import Array
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.holdout import HELD_OUT, ValidationData
from orchestration.discrepancy.note import Note, NoteCode, UnusableRecordError
from orchestration.identify.fitting import ModelOverRuns
from orchestration.identify.noise import ORDER, noise_std, segments
from orchestration.records.quality import (
    Fault,
    as_measured,
    assess,
    check_sizes,
    without_oversampling,
)
from orchestration.reporting import option

_SHORTEST = 150  # samples to fit to
_LASTING = 0.5  # of the record, before which an output ends too early
_FEWEST = 20  # samples that an output must have
_LOST = 0.05  # of the noise, below which a response is lost even in thousands of samples
_SEEN = 5.0  # times the noise, from which on a movement is none of noise, be it of some colour
OVER_RECORD = "the record from where it starts"
_DERIVATIVE = re.compile(r"\bd\(\w+\)/d\(")  # in the message of a simulation that fails


@dataclass(frozen=True)
class DividedData:
    """A record that was screened and divided.

    Attributes
    ----------
    usable : Dataset
        All that the model is fitted to once its gain is known: the estimation data, and what was
        held out of a record.
    estimation : Dataset
        The part of it that is fitted to.
    validation : ValidationData
    notes : list of Note
        On what was left out of either, and why.
    """

    usable: Dataset
    estimation: Dataset
    validation: ValidationData
    notes: list[Note]

    def taken(self, how: Callable[[Dataset], Dataset]) -> DividedData:
        """Apply a function to all parts, such as one that takes inputs as smooth."""
        return replace(
            self,
            usable=how(self.usable),
            estimation=how(self.estimation),
            validation=replace(self.validation, data=how(self.validation.data)),
        )


def screen_and_divide(
    cls: type[Component],
    data: Dataset,
    holdout: Dataset | None,
    fixed: Mapping[str, float],
    each: bool = False,
) -> DividedData:
    """Screen a record and divide it into estimation and validation data.

    Parameters
    ----------
    cls : type[Component]
    data : Dataset
    holdout : Dataset, optional
        Other records to judge by; without them the end of the record is held out, or the last third
        of several.
    fixed : Mapping of str to float
        Parameters of the model.
    each : bool
        Whether any parameter differs from record to record.

    Raises
    ------
    UserError
        If a value is no measurement, the record is too short, or no output can be both fitted and
        judged.
    """
    data, notes = _measured(data)
    least = round(_SHORTEST / (1.0 - HELD_OUT)) if holdout is None else _SHORTEST
    samples = int(data.within.sum())
    if samples < least:
        raise UserError(f"{samples} samples are too few for a diagnosis; {least} are the least")
    usable, faults = screened(cls, data, fixed)
    notes += faults
    judged = None
    if holdout is not None:
        judged, others = _screened_holdout(cls, holdout, fixed)
        notes += [note.of_holdout() for note in others if note not in notes]
    usable, early = drop_truncated(usable)
    if judged is None:
        estimation, validation = ValidationData.split(usable, each)
    else:
        estimation = usable
        validation = ValidationData.separate_record(judged, each)
    kept = outputs_with_enough_samples(estimation)
    notes += early + [Note(NoteCode.MANY_GAPS, o) for o in estimation.measured if o not in kept]
    validation = replace(validation, data=validation.data.only(kept))
    if not (kept and validation.data.measured):
        raise UnusableRecordError(notes)
    notes += [
        Note(NoteCode.NOT_IN_VALIDATION_DATA, o) for o in kept if o not in validation.data.measured
    ]
    estimation = estimation.only(kept)
    return DividedData(
        usable.only(kept) if judged is None else estimation, estimation, validation, notes
    )


def _screened_holdout(
    cls: type[Component], holdout: Dataset, fixed: Mapping[str, float]
) -> tuple[Dataset, list[Note]]:
    """Screen records to judge by, of which an error says so."""
    try:
        data, notes = _measured(holdout)
        usable, faults = screened(cls, data, fixed)
        return usable, notes + faults
    except UnusableRecordError as error:
        raise UnusableRecordError([note.of_holdout() for note in error.notes]) from error


def _measured(data: Dataset) -> tuple[Dataset, list[Note]]:
    """Return the samples that were measured; those of several runs stay.

    Raises
    ------
    UserError
        If a value is no measurement.
    """
    check_sizes(data.channels)
    if data.several:
        return data, []
    kept, faults = as_measured(data.channels)
    if not faults:
        kept, faults = without_oversampling(data.channels)
    return data.with_channels(kept), list(map(note_of, faults))


def note_of(fault: Fault) -> Note:
    """Return the note on a fault."""
    return Note(NoteCode(fault.code), fault.channel, fault.facts)


def screened(
    cls: type[Component], data: Dataset, fixed: Mapping[str, float]
) -> tuple[Dataset, list[Note]]:
    """Leave out what cannot be trusted; what the model does too is no fault of the data.

    Raises
    ------
    UserError
        If nothing is left.
    """
    try:
        simulated = _simulated(cls, data, fixed)
    except UserError:
        simulated = {}
    usable, faults = assess(
        data.channels, {o: simulated[o] for o in data.measured if o in simulated}
    )
    notes = [note_of(fault) for fault in sorted(faults, key=lambda fault: bool(fault.channel))]
    enough = {o: y for o, y in usable.outputs.items() if np.isfinite(y).sum() >= _FEWEST}
    notes += [Note(NoteCode.TOO_FEW_SAMPLES, o) for o in usable.outputs if o not in enough]
    if not enough:
        raise UnusableRecordError(notes)
    return replace(data, measured=enough), notes


def drop_truncated(data: Dataset) -> tuple[Dataset, list[Note]]:
    """Leave out outputs that end long before the others.

    The part held out is the end of what all of them have. Of several records whole ones are held
    out, and an output may be missing in any of them.
    """
    if data.several:
        return data, []
    ends = {o: int(np.flatnonzero(np.isfinite(y))[-1]) for o, y in data.measured.items()}
    short = [o for o, end in ends.items() if end < _LASTING * max(ends.values())]
    notes = [Note(NoteCode.ENDS_EARLY, o, {"time": float(data.time[ends[o]])}) for o in short]
    return data.only([o for o in ends if o not in short]), notes


def outputs_with_enough_samples(data: Dataset) -> list[str]:
    """Return the outputs with enough consecutive samples to estimate their noise."""
    memory = ORDER if data.even else 0
    kept = []
    for output, y in data.measured.items():
        lengths = [last - first - memory for first, last in segments(np.isfinite(y))]
        if sum(length for length in lengths if length > 0) >= _FEWEST:
            kept.append(output)
    return kept


def is_excited(cls: type[Component], data: Dataset, fixed: Mapping[str, float]) -> bool:
    """Return True if the inputs move any output by more than is lost in its noise.

    Simulations with the inputs as they are and with their means are compared; the noise is what
    third differences of the measurement show. If the model cannot be simulated, nothing speaks
    against excitation.
    """
    if not any(np.ptp(values) > 0.0 for values in data.inputs.values()):
        return False
    means = {name: np.full_like(values, values.mean()) for name, values in data.inputs.items()}
    try:
        moved = _simulated(cls, data, fixed)
        still = _simulated(cls, replace(data, inputs=means), fixed)
    except UserError:
        return True
    for output, y in data.measured.items():
        if float(np.sqrt(np.mean((moved[output] - still[output]) ** 2))) > _LOST * noise_std(y, 3):
            return True
    return False


def has_transient(data: Dataset) -> bool:
    """Return True if any output moves by far more than its noise, as what settles does.

    The noise is what third differences of the measurement show.
    """
    for y in data.measured.values():
        noise = noise_std(y, 3)
        if max(float(np.nanvar(y)) - noise**2, 0.0) ** 0.5 > _SEEN * noise:
            return True
    return False


def _simulated(cls: type[Component], data: Dataset, fixed: Mapping[str, float]) -> dict[str, Array]:
    """Simulate a model with its start values; return outputs and states.

    Raises
    ------
    UserError
        If it cannot be simulated.
    """
    values = {p.name: float(p.start) for p in cls.layout.parameters} | dict(fixed)
    model = ModelOverRuns(cls, (), data.linear or (), data.runs)
    with telling_of_simulation(cls, OVER_RECORD):
        return model.run(data.time, data.inputs, values, runs=data.runs).signals


@contextmanager
def telling_of_simulation(cls: type[Component], over: str) -> Iterator[None]:
    """Say of a simulation that fails which it is.

    Parameters
    ----------
    cls : type[Component]
        The model.
    over : str
        The data, and the values of parameters.

    Raises
    ------
    UserError
        If it fails.
    """
    try:
        yield
    except (UserError, np.linalg.LinAlgError) as error:
        reason = str(error)
        if _DERIVATIVE.search(reason):
            reason += "; a slope of some law is infinite there, as that of sqrt(x) is at 0"
        raise UserError(
            f"{cls.name} cannot be simulated over {over}: {reason}; give other values with"
            f" {option('settings')}, or another law"
        ) from error
