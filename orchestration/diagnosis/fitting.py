"""Fits of a model with terms to free runs, from several starts, by exact derivatives.

The cost is ``1/2 sum (e / sigma)^2 n_eff / n + 1/2 sum ((q - mean) / deviation)^2`` over all
samples of all records and all searched coordinates: parameters (in their logarithm where they are
positive), values of the terms, and the start states of each record. It is minimised by the method
of Levenberg and Marquardt (Nocedal, Wright: Numerical Optimization, section 10.3).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TypeVar

import numpy as np

from fmus.kit.arrays import Array, Indices, Mask
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.local_values import COMMON, Copy, LocalValues, columns
from orchestration.diagnosis.runs import Course, Record, Setting
from orchestration.diagnosis.terms import Shape, Term
from orchestration.identify.fitting import Scale, scale_of

_LOGARITHM = float(np.log(10.0))  # prior deviation of a positive parameter: a factor of ten
_PLAIN = 3.0  # prior deviation of other parameters, in their size
_COEFFICIENT = 10.0  # prior deviation of a coefficient, in the size of its law
_CONSTANT = 0.8  # prior deviation of the logarithm of a constant of a memory
_WIDTH = 0.6  # prior deviation of the logarithm of a width
_PHASE = 1.0  # prior deviation of the phase of a clock, in periods: nobody knows it
_PHASES = 24  # of a clock, from which a fit may start: within 2 % of a period of the nearest
_SHORT_PIECES = 40  # of a record, at most
_SHORTEST = 12  # samples of a piece
_STEPS_OF_PIECES = 20
_BEGINNING = 10.0  # weight of squared errors, in spreads, before any fit has left some
_WIDE_START = 30.0  # nominal values of a state, within which a piece begins
_LONGEST = 1.5  # step of a coordinate, in prior deviations of a logarithm
FLAT = 1e-4  # relative fall of the cost that ends a search, twice in a row
_SMALL_FALLS = 2  # in a row, that end a search
_HALVINGS = 8  # of a step that does not go downhill, before a search ends
_START_STEPS = 12  # of a fit of start states alone
_STARTS = 3  # that are tried, of those that begin nearest to the record
_TRIAL = 4  # steps from each, before the best goes on
_ROUNDS = 3  # of a fit with weights by what the last one leaves
_BASE_STEPS = 60  # of each
_VAGUE = 3.0  # a factor of a thousand: beside a few samples, hardly a prior
_FARTHER = 3  # times as many from nominal parameters
SMALL = 1e-3  # coefficient from which a search starts, so that a term has slopes
_FEWEST = 4.0  # effective samples that are counted at least
_PLACES = 12  # of a parameter, of which the last is its end where runs are steady
_DIGITS = 9  # of phases that are one
_BEHIND = 1e-6  # a jump, in periods, at which a phase ends
_BEYOND = 0.01  # the same, from where it is searched on the other side
_FEW_NATS = 10.0  # of a cost, below which a share of it is less than any comparison turns on


Place = TypeVar("Place")


def effective_samples(error: Array, phases: Indices | None = None) -> float:
    """Return the number of independent samples that tell as much of a mean as these.

    By the autocorrelation up to where it first falls below a twentieth (Geyer: Practical Markov
    chain Monte Carlo, Statistical Science 7, 1992); an error that comes again in each period is
    one (the design effect of clusters; Kish: Survey Sampling, 1965).

    Parameters
    ----------
    error : ndarray, shape (n,)
        NaN is a gap, and left out.
    phases : ndarray of int, shape (n,), optional
        See `Record.phases`.
    """
    known = np.isfinite(error)
    e = error[known]
    n = len(e)
    e = e - e.mean() if n else e
    if n < 2 * _FEWEST or not e.any():
        return float(n)
    spectrum = np.fft.rfft(e, 2 * n)
    covariance = np.fft.irfft(spectrum * spectrum.conj())[: n // 2]
    correlation = covariance / covariance[0]
    below = np.flatnonzero(correlation < 0.05)
    last = int(below[0]) if len(below) else len(correlation)
    copies = 1.0 if phases is None else repeats(e, phases[known])
    return float(np.clip(n / (1.0 + 2.0 * correlation[1:last].sum()) / copies, _FEWEST, n))


def repeats(error: Array, phases: Indices) -> float:
    """Return how often the same error repeats: about 1 if periods have nothing in common.

    The ratio of mean squares between phases and in all (one-way analysis of variance).

    Parameters
    ----------
    error : ndarray, shape (n,)
        Without gaps, and of mean zero.
    phases : ndarray of int, shape (n,)
        See `Record.phases`.
    """
    counts = np.bincount(phases)
    sums = np.bincount(phases, error)
    between = float(np.mean(sums[counts > 0] ** 2 / counts[counts > 0]))
    return max(1.0, between / float(np.mean(error**2)))


@dataclass(frozen=True, eq=False)
class Evaluated:
    """The cost at a place, with slopes.

    Attributes
    ----------
    cost : float
    curvature : ndarray, shape (m, m)
    gradient : ndarray, shape (m,)
        Downhill.
    errors : tuple of ndarray, shape (n, ny)
    """

    cost: float
    curvature: Array
    gradient: Array
    errors: tuple[Array, ...]

    @cached_property
    def foreseen(self) -> float:
        """The cost at the end of a whole step, as if errors went in straight lines."""
        try:
            step = np.linalg.solve(self.curvature, self.gradient)
        except np.linalg.LinAlgError:
            return -np.inf
        return float(self.cost - 0.5 * self.gradient @ step)

    def may_fall(self, cost: float, flat: float) -> bool:
        """Return whether it is foreseen to fall below a cost by more than a share of it."""
        return self.foreseen < cost - small_fall(cost, flat)


def small_fall(cost: float, flat: float) -> float:
    """Return the fall of a cost, nats, that ends a search: a share of it, or of few nats."""
    return flat * max(_FEW_NATS, cost)


@dataclass(frozen=True, eq=False)
class StartPrior:
    """Expected start states of a record, with standard deviations, SI."""

    mean: Array
    deviation: Array


@dataclass(frozen=True, eq=False)
class Problem:
    """A model over records, of which all or some are fitted.

    Attributes
    ----------
    model : LawModel
    records : tuple of Record
        Fitted.
    spread : ndarray, shape (ny,)
        Of the outputs, by which residuals are divided.
    starts : tuple of StartPrior
        Of each record.
    hold : frozenset of str
        Parameters and start states that keep their values.
    values : Mapping of str to float
        Nominal values of parameters, SI, where they are not the declared ones.
    substeps : int
        Of a run, between two samples.
    begins_anywhere : bool
        Whether a run of a model with inputs begins where its record says, and not near the start
        states that are declared.
    local : LocalValues
        Values that the records do not share.
    vagueness : float
        By which prior deviations of parameters are multiplied.
    """

    model: LawModel
    records: tuple[Record, ...]
    spread: Array
    starts: tuple[StartPrior, ...]
    hold: frozenset[str] = frozenset()
    values: Mapping[str, float] | None = None
    substeps: int = 1
    begins_anywhere: bool = False
    local: LocalValues = COMMON
    vagueness: float = 1.0

    @cached_property
    def nominal(self) -> Array:
        """Nominal values of all parameters (np,), SI."""
        given = self.values or {}
        return np.array([float(given.get(p.name, p.start)) for p in self.model.parameters])

    @cached_property
    def searched(self) -> Indices:
        """Positions of the parameters that are searched; clocks keep their periods."""
        starts = set(self.model.start_positions)
        held = self.hold | self.model.periods
        return np.array(
            [
                i
                for i, p in enumerate(self.model.parameters)
                if i not in starts and p.type == "real" and p.name not in held
            ],
            dtype=int,
        )

    @cached_property
    def known_starts(self) -> Mask:
        """Mask (nx,) of the states that start as declared in every record."""
        if self.model.begins_as_declared:
            return np.ones(len(self.model.states), dtype=bool)
        names = [self.model.parameters[i].name for i in self.model.start_positions]
        states = zip(names, self.model.states, strict=True)
        return np.array(
            [name in self.hold or getattr(s, "is_memory", False) for name, s in states], dtype=bool
        )

    @cached_property
    def _copies(self) -> list[Copy]:
        return self.local.of_parameters([self.model.parameters[i].name for i in self.searched])

    @cached_property
    def free(self) -> Indices:
        """Positions of the parameters of all searched coordinates, local values behind common."""
        further = [self.searched[position] for position, _ in self._copies]
        return np.append(self.searched, np.array(further, dtype=int))

    @cached_property
    def names(self) -> list[str]:
        """Names of the searched coordinates; see `LocalValues.name`."""
        groups = [0] * len(self.searched) + [group for _, group in self._copies]
        declared = [self.model.parameters[i].name for i in self.free]
        return [self.local.name(*pair) for pair in zip(declared, groups, strict=True)]

    def columns(self, group: int) -> Indices:
        """Return which searched coordinates a group of records has, in the order of `searched`."""
        return columns(len(self.searched), self._copies, group)

    def value_columns(self, count: int, group: int) -> Indices:
        """Return which of so many values of terms a group of records has."""
        copies = self.local.of_terms()
        return columns(count - len(copies), copies, group)

    def coordinates(self, values: int, group: int) -> Indices:
        """Return which coordinates and, behind all, which values of terms a group has."""
        behind = len(self.free) + self.value_columns(values, group)
        return np.append(self.columns(group), behind)

    @cached_property
    def scales(self) -> list[Scale]:
        """Scale of each free parameter: of a shift of a clock, the period."""
        return [
            Scale(False, float(self.period_of[i]))
            if i in self.period_of
            else scale_of(self.model.parameters[i], self.nominal[i])
            for i in self.free
        ]

    @cached_property
    def period_of(self) -> dict[int, float]:
        """Period of the clock that each parameter shifts, s, by its position."""
        places = {p.name: i for i, p in enumerate(self.model.parameters)}
        return {
            places[name]: float(self.nominal[places[of]] if isinstance(of, str) else of)
            for name, of in self.model.shifts.items()
        }

    @cached_property
    def phases(self) -> Indices:
        """Indices (k,) of the searched coordinates that are shifts of clocks, in their periods."""
        return np.array([k for k, i in enumerate(self.free) if i in self.period_of], dtype=int)

    @cached_property
    def _logarithmic(self) -> Mask:
        return np.array([s.logarithmic for s in self.scales], dtype=bool)

    @cached_property
    def _sizes(self) -> Array:
        return np.array([s.size for s in self.scales])

    @cached_property
    def mean(self) -> Array:
        """Searched coordinates of the nominal values."""
        pairs = zip(self.scales, self.nominal[self.free], strict=True)
        return np.array([s.position(v) for s, v in pairs])

    @cached_property
    def walls(self) -> list[Array]:
        """Phases, for each of `phases`, at which a tick meets a jump of an input, ascending.

        The cost jumps there. None of a clock that meets jumps at nearly all phases.
        """
        walls = []
        for k in self.phases:
            period = self.period_of[int(self.free[k])]
            held = [record for record in self.records if not all(record.smooth)]
            meets = [(r.time[r.jumps] - r.begin) / period % 1.0 for r in held]
            at = np.unique(np.concatenate([[], *meets]).round(_DIGITS) % 1.0)
            walls.append(at if len(at) <= _PHASES else at[:0])
        return walls

    def between_walls(self, before: Array, q: Array) -> Array:
        """Return coordinates (p,) with the phases between the same jumps as before (p,)."""
        q = q.copy()
        for k, walls in zip(self.phases, self.walls, strict=True):
            if len(walls):
                low, high = _cell(walls, before[k])
                q[k] = np.clip(q[k], low + _BEHIND, high - _BEHIND)
        return q

    def beyond_walls(self, q: Array) -> Iterator[Array]:
        """Yield coordinates (p,) with a phase that is beyond a jump near it."""
        for k, walls in zip(self.phases, self.walls, strict=True):
            if not len(walls):
                continue
            for side, wall in zip((-1.0, 1.0), _cell(walls, q[k]), strict=True):
                if abs(q[k] - wall) < 1.0 / _PHASES:
                    other = q.copy()
                    other[k] = wall + side * _BEYOND
                    yield other

    def nominal_at_phases(self, q: Array) -> Array:
        """Return the coordinates (p,) of the nominal values at the phases of others (p,)."""
        nominal = self.mean.copy()
        nominal[self.phases] = q[self.phases]
        return nominal

    @cached_property
    def deviation(self) -> Array:
        """Prior deviations of the free parameters, in searched coordinates."""
        deviation = np.array([_LOGARITHM if s.logarithmic else _PLAIN for s in self.scales])
        deviation[self.phases] = _PHASE
        return self.vagueness * deviation

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Both ends of the ranges of the free parameters, in searched coordinates.

        That of a phase is open: later by a period, a clock ticks at the same instants.
        """
        low, high = [], []
        for i, scale in zip(self.free, self.scales, strict=True):
            p = self.model.parameters[i]
            low.append(scale.position(p.min))
            high.append(scale.position(p.max))
        ends = np.array(low, dtype=float), np.array(high, dtype=float)
        for end, sign in zip(ends, (-1.0, 1.0), strict=True):
            for k in np.flatnonzero(self._logarithmic).tolist():
                end[k] = sign * min(sign * end[k], sign * self._steady_until(k, sign))
        ends[0][self.phases], ends[1][self.phases] = -np.inf, np.inf
        return ends

    def _steady_until(self, k: int, sign: float) -> float:
        """Return the end up to which runs take enough steps, others being nominal; else infinity.

        A time constant that no output shows goes to where a run is unstable.
        """

        def is_steady(distance: float) -> bool:
            q = self.mean.copy()
            q[k] += sign * distance
            return all(
                self.model.is_steady(record, self._bare(q, record), start.mean)
                for record, start in zip(self.records, self.starts, strict=True)
            )

        places = np.linspace(0.0, _LOGARITHM, _PLACES)
        if is_steady(places[-1]):
            return sign * np.inf
        steady = [float(place) for place in places if is_steady(place)]
        return float(self.mean[k] + sign * max(steady, default=0.0))

    def _bare(self, q: Array, record: Record) -> Setting:
        """Return the model without terms at searched coordinates, with nothing free."""
        none = np.zeros(0)
        parameters = self.parameters(q, record.group)
        return Setting(parameters, self.searched[:0], (), none, self.substeps)

    def parameters(self, q: Array, group: int = 0) -> Array:
        """Return all parameters (np,) of a group of records, SI, at searched coordinates."""
        all_of_them = self.nominal.copy()
        with np.errstate(over="ignore"):  # the end of an interval may lie beyond every number
            values = np.where(self._logarithmic, np.exp(q), q * self._sizes)
        all_of_them[self.searched] = values[self.columns(group)]
        for i, period in self.period_of.items():
            all_of_them[i] %= period
        return all_of_them

    def slopes(self, q: Array) -> Array:
        """Return d value / d q of the free parameters."""
        with np.errstate(over="ignore"):
            return np.where(self._logarithmic, np.exp(q), self._sizes)

    def run(
        self, record: Record, point: Point, terms: Sequence[Term], start: Array, sensitive: bool
    ) -> Course | None:
        """Run over a record at a point."""
        setting = self.setting(point, terms, record.group)
        return self.model.run(record, setting, start, sensitive=sensitive)

    def errors(self, point: Point, terms: Sequence[Term] = ()) -> tuple[Array, ...] | None:
        """Return the errors (n, ny) of each record in spreads; None where a run fails."""
        errors = []
        for record, start in zip(self.records, point.starts, strict=True):
            course = self.run(record, point, terms, start, False)
            if course is None:
                return None
            errors.append((record.outputs - course.outputs) / self.spread)
        return tuple(errors)

    def setting(self, point: Point, terms: Sequence[Term], group: int = 0) -> Setting:
        """Return a point as the model takes it over a group of records."""
        all_of_them = self.parameters(point.q, group)
        values = point.values[self.value_columns(len(point.values), group)]
        return Setting(all_of_them, self.searched, tuple(terms), values, self.substeps)


