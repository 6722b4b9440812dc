"""Records that are not what they say: columns exchanged, of the other sign, or in another unit.

A model that misses much of a record, or that follows it only with parameters that no specimen has,
may be right and the record wired otherwise. That is tried: the model is fitted once more with two
columns exchanged, with the sign of one changed, with one of them, or the clock, in another unit of
its kind, and with outputs integrated or differentiated, or with the sign that they lost.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array, Mask
from fmus.kit.units import BaseUnit, base_unit
from orchestration.discrepancy.candidates import Candidate, FittedCandidate
from orchestration.discrepancy.data import Dataset
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.parallel import parallel_map
from orchestration.discrepancy.selection.misfit import (
    MUCH_NEARER,
    change_from_nominal,
    nominal_outputs,
    pooled,
    share_of_power,
)
from orchestration.discrepancy.selection.search import FAILURES, Search
from orchestration.identify.fitting import FitResult, Problem

_LARGE = 0.15  # error over the spread, from which on it is worth a look
_SPREAD = 1.0  # that error where a model is no nearer than the mean, which explains nothing
_ALIKE = 1.2  # times the least error, among which the usual parameters decide
_HALF = 0.5  # of the spread, up to which an error tells something of parameters
_AS_NEAR = 1.05  # times that error, which another unit may leave where parameters come to reason
# Distance of parameters from nominal, in searched coordinates, most of which are logarithms: from
# the first on one is worth a look, and up to the second it is that of another specimen.
_FAR = float(np.log(8.0))
_USUAL = float(np.log(2.5))
_SAME = 0.1  # of distance, within which readings cannot be told apart
_ENOUGH = 4_000  # samples, to tell readings apart by
# Units that people write for one another, the SI one first; and thousands and thousandths of any.
_KINDS = (
    ("rad", "deg", "revolution"),
    ("rad/s", "rpm", "deg/s"),
    ("m/s", "km/h"),
    ("m", "cm", "um"),
    ("K", "degC", "degF"),
    ("Pa", "bar"),
    ("kg", "g", "t"),
    ("C", "A*h", "mA*h"),
    ("m^3", "l", "ml"),
    ("m^3/s", "l/min", "l/s", "m^3/h"),
    ("kg/s", "kg/h", "kg/min", "g/s"),
    ("s", "min", "h"),
)
_PREFIXES = ("m", "k")
_CLOCK = "time"


@dataclass(frozen=True)
class _Reading:
    """A way to read a record, and the note that it would be.

    Attributes
    ----------
    data : Dataset
        As the model would be given it.
    code : NoteCode
    columns : str
        Of the record, in words.
    unit : str
        That a column is read in; empty for another way.
    folds : Mapping of str to float
        Levels about which outputs lost their sign, in which they are compared without it.
    is_fed_output : bool
        Whether what was measured is fed, and what was fed is compared.
    """

    data: Dataset
    code: NoteCode
    columns: str
    unit: str = ""
    folds: Mapping[str, float] = field(default_factory=dict)
    is_fed_output: bool = False

    def __str__(self) -> str:
        """Return the columns, and the unit if they are read in another."""
        return f"{self.columns} in {self.unit}" if self.unit else self.columns


@dataclass(frozen=True)
class _Worth:
    """Worth of a reading.

    Attributes
    ----------
    error : float
        RMS error of the nearest free run over the spread, pooled over outputs.
    distance : float
        Of the parameters from nominal, in searched coordinates: the largest of all.
    """

    error: float
    distance: float


def mixed_up_columns(search: Search, base: FittedCandidate) -> list[Note]:
    """Return a note on columns that are mixed up, if the model is much nearer with them put right.

    Nearer is what leaves half of the error, or as much with the parameters of a specimen where they
    were out of all reason. Of an input and an output exchanged it is what leaves a quarter: a model
    that is fed what was measured knows where the plant is, and may be wrong elsewhere.

    Parameters
    ----------
    search : Search
        Over the record as it is.
    base : FittedCandidate
        The model without effects, fitted to that.

    Returns
    -------
    list of Note
        One, or none where no way is much nearer.
    """
    present = _worth(base.problem, base.free_run or base.fit)
    is_suspicious = present.error > _LARGE or present.distance > _FAR
    if not is_suspicious or search.budget.spent():
        return []
    few = search.data.part(0, _ENOUGH) if len(search.data.time) > _ENOUGH else search.data
    readings = list(_readings(search, few))

    def worth_of(reading: _Reading) -> _Worth:
        again = replace(search, data=reading.data, progress=lambda text: None)
        try:
            with np.errstate(over="ignore"):  # a simulation that runs away is far off
                return _worth(*again.free_run(), reading)
        except FAILURES:
            return _Worth(np.inf, np.inf)

    as_is, *worths = parallel_map(worth_of, [_Reading(few, NoteCode.OTHER_UNIT, ""), *readings])
    handicaps = np.array([1.0 + reading.is_fed_output for reading in readings])
    errors = handicaps * np.array([worth.error for worth in worths])
    distances = np.array([worth.distance for worth in worths])
    if not readings:
        return []
    near = errors <= _ALIKE * np.min(errors)
    if as_is.error > _LARGE and np.min(errors) < min(MUCH_NEARER * as_is.error, _SPREAD):
        return [_note(readings, near, as_is, worths)]
    in_units = np.array([reading.code is NoteCode.OTHER_UNIT for reading in readings])
    reasonable = in_units & (errors <= _AS_NEAR * as_is.error) & (distances <= _USUAL)
    if as_is.distance <= _FAR or as_is.error > _HALF or not reasonable.any():
        return []
    return [_note(readings, reasonable, as_is, worths)]


def _note(
    readings: Sequence[_Reading], taken: Mask, present: _Worth, worths: Sequence[_Worth]
) -> Note:
    """Return the note on the reading with the usual parameters, and those that do as well.

    Of a linear model the gain alone tells of a unit or a sign, be it of the input or the output.
    """
    order = sorted(map(int, np.flatnonzero(taken)), key=lambda k: worths[k].distance)
    first = readings[order[0]]
    least = worths[order[0]].distance
    others = [readings[k] for k in order[1:] if worths[k].distance <= least + _SAME]
    facts = {
        "columns": first.columns,
        "share": present.error,
        "instead": worths[order[0]].error,
        "others": tuple(str(other) for other in others if other.code is first.code),
    }
    if first.unit:
        facts["unit"] = first.unit
    return Note(first.code, "", facts)


def _readings(search: Search, data: Dataset) -> Iterator[_Reading]:
    """Yield the ways in which data may be meant."""
    columns = {**data.inputs, **data.measured}
    for one, other in combinations(columns, 2):
        exchanged = {one: columns[other], other: columns[one]}
        if not all(_complete(values) for n, values in exchanged.items() if n in data.inputs):
            continue
        is_fed = (one in data.inputs) != (other in data.inputs)
        if is_fed and not (np.ptp(columns[one]) > 0.0 and np.ptp(columns[other]) > 0.0):
            continue  # what does not move is not compared
        names = f"{one} and {other}"
        yield _Reading(_with(data, exchanged), NoteCode.EXCHANGED, names, is_fed_output=is_fed)
    for one, values in columns.items():
        yield _Reading(_with(data, {one: -values}), NoteCode.OTHER_SIGN, one)
    declared = {variable.name: variable.unit for variable in search.base.layout.variables}
    for one, values in columns.items():
        for unit, meant in _confused_with(declared[one]).items():
            read = meant.factor * values + meant.offset
            yield _Reading(_with(data, {one: read}), NoteCode.OTHER_UNIT, one, unit)
    if not data.several:
        for unit, meant in _confused_with("s").items():
            clock = replace(data, time=meant.factor * data.time)
            yield _Reading(clock, NoteCode.OTHER_UNIT, _CLOCK, unit)
        yield from _rates_and_integrals(search, data)
        yield from _with_signs(data, nominal_outputs(search, data))


def _with_signs(data: Dataset, simulated: Mapping[str, Array]) -> Iterator[_Reading]:
    """Yield the data with the sign of the nominal model on outputs that are never negative.

    Some lost it about zero, and others about their mean.
    """
    unsigned = {o: y for o, y in data.measured.items() if np.nanmin(y) >= 0.0 < np.nanmax(y)}
    if not unsigned or not simulated:
        return
    folds = {o: float(np.mean(simulated[o])) for o in unsigned}
    signed = {o: folds[o] + np.sign(simulated[o] - folds[o]) * y for o, y in unsigned.items()}
    yield _Reading(_with(data, signed), NoteCode.UNSIGNED, " and ".join(signed), folds=folds)


def _rates_and_integrals(search: Search, data: Dataset) -> Iterator[_Reading]:
    """Yield the data with all outputs integrated, and differentiated, where none has a gap.

    Each begins where the nominal model does, as neither tells from where it counts.
    """
    if data.several or not (data.even and all(_complete(y) for y in data.measured.values())):
        return
    problem = search.problem(Candidate((), search.base), list(search.parameters), search.fixed)
    residual = problem.evaluate(problem.position(problem.start))[0]
    begin = {o: y[0] - residual[o][0] for o, y in search.data.measured.items()}
    names = " and ".join(data.measured)
    step = np.diff(data.time, prepend=data.time[0])
    sums = {o: begin[o] + np.cumsum(y * step) for o, y in data.measured.items()}
    yield _Reading(_with(data, sums), NoteCode.DIFFERENTIATED, names)
    rates = {o: begin[o] + np.gradient(y, data.time) for o, y in data.measured.items()}
    yield _Reading(_with(data, rates), NoteCode.INTEGRATED, names)


def _confused_with(unit: str) -> dict[str, BaseUnit]:
    """Return the units that people write for one, by name, with what makes SI of their values."""
    own = base_unit(unit)
    coherent = replace(own, factor=1.0, offset=0.0)
    names = [prefix + unit for prefix in _PREFIXES]
    for kind in _KINDS:
        if base_unit(kind[0]) == coherent:
            names += kind
    meant: dict[str, BaseUnit] = {}
    for name in names:
        try:
            other = base_unit(name)
        except UserError:
            continue  # "m1" and "mkg" are no units
        if other.exponents == own.exponents and other not in (own, *meant.values()):
            meant[name] = other
    return meant


def _complete(column: Array) -> bool:
    return bool(np.isfinite(column).all())


def _with(data: Dataset, columns: dict[str, Array]) -> Dataset:
    """Return data with other values in some columns."""
    inputs = {name: columns.get(name, values) for name, values in data.inputs.items()}
    measured = {name: columns.get(name, values) for name, values in data.measured.items()}
    return replace(data, inputs=inputs, measured=measured)


def _worth(problem: Problem, fit: FitResult, reading: _Reading | None = None) -> _Worth:
    """Return what a reading is worth by a fit of the model.

    Of a sum noise is small beside the spread, however large it is in what was summed up: of sums,
    rates are compared. What has no sign is compared without one.
    """
    shares: list[float] = []
    order = int(reading is not None and reading.code is NoteCode.DIFFERENTIATED)
    folds = reading.folds if reading else {}
    for output, residual in fit.residual.items():
        measured = problem.measured[output][problem.present[output]]
        if output in folds:
            deviation = measured - folds[output]
            measured = np.abs(deviation)
            residual = measured - np.abs(deviation - residual)
        shares.append(share_of_power(np.diff(measured, order), np.diff(residual, order)))
    change = np.abs(change_from_nominal(problem, fit))
    return _Worth(pooled(shares), float(np.max(change, initial=0.0)))
