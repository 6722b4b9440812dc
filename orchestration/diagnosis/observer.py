"""Predictions by an observer, where a model keeps the errors of its states and cannot run freely.

States that do not decay keep every error of an input, or let it grow: those of an integrator, or of
an unstable plant under control. There the error of a model is that of its predictions: after each
sample the states move towards the measured outputs, by the gain of a Kalman filter (Ljung: System
Identification, section 4.3), linearised along the course of the model (Jazwinski: Stochastic
Processes and Filtering Theory, section 8.3). Its noise are white noise of the outputs, and a
disturbance of each rate that is no definition, whose sizes are the most likely ones. Without
disturbances the gain vanishes, but for the least that holds an unstable mode.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fmus.kit.arrays import Array, Mask
from orchestration.diagnosis.fitting import Point, Problem, StartPrior, mean_squares
from orchestration.diagnosis.responses import kalman_gains, steps_along
from orchestration.diagnosis.runs import Course, Linearisation, Record
from orchestration.diagnosis.terms import Term
from orchestration.records.quality import noise_of

_SHARES = 10.0 ** np.arange(-5.0, 1.1, 0.5)  # of the rates, that disturbances are tried to be
_NEAR = 10.0 ** np.array([-4.0, -2.0, -1.0, -0.5, -0.25, 0.0, 0.25, 0.5, 1.0])  # then, of each
_RESOLUTION = 0.002  # of the spread of an output, below which there is no noise
_KEPT = 1e-3  # e-folds over a record, up to which a mode keeps what it has
_ROUNDS = 3  # of courses and gains by turns


@dataclass(frozen=True, eq=False)
class Linear:
    """A model linearised along a course, of states in their nominal magnitudes.

    Attributes
    ----------
    start : ndarray, shape (nx, nx)
        Covariance at the start.
    transitions : ndarray, shape (n - 1, nx, nx)
    outputs : ndarray, shape (n, ny, nx)
        In spreads.
    pushes : ndarray, shape (n - 1, nx, k)
        By disturbances of the rates, in their sizes.
    measured : ndarray of bool, shape (n, ny)
    """

    start: Array
    transitions: Array
    outputs: Array
    pushes: Array
    measured: Mask

    @cached_property
    def growths(self) -> Array:
        """Growth of each mode over the record, e-folds."""
        if not self.transitions.size:
            return np.array([-np.inf])
        mean = self.transitions.mean(axis=0)
        if not np.isfinite(mean).all():
            return np.array([np.inf])
        sizes = np.abs(np.linalg.eigvals(mean))
        return np.asarray(len(self.transitions) * np.log(np.maximum(sizes, np.finfo(float).tiny)))

    def gains(self, noise: Array, shares: Array) -> Array:
        """Return the gains (s, n, nx, ny) of Kalman filters.

        Parameters
        ----------
        noise : ndarray, shape (ny,)
            Standard deviations of the outputs, in spreads.
        shares : ndarray, shape (s, k)
            Disturbances, in the sizes of the rates.
        """
        given = self.start, self.transitions, self.outputs
        each = [kalman_gains(*given, self.pushes * s, noise**2, self.measured) for s in shares]
        return np.array(each)

    def memory(self, gains: Array) -> float:
        """Return the steps in which the slowest error falls by e, with gains (n, nx, ny)."""
        rest = np.eye(gains.shape[1]) - gains[:-1] @ self.outputs[:-1]
        later = len(rest) // 2  # the first gains are of the start
        largest = np.abs(np.linalg.eigvals((self.transitions @ rest)[later:].mean(axis=0))).max()
        return -1.0 / float(np.log(largest)) if 0.0 < largest < 1.0 else np.inf


@dataclass(frozen=True, eq=False)
class Place:
    """A model with terms at a point of a search.

    Attributes
    ----------
    problem : Problem
    point : Point
    terms : tuple of Term
    records : tuple of Record
    counts : tuple of int
        Samples at the beginning of each record by which an observer is chosen.
    starts : tuple of StartPrior
        Of each record.
    """

    problem: Problem
    point: Point
    terms: tuple[Term, ...]
    records: tuple[Record, ...]
    counts: tuple[int, ...]
    starts: tuple[StartPrior, ...]

    def runs(self, gains: Sequence[Array | None]) -> list[Course] | None:
        """Run with gains (n, nx, ny) of each record; None if one leaves its bounds."""
        runs = []
        for record, gain, start in zip(self.records, gains, self.starts, strict=True):
            own = replace(record, gain=gain)
            run = self.problem.run(own, self.point, self.terms, start.mean, False)
            if run is None:
                return None
            runs.append(run)
        return runs

    def courses(self) -> list[Array]:
        """Return states (n, nx + nz) of each record, by runs, or where they start.

        A state that an output shows is that which was measured. Where a run leaves its bounds
        memories are empty.
        """
        runs = self.runs([record.gain for record in self.records])
        courses = []
        for i, (record, start) in enumerate(zip(self.records, self.starts, strict=True)):
            memories = self.problem.setting(self.point, self.terms, record.group).memories
            still = np.tile(np.append(start.mean, np.zeros(memories)), (len(record.time), 1))
            states = still if runs is None else runs[i].states.copy()
            for state, output in self.problem.model.measured_states.items():
                column = record.outputs[:, output]
                known = np.isfinite(column)
                if known.any():
                    states[:, state] = np.interp(record.time, record.time[known], column[known])
            courses.append(states)
        return courses

    def linear(self, courses: Sequence[Array]) -> list[Linear]:
        """Linearise the model along courses (n, nx + nz) of the records."""
        own = zip(self.records, courses, self.starts, strict=True)
        return [self._linear(record, states, start.deviation) for record, states, start in own]

    def _linear(self, record: Record, states: Array, deviation: Array) -> Linear:
        model = self.problem.model
        nominal = model.nominal_states
        none = np.empty(0)
        setting = self.problem.setting(self.point, self.terms, record.group)
        part = model.linearise(record, setting, Course(none, none, np.ascontiguousarray(states)))
        transitions, pushes = _steps(part, record, self._laws)
        own = slice(0, len(nominal))
        sizes = np.sqrt(np.mean(part.laws[:, self._laws] ** 2, axis=0))
        first = part.outputs.shape[2] - part.rates.shape[1]
        shown = part.outputs[:, :, first : first + len(nominal)] * nominal
        return Linear(
            np.diag((deviation / nominal) ** 2),
            transitions[:, own, own] * nominal / nominal[:, np.newaxis],
            shown / self.problem.spread[:, np.newaxis],
            pushes[:, own] * sizes / nominal[:, np.newaxis],
            np.isfinite(record.outputs),
        )

    @cached_property
    def _laws(self) -> list[int]:
        """Positions of the laws that are rates, and no definitions."""
        model = self.problem.model
        rates = model.rates[: len(model.cls.layout.states)]
        return [model.laws.index(r) for r in rates if not model.perturbed.is_definition(r)]

    @property
    def disturbances(self) -> int:
        """Number of rates that may be disturbed."""
        return len(self._laws)

    @cached_property
    def noise(self) -> Array:
        """Standard deviations (ny,) of white noise of the outputs, in spreads."""
        pairs = zip(self.records, self.counts, strict=True)
        columns = [(r.outputs[:count] / self.problem.spread).T for r, count in pairs if count]
        each = np.array([[noise_of(column) for column in own] for own in columns])
        return np.maximum(each.mean(axis=0), _RESOLUTION)


def _steps(part: Linearisation, record: Record, laws: Sequence[int]) -> tuple[Array, Array]:
    """Return transitions (n - 1, nx, nx) of the states, and what additions to laws do to them."""
    nx = part.rates.shape[1]
    if part.steps is not None and part.steps_by_laws is not None:
        return part.steps[:, :, -nx:], part.steps_by_laws[:, :, laws]
    transitions, driven = steps_along(part, np.diff(record.time))
    by_laws = np.nan_to_num(part.rates_by_laws[:-1][:, :, laws])
    return transitions, driven[:, :, : by_laws.shape[1]] @ by_laws


@dataclass(frozen=True, eq=False)
class Observer:
    """An observer over records.

    Attributes
    ----------
    shares : ndarray, shape (k,)
        Disturbances of rates, in their sizes.
    memory : float
        Time in which the slowest error of the states falls by e, or the record if it is longer, s.
    gains : tuple of ndarray, shape (n, nx, ny)
        Of each record, SI.
    courses : tuple of ndarray, shape (n, nx + nz)
        States and memories of each record.
    value : float
        Log likelihood, but for a constant.
    """

    shares: Array
    memory: float
    gains: tuple[Array, ...]
    courses: tuple[Array, ...]
    value: float

    @property
    def is_small(self) -> bool:
        """True if each disturbance is smaller than the rate that it disturbs."""
        return bool(np.all(self.shares < 1.0))


def observer_of(place: Place) -> Observer | None:
    """Return the observer of the likeliest disturbances at a place.

    First with one share for all rates, then with one for each. None if the model leaves its bounds
    with all of them.
    """
    count = place.disturbances
    courses: Sequence[Array] = place.courses()
    shares = np.repeat(_SHARES[:, np.newaxis], count, axis=1)
    best: Observer | None = None
    for _ in range(_ROUNDS):
        linear = place.linear(courses)
        best = _likeliest(place, linear, shares)
        if best is None:
            return None
        if count > 1:
            best = _likeliest_of_each(place, linear, best)
        courses = best.courses
        shares = np.minimum(best.shares * _NEAR[:, np.newaxis], _SHARES[-1])
    return best


def _likeliest_of_each(place: Place, linear: Sequence[Linear], best: Observer) -> Observer:
    """Return the likeliest observer with another share for one rate after the other."""
    for rate in range(len(best.shares)):
        shares = np.tile(best.shares, (len(_NEAR), 1))
        shares[:, rate] = np.minimum(shares[:, rate] * _NEAR, _SHARES[-1])
        best = _likeliest(place, linear, shares) or best
    return best


def _likeliest(place: Place, linear: Sequence[Linear], shares: Array) -> Observer | None:
    """Return the likeliest observer of some shares (s, k)."""
    tried = list(_tried(place, linear, shares))
    return max(tried, key=lambda one: one.value, default=None)


def _tried(place: Place, linear: Sequence[Linear], shares: Array) -> Iterator[Observer]:
    """Yield an observer for each share by which the model stays in its bounds."""
    scaled = [one.gains(place.noise, shares) for one in linear]
    durations = [float(np.mean(np.diff(record.time))) for record in place.records]
    nominal, spread = place.problem.model.nominal_states, place.problem.spread
    for k, share in enumerate(shares):
        own = [gains[k] for gains in scaled]
        gains = [np.ascontiguousarray(nominal[:, np.newaxis] * g / spread) for g in own]
        runs = place.runs(gains)
        if runs is None:
            continue
        steps = [one.memory(g) for one, g in zip(linear, own, strict=True)]
        each = zip(steps, durations, place.records, strict=True)
        memory = max(min(count * h, float(np.ptp(record.time))) for count, h, record in each)
        states = tuple(run.states for run in runs)
        yield Observer(share, memory, tuple(gains), states, _log_likelihood(place, runs))


def growth_of(place: Place) -> float:
    """Return the growth of the fastest mode over a record, e-folds."""
    return float(max(one.growths.max() for one in place.linear(place.courses())))


def slowest_decay(place: Place) -> float:
    """Return the time in which the slowest mode falls by e, s, of those that decay at all."""
    slowest = 0.0
    for record, one in zip(place.records, place.linear(place.courses()), strict=True):
        decays = -one.growths[np.isfinite(one.growths) & (one.growths < -_KEPT)]
        slowest = max(slowest, float(np.ptp(record.time)) / decays.min(initial=np.inf))
    return slowest


def _log_likelihood(place: Place, runs: Sequence[Course]) -> float:
    """Return the log likelihood of white prediction errors, but for a constant."""
    own = zip(place.records, runs, place.counts, strict=True)
    parts = [(r.outputs - run.outputs)[:count] / place.problem.spread for r, run, count in own]
    errors = np.concatenate(parts)
    known = np.isfinite(errors).sum(axis=0)
    return -0.5 * float(np.nansum(known * np.log(mean_squares(errors))))
