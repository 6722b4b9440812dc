"""Estimation of frequency responses from a record: usable signals, spectra, ratios."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from fmus.kit.arrays import Array, Signals
from fmus.kit.errors import UserError, suggestion
from fmus.kit.units import base_unit
from orchestration.identify.spectral.local_polynomial import (
    Estimates,
    Spectra,
    Spectrum,
    estimate,
)
from orchestration.identify.spectral.periods import named_period, period_of
from orchestration.identify.spectral.response import Response
from orchestration.identify.spectral.result import FrequencyResponse
from orchestration.records import Record
from orchestration.records.sampling import sample_period
from orchestration.reporting import option

_SHARED = 0.5  # of the excited lines of an input that may be those of another
_TOO_SHORT = "the record is too short for a response that changes so fast"
_ALIKE = "cannot be told from what another input does, or from the transient"
_KNOWN_UNITS = ("ohm", "S", "F", "H")


class Ratio(NamedTuple):
    """A ratio of two signals of a record."""

    above: str
    below: str

    def __str__(self) -> str:
        return f"{self.above}/{self.below}"


@dataclass(frozen=True)
class _Stretch:
    """The last samples of a record, whose spectra are taken: whole periods, where inputs have them.

    Attributes
    ----------
    record : Record
    step : float
        Seconds between samples.
    inputs, outputs : list of str
        Signals that are used.
    periods : dict of str to int
        Of the inputs, in samples; 0 without.
    size : int
        Number of samples.
    """

    record: Record
    step: float
    inputs: list[str]
    outputs: list[str]
    periods: dict[str, int]
    size: int

    @property
    def duration(self) -> float:
        """In seconds."""
        return self.size * self.step

    @property
    def skipped(self) -> int:
        """Number of samples before it."""
        return self.record.time.size - self.size


def estimate_responses(
    record: Record,
    inputs: Sequence[str],
    of: Sequence[str] = (),
    *,
    period: float | None = None,
    band: tuple[float, float] | None = None,
    model: str = "",
    modelled: Signals | None = None,
) -> FrequencyResponse:
    """Estimate frequency responses from a record, and from a simulation with the same inputs.

    Parameters
    ----------
    record : Record
        Equally spaced.
    inputs : sequence of str
        Signals that drive it; those that vary count.
    of : sequence of str
        Ratios of signals such as ``voltage/current``; every output over every input that varies
        unless given.
    period : float, optional
        Of the inputs in s; found in them unless given.
    band : tuple of two floats, optional
        Lowest and highest frequency, Hz.
    model : str
        Its name, for the result.
    modelled : Mapping of str to ndarray, shape (n,), optional
        The model's outputs for the record's inputs.

    Returns
    -------
    FrequencyResponse

    Raises
    ------
    UserError
        If samples are missing or not equally spaced, a ratio makes no sense, or no response can be
        estimated.
    """
    step = sample_period(record.source, record.time, "a spectrum")
    varying = [name for name in inputs if name in record.signals and _varies(record, name)]
    ratios = _choose_ratios(record, inputs, varying, of)
    stretch = _choose_stretch(record, step, varying, ratios, period)
    spectra = _transform(stretch, modelled or {})
    estimates = estimate(spectra, *_lines_in(spectra, stretch.duration, band))
    responses = {str(ratio): _response_of(stretch, ratio, estimates) for ratio in ratios}
    if not any(one.frequency.size for one in responses.values()):
        raise UserError(f"{record.source}: {_describe_failure(varying, responses)}")
    notes = tuple(_describe_method(stretch, spectra))
    repairs = tuple(record.repairs)
    return FrequencyResponse(
        record.source.name, model, stretch.size, step, responses, notes, repairs
    )


# --- signals and ratios --------------------------------------------------------------------------


def _varies(record: Record, name: str) -> bool:
    values = record.signals[name]
    return bool(np.nanmax(values) > np.nanmin(values))


def _choose_ratios(
    record: Record, inputs: Sequence[str], varying: Sequence[str], of: Sequence[str]
) -> list[Ratio]:
    """Return the ratios to estimate; refuse those that make no sense."""
    if not varying:
        raise UserError(
            f"{record.source}: no input varies ({', '.join(inputs)}), so there is no response"
        )
    outputs = [name for name in record.signals if name not in inputs]
    if not of:
        return [Ratio(output, name) for output in outputs for name in varying]
    return [_check_ratio(record, inputs, varying, text) for text in of]


def parts_of_ratio(text: str) -> Ratio:
    """Return a ratio of two signals such as ``voltage/current``; UserError for another text."""
    above, slash, below = (part.strip() for part in text.partition("/"))
    if not (slash and above and below) or above == below:
        raise UserError(
            f"{option('of', text)}: write a ratio of two signals, such as voltage/current"
        )
    return Ratio(above, below)


def _check_ratio(record: Record, inputs: Sequence[str], varying: Sequence[str], text: str) -> Ratio:
    """Return a ratio of a record's signals; UserError unless one varying input causes it."""
    written = option("of", text)
    ratio = parts_of_ratio(text)
    for name in ratio:
        if name not in record.signals:
            raise UserError(
                f"{written}: {record.source} has no {name}{suggestion(name, record.signals)}"
            )
        if name in inputs and name not in varying:
            raise UserError(f"{written}: {name} is constant in {record.source}")
    driving = [name for name in ratio if name in varying]
    if len(driving) == 2:
        raise UserError(f"{written}: both are inputs; one of the two has to be an output")
    if not driving and len(varying) > 1:
        raise UserError(
            f"{written}: both are outputs, and {' and '.join(varying)} move them: name the ratio"
            " of each to one of these"
        )
    return ratio