@dataclass(frozen=True, eq=False)
class Point:
    """A point of a search.

    Attributes
    ----------
    q : ndarray, shape (p,)
        Searched coordinates of the free parameters, local values behind common ones.
    values : ndarray, shape (k,)
        Of the terms: coefficients, and logarithms of constants and widths, local ones behind.
    starts : tuple of ndarray, shape (nx,)
        Start states of each record, SI.
    """

    q: Array
    values: Array
    starts: tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class Fit:
    """A model with terms, fitted.

    Attributes
    ----------
    problem : Problem
    terms : tuple of Term
    point : Point
    errors : tuple of ndarray, shape (n, ny)
        Measured minus simulated of each record, divided by the spread; NaN at gaps.
    cost : float
        With priors.
    curvature : ndarray, shape (m, m)
        Of the cost, by free parameters, values and start states in their searched scales.
    """

    problem: Problem
    terms: tuple[Term, ...]
    point: Point
    errors: tuple[Array, ...]
    cost: float
    curvature: Array

    @property
    def freedom(self) -> int:
        """Degrees of freedom that the terms add, and values that differ in a later record."""
        return sum(term.freedom for term in self.terms) + self.problem.local.released

    @property
    def explanations(self) -> int:
        """Number of terms, and of changes in a later record."""
        return len(self.terms) + self.problem.local.changes

    @property
    def misfit(self) -> float:
        """Root mean square of all errors, in spreads of the outputs."""
        return _misfit(self.errors)

    @property
    def distance(self) -> float:
        """Half the squared distance of the parameters from nominal, in prior deviations."""
        problem = self.problem
        return float(0.5 * np.sum(((self.point.q - problem.mean) / problem.deviation) ** 2))

    def values_of(self, term: Term) -> Array:
        """Return the values of one of its terms: coefficients, then logarithms."""
        at = 0
        for other in self.terms:
            width = other.coefficients + len(other.start)
            if other == term:
                return self.point.values[at : at + width]
            at += width
        raise KeyError(str(term))


