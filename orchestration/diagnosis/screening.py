"""Linear responses of the outputs to every term, and the sets of terms that they propose.

Along a course each candidate's drive enters its law; the response of the outputs is that of the
model linearised there. What parameters, start states and terms that are already in the model can
do is projected out, with their priors.
"""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fmus.kit.arrays import Array, Indices, Mask
from orchestration.diagnosis.catalogue import named_terms
from orchestration.diagnosis.comparison import words
from orchestration.diagnosis.courses import Courses
from orchestration.diagnosis.delays import earlier
from orchestration.diagnosis.fitting import effective_samples, weights_of
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.responses import Drives, Projection, Response, respond
from orchestration.diagnosis.runs import Linearisation
from orchestration.diagnosis.signals import Seen, alike_signals, distinct, seen
from orchestration.diagnosis.terms import (
    FORMS,
    DelayTerm,
    Memory,
    NamedTerm,
    SensorTerm,
    Shape,
    Term,
)

_POWERS = (Shape.LINEAR, Shape.SQUARE, Shape.ODD_SQUARE, Shape.CUBE)
_PLAIN = (*_POWERS, Shape.ROOT, Shape.DRY, Shape.DEAD_ZONE, Shape.CURVE)
_REMEMBERED = {
    Memory.LAG: (Shape.LINEAR, Shape.SQUARE, Shape.ODD_SQUARE),
    Memory.FADING: (Shape.LINEAR, Shape.DRY),
    Memory.PLAY: (Shape.LINEAR,),
    Memory.DAHL: (Shape.LINEAR,),
    Memory.BACKLASH: (Shape.LINEAR,),
    Memory.HEAT: (),  # it changes a law in percent
    Memory.INTEGRAL: (Shape.LINEAR, Shape.SQUARE, Shape.CURVE),
    Memory.THROUGHPUT: (Shape.LINEAR, Shape.ROOT, Shape.DRY),
}
_FACTORS = {
    Memory.NONE: (Shape.LINEAR, Shape.SQUARE, Shape.DRY, Shape.CURVE),
    Memory.HEAT: (Shape.LINEAR,),
    Memory.INTEGRAL: (Shape.LINEAR, Shape.SQUARE, Shape.CURVE),
    Memory.THROUGHPUT: (Shape.LINEAR, Shape.ROOT, Shape.DRY),
}
_OF_ITSELF = (Shape.MODULUS, Shape.ODD_SQUARE, Shape.CUBE, Shape.DRY)  # of a rate, as a signal
_DRIFTS = (Shape.LINEAR, Shape.ROOT, Shape.SQUARE)  # of a sensor, over the time
_PRODUCT = (Shape.LINEAR, Shape.SQUARE, Shape.CURVE)  # of a term in proportion to an input
_DELAYS, _LATEST = 6, 16.0  # of an output; the longest is so small a part of the record
_PLACES = 24  # instants of a record at which a law may have changed
CURVE_KNOTS = 9  # of a curve at first
_ROWS = 1600  # of the screen at most
_SAME = 0.9999  # cosine from which on two laws act alike
_START = 3.0  # prior deviation of a start state, in nominal values
_RIDGE = 1e-2  # prior precision of a coefficient
_VISIBLE = 1e-8  # share of a column's square that parameters leave, below which it is none
_NOTHING = 1e-300
_LEAST = 1e-6  # share of a sum of squares, to which a set can take it
_AT_ONCE = 400  # columns whose products are computed at once: as much as a cache holds
_POOL = 60  # candidates of which sets are made
_LEADING, _PARTNERS = 4, 50  # of the pool, that are joined with so many that need not be good alone


@dataclass(frozen=True, eq=False)
class Candidate:
    """A term with the prior of its words, nats.

    Attributes
    ----------
    term : Term
    values : ndarray, shape (n, coefficients)
        Of its shapes; for a named term the response (n, ny) of the outputs, SI.
    amount : ndarray, shape (n,)
        Addition to its law at a value of 1, SI.
    prior : float
    """

    term: Term
    values: Array
    amount: Array
    prior: float