def _check_whole(record: Record, name: str) -> None:
    """Refuse a signal with missing samples."""
    missing = np.flatnonzero(~np.isfinite(record.signals[name]))
    if missing.size:
        more = f" and {missing.size - 1} more" if missing.size > 1 else ""
        raise UserError(
            f"{record.source}: {name} has no value at {record.time[missing[0]]:g} s{more}: a"
            " spectrum needs all samples; cut out a stretch without gaps"
        )


# --- spectra -------------------------------------------------------------------------------------


def _choose_stretch(
    record: Record,
    step: float,
    inputs: Sequence[str],
    ratios: Sequence[Ratio],
    period: float | None,
) -> _Stretch:
    """Return the last samples that are whole common periods of the periodic inputs.

    In a record of fewer than two of these, inputs count as not periodic, and all samples are used.
    """
    outputs = sorted({name for ratio in ratios for name in ratio if name not in inputs})
    for name in (*inputs, *outputs):
        _check_whole(record, name)
    values = {name: record.signals[name] for name in inputs}
    periods = (
        {name: period_of(one) for name, one in values.items()}
        if period is None
        else named_period(period, step, values)
    )
    size = record.time.size
    common = math.lcm(*filter(None, periods.values()))
    if 2 * common > size:
        periods = dict.fromkeys(inputs, 0)
        common = 1
    return _Stretch(record, step, list(inputs), outputs, periods, size - size % common)


