"""Runs of a model: the records, the settings, and the courses with their derivatives."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from fmus.kit.arrays import Array, Indices, Mask
from fmus.kit.record import Rhythm, Ticks, ticks_of
from orchestration.diagnosis.terms import Term

_KNOTS = 4  # samples that determine a cubic


_JUMP = 0.01  # standard deviations, from which on an input jumps that stands still at most samples
_APART = 0.5  # correlation of an input with itself later, below which it has moved on
_REPEATED = 0.98  # the same, from which on it repeats
_DENSEST = 4  # instants of an even clock, for each sample of a record, at most


def step_of(time: Array) -> float:
    """Return the usual time between samples, s."""
    return float(np.median(np.diff(time)))


@dataclass(frozen=True, eq=False)
class Record:
    """A record of one run, SI.

    Attributes
    ----------
    time : ndarray, shape (n,)
    inputs : ndarray, shape (n, nu)
        In the order of the model.
    outputs : ndarray, shape (n, ny)
        Measured; NaN is a gap.
    smooth : tuple of bool
        Of each input, whether it goes in straight lines between samples or is held.
    label : str
    begin : float
        When the run began and its clocks were started, in its time.
    gain : ndarray, shape (n, nx, ny), or None
        Of an observer, by which measured less predicted outputs correct the states after each
        sample; None for a free run.
    group : int
        Number of the group of records with the same local values; see `LocalValues`.
    denoised : tuple of str
        Inputs, and ``time``, that are read without their noise; an output for each of its values
        that is left out.
    folds : ndarray, shape (ny,), or None
        Levels about which outputs are recorded without a sign; NaN of one that has it.
    pace : float
        Share by which the clock of the outputs is faster than that of the inputs.
    curved : bool
        Whether smooth inputs go in cubics in place of straight lines; see `bends`.
    """

    time: Array
    inputs: Array
    outputs: Array
    smooth: tuple[bool, ...]
    label: str = ""
    begin: float = 0.0
    gain: Array | None = None
    group: int = 0
    denoised: tuple[str, ...] = ()
    folds: Array | None = None
    pace: float = 0.0
    curved: bool = False
    _ticks: dict[tuple[Rhythm, ...], Ticks] = field(default_factory=dict, init=False, repr=False)

    def ticks(self, rhythms: tuple[Rhythm, ...]) -> Ticks:
        """Return the ticks of clocks, which are computed once."""
        if rhythms not in self._ticks:
            self._ticks[rhythms] = ticks_of(self.time, self.begin, rhythms)
        return self._ticks[rhythms]

    def gains(self, memories: int) -> Array | None:
        """Return the gain (n, nx + memories, ny) of an observer: memories are not corrected."""
        return None if self.gain is None else np.pad(self.gain, ((0, 0), (0, memories), (0, 0)))

    @property
    def is_recorded_otherwise(self) -> bool:
        """True if outputs lost their sign, or have a clock of their own."""
        return self.folds is not None or self.pace != 0.0

    @property
    def plain(self) -> Record:
        """The record as if its outputs were recorded like its inputs."""
        return replace(self, folds=None, pace=0.0)

    @cached_property
    def bends(self) -> Array | None:
        """Slopes (n, nu) of curved inputs at the samples, by a cubic spline; else None.

        Also of inputs that cannot be so (see `Reading.apply`), over which no model runs.
        """
        if not self.curved or len(self.time) < _KNOTS or not np.isfinite(self.inputs).all():
            return None
        slopes = CubicSpline(self.time, self.inputs).derivative()(self.time)
        return np.ascontiguousarray(slopes)

    @cached_property
    def measured(self) -> Mask:
        """Outputs (ny,) that are measured at some sample."""
        return np.asarray(np.isfinite(self.outputs).any(axis=0))

    @cached_property
    def jumps(self) -> Mask:
        """Samples (n,) at which an input jumps that stands still at most others."""
        moves = np.abs(np.diff(self.inputs, axis=0, prepend=self.inputs[:1]))
        least = _JUMP * self.inputs.std(axis=0)
        stands = 10.0 * np.median(moves[1:], axis=0) <= least
        return np.asarray(((moves > least) & stands).any(axis=1))

    @cached_property
    def phases(self) -> Indices | None:
        """Numbers (n,) of the samples within a period of the inputs; None unless these repeat."""
        step = step_of(self.time) if len(self.time) > _KNOTS else np.inf
        even = np.arange(self.time[0], self.time[-1], step)
        moving = self.inputs[:, np.ptp(self.inputs, axis=0) > 0.0]
        if not moving.size or len(even) > _DENSEST * len(self.time):
            return None
        likeness = [_likeness(np.interp(even, self.time, column)) for column in moving.T]
        period = _period(np.min(likeness, axis=0))
        if not period:
            return None
        return np.asarray(np.rint((self.time - self.time[0]) / step) % period, dtype=int)

    @cached_property
    def first(self) -> Record:
        """The first sample alone."""
        return self.part(0, 1)

    def part(self, first: int, last: int, step: int = 1) -> Record:
        """Return some of the samples."""
        chosen = slice(first, last, step)
        return replace(
            self,
            time=np.ascontiguousarray(self.time[chosen]),
            inputs=np.ascontiguousarray(self.inputs[chosen]),
            outputs=np.ascontiguousarray(self.outputs[chosen]),
            gain=None if self.gain is None else np.ascontiguousarray(self.gain[chosen]),
        )


@dataclass(frozen=True, eq=False)
class Course:
    """A free run over a record.

    Attributes
    ----------
    outputs : ndarray, shape (n, ny)
    slopes : ndarray, shape (n, m, p)
        Of the m measured outputs, by free parameters, values of the terms, and start states; empty
        unless asked for.
    states : ndarray, shape (n, nx + nz)
        Memories of the terms after the model's own states.
    signs : ndarray, shape (n, ny), or None
        By which outputs that are recorded without their sign were multiplied.
    """

    outputs: Array
    slopes: Array
    states: Array
    signs: Array | None = None


@dataclass(frozen=True, eq=False)
class Linearisation:
    """Derivatives of a model with terms along a course, of its states and memories.

    Attributes
    ----------
    rates : ndarray, shape (n, nx + nz, p + k + nx + nz)
        By free parameters, values of the terms, and states.
    outputs : ndarray, shape (n, ny, p + k + nx + nz)
    rates_by_laws : ndarray, shape (n, nx, nl)
        By additions to the laws.
    outputs_by_laws : ndarray, shape (n, ny, nl)
    laws : ndarray, shape (n, nl)
        Values of the laws without terms.
    steps : ndarray, shape (n - 1, nx + nz, p + k + nx + nz), or None
        Derivatives of the states at the next sample, of a model with discrete states.
    steps_by_laws : ndarray, shape (n - 1, nx + nz, nl), or None
        By additions to the laws that stay for the step.
    gains : ndarray, shape (n, nx + nz, ny), or None
        By which an observer corrects the states at each sample; None of a free run.
    """

    rates: Array
    outputs: Array
    rates_by_laws: Array
    outputs_by_laws: Array
    laws: Array
    steps: Array | None = None
    steps_by_laws: Array | None = None
    gains: Array | None = None

    @property
    def actions(self) -> list[Array]:
        """Effects of additions to the laws (..., nl): on rates, on outputs, and by updates."""
        known = self.rates_by_laws, self.outputs_by_laws, self.steps_by_laws
        return [action for action in known if action is not None]

    def of_outputs(self, chosen: Mask) -> Linearisation:
        """Return the derivatives of some outputs, by a mask (ny,)."""
        return replace(
            self,
            outputs=self.outputs[:, chosen],
            outputs_by_laws=self.outputs_by_laws[:, chosen],
            gains=None if self.gains is None else self.gains[:, :, chosen],
        )

    def weighed(self, weights: Array) -> Linearisation:
        """Return the derivatives of the outputs times weights (ny,)."""
        by_output = weights[:, np.newaxis]
        return replace(
            self,
            outputs=self.outputs * by_output,
            outputs_by_laws=self.outputs_by_laws * by_output,
            gains=None if self.gains is None else self.gains / weights,
        )


@dataclass(frozen=True, eq=False)
class Setting:
    """All that a run depends on but its record.

    Attributes
    ----------
    parameters : ndarray, shape (np,)
        All of them, SI.
    free : ndarray of int, shape (p,)
        Positions of those by which there are derivatives.
    terms : tuple of Term
    values : ndarray, shape (k,)
        Of each term its coefficients, then the logarithms of its constants and width.
    substeps : int
        Steps between two samples.
    searched : tuple of int, or None
        Positions of the states by whose start values a run has derivatives; None for all.
    """

    parameters: Array
    free: Indices
    terms: tuple[Term, ...] = ()
    values: Array = field(default_factory=lambda: np.zeros(0))
    substeps: int = 1
    searched: tuple[int, ...] | None = None

    @property
    def memories(self) -> int:
        """Memories of the terms, each with a state."""
        return sum(term.has_memory for term in self.terms)

    def by_term(self) -> Iterator[tuple[Term, Array]]:
        """Yield each term with its values."""
        at = 0
        for term in self.terms:
            width = term.coefficients + len(term.start)
            yield term, self.values[at : at + width]
            at += width


def _likeness(values: Array) -> Array:
    """Return the correlations of values (n,) with those by 0, 1, ... (n // 2) samples later."""
    n = len(values)
    centred = values - values.mean()
    spectrum = np.fft.rfft(centred, 2 * n)
    products = np.fft.irfft(spectrum * spectrum.conj())[: n // 2]
    energy = np.append(0.0, np.cumsum(centred**2))
    lags = np.arange(n // 2)
    of_both = energy[n - lags] * (energy[-1] - energy[lags])
    return np.divide(products, np.sqrt(of_both), out=np.zeros(n // 2), where=of_both > 0.0)


def _period(likeness: Array) -> float:
    """Return the lag, in samples, after which values are again what they were; 0 if none is.

    By that of twice as many periods each time, of which the ends are as uncertain as of one.
    """
    apart = np.flatnonzero(likeness < _APART)
    again = np.flatnonzero(likeness > _REPEATED)
    again = again[again > apart[0]] if len(apart) else apart
    if not len(again):
        return 0.0
    near = again[again < again[0] + apart[0]]
    period, count = float(near[np.argmax(likeness[near])]), 1
    while 2.0 * count * period < len(likeness) - 2:
        count *= 2
        lags = round(count * period) + np.arange(-2, 3)
        period = float(lags[np.argmax(likeness[lags])]) / count
    return period