def _misfit(errors: Sequence[Array]) -> float:
    """Return the root mean square of all errors."""
    squares = np.concatenate([e[np.isfinite(e)] ** 2 for e in errors])
    return float(np.sqrt(squares.mean()))


def joined_by(fitted: Fit, record: Record) -> Fit:
    """Return a fit with local values, as their prior has them, of a record in no group so far."""
    problem, point = fitted.problem, fitted.point
    if not problem.local.each or record.group < len(problem.local.groups):
        return fitted
    local = replace(problem.local, groups=(*problem.local.groups, record.label))
    joined = replace(problem, local=local)
    q = np.append(point.q, joined.mean[len(point.q) :])
    return replace(fitted, problem=joined, point=replace(point, q=q))


def located(fitted: Fit) -> Fit:
    """Return a fit whose changes at an instant are named by the instant that was fitted."""
    terms = []
    for term in fitted.terms:
        is_change = term.shape is Shape.STEP
        width = float(np.exp(fitted.values_of(term)[-1])) if is_change else term.width
        terms.append(replace(term, width=width))
    return replace(fitted, terms=tuple(terms))


def mean_squares(errors: Array) -> Array:
    """Return the mean squares (ny,) of errors (n, ny); NaN of an output that was not measured.

    Without NumPy's warning, which a filter holds back in one thread only.
    """
    known = np.isfinite(errors)
    count = known.sum(axis=0)
    sums = np.sum(np.where(known, errors, 0.0) ** 2, axis=0)
    return np.divide(sums, count, out=np.full(len(count), np.nan), where=count > 0)