def _transform(stretch: _Stretch, modelled: Signals) -> Spectra:
    """Return the spectra of a stretch, also those of the model's outputs; refuse too few lines."""
    size = stretch.size

    def transformed(columns: Sequence[Array]) -> Spectrum:
        used = np.column_stack([column[-size:] for column in columns])
        lines = np.fft.rfft(used - used.mean(axis=0), axis=0)
        return lines[: (size - 1) // 2 + 1] / math.sqrt(size)

    signals = stretch.record.signals
    inputs = transformed([signals[name] for name in stretch.inputs])
    measured = [signals[name] for name in stretch.outputs]
    simulated = [modelled[name] for name in stretch.outputs] if modelled else []
    periods = [stretch.periods[name] for name in stretch.inputs]
    counts = [size // period if period else 0 for period in periods]
    made = Spectra(inputs, transformed([*measured, *simulated]), len(measured), counts)
    spectra = _share_by_smoothness(made)
    needed = spectra.narrowest
    if len(spectra.between) < needed:
        raise UserError(
            f"{stretch.record.source}: {size} samples have {len(spectra.between)} spectral lines to"
            f" use, and {needed} are needed for {len(stretch.inputs)} inputs; record for longer"
        )
    return spectra


def _share_by_smoothness(spectra: Spectra) -> Spectra:
    """Return spectra in which periodic inputs with the same excited lines have smooth responses.

    Harmonics alone do not separate the responses to such inputs.
    """
    lines = {i: set(spectra.harmonics(i).tolist()) for i, n in enumerate(spectra.periods) if n}
    shared: set[int] = set()
    for i, k in combinations(lines, 2):
        if len(lines[i] & lines[k]) > _SHARED * min(len(lines[i]), len(lines[k])):
            shared |= {i, k}
    if not shared:
        return spectra
    counts = [0 if i in shared else n for i, n in enumerate(spectra.periods)]
    stride = max(spectra.periods[i] for i in shared)
    return replace(spectra, periods=counts, stride=stride)


def _lines_in(
    spectra: Spectra, duration: float, band: tuple[float, float] | None
) -> tuple[int, int]:
    """Return the first and the last line of a band in Hz; refuse a band without lines."""
    last = len(spectra.inputs) - 1
    if band is None:
        return 1, last
    low, high = band
    first = max(1, math.ceil(low * duration * (1.0 - 1e-9)))
    until = min(last, math.floor(high * duration * (1.0 + 1e-9)))
    if first > until:
        raise UserError(
            f"{option('band', f'{low:g}Hz..{high:g}Hz')}: the record has lines from"
            f" {1.0 / duration:g} Hz to {last / duration:g} Hz, {1.0 / duration:g} Hz apart"
        )
    return first, until


# --- responses -----------------------------------------------------------------------------------


def _response_of(stretch: _Stretch, ratio: Ratio, estimates: Sequence[Estimates]) -> Response:
    """Return the response of one ratio, without the lines for which the record is too short.

    Estimates are of all outputs over each input; a ratio of two outputs is one of two of these.
    """
    driving = next((name for name in ratio if name in stretch.inputs), stretch.inputs[0])
    estimated = estimates[stretch.inputs.index(driving)]
    outputs = stretch.outputs
    measured, modelled = np.hsplit(estimated.values, [len(outputs)])
    values, derivatives = _take_ratio(ratio, outputs, measured)
    variance = estimated.variance(derivatives)
    kept = ~estimated.is_rough([outputs.index(name) for name in ratio if name in outputs])
    frequency = np.array(estimated.lines) / stretch.duration
    left_out = {
        _TOO_SHORT: frequency[~kept],
        _ALIKE: np.array(estimated.alike) / stretch.duration,
        f"{driving} is not excited": np.array(estimated.weak) / stretch.duration,
    }
    units = stretch.record.units
    return Response(
        str(ratio),
        unit_of_ratio(units[ratio.above], units[ratio.below]),
        frequency[kept],
        values[kept],
        variance[kept],
        2.0 * estimated.freedom[kept],
        _take_ratio(ratio, outputs, modelled)[0][kept] if modelled.shape[1] else None,
        {reason: at for reason, at in left_out.items() if at.size},
    )


def _take_ratio(ratio: Ratio, outputs: Sequence[str], gains: Spectrum) -> tuple[Spectrum, Spectrum]:
    """Return a ratio (n,) of the responses to one input, and its derivatives by them (n, outputs).

    Parameters
    ----------
    ratio : Ratio
    outputs : sequence of str
    gains : ndarray of complex, shape (n, outputs)
    """
    above, below = (
        gains[:, outputs.index(name)] if name in outputs else np.ones(len(gains)) for name in ratio
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        values = above / below
        derivatives = np.zeros_like(gains)
        if ratio.above in outputs:
            derivatives[:, outputs.index(ratio.above)] = 1.0 / below
        if ratio.below in outputs:
            derivatives[:, outputs.index(ratio.below)] = -values / below
    return np.asarray(values, dtype=np.complex128), derivatives


def unit_of_ratio(above: str, below: str) -> str:
    """Return the unit of a ratio of two signals, by a name of its own if it has one.

    Parameters
    ----------
    above, below : str

    Examples
    --------
    >>> [unit_of_ratio(*pair) for pair in (("V", "A"), ("N", "m"), ("m", "N*s"), ("V", "V"))]
    ['ohm', 'N/m', 'm/(N*s)', '1']
    """
    if above == below:
        return "1"
    if below == "1":
        return above
    compound = any(sign in below for sign in "*/ ")
    written = f"{above}/({below})" if compound else f"{above}/{below}"
    try:
        plain = base_unit(written)
    except UserError:
        return written
    return next((name for name in _KNOWN_UNITS if base_unit(name) == plain), written)


# --- words ---------------------------------------------------------------------------------------


def _describe_failure(inputs: Sequence[str], responses: Mapping[str, Response]) -> str:
    """Return the reason why there is no response at all, with advice."""
    reasons = [reason for one in responses.values() for reason in one.left_out]
    names = " and ".join(inputs)
    if _ALIKE in reasons and len(inputs) > 1:
        return (
            f"the responses to {names} cannot be told apart, for their spectra are alike; drive"
            " them by signals that are independent, or in turn"
        )
    if _ALIKE in reasons:
        return (
            f"the response to {names} cannot be told from the transient, for its spectrum is as"
            " smooth as that of a step near an end of the record; excite by several periods, or at"
            " random"
        )
    return f"no response to {names} can be estimated: {'; '.join(dict.fromkeys(reasons))}"


def _describe_method(stretch: _Stretch, spectra: Spectra) -> list[str]:
    """Return a sentence for each input on how its response was estimated."""
    notes = []
    for name, count in zip(stretch.inputs, spectra.periods, strict=True):
        if count:
            notes.append(
                f"{name} repeats every {stretch.periods[name] * stretch.step:.6g} s, {count} times:"
                " responses to it are those at its harmonics, and the lines between tell noise and"
                " transient"
            )
        else:
            notes.append(
                f"responses to {name} are smooth curves, fitted over lines near each frequency"
            )
    if stretch.skipped:
        skipped = stretch.skipped * stretch.step
        notes.append(f"the first {skipped:.6g} s are left out, so that whole periods remain")
    return notes