class Screen:
    """Linear responses along a course, whitened and free of what else can be fitted.

    Attributes
    ----------
    candidates : list of Candidate
    effective : ndarray, shape (m,)
        Effective samples of each measured output, of what is left to explain.

    Parameters
    ----------
    along : Courses
    candidates : sequence of Candidate
        Those of the catalogue last.
    replaced : Term, optional
        Of the fit, in place of which they stand.
    """

    def __init__(
        self, along: Courses, candidates: Sequence[Candidate], replaced: Term | None = None
    ):
        self._along = along
        self.candidates = list(candidates)
        self._replaced = replaced
        self.ends = np.cumsum([0, *(c.term.coefficients for c in self.candidates)])
        self._columns, measured = self._projected()
        outputs = len(along.spread)
        ends = np.linspace(0, len(measured), outputs + 1).astype(int)
        # rows of each measured output, and of the prior
        self._rows_of = [*map(slice, ends[:-1], ends[1:]), slice(ends[-1], None)]
        rest = self._columns.remaining
        of_each = [rest[rows][measured[rows]] for rows in self._rows_of[:-1]]
        if replaced is not None:
            of_each = list(np.concatenate(along.errors).T)
        self.effective = np.array([effective_samples(own) for own in of_each])
        self._squares = np.array([rest[rows] @ rest[rows] for rows in self._rows_of])

    def _projected(self) -> tuple[Projection, Mask]:
        """Respond to all drives piece by piece, and project out what can be fitted anyway.

        The rows of each output stand one after the other; returns which are measured, too. The
        others are zero.
        """
        along = self._along
        stride = max(1, int(np.ceil(len(along.laws) * len(along.spread) / _ROWS)))
        counts = [-(-len(t) // stride) for t in along.times]
        columns = np.empty((self.ends[-1], len(along.spread), sum(counts)))
        of_pieces = np.split(columns, np.cumsum(counts)[:-1], axis=2)
        drives, effects = self._drives(), self._effects()
        first, rows = 0, []
        for i, own in enumerate(of_pieces):
            last = first + len(along.times[i])
            rows.append(self._rows(i, drives.part(first, last), effects[first:last], stride, own))
            first = last
        target, free = (np.concatenate(parts).swapaxes(0, 1) for parts in zip(*rows, strict=True))
        absent = ~np.isfinite(target).ravel()
        whole = columns.reshape(len(columns), len(absent))
        whole[:, absent] = 0.0
        whole[~np.isfinite(whole).all(axis=1)] = 0.0  # they run away
        free = np.where(absent[:, np.newaxis], 0.0, free.reshape(len(absent), -1))
        return Projection(np.where(absent, 0.0, target.ravel()), whole.T, free), ~absent

    def _drives(self) -> Drives:
        """Return the drives of terms without a name."""
        samples = len(self._along.laws)
        values, amounts = _Rows(samples), _Rows(samples)
        laws = self._along.model.laws
        rows = []
        for candidate in self.candidates:
            if isinstance(candidate.term, NamedTerm):
                continue
            law, first = laws.index(candidate.term.law), values.place(candidate.values)
            amount = amounts.place(candidate.amount)
            count = candidate.term.coefficients
            rows += [(law, row, amount) for row in range(first, first + count)]
        return Drives(values.stacked, amounts.stacked, np.array(rows, dtype=int).reshape(-1, 3).T)

    def _rows(
        self, piece: int, drives: Drives, effects: Array, stride: int, out: Array
    ) -> tuple[Array, Array]:
        """Return the errors (m, ny) of a piece and the columns (m, ny, o) of what is fitted anyway.

        At every so many samples, whitened. The responses of all candidates go to `out` (c, ny, m).
        """
        along = self._along
        root = np.sqrt(self._weights[piece] * stride)
        size = root / along.spread
        part = along.parts[piece].weighed(size)
        laws = drives.rows.shape[1]
        response = respond(along.pieces[piece], part, drives, stride, out[:laws])
        out[laws:] = (effects[::stride] * size[:, np.newaxis]).T
        target, free = along.errors[piece][::stride] * root, self._nuisance(response, piece)
        if self._replaced is None:
            return target, free
        coefficients, places = self._of_replaced
        own = places[: len(coefficients)]
        return target + free[:, :, own] @ coefficients, np.delete(free, places, axis=2)

    @cached_property
    def _of_replaced(self) -> tuple[Array, Indices]:
        """Return the coefficients of the term that is replaced, and the columns of it that go.

        Constants of its memory stay: they are those of the terms in its place.
        """
        fitted, term = self._along.fitted, self._replaced
        assert term is not None
        before = fitted.terms[: fitted.terms.index(term)]
        first = len(fitted.point.q) + sum(t.coefficients + len(t.start) for t in before)
        places = first + np.arange(term.coefficients)
        if term.shape.has_width:
            places = np.append(places, first + term.coefficients + len(term.start) - 1)
        return fitted.values_of(term)[: term.coefficients], places

    @cached_property
    def _weights(self) -> list[Array]:
        return weights_of(self._along.errors)

    def _effects(self) -> Array:
        """Return the responses (n, m, c) of named terms, which are the last candidates."""
        along = self._along
        none = np.zeros((len(along.laws), len(along.spread), 0))
        named = [c.values for c in self.candidates if isinstance(c.term, NamedTerm)]
        return np.dstack([none, *(d[:, :, np.newaxis] for d in named)])

    def _nuisance(self, response: Response, piece: int) -> Array:
        """Return the columns (n, m, o) of what is fitted anyway, in prior deviations.

        Parameters, values of the terms, and the start states of every piece.
        """
        fitted, pieces = self._along.fitted, self._along.pieces
        problem, values = fitted.problem, len(fitted.point.values)
        slopes = problem.slopes(fitted.point.q)
        free = np.zeros((*response.to_coordinates.shape[:2], len(slopes) + values))
        free[:, :, problem.coordinates(values, pieces[piece].group)] = response.to_coordinates
        free[:, :, : len(slopes)] *= slopes
        nominal = self._along.model.nominal_states
        starts = np.zeros((*free.shape[:2], len(pieces), len(nominal)))
        starts[:, :, piece] = response.to_start[:, :, : len(nominal)] * _START * nominal
        widths = np.append(problem.deviation, np.ones(values))
        return np.dstack([free * widths, starts.reshape(*free.shape[:2], -1)])

    def _coefficients(self, places: Array) -> Array:
        """Return the coefficients of some columns by ridge regression."""
        matrix = self._columns.products(places) + np.diag(self._ridge[places])
        return np.asarray(np.linalg.solve(matrix, self._columns.moments[places]))

    @cached_property
    def _ridge(self) -> Array:
        return 1e-6 * self._columns.alone + _RIDGE

    def solve(self, chosen: Sequence[int]) -> tuple[list[Array], Array]:
        """Return the coefficients of a set, and the shift of the parameters, in deviations."""
        places = self._places(chosen)
        coefficients = self._coefficients(places)
        sizes = np.cumsum([self.candidates[i].term.coefficients for i in chosen])[:-1]
        return np.split(coefficients, sizes), self._columns.shift(places, coefficients)

    def _places(self, chosen: Sequence[int]) -> Array:
        """Return the columns of some candidates."""
        spans = [np.arange(self.ends[i], self.ends[i + 1]) for i in chosen]
        return np.concatenate(spans)

    def gains(self, chosen: Sequence[Sequence[int]]) -> Array:
        """Return the gains in log likelihood of sets, nats, as the linear responses have it."""
        gains = np.zeros(len(chosen))
        sizes = np.diff(self.ends).tolist()
        alike = defaultdict(list)
        for k, one in enumerate(chosen):
            alike[tuple(sizes[i] for i in one)].append(k)
        for widths, sets in alike.items():
            count = max(1, _AT_ONCE // sum(widths))
            for first in range(0, len(sets), count):
                part = sets[first : first + count]
                starts = self.ends[np.array([chosen[k] for k in part])]
                spans = [starts[:, [i]] + np.arange(width) for i, width in enumerate(widths)]
                gains[part] = self._gains(np.hstack(spans))
        return gains

    def values(self, chosen: Sequence[Sequence[int]]) -> Array:
        """Return the penalised evidence of sets, nats, as the linear responses have it."""
        costs = self._costs.tolist()
        return self.gains(chosen) - np.array([sum(costs[i] for i in one) for one in chosen])

    def value(self, chosen: Sequence[int]) -> float:
        """Return the penalised evidence of a set, nats, as the linear responses have it."""
        return float(self._alone[chosen[0]] if len(chosen) == 1 else self.values([chosen])[0])

    def _gains(self, places: Array) -> Array:
        """Return the gains of sets of columns (n, k).

        A model is judged by the likelihood of each output: one that is followed well would hide
        another in the sum of both.
        """
        products = np.array([self._columns.products_within(places, r) for r in self._rows_of])
        moments = self._moments[:, places]
        whole = products.sum(axis=0) + self._ridge[places][:, :, np.newaxis] * np.eye(len(places.T))
        solved = np.linalg.solve(whole, moments.sum(axis=0)[:, :, np.newaxis])[:, :, 0]
        falls = 2.0 * np.einsum("gnk,nk->gn", moments, solved)
        falls -= np.einsum("nk,gnkl,nl->gn", solved, products, solved)
        before = np.maximum(self._squares[:-1, np.newaxis], _NOTHING)
        shares = np.maximum(1.0 - falls[:-1] / before, _LEAST)
        return np.asarray(0.5 * falls[-1] - 0.5 * self.effective @ np.log(shares))

    @cached_property
    def _moments(self) -> Array:
        """Inner products (outputs and prior, c) of the columns with what is left to explain."""
        return np.array([self._columns.moments_within(rows) for rows in self._rows_of])

    @cached_property
    def _costs(self) -> Array:
        """Nats that each candidate costs: its coefficients, its words, and the choice of it."""
        half = 0.5 * np.log(max(self.effective.sum(), 3.0))
        choice = 0.5 * np.log(max(len(self.candidates), 2))
        return np.array([half * c.term.freedom + c.prior + choice for c in self.candidates])

    @cached_property
    def _alone(self) -> Array:
        """Values of the sets of one candidate."""
        return self.values([(i,) for i in range(len(self.candidates))])

    @cached_property
    def _singles(self) -> Array:
        """The same; minus infinity of one that nothing sees."""
        norms, alone = (
            np.add.reduceat(sums, self.ends[:-1])
            for sums in (self._columns.norms, self._columns.alone)
        )
        visible = (norms > _VISIBLE * alone) | (np.diff(self.ends) > 1)
        return np.where(visible, self._alone, -np.inf)

    def _partners(self, i: int) -> list[int]:
        """Return candidates of one coefficient that explain most beside a candidate.

        What candidate `i` explains is projected out of the others, by the Schur complement of its
        block in their products; all outputs count together.
        """
        simple = np.flatnonzero(np.diff(self.ends) == 1)
        places, own = self.ends[simple], self._places([i])
        columns = self._columns
        inside = columns.products(own) + np.diag(self._ridge[own])
        across = columns.across(own)[:, places]
        removed = np.linalg.solve(inside, np.column_stack([across, columns.moments[own]]))
        moments = columns.moments[places] - across.T @ removed[:, -1]
        rest = columns.norms[places] - np.einsum("ij,ij->j", across, removed[:, :-1])
        falls = moments**2 / (np.maximum(rest, 0.0) + self._ridge[places])
        falls += columns.moments[own] @ removed[:, -1]
        left = np.maximum(1.0 - falls / self._squares.sum(), _LEAST)
        values = -0.5 * self.effective.sum() * np.log(left) - self._costs[simple]
        best = simple[np.argsort(-values)[:_PARTNERS]]
        return [j for j in best.tolist() if j != i]

    def propose(self, most_terms: int) -> list[tuple[float, tuple[int, ...]]]:
        """Return sets of one to so many terms, best first; those of one source differ.

        The best of each number of terms; a second term need not be good alone.
        """
        best: dict[frozenset[object], tuple[float, tuple[int, ...]]] = {}

        def keep(chosen: tuple[int, ...], value: float) -> None:
            sources = [self.candidates[i].term.source for i in chosen]
            curved = [self.candidates[i].term.shape is Shape.CURVE for i in chosen]
            if len(set(sources)) < len(sources) or not np.isfinite(value):
                return
            key = frozenset(zip(sources, curved, strict=True))
            if key not in best or value > best[key][0]:
                best[key] = (value, chosen)

        for i, value in enumerate(self._singles.tolist()):
            keep((i,), value)
        pool = self._pool()
        pairs = list(itertools.combinations(pool, 2)) if most_terms > 1 else []
        pairs += [(i, j) for i in pool[:_LEADING] for j in self._partners(i) if most_terms > 1]
        ranked = sorted(zip(self.values(pairs).tolist(), pairs, strict=True), reverse=True)
        for value, pair in ranked[:200]:
            keep(pair, value)
        if most_terms > 2:
            more = ({*pair, j} for _, pair in ranked[:12] for j in pool if j not in pair)
            triples = list({tuple(sorted(chosen)) for chosen in more})
            for triple, value in zip(triples, self.values(triples).tolist(), strict=True):
                keep(triple, value)
        return sorted(best.values(), reverse=True)

    def _pool(self) -> list[int]:
        """Return the best candidates, of which few have the same source."""
        pool: list[int] = []
        taken: dict[object, int] = {}
        for i in np.argsort(-self._singles).tolist():
            source = self.candidates[i].term.source
            if taken.get(source, 0) < 2 and len(pool) < _POOL and np.isfinite(self._singles[i]):
                pool.append(i)
                taken[source] = taken.get(source, 0) + 1
        return pool


def alike(model: LawModel, parts: Sequence[Linearisation]) -> list[dict[str, float]]:
    """Return the targets in classes of those that act alike: whose columns are in proportion.

    Each with how much it does, by which sizes in its unit become those in another's. A law without
    any action is left out.
    """
    classes: list[dict[str, float]] = []
    actions: list[Array] = []
    for law, action in zip(model.targets, _scaled_actions(model, parts).T, strict=True):
        size = float(np.linalg.norm(action))
        if not size:
            continue
        for known, direction in zip(classes, actions, strict=True):
            if abs(action @ direction) > _SAME * size:
                known[law] = size
                break
        else:
            classes.append({law: size})
            actions.append(action / size)
    return classes


def _scaled_actions(model: LawModel, parts: Sequence[Linearisation]) -> Array:
    """Return what additions to the targets do, (rows, targets), whatever the units.

    To each rate and output over the largest that one of them does.
    """
    targets = [model.laws.index(law) for law in model.targets]
    rows = []
    for same in zip(*(part.actions for part in parts), strict=True):
        action = np.nan_to_num(np.concatenate(same)[:, :, targets], posinf=0.0, neginf=0.0)
        largest = np.abs(action).max(axis=(0, 2), keepdims=True, initial=0.0)
        action = action / np.where(largest > 0.0, largest, 1.0)
        rows.append(action.reshape(action.shape[0] * action.shape[1], len(targets)))
    return np.concatenate(rows)


class _Views:
    """Signals of a model along its courses and through memories, as each law sees them."""

    def __init__(self, along: Courses):
        model = self._model = along.model
        named = [(name, values) for name, values in along.values.items() if name in model.arguments]
        self._times = along.times
        self._alike = alike_signals([one for one in named if np.isfinite(one[1]).all()])
        self._counted = {v.name for v in (*model.inputs, *model.states)} - model.integrals
        if len(along.pieces) > len(along.fitted.problem.records):
            self._counted = set()  # what has passed is known from the start of a record on
        self._shares = _residual_shares(along)
        self._known: dict[tuple[str, ...], list[Seen]] = {}

    def of(self, laws: Sequence[str]) -> list[Seen]:
        """Return the views of distinct signals.

        Of signals that are one along these courses, the one that the plainest law reads.
        """
        reads = sorted(map(self._model.reads, laws), key=len)
        signals = []
        for same in self._alike:
            own = (one for read in reads for one in same if one[0] in read)
            signals.append(next(own, same[0]))
        key = tuple(name for name, _ in signals)
        if key not in self._known:
            views = seen(signals, self._times, list(_REMEMBERED), self._shares)
            self._known[key] = [view for view in views if self._is_view(view)]
        return self._known[key]

    def _is_view(self, view: Seen) -> bool:
        if view.memory.counts:
            return view.signal in self._counted
        return view.memory is not Memory.FADING or view.signal not in self._model.integrals


def _residual_shares(along: Courses) -> list[float]:
    """Return the residual of each measured output, in its spreads.

    The output of a joint with backlash is off by the way, however often the joint turns.
    """
    squares = np.nanmean(np.concatenate(along.errors) ** 2, axis=0)
    return [float(share) for share in np.sqrt(squares) if share > 0.0]


@dataclass(frozen=True, eq=False)
class _Alike:
    """Laws that act alike.

    Attributes
    ----------
    model : LawModel
    values : Mapping of str to ndarray, shape (n,)
        Of signals along the courses.
    sizes : dict of str to float
        Of each law, SI: the typical size of one of them, and what does the same in the others.
    """

    model: LawModel
    values: Mapping[str, Array]
    sizes: dict[str, float]

    @cached_property
    def whole(self) -> str:
        """A rate among them, which is a whole balance, or the first."""
        return next((law for law in self.sizes if law in self.model.rates), next(iter(self.sizes)))

    @cached_property
    def amounts(self) -> dict[str, Array]:
        """Additions (n,) of a size to each law."""
        return {law: np.full(len(self.values[law]), size) for law, size in self.sizes.items()}

    @cached_property
    def reads(self) -> dict[str, Collection[str]]:
        """Signals that each law depends on."""
        return {law: self.model.reads(law) for law in self.sizes}

    def owner(self, signal: str) -> tuple[str, bool]:
        """Return the law that owns a signal, and whether it depends on it already."""
        reads, rates = self.reads, self.model.rates
        having = [law for law in reads if signal in reads[law] or signal == law]
        if having:
            return min(having, key=lambda law: (len(reads[law]), law in rates)), True
        if self.whole in rates:
            return self.whole, False
        return max(reads, key=lambda law: len(reads[law])), False

    def have(self, signal: Array) -> bool:
        """Return whether one of them is in proportion to a signal (n,)."""
        return any(_cosine(self.values[law], signal) > _SAME for law in self.sizes)


class _Rows:
    """Arrays over n samples as rows, each array once."""

    def __init__(self, samples: int) -> None:
        self._samples = samples
        self._arrays: list[Array] = []
        self._first: dict[int, int] = {}
        self._count = 0

    def place(self, array: Array) -> int:
        """Return the first row of an array (n,) or (n, k)."""
        if id(array) not in self._first:
            rows = array.reshape(len(array), -1).T
            self._first[id(array)] = self._count
            self._arrays.append(rows)
            self._count += len(rows)
        return self._first[id(array)]

    @property
    def stacked(self) -> Array:
        """All rows (r, n)."""
        return np.concatenate([np.zeros((0, self._samples)), *self._arrays])


class _Shapes:
    """Shapes of the signals of a model, each computed once for all laws."""

    def __init__(self, model: LawModel):
        self.model = model
        self.outputs = {output.name for output in model.outputs}
        self._known: dict[object, Array] = {}

    def candidate(self, term: Term, view: Seen, amount: Array, depends: bool) -> Candidate:
        """Return a term of a signal, with its addition (n,) to its law at a value of 1."""
        key = view, term.shape, term.scale, term.middle, term.width, term.places
        if key not in self._known:
            self._known[key] = self.model.shape_values(term, view.values)
        return Candidate(term, self._known[key], amount, words(self.model, term, depends))


def screen_of(
    along: Courses, named: bool = False, is_candidate: Callable[[Term], bool] = lambda term: True
) -> Screen:
    """Return the screen of every term that may be missing.

    Parameters
    ----------
    along : Courses
    named : bool
        Whether effects of the catalogue are candidates.
    is_candidate : callable
        Returns whether a term may be one at all.
    """
    return Screen(along, [one for one in _candidates(along, named) if is_candidate(one.term)])


def _candidates(along: Courses, named: bool) -> Iterator[Candidate]:
    """Yield every term that may be missing, those of the catalogue last."""
    classes = alike(along.model, along.parts)
    shapes = _Shapes(along.model)
    views_of = _Views(along)
    for actions in classes:
        largest = max(_rms(along.values[law]) * action for law, action in actions.items())
        sizes = {law: largest / action or 1.0 for law, action in actions.items()}
        yield from _of_class(shapes, _Alike(along.model, along.values, sizes), views_of)
    if all(piece.gain is None for piece in along.pieces):  # an observer follows its sensors
        yield from _of_sensors(along, shapes)
    if len(along.fitted.problem.records) == 1:  # an instant is one of a record
        yield from _changes(along, classes, shapes)
    for effect in named_terms(along) if named else ():
        yield Candidate(effect.term, effect.response, np.zeros(0), 0.0)


def _of_class(shapes: _Shapes, same: _Alike, views_of: _Views) -> Iterator[Candidate]:
    """Yield terms of laws that act alike."""
    whole = same.whole
    if whole not in shapes.outputs:  # of an output it is one of its sensor
        constant = Term(whole, "", Shape.CONSTANT, size=same.sizes[whole])
        amount = same.amounts[whole]
        yield Candidate(constant, np.ones((len(amount), 1)), amount, 0.0)
    yield from _of_itself(shapes, same)
    views = views_of.of(list(same.sizes))
    for view in views:
        if view.signal not in same.sizes or view.memory is not Memory.NONE:
            yield from _over_view(shapes, same, view)  # one that acts alike is no signal of another
    yield from _in_percent(shapes, same, views)
    yield from _by_inputs(shapes, same, views)


def _over_view(shapes: _Shapes, same: _Alike, view: Seen) -> Iterator[Candidate]:
    """Yield terms of the law that owns a signal."""
    law, depends = same.owner(view.signal)
    values = same.values
    of_sensor = law in shapes.outputs and _is_one(view, values[view.signal], values[law])
    for term in _terms(law, view, _REMEMBERED.get(view.memory, _PLAIN), same.sizes[law]):
        if not (of_sensor and term.shape is Shape.LINEAR):
            yield shapes.candidate(term, view, same.amounts[law], depends)


def _is_one(view: Seen, signal: Array, output: Array) -> bool:
    """Return whether a view of a signal (n,) is one that a sensor has of an output (n,)."""
    is_of_sensor = view.memory in (Memory.NONE, Memory.FADING)
    return is_of_sensor and len(distinct([("output", output), ("signal", signal)])) == 1


def _of_sensors(along: Courses, shapes: _Shapes) -> Iterator[Candidate]:
    """Yield faults of the sensors of measured outputs: offset, gain, drift, lag and delay.

    A state that is shown has no law of a sensor by which a model could be extended.
    """
    model = along.model
    by_sensors = {output.name for output in model.cls.layout.measured_outputs}
    for j in np.flatnonzero(along.measured).tolist():
        output = model.outputs[j].name
        values = along.values[output]
        if output not in by_sensors or not np.isfinite(values).all():
            continue
        views = seen(distinct([(output, values)]), along.times, [Memory.FADING])
        size = float(along.fitted.problem.spread[j])
        offset = SensorTerm(output, "", Shape.CONSTANT, size=size)
        amount = np.full(len(values), size)
        one = np.ones((len(values), 1))
        yield Candidate(offset, one, amount, words(model, offset, True))
        for view in [*views, _time(along)]:
            for shape in _DRIFTS if view.signal == "time" else (Shape.LINEAR,):
                term = SensorTerm(
                    output, view.signal, shape, view.memory, view.constants, "", size, view.scale
                )
                yield shapes.candidate(term, view, amount, True)
        yield from _delays(along, output, size)


def _time(along: Courses) -> Seen:
    """Return the time as a signal."""
    return Seen("time", Memory.NONE, (), along.values["time"], along.length, 0.0)


def _delays(along: Courses, output: str, size: float) -> Iterator[Candidate]:
    """Yield delays of an output."""
    model, values = along.model, along.values[output]
    ends = np.cumsum([len(time) for time in along.times])[:-1]
    parts = list(zip(np.split(values, ends), along.times, strict=True))
    for delay in np.geomspace(along.step, along.length / _LATEST, _DELAYS).tolist():
        late = np.concatenate([earlier(part, time, delay)[0] for part, time in parts])
        term = DelayTerm(output, output, Shape.LINEAR, size=delay)
        amount = np.full(len(values), size)
        column = ((late - values) / size)[:, np.newaxis]
        yield Candidate(term, column, amount, words(model, term, True))


def _of_itself(shapes: _Shapes, same: _Alike) -> Iterator[Candidate]:
    """Yield terms of a rate that relaxes its state over the rate: its time constant is none.

    It differs by direction, falls with the distance from equilibrium, or is a limit of the rate.
    """
    model, rate = shapes.model, same.whole
    state = next((s.name for s in model.cls.layout.states if s.rate == rate), None)
    values = same.values[rate]
    scale = _rms(values)
    if state not in model.depends_on(rate) or not scale:
        return
    view = Seen(rate, Memory.NONE, (), values, scale, 0.0)
    for term in _terms(rate, view, _OF_ITSELF, same.sizes[rate]):
        yield shapes.candidate(term, view, same.amounts[rate], True)


def _in_percent(shapes: _Shapes, same: _Alike, views: Sequence[Seen]) -> Iterator[Candidate]:
    """Yield terms in proportion to each law of those that act alike."""
    for law in same.sizes:
        values = same.values[law]
        if len(same.sizes) > 1 and np.ptp(values) == 0.0:
            continue
        own = shapes.model.depends_on(law)
        for view in views:
            if view.memory is Memory.NONE and (own == {view.signal} or view.signal == law):
                continue
            for term in _terms(law, view, _FACTORS.get(view.memory, ()), 1.0, factor=law):
                yield shapes.candidate(term, view, values, view.signal in own)


def _by_inputs(shapes: _Shapes, same: _Alike, views: Sequence[Seen]) -> Iterator[Candidate]:
    """Yield terms in proportion to an input: command times state, heat by flow over charge.

    Where a law is in proportion to the input, these are changes in percent of that law.
    """
    model = shapes.model
    variables = {v.name for v in (*model.inputs, *model.states)}
    distinct_signals = {view.signal for view in views}
    plain = [v for v in views if v.memory is Memory.NONE and v.signal in variables]
    for factor in (v.name for v in model.inputs if v.name in distinct_signals):
        values = same.values[factor]
        if same.have(values):
            continue
        units = {law: size / _rms(values) for law, size in same.sizes.items()}
        amounts = {law: unit * values for law, unit in units.items()}
        for view in plain:
            if view.signal == factor:
                continue
            owner, depends = same.owner(view.signal)
            law = owner if depends else same.owner(factor)[0]
            products = _PRODUCT[1:] if same.have(view.values) else _PRODUCT  # it is in percent
            has_both = depends and factor in model.reads(law)
            for term in _terms(law, view, products, units[law], factor=factor):
                yield shapes.candidate(term, view, amounts[law], has_both)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _cosine(one: Array, other: Array) -> float:
    """Return the modulus of the cosine between two signals; 0 if one of them is zero."""
    sizes = np.linalg.norm(one) * np.linalg.norm(other)
    return float(abs(one @ other) / sizes) if sizes else 0.0


def _changes(
    along: Courses, classes: Sequence[Collection[str]], shapes: _Shapes
) -> Iterator[Candidate]:
    """Yield changes of laws in percent at an instant, and offsets from one on."""
    model = along.model
    view = _time(along)
    for same in classes:
        for law in same:
            if len(same) > 1 and law in model.rates:
                continue
            amount = along.values[law]
            for place in (np.arange(_PLACES) + 1.0) / (_PLACES + 1.0):
                term = Term(
                    law, "time", Shape.STEP, factor=law, scale=along.length, width=float(place)
                )
                yield shapes.candidate(term, view, amount, True)


def _terms(
    law: str, view: Seen, shapes: Sequence[Shape], size: float, factor: str = ""
) -> Iterator[Term]:
    """Yield the terms of a law over a signal in all these shapes."""
    z = view.scaled
    low, high = float(z.min()), float(z.max())
    for shape in shapes:
        if shape is Shape.ODD_SQUARE and view.one_sided:
            continue
        if shape is Shape.CURVE and high - low <= 0.2:
            continue
        places = tuple(np.linspace(low, high, CURVE_KNOTS)) if shape is Shape.CURVE else ()
        for width in FORMS[shape].widths:
            wide = 2.0 if shape is Shape.DRY and view.one_sided else 1.0
            of_signal = law, view.signal, shape, view.memory, view.constants
            yield Term(*of_signal, factor, size, view.scale, view.middle, width * wide, places)


def at_other_instants(term: Term) -> Iterator[Term]:
    """Yield a change at an instant with instants between those of the screen."""
    if term.shape is Shape.STEP:
        for part in (-1.0 / 3.0, 1.0 / 3.0):
            yield replace(term, width=term.width + part / (_PLACES + 1.0))


def with_shorter_lags(term: Term) -> Iterator[Term]:
    """Yield a term and, of the lag of a sensor, shorter lags, which a long one hides."""
    yield term
    if isinstance(term, SensorTerm) and term.has_memory:
        for ratio in (10.0, 100.0):
            yield replace(term, constants=tuple(lag / ratio for lag in term.constants))