def weights_of(errors: Sequence[Array]) -> list[Array]:
    """Return weights (ny,) of squared errors for a search, record by record: ``s / sigma^2``.

    Sigma of each output is that of all records together, or a fit would give up the worst of them;
    and so is the share s of independent samples that of all outputs, or it would give up one that
    is slow because the model fails there.
    """
    count = max(int(np.isfinite(np.concatenate(errors)).sum()), 1)
    share = float(np.sum(_independent(errors))) / count
    return [share / variance_of(errors)] * len(errors)


def independent_weights(errors: Sequence[Array]) -> list[Array]:
    """Return weights (ny,) of squared errors, record by record: ``n_eff / n / sigma^2``.

    By these the likelihood is that of so many independent samples.
    """
    counts = [np.maximum(np.isfinite(e).sum(axis=0), 1) for e in errors]
    pairs = zip(_independent(errors), counts, strict=True)
    return [n_eff / n / variance_of(errors) for n_eff, n in pairs]


def _independent(errors: Sequence[Array]) -> list[Array]:
    """Return the effective samples (ny,) of each record."""
    return [np.array([effective_samples(column) for column in e.T]) for e in errors]


def variance_of(errors: Sequence[Array]) -> Array:
    """Return the mean squares (ny,) of errors of all records, of which none vanishes.

    NaN of an output that was not measured.
    """
    return np.maximum(mean_squares(np.concatenate(errors)), 1e-10)


