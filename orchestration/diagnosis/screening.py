"""Linear responses of the outputs to every term, and the sets of terms that they propose.

Along a course each candidate's drive enters its law; the response of the outputs is that of the
model linearised there. What parameters, start states and terms that are already in the model can
do is projected out, with their priors.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fmus.kit.arrays import Array
from orchestration.diagnosis.catalogue import named_terms
from orchestration.diagnosis.comparison import words
from orchestration.diagnosis.fitting import (
    Fit,
    Problem,
    effective_samples,
    weights_of,
)
from orchestration.diagnosis.law_model import Course, LawModel, Linearisation, Record
from orchestration.diagnosis.responses import Projection, Response, respond
from orchestration.diagnosis.signals import Seen, distinct, seen
from orchestration.diagnosis.terms import Memory, NamedTerm, Shape, Term

_PLAIN = (
    Shape.LINEAR,
    Shape.SQUARE,
    Shape.ODD_SQUARE,
    Shape.CUBE,
    Shape.ROOT,
    Shape.DRY,
    Shape.DEAD_ZONE,
    Shape.CURVE,
)
_REMEMBERED = {
    Memory.LAG: (Shape.LINEAR, Shape.ODD_SQUARE, Shape.CURVE),
    Memory.FADING: (Shape.LINEAR, Shape.DRY),
    Memory.PLAY: (Shape.LINEAR,),
    Memory.DAHL: (Shape.LINEAR,),
    Memory.HEAT: (),  # it changes a law in percent
}
_FACTORS = {
    Memory.NONE: (Shape.LINEAR, Shape.SQUARE, Shape.DRY, Shape.CURVE),
    Memory.HEAT: (Shape.LINEAR,),
}
_OF_ITSELF = (Shape.MODULUS, Shape.ODD_SQUARE, Shape.CUBE, Shape.DRY)  # of a rate, as a signal
_PRODUCT = (Shape.LINEAR, Shape.SQUARE, Shape.CURVE)  # of a term in proportion to an input
_PLACES = 24  # instants of a record at which a law may have changed
_WIDTHS = {
    Shape.DRY: (0.05, 0.4),
    Shape.DEAD_ZONE: (0.4, 1.0),
    Shape.ABOVE: (0.5,),
    Shape.BELOW: (0.5,),
}
_DRY, _BEND = 0.3, 0.6  # widths from which other shapes of a term are fitted, in scales
_RANGE = -2.0, 2.0  # of a signal whose curve has no knots yet, in scales
_KNOTS = 9
_RATIO = 4.0  # of two lags, from which a search starts
_QUICK, _RATES = 5.0, (0.5, 2.0)  # of a rate limit: its lag, and rates in scales over that of a lag
_SAMPLES = 2400  # along which responses are computed, at most
_ROWS = 1600  # of the screen at most, of all measured outputs
_SAME = 0.9999  # cosine from which on two laws act alike
_RIDGE = 1e-2  # prior precision of a coefficient
_LEADING = 4  # terms that are paired with every other
_RANKED = 200  # pairs that are kept
_VISIBLE = 1e-4  # share of a column's square that parameters leave, below which it is none
_NOTHING = 1e-300
_LEAST = 1e-6  # share of a sum of squares, to which a set can take it


@dataclass(frozen=True, eq=False)
class Candidate:
    """A term with the prior of its words, nats.

    Attributes
    ----------
    term : Term
    drive : ndarray, shape (n, coefficients)
        SI of its law; for a named term the response (n, ny) of the outputs, SI.
    prior : float
    """

    term: Term
    drive: Array
    prior: float


class Screen:
    """Linear responses along a course, whitened and free of what else can be fitted.

    Attributes
    ----------
    candidates : list of Candidate
    effective : ndarray, shape (ny,)
        Effective samples of each measured output, of what is left to explain.
    """

    def __init__(
        self,
        fitted: Fit,
        pieces: Sequence[Record],
        starts: Sequence[Array],
        named: bool = False,
    ):
        problem = replace(fitted.problem, records=tuple(pieces), starts=())
        self.fitted = fitted
        setting = problem.setting(fitted.point, fitted.terms)
        model = problem.model
        runs = [model.run(r, setting, x) for r, x in zip(pieces, starts, strict=True)]
        courses = [course for course in runs if course is not None]
        if len(courses) < len(runs):
            raise FloatingPointError("the model runs away in a piece of the record")
        self.errors = [
            (r.outputs - c.outputs) / problem.spread for r, c in zip(pieces, courses, strict=True)
        ]
        self._step = int(np.ceil(sum(len(r.time) for r in pieces) / _SAMPLES))
        courses = [replace(c, states=c.states[:: self._step]) for c in courses]
        pieces = [_every(r, self._step) for r in pieces]
        parts = [model.linearise(r, setting, c) for r, c in zip(pieces, courses, strict=True)]
        classes = alike(model, parts)
        signals = _signals(model, pieces, courses, parts)
        laws = np.concatenate([part.laws for part in parts])
        times = [r.time for r in pieces]
        self.candidates = list(_candidates(model, classes, signals, laws, times))
        if len(fitted.problem.records) == 1:  # an instant is one of a record
            self.candidates += _changes(model, classes, np.concatenate(times), laws)
        if named:
            effects = named_terms(model, setting, pieces, courses, parts, problem.spread)
            self.candidates += [Candidate(one.term, one.response, 0.0) for one in effects]
        self.ends = np.cumsum([0, *(c.term.coefficients for c in self.candidates)])
        self._columns = self._projected(problem, pieces, parts)
        rest = self._columns.remaining
        self.effective = np.array([effective_samples(rest[g]) for g in self._columns.groups])

    def _projected(
        self, problem: Problem, pieces: Sequence[Record], parts: Sequence[Linearisation]
    ) -> Projection:
        """Respond to all drives piece by piece, whiten the rows, and project the others out.

        Of the outputs that are measured.
        """
        samples = [len(r.time) for r in pieces]
        measured = np.flatnonzero(np.isfinite(np.vstack(self.errors)).any(axis=0))
        stride = max(1, int(np.ceil(sum(samples) * len(measured) / _ROWS)))
        columns, others = self._responses(problem, pieces, parts, (measured, stride))
        every = self._step * stride
        roots = [np.sqrt(weight * every)[measured] for weight in weights_of(self.errors)]
        sizes = [root / problem.spread[measured] for root in roots]
        errors = zip(self.errors, roots, strict=True)
        return _projection(
            np.concatenate([_rows(c, size) for c, size in zip(columns, sizes, strict=True)]),
            np.concatenate([_rows(o, size) for o, size in zip(others, sizes, strict=True)]),
            np.concatenate([e[::every, measured] * root for e, root in errors]),
        )

    def _responses(
        self,
        problem: Problem,
        pieces: Sequence[Record],
        parts: Sequence[Linearisation],
        rows: tuple[Array, int],
    ) -> tuple[list[Array], list[Array]]:
        """Return the responses to the candidates and to what is fitted anyway, of each piece.

        Parameters
        ----------
        rows : tuple of ndarray of int and int
            Outputs, and of so many samples one.
        """
        measured, stride = rows
        ends = np.cumsum([len(r.time) for r in pieces])
        laws = [c for c in self.candidates if not isinstance(c.term, NamedTerm)]
        drives = np.split(np.hstack([c.drive for c in laws]), ends[:-1])
        positions = [problem.model.laws.index(c.term.law) for c in laws]
        law_of = np.repeat(positions, [c.term.coefficients for c in laws])
        effects = np.split(self._effects(ends[-1], len(problem.spread)), ends[:-1])
        columns, others = [], []
        for i, piece in enumerate(pieces):
            response = respond(piece, _of_outputs(parts[i], measured), drives[i], law_of, stride)
            columns.append(np.dstack([response.to_drives, effects[i][::stride, measured]]))
            others.append(self._nuisance(response, i, len(pieces)))
        return columns, others

    def _effects(self, samples: int, outputs: int) -> Array:
        """Return the responses (n, ny, c) of named terms, which are the last candidates."""
        named = [c.drive for c in self.candidates if isinstance(c.term, NamedTerm)]
        return np.dstack([np.zeros((samples, outputs, 0)), *(d[:, :, None] for d in named)])

    def _nuisance(self, response: Response, piece: int, pieces: int) -> Array:
        """Return the columns (m, ny, o) of what is fitted anyway, in prior deviations.

        Parameters, values of the terms, and the start states of every piece.
        """
        fitted = self.fitted
        free = response.to_coordinates.copy()
        slopes = fitted.problem.slopes(fitted.point.q)
        free[:, :, : len(slopes)] *= slopes
        states = len(fitted.problem.model.states)
        start = np.zeros((*free.shape[:2], states * pieces))
        own = slice(states * piece, states * (piece + 1))
        start[:, :, own] = response.to_start[:, :, :states] * self._starts()
        return np.dstack([free * self._widths(), start])

    def _widths(self) -> Array:
        """Prior deviations of the coordinates that are in the model already."""
        problem = self.fitted.problem
        return np.append(problem.deviation, np.ones(len(self.fitted.point.values)))

    def _starts(self) -> Array:
        """Prior deviations of the start states of a piece."""
        return 3.0 * self.fitted.problem.model.nominal_states

    @cached_property
    def _ridge(self) -> Array:
        """Prior precision (c,) of the coefficient of each column."""
        return 1e-6 * self._columns.alone + _RIDGE

    def _coefficients(self, places: Array) -> Array:
        """Return the coefficients of some columns by ridge regression."""
        matrix = self._columns.products(places) + np.diag(self._ridge[places])
        return np.asarray(np.linalg.solve(matrix, self._columns.moments[places]))

    def solve(self, chosen: Sequence[int]) -> tuple[list[Array], Array]:
        """Return the coefficients of a set, and the shift of the parameters, in deviations."""
        places = self._places(chosen)
        coefficients = self._coefficients(places)
        sizes = np.cumsum([self.candidates[i].term.coefficients for i in chosen])[:-1]
        return np.split(coefficients, sizes), self._columns.shift(places, coefficients)

    def _places(self, chosen: Sequence[int]) -> Array:
        spans = [np.arange(self.ends[i], self.ends[i + 1]) for i in chosen]
        return np.concatenate(spans)

    def _gains(self, sums: Array) -> Array:
        """Return gains (k,) in log likelihood, nats, of sums of squares (ny + 1, k) that are left.

        Of each output by itself: one that is followed well would hide another in the sum of both.
        """
        *before, prior_before = self._columns.squares
        *after, prior_after = sums
        shares = np.array(after) / np.maximum(before, _NOTHING)[:, None]
        gains = -0.5 * self.effective @ np.log(np.maximum(shares, _LEAST))
        return np.asarray(gains + 0.5 * (prior_before - prior_after))

    def gain(self, chosen: Sequence[int]) -> float:
        """Return the gain in log likelihood of a set, nats, as the linear responses have it."""
        places = self._places(chosen)
        try:
            coefficients = self._coefficients(places)
        except np.linalg.LinAlgError:
            return 0.0
        return float(self._gains(self._columns.squares_left(places, coefficients)[:, None])[0])

    def value(self, chosen: Sequence[int]) -> float:
        """Return the penalised evidence of a set, nats, as the linear responses have it."""
        return float(self.gain(chosen) - self._cost[list(chosen)].sum())

    @cached_property
    def _cost(self) -> Array:
        """Cost (candidates,) of each candidate, nats."""
        half = 0.5 * np.log(max(self.effective.sum(), 3.0))
        choice = 0.5 * np.log(max(len(self.candidates), 2))
        return np.array([half * c.term.freedom + c.prior + choice for c in self.candidates])

    def _values_of_singles(self) -> Array:
        """Return the values (candidates,) of each candidate alone."""
        values = np.empty(len(self.candidates))
        single = np.diff(self.ends) == 1
        places = self.ends[:-1][single]
        gains = self._gains(self._columns.squares_by_single(places, self._ridge))
        values[single] = gains - self._cost[single]
        for i in np.flatnonzero(~single).tolist():
            values[i] = self.value([i])
        return values

    def _best_with(self, i: int) -> list[tuple[float, tuple[int, int]]]:
        """Return the best pairs of a candidate with another of few degrees of freedom."""
        simple = [
            j
            for j, c in enumerate(self.candidates)
            if j != i and c.term.coefficients == 1 and c.term.freedom <= 2
        ]
        places = self.ends[simple]
        sums = self._columns.squares_with_one_more(self._places([i]), places, self._ridge)
        values = self._gains(sums) - self._cost[i] - self._cost[simple]
        best = np.argsort(-values)[:_RANKED]
        return [(float(values[k]), (i, simple[k])) for k in best]

    def _pairs(self, pool: Sequence[int]) -> list[tuple[float, tuple[int, ...]]]:
        """Return pairs of a pool, and of its first few with all that are simple, best first."""
        ranked: list[tuple[float, tuple[int, ...]]] = []
        ranked += [(self.value(pair), pair) for pair in itertools.combinations(pool, 2)]
        for i in pool[:_LEADING]:
            ranked += self._best_with(i)
        return sorted(ranked, reverse=True)

    def _is_visible(self) -> Array:
        """Return of each candidate whether parameters leave anything of it."""
        norms, alone = self._columns.norms, self._columns.alone
        return np.array(
            [
                norms[a:b].sum() > _VISIBLE * alone[a:b].sum() or b - a > 1
                for a, b in itertools.pairwise(self.ends)
            ]
        )

    def propose(self, most_terms: int) -> list[tuple[float, tuple[int, ...]]]:
        """Return sets of one to so many terms, best first; those of one source differ.

        The best of each number of terms; a second term need not be good alone.
        """
        singles = np.where(self._is_visible(), self._values_of_singles(), -np.inf)
        order = np.argsort(-singles)
        best: dict[frozenset[object], tuple[float, tuple[int, ...]]] = {}

        def keep(chosen: tuple[int, ...], value: float) -> None:
            sources = [self.candidates[i].term.source for i in chosen]
            curved = [self.candidates[i].term.shape is Shape.CURVE for i in chosen]
            if len(set(sources)) < len(sources) or not np.isfinite(value):
                return
            key = frozenset(zip(sources, curved, strict=True))
            if key not in best or value > best[key][0]:
                best[key] = (value, chosen)

        pool: list[int] = []
        taken: dict[object, int] = {}
        for i in order.tolist():
            source = self.candidates[i].term.source
            keep((i,), float(singles[i]))
            if taken.get(source, 0) < 2 and len(pool) < 60 and np.isfinite(singles[i]):
                pool.append(i)
                taken[source] = taken.get(source, 0) + 1
        if most_terms > 1:
            ranked = self._pairs(pool)
            for value, pair in ranked[:_RANKED]:
                keep(pair, value)
            if most_terms > 2:
                triples = {
                    tuple(sorted({*pair, j}))
                    for _, pair in ranked[:12]
                    for j in pool
                    if j not in pair
                }
                for triple in triples:
                    keep(triple, self.value(triple))
        return sorted(best.values(), reverse=True)


def _of_outputs(part: Linearisation, chosen: Array) -> Linearisation:
    """Return a linearisation of some of the outputs."""
    return replace(
        part,
        outputs=part.outputs[:, chosen],
        outputs_by_laws=part.outputs_by_laws[:, chosen],
    )


def _every(record: Record, step: int) -> Record:
    """Return every so many samples of a record, between which drives go in straight lines."""
    if step == 1:
        return record
    part = record.part(0, len(record.time), step)
    return replace(part, smooth=(True,) * part.inputs.shape[1])


def _projection(columns: Array, others: Array, target: Array) -> Projection:
    """Return a projection of the rows that were measured, output by output.

    A column that runs away is zero.

    Parameters
    ----------
    columns : ndarray, shape (m * ny, c)
    others : ndarray, shape (m * ny, o)
    target : ndarray, shape (m, ny)
    """
    by_output = np.arange(target.size).reshape(target.shape).T
    known = np.isfinite(target).T
    order = by_output[known]
    ends = np.cumsum([0, *known.sum(axis=1)]).tolist()
    groups = tuple(slice(a, b) for a, b in itertools.pairwise(ends))
    columns = columns[order]
    columns[:, ~np.isfinite(columns).all(axis=0)] = 0.0
    return Projection(target.ravel()[order], columns, others[order], groups)


def _rows(columns: Array, sizes: Array) -> Array:
    """Return columns (m, ny, c), times sizes (ny,), with a row for each sample and output."""
    return (columns * sizes[:, None]).reshape(-1, columns.shape[2])


def alike(model: LawModel, parts: Sequence[Linearisation]) -> list[list[str]]:
    """Return the laws in classes of those that act alike: whose columns are in proportion.

    Outputs and definitions are no targets, nor is a law without any action.
    """
    perturbed = model.perturbed
    outputs = {o.name for o in model.outputs}
    classes: list[list[str]] = []
    actions: list[Array] = []
    for i, law in enumerate(model.laws):
        if law in outputs or perturbed.is_definition(law) or perturbed.is_count(law):
            continue
        action = np.concatenate([a[:, :, i].ravel() for part in parts for a in part.actions])
        action = np.nan_to_num(action)
        size = np.linalg.norm(action)
        if not size:
            continue
        for known, direction in zip(classes, actions, strict=True):
            if abs(action @ direction) > _SAME * size:
                known.append(law)
                break
        else:
            classes.append([law])
            actions.append(action / size)
    return classes


def _signals(
    model: LawModel,
    pieces: Sequence[Record],
    courses: Sequence[Course],
    parts: Sequence[Linearisation],
) -> list[tuple[str, Array]]:
    """Return the distinct signals of a model along a course."""
    inputs = np.concatenate([r.inputs for r in pieces])
    states = np.concatenate([c.states for c in courses])
    laws = np.concatenate([part.laws for part in parts])
    named = [(v.name, inputs[:, i]) for i, v in enumerate(model.inputs)]
    named += [(v.name, states[:, i]) for i, v in enumerate(model.states)]
    # neither is an output's law a signal, nor the rate of a state, which follows from the others
    no_signal = {o.name for o in model.outputs} | set(model.followed)
    # nor a law that is a function of one of them
    no_signal |= {law for law in model.laws if len(model.perturbed.computed_from(law)) < 2}
    named += [(law, laws[:, i]) for i, law in enumerate(model.laws) if law not in no_signal]
    named.append(("time", np.concatenate([r.time for r in pieces])))
    return distinct([(name, values) for name, values in named if np.isfinite(values).all()])


def _owner(model: LawModel, classes: Sequence[str], signal: str) -> tuple[str, bool]:
    """Return the law of a class that owns a signal, and whether it depends on it already."""
    depends = {law: model.perturbed.computed_from(law) for law in classes}
    having = [law for law in classes if signal in depends[law] or signal == law]
    if having:
        return min(having, key=lambda law: (len(depends[law]), law in model.rates)), True
    whole = [law for law in classes if law in model.rates]
    return (whole or [max(classes, key=lambda law: len(depends[law]))])[0], False


def _candidates(
    model: LawModel,
    classes: Sequence[Sequence[str]],
    signals: Sequence[tuple[str, Array]],
    laws: Array,
    times: Sequence[Array],
) -> Iterator[Candidate]:
    """Yield every term that may be missing."""
    views = seen(signals, times, list(_REMEMBERED))
    value_of = {law: laws[:, i] for i, law in enumerate(model.laws)}
    for same in classes:
        size = max(float(np.sqrt(np.mean(value_of[law] ** 2))) for law in same) or 1.0
        whole = next((law for law in same if law in model.rates), same[0])
        constant = Term(whole, "", Shape.CONSTANT, size=size)
        yield Candidate(constant, np.full((len(laws), 1), size), 0.0)
        yield from _of_itself(model, whole, value_of[whole], size)
        for view in views:
            if view.signal in same and view.memory is Memory.NONE:
                continue  # a law that acts alike is no signal of another
            law, depends = _owner(model, same, view.signal)
            shapes = _REMEMBERED.get(view.memory, _PLAIN)
            for term in _terms(law, view, shapes, size):
                yield _candidate(model, term, view, np.full(len(laws), size), depends)
        yield from _in_percent(model, same, views, value_of)
        yield from _by_inputs(model, same, size, views, dict(signals), value_of)


def _of_itself(model: LawModel, law: str, values: Array, size: float) -> Iterator[Candidate]:
    """Yield terms of a rate that relaxes its state over the rate: its time constant is none.

    It differs by direction, falls with the distance from equilibrium, or is a limit of the rate.
    """
    state = next((s.name for s in model.states if s.rate == law), None)
    scale = float(np.sqrt(np.mean(values**2)))
    if state not in model.perturbed.computed_from(law) or not scale:
        return
    view = Seen(law, Memory.NONE, (), values, scale, 0.0)
    for term in _terms(law, view, _OF_ITSELF, size):
        yield _candidate(model, term, view, np.full(len(values), size), True)


def _in_percent(
    model: LawModel, same: Sequence[str], views: Sequence[Seen], value_of: Mapping[str, Array]
) -> Iterator[Candidate]:
    """Yield terms in proportion to each law of those that act alike."""
    for law in same:
        if len(same) > 1 and (law in model.rates or np.ptp(value_of[law]) == 0.0):
            continue
        own = model.perturbed.computed_from(law)
        for view in views:
            shapes = _FACTORS.get(view.memory, ())
            is_own = view.memory is Memory.NONE and own == {view.signal}
            if is_own or view.signal == law:
                continue
            for term in _terms(law, view, shapes, 1.0, factor=law):
                yield _candidate(model, term, view, value_of[law], view.signal in own)


def _by_inputs(
    model: LawModel,
    same: Sequence[str],
    size: float,
    views: Sequence[Seen],
    values: Mapping[str, Array],
    value_of: Mapping[str, Array],
) -> Iterator[Candidate]:
    """Yield terms in proportion to an input: command times state, heat by flow over charge.

    Where a law is in proportion to the input, these are changes in percent of that law.
    """
    others = {v.name for v in (*model.inputs, *model.states)}
    for factor in (v.name for v in model.inputs if v.name in values):
        amount = values[factor]
        if any(_cosine(value_of[law], amount) > _SAME for law in same):
            continue
        unit = size / float(np.sqrt(np.mean(amount**2)))
        for view in views:
            if view.memory is Memory.NONE and view.signal in others - {factor}:
                law, depends = _owner(model, same, view.signal)
                law = law if depends else _owner(model, same, factor)[0]
                for term in _terms(law, view, _PRODUCT, unit, factor=factor):
                    yield _candidate(model, term, view, unit * amount, depends)


def _cosine(one: Array, other: Array) -> float:
    """Return the modulus of the cosine between two signals; 0 if one of them is zero."""
    sizes = np.linalg.norm(one) * np.linalg.norm(other)
    return float(abs(one @ other) / sizes) if sizes else 0.0


def _changes(
    model: LawModel, classes: Sequence[Sequence[str]], time: Array, laws: Array
) -> Iterator[Candidate]:
    """Yield changes of laws in percent at an instant, and offsets from one on."""
    length = float(time.max())
    view = Seen("time", Memory.NONE, (), time, length, 0.0)
    value_of = dict(zip(model.laws, laws.T, strict=True))
    for same in classes:
        for law in same:
            if len(same) > 1 and law in model.rates:
                continue
            amount = value_of[law]
            for place in (np.arange(_PLACES) + 1.0) / (_PLACES + 1.0):
                term = Term(law, "time", Shape.STEP, factor=law, scale=length, width=float(place))
                yield _candidate(model, term, view, amount, True)


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
        places = tuple(np.linspace(low, high, _KNOTS)) if shape is Shape.CURVE else ()
        for width in _WIDTHS.get(shape, (1.0,)):
            wide = 2.0 if shape is Shape.DRY and view.one_sided else 1.0
            yield Term(
                law,
                view.signal,
                shape,
                view.memory,
                view.constants,
                factor,
                size,
                view.scale,
                view.middle,
                width * wide,
                places,
            )


def other_shapes(term: Term) -> Iterator[Term]:
    """Yield a term with each of the other shapes of its signal."""
    low, high = (term.places[0], term.places[-1]) if term.places else _RANGE
    for shape in Shape:
        if shape is term.shape or shape in (Shape.CONSTANT, Shape.MODULUS, Shape.STEP):
            continue
        places = tuple(np.linspace(low, high, _KNOTS)) if shape is Shape.CURVE else ()
        width = _DRY if shape is Shape.DRY else _BEND
        yield replace(term, shape=shape, width=width, places=places)


def other_memories(term: Term) -> Iterator[Term]:
    """Yield a term that lags or fades with lags that differ by direction, or a limited rate."""
    if term.memory not in (Memory.LAG, Memory.FADING):
        return
    lag = term.constants[0]
    kinds: list[tuple[Memory, tuple[float, ...]]] = [(Memory.FADING, (lag,))]
    kinds += [(Memory.TWO_LAGS, (lag / ratio**0.5, ratio)) for ratio in (_RATIO, 1.0 / _RATIO)]
    kinds += [(Memory.RATE_LIMIT, (lag / _QUICK, rate / lag)) for rate in _RATES]
    for memory, constants in kinds:
        if memory is not term.memory or term.shape is not Shape.LINEAR:
            yield replace(term, memory=memory, constants=constants, shape=Shape.LINEAR, places=())


def at_other_instants(term: Term) -> Iterator[Term]:
    """Yield a change at an instant with instants between those of the screen."""
    if term.shape is Shape.STEP:
        for part in (-1.0 / 3.0, 1.0 / 3.0):
            yield replace(term, width=term.width + part / (_PLACES + 1.0))


def _candidate(model: LawModel, term: Term, view: Seen, amount: Array, depends: bool) -> Candidate:
    drive = model.shape_values(term, view.values) * amount[:, None]
    return Candidate(term, drive, words(model, term, depends))