class _Search:
    """The cost of a set of terms over the records of a problem."""

    def __init__(self, problem: Problem, terms: Sequence[Term], weights: Sequence[Array]):
        self.problem = problem
        self.terms = tuple(terms)
        self.weights = list(weights)
        mean, deviation = [], []
        for term in terms:
            mean += [0.0] * term.coefficients + list(term.start)
            own = [_CONSTANT] * len(term.constants) + [_WIDTH] * term.shape.has_width
            deviation += [_COEFFICIENT] * term.coefficients + own
        further = [position for position, _ in problem.local.of_terms()]
        mean += [mean[i] for i in further]
        deviation += [deviation[i] for i in further]
        self.values = len(mean)
        ends = [np.concatenate([np.zeros(0), *(t.bounds[i] for t in terms)]) for i in (0, 1)]
        # where it does nothing a strength has slopes, and beyond it none
        self._ranges = [np.append(end, end[further]) for end in ends]
        self.mean = np.array([*problem.mean, *mean])
        self.deviation = np.array([*problem.deviation, *deviation])
        self.size = len(self.mean)

    def cost(self, point: Point) -> float:
        """Return the cost at a point; infinite where a run fails."""
        errors = self.problem.errors(point, self.terms)
        return np.inf if errors is None else self._cost(point, errors)

    def _cost(self, point: Point, errors: Sequence[Array]) -> float:
        far = self._far(point)
        pairs = zip(errors, self.weights, strict=True)
        return 0.5 * float(far @ far + sum(np.nansum(e**2 * weight) for e, weight in pairs))

    def evaluate(self, point: Point) -> Evaluated | None:
        """Return cost, curvature, downhill gradient and errors; None where a run fails."""
        problem = self.problem
        nx, m = len(problem.model.states), len(self._widths)
        curvature, gradient, cost = np.zeros((m, m)), np.zeros(m), 0.0
        errors = []
        for r, record in enumerate(problem.records):
            course = problem.run(record, point, self.terms, point.starts[r], True)
            if course is None:
                return None
            errors.append((record.outputs - course.outputs) / problem.spread)
            rows = self._weighed(course, errors[r], problem.slopes(point.q), r)
            e = self._left(errors[r], r)
            own = np.arange(self.size + r * nx, self.size + (r + 1) * nx)
            at = np.append(problem.coordinates(self.values, record.group), own)
            with np.errstate(over="ignore", invalid="ignore"):
                curvature[np.ix_(at, at)] += rows.T @ rows
                gradient[at] += rows.T @ e
            cost += 0.5 * float(e @ e)
        if not np.isfinite(curvature).all():  # slopes of a run that nearly leaves its range
            return None
        far, widths = self._far(point), self._widths
        cost += 0.5 * float(far @ far)
        curvature[np.diag_indices(m)] += 1.0 / widths**2
        gradient -= far / widths
        return Evaluated(cost, curvature, gradient, tuple(errors))

    @property
    def _widths(self) -> Array:
        """Prior deviations (m,) of all that is fitted; start states are in theirs."""
        starts = len(self.problem.model.states) * len(self.problem.records)
        return np.append(self.deviation, np.ones(starts))

    def _weighed(self, course: Course, error: Array, slopes: Array, r: int) -> Array:
        """Return weighed derivatives by a record's coordinates, without gaps."""
        problem = self.problem
        measured = problem.records[r].measured
        root = np.sqrt(self.weights[r])[measured]
        slopes = slopes[problem.columns(problem.records[r].group)]
        terms = np.ones(course.slopes.shape[2] - len(slopes) - len(problem.model.states))
        factors = np.concatenate([slopes, terms, problem.starts[r].deviation])
        rows = course.slopes * ((root / problem.spread[measured])[:, np.newaxis] * factors)
        present = np.isfinite(error[:, measured])
        return rows.reshape(present.size, len(factors)) if present.all() else rows[present]

    def _left(self, error: Array, r: int) -> Array:
        """Return weighed errors of a record, without gaps."""
        measured = self.problem.records[r].measured
        e = (error * np.sqrt(self.weights[r]))[:, measured]
        return e[np.isfinite(e)]

    def _far(self, point: Point) -> Array:
        """Return the distance of a point from the mean of the prior, in its deviations."""
        own = (np.append(point.q, point.values) - self.mean) / self.deviation
        pairs = zip(point.starts, self.problem.starts, strict=True)
        return np.concatenate([own, *((x - s.mean) / s.deviation for x, s in pairs)])

    def moved(self, point: Point, step: Array) -> Point:
        """Return a point after a step, within the bounds of the parameters."""
        problem = self.problem
        p, nx = len(point.q), len(problem.model.states)
        low, high = problem.bounds
        q = np.clip(point.q + np.clip(step[:p], -_LONGEST, _LONGEST), low, high)
        q = problem.between_walls(point.q, q)
        starts = tuple(
            x + step[self.size + r * nx :][:nx] * prior.deviation
            for r, (x, prior) in enumerate(zip(point.starts, problem.starts, strict=True))
        )
        values = np.clip(point.values + step[p : self.size], *self._ranges)
        return Point(q, values, starts)

    def begin(self, points: Iterable[Point]) -> list[tuple[Point, Evaluated]]:
        """Return points with what is known there, the lowest first; none where a run fails."""
        within = (replace(p, values=np.clip(p.values, *self._ranges)) for p in points)
        begun = [(point, self.evaluate(point)) for point in within]
        known = [(point, here) for point, here in begun if here is not None]
        return sorted(known, key=lambda start: start[1].cost)

    def descend(
        self, begun: tuple[Point, Evaluated], most: int, flat: float, *, is_trial: bool = False
    ) -> tuple[Point, Evaluated]:
        """Search downhill from a point, for so many steps at most."""
        return _downhill(self.evaluate, self.moved, begun, most, flat, is_trial=is_trial)


def _downhill(
    evaluate: Callable[[Place], Evaluated | None],
    moved: Callable[[Place, Array], Place],
    begun: tuple[Place, Evaluated],
    most: int,
    flat: float,
    *,
    is_trial: bool = False,
) -> tuple[Place, Evaluated]:
    """Search downhill from a place by damped Gauss-Newton steps.

    A step that is foreseen to gain nothing, by half the squared Newton decrement (Boyd,
    Vandenberghe: Convex Optimization, section 9.5.1), is the last.

    Parameters
    ----------
    evaluate : callable
        Returns what is known of a place, or None.
    moved : callable
        Returns the place after a step.
    begun : tuple
        Place (Point or ndarray) with what `evaluate` returned there.
    most : int
        Steps at most.
    flat : float
        See `small_fall`; two in a row end the search.
    is_trial : bool
        Whether to leave out the last step, for another search goes on.
    """
    place, here = begun
    damping, small = 1e-2, 0
    for _ in range(most):
        is_end = not here.may_fall(here.cost, flat)
        if is_end and is_trial:
            break
        lower, overshot = None, False
        for _ in range(1 if is_end else _HALVINGS):
            damped = here.curvature + np.diag(damping * np.diag(here.curvature))
            try:
                trial = moved(place, np.asarray(np.linalg.solve(damped, here.gradient)))
            except np.linalg.LinAlgError:
                damping *= 10.0
                continue
            there = evaluate(trial)
            if there is not None and there.cost < here.cost:
                lower = there
                break
            damping, overshot = max(damping, 1e-6) * 6.0, True
        if lower is None:
            break
        is_small = here.cost - lower.cost < small_fall(lower.cost, flat)
        small = small + 1 if is_small else 0
        place, here = trial, lower
        damping = damping if overshot else max(damping / 6.0, 1e-9)
        if is_end or small >= _SMALL_FALLS:
            break
    return place, here


def fit(
    problem: Problem,
    terms: Sequence[Term],
    starts: Iterable[Point],
    weights: Sequence[Array],
    most: int = 25,
    flat: float = FLAT,
) -> Fit | None:
    """Fit from the nearest of several points; that which is lowest after a few steps goes on.

    A point at nominal parameters is tried even if others are nearer: parameters that went far to do
    the work of a term are near without it, and hide it. A point from which no lower end is foreseen
    than where another has come is left out.

    Parameters
    ----------
    problem : Problem
    terms : sequence of Term
    starts : iterable of Point
    weights : sequence of ndarray, shape (ny,)
        Of squared errors, for each record; see `weights_of`.
    most : int
        Steps from each point.
    flat : float
        See `small_fall`; two in a row end it.

    Returns
    -------
    Fit or None
        None if the model runs away at every start.
    """
    search = _Search(problem, terms, weights)
    points = list(starts)
    if terms:  # without them a clock seems to be early or late
        points += [replace(p, q=q) for p in points for q in problem.beyond_walls(p.q)]
    nearest = sorted(points, key=search.cost)[:_STARTS] if len(points) > _STARTS else points
    nominal = [p for p in points if np.array_equal(p.q, problem.nominal_at_phases(p.q))]
    if len(problem.phases):
        nominal = sorted(nominal, key=search.cost)[:_STARTS]
    nearest = [p for p in nearest if p not in nominal]
    begun = [(start, _TRIAL) for start in search.begin(nearest)]
    begun += [(start, _FARTHER * _TRIAL) for start in search.begin(nominal)]
    best = None
    for start, count in begun:
        if best is None or start[1].may_fall(best[1].cost, flat):
            there = search.descend(start, count, flat, is_trial=True)
            best = there if best is None or there[1].cost < best[1].cost else best
    if best is None:
        return None
    point, here = search.descend(best, most, flat)
    return Fit(problem, search.terms, point, here.errors, here.cost, here.curvature)


def not_fitted(problem: Problem, point: Point, weights: Sequence[Array]) -> Fit | None:
    """Return the model without terms as it is at a point; None if it runs away there."""
    here = _Search(problem, (), weights).evaluate(point)
    if here is None:
        return None
    return Fit(problem, (), point, here.errors, here.cost, here.curvature)


def nominal_point(problem: Problem, terms: Sequence[Term] = ()) -> Point:
    """Return the nominal parameters and start states, with small coefficients of the terms."""
    values = [term.values(SMALL) for term in terms]
    starts = tuple(prior.mean for prior in problem.starts)
    return Point(problem.mean, np.concatenate([np.zeros(0), *values]), starts)


def fit_base(problem: Problem, q: Array | None = None) -> Fit | None:
    """Fit the model without terms: weights from the nominal run, then from the fit itself.

    Parameters
    ----------
    problem : Problem
    q : ndarray, shape (p,), optional
        Where it starts; by default nominal, but for the phases of clocks, which may be any.
    """
    point = nominal_point(problem)
    points = list(_at_phases(problem, point)) if q is None else [replace(point, q=q)]
    weights = [np.full(len(problem.spread), _BEGINNING)] * len(problem.records)
    best = None
    for _ in range(_ROUNDS):
        found = fit(problem, (), points, weights, _BASE_STEPS)
        if found is None:
            return best
        best, points = found, [found.point]
        weights = weights_of(found.errors)
    return best


def fit_from_pieces(base: Fit) -> Fit:
    """Return a fit that starts where one of short pieces of the records ends, if it is nearer.

    Over many periods a free run is near the record at every frequency in turn; over pieces, each
    from a start of its own, it follows the slopes of the true one (Bock: Recent advances in
    parameter identification techniques for O.D.E., 1983).
    """
    problem = base.problem
    if not problem.model.states:
        return base
    parts = [
        [record.part(*ends) for ends in pairwise(piece_ends(record, _SHORT_PIECES))]
        for record in problem.records
    ]
    pieces = tuple(piece for own in parts for piece in own)
    wide = _WIDE_START * problem.model.nominal_states
    starts = tuple(
        replace(prior, deviation=np.maximum(prior.deviation, wide))
        for own, prior in zip(parts, problem.starts, strict=True)
        for _ in own
    )
    short = replace(problem, records=pieces, starts=starts)
    weights = [np.full(len(problem.spread), _BEGINNING)] * len(pieces)
    near = fit(short, (), [nominal_point(short)], weights, _STEPS_OF_PIECES)
    if near is None:
        return base
    first = np.cumsum([0, *map(len, parts[:-1])])
    begun = replace(near.point, starts=tuple(near.point.starts[k] for k in first))
    errors = problem.errors(begun)
    if errors is None or _misfit(errors) > base.misfit:
        return base
    other = fit_base(problem, begun.q)
    return other if other is not None and other.misfit < base.misfit else base


def piece_ends(record: Record, most: int) -> list[int]:
    """Return the samples at which pieces of a record begin, as long as each other, and its end.

    Parameters
    ----------
    record : Record
    most : int
        Pieces; fewer of a short record.
    """
    count = max(1, min(most, len(record.time) // _SHORTEST))
    return [int(end) for end in np.linspace(0, len(record.time), count + 1)]


def with_free_starts(problem: Problem) -> Problem:
    """Return a problem of which records begin anywhere, but for start states that are held.

    What happened before its first sample no record tells: a load may have been there long before,
    and a prior near the declared states would tell a stiffness by it.
    """
    wide = _WIDE_START * problem.model.nominal_states
    starts = tuple(
        replace(s, deviation=np.where(problem.known_starts, s.deviation, wide))
        for s in problem.starts
    )
    return replace(problem, starts=starts)


def vague(problem: Problem) -> Problem:
    """Return a problem of which priors hold nothing but what no sample tells."""
    return replace(with_free_starts(problem), vagueness=_VAGUE)


def by_least_squares(fitted: Fit) -> Fit:
    """Return a fit in which priors hold those parameters alone of which no sample says anything.

    Where the model misses something slow, few samples are independent, and the fit of a search
    stays near nominal. Start states are as near to the declared ones as before.
    """
    problem, ends = replace(fitted.problem, vagueness=_VAGUE), fitted
    for _ in range(_ROUNDS):
        found = fit(problem, ends.terms, [ends.point], weights_of(ends.errors), _BASE_STEPS)
        ends = found or ends
    return replace(ends, problem=fitted.problem)


def _cell(walls: Array, phase: float) -> tuple[float, float]:
    """Return the walls between which a phase is, in periods."""
    turn = np.floor(phase)
    i = int(np.searchsorted(walls, phase - turn, side="right"))
    around = np.concatenate([walls[-1:] - 1.0, walls, walls[:1] + 1.0])
    return float(turn + around[i]), float(turn + around[i + 1])


def _at_phases(problem: Problem, point: Point) -> Iterator[Point]:
    """Yield a point, and those with another phase of each clock in turn.

    The cost jumps where a tick passes a sample, and has many minima over a phase. Phases are those
    between the parts of a period, many of which are at samples.
    """
    yield point
    for k in problem.phases:
        for phase in range(_PHASES):
            q = point.q.copy()
            q[k] += (phase + 0.5) / _PHASES
            yield replace(point, q=q)


def fit_start(
    problem: Problem,
    point: Point,
    terms: Sequence[Term],
    record: Record,
    prior: StartPrior,
    weight: Array,
    *,
    local: int = 0,
) -> tuple[Point, Array] | None:
    """Fit the start states of a record alone, and local values; None if the model runs away.

    Parameters
    ----------
    problem : Problem
    point : Point
        All other values, which stay.
    terms : sequence of Term
    record : Record
    prior : StartPrior
    weight : ndarray, shape (ny,)
        Of squared errors in spreads.
    local : int
        Number of the last coordinates of the point that are fitted with the start states.

    Returns
    -------
    point : Point
        With the local values.
    start : ndarray, shape (nx,)
    """
    nothing = np.zeros(local + len(prior.mean))
    if not nothing.size:
        return point, prior.mean
    search = _StartSearch(problem, point, terms, record, prior, np.sqrt(weight), local)
    begun = search.evaluate(nothing)
    if begun is None:
        return None
    found, _ = _downhill(search.evaluate, np.add, (nothing, begun), _START_STEPS, FLAT)
    return search.at(found)


@dataclass(frozen=True, eq=False)
class _StartSearch:
    """The cost of a record by local values and start states z, in prior deviations.

    It has the arguments of `fit_start`, and the root (ny,) of the weight.
    """

    problem: Problem
    point: Point
    terms: Sequence[Term]
    record: Record
    prior: StartPrior
    root: Array
    local: int

    @cached_property
    def of_point(self) -> slice:
        """Coordinates of the point that are searched."""
        return slice(len(self.point.q) - self.local, None)

    @cached_property
    def deviation(self) -> Array:
        """Prior deviations of local values and start states."""
        return np.append(self.problem.deviation[self.of_point], self.prior.deviation)

    @cached_property
    def free(self) -> Indices:
        """Positions of the parameters of the local values."""
        places = self.problem.columns(self.record.group).tolist()
        searched = range(len(self.point.q))[self.of_point]
        return self.problem.searched[np.array([places.index(k) for k in searched], dtype=int)]

    def at(self, z: Array) -> tuple[Point, Array]:
        """Return the point, within bounds, and the start states."""
        mean = np.append(self.problem.mean[self.of_point], self.prior.mean)
        local, start = np.split(mean + z * self.deviation, [self.local])
        q = self.point.q.copy()
        q[self.of_point] = local
        return replace(self.point, q=np.clip(q, *self.problem.bounds)), start

    def evaluate(self, z: Array) -> Evaluated | None:
        """Return the cost with its derivatives by z; None if the model runs away."""
        problem, record = self.problem, self.record
        point, start = self.at(z)
        setting = replace(problem.setting(point, self.terms, record.group), free=self.free)
        course = problem.model.run(record, setting, start, sensitive=True)
        if course is None:
            return None
        errors = (record.outputs - course.outputs) / problem.spread * self.root
        factors = np.append(problem.slopes(point.q)[self.of_point], np.ones(len(start)))
        # between local values and start states are values of the terms
        searched = np.r_[: self.local, -len(start) : 0]
        rows = course.slopes[:, :, searched] * (factors * self.deviation)
        rows *= (self.root / problem.spread)[record.measured, np.newaxis]
        e = errors[:, record.measured].ravel()
        present = np.isfinite(e)
        e, rows = e[present], rows.reshape(-1, len(z))[present]
        cost = 0.5 * float(e @ e + z @ z)
        return Evaluated(cost, rows.T @ rows + np.eye(len(z)), rows.T @ e - z, (e,))


def prior_deviations(fitted: Fit) -> Array:
    """Return the prior deviations of parameters and terms, in the order of the curvature."""
    return _Search(fitted.problem, fitted.terms, independent_weights(fitted.errors)).deviation


def final_curvature(fitted: Fit) -> Array:
    """Return the curvature of the cost at a fit, by the independent samples of what it leaves."""
    search = _Search(fitted.problem, fitted.terms, independent_weights(fitted.errors))
    here = search.evaluate(fitted.point)
    return fitted.curvature if here is None else here.curvature
