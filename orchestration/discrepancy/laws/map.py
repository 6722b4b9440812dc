"""The map of what a model's laws lack: every law over every signal, and how much a curve there would explain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fmus.kit.corrections import MEMORIES
from fmus.kit.symbolic.perturbed import PerturbedLaws
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.laws.course import FreeCourse, follow
from orchestration.discrepancy.laws.evidence import Basis, Columns, Curve
from orchestration.discrepancy.laws.response import Course, LinearResponse, Sides, responses_of_runs
from orchestration.discrepancy.laws.signals import Signal, is_new, of, plain, remembered
from orchestration.discrepancy.parallel import side_by_side
from orchestration.discrepancy.selection.search import Search
from orchestration.identify.noise.model import Noise, Whitening, estimate
from orchestration.records.joined import Run

Array = NDArray[np.float64]
_MEMORIES = {"add": MEMORIES, "multiply": ("", "lagged", "throughput")}  # of signals, by kind of correction
_QUANTILES = np.linspace(0.0, 1.0, 101)
_AT_ONCE = 48  # signals whose columns are in memory together
_NATURAL, _REMEMBERING, _OTHERS = 10, 3, 4  # entries that are fitted: of signals that the law hangs on, and others
_FARTHEST = 1.0  # that a parameter may move beside a correction, in its logarithm
_SURE = 0.95  # share of records without anything hidden in which no entry gains more
_NEARLY = 0.95  # of the gain of the best of its like, which a correction that is nearer to the model must have
_DRAWS, _SEED = 39, 14  # of noise, by which is told what the best of so many entries gains by chance
_ALIKE = 0.99  # correlation of what two corrections do, above which a record cannot tell them apart


@dataclass(frozen=True)
class Entry:
    """A correction of a law by a curve of a signal.

    Attributes
    ----------
    driven : str
        Law whose free course it was found along, which does the same to the outputs.
    law : str
    signal : Signal
    kind : {"add", "multiply"}
    basis : Basis
    curve : Curve
    direction : ndarray, shape (m,)
        What it does to the whitened outputs, of unit length.
    step : ndarray, shape (p,)
        Of the model's own searched coordinates, beside the free course.
    visited : ndarray, shape (v,)
        Quantiles of the signal, evenly spaced: where the record has been.
    """

    driven: str
    law: str
    signal: Signal
    kind: str
    basis: Basis
    curve: Curve
    direction: Array
    step: Array
    visited: Array

    @property
    def label(self) -> str:
        """For people."""
        return f"{self.law}{' x' if self.kind == 'multiply' else ''} over {self.signal.label}"


def alike(one: Entry, other: Entry) -> bool:
    """Whether a record cannot tell two corrections apart: they do the same to the outputs."""
    return abs(float(one.direction @ other.direction)) >= _ALIKE


class LinearisedRecord:
    """What is to be explained, whitened, and free of what the model's own parameters can do."""

    def __init__(
        self, course: FreeCourse, prior: Array, present: Mapping[str, NDArray[np.bool_]], noise: Mapping[str, Noise]
    ):
        residual, slopes = course.residual, course.slopes
        # an outlier is what no course explains, and not what a model lacks
        self._whitened = Whitening.of(noise, course.left, present)
        columns = self._whitened(slopes)
        sizes = np.linalg.norm(columns, axis=0)
        kept = sizes > 0.0
        # rows for the prior, so that a parameter that it holds takes nothing away
        whole = np.vstack([columns, np.diag(np.sqrt(prior))])[:, kept] / sizes[kept]
        left, strength, right = np.linalg.svd(whole, full_matrices=False)
        seen = strength > 1e-7 * strength.max()
        self._own = left[:, seen][: len(columns)]
        self._back = np.zeros((len(sizes), len(columns)))
        self._back[kept] = (right[seen].T / strength[seen]) @ self._own.T / sizes[kept, None]
        self._whole, self._slopes = self._whitened(residual), columns
        # how far a parameter of the model may go: what a course makes of its trace is not what is there without
        self._farthest = np.where(prior > 0.0, _FARTHEST, np.inf)
        self.residual = self.free(self._whole)
        self.samples = len(self.residual)
        self.noise = np.random.default_rng(_SEED).normal(size=(self.samples, _DRAWS))

    def beside(self, effect: Array) -> Array:
        """Step (p,) of the model's own parameters that goes with what a correction does to the whitened outputs."""
        step = -self._back @ (self._whole - effect)
        return np.asarray(np.clip(step, -self._farthest, self._farthest))

    def fall(self, effect: Array, step: Array) -> float:
        """Fall of the sum of squares with a correction and a step beside it."""
        left = self._whole - effect + self._slopes @ step
        return float(self.residual @ self.residual - left @ left)

    def own(self, columns: Array) -> Array:
        """What parameters can do of columns, in coordinates of its own."""
        return np.asarray(self._own.T @ columns)

    def free(self, columns: Array) -> Array:
        """Take away what parameters can do."""
        return np.asarray(columns - self._own @ self.own(columns))

    def __call__(self, responses: Mapping[str, Array]) -> Array:
        """Whiten responses of outputs where they were measured."""
        return np.asarray(self._whitened(responses))


def _other_names(parts: Sequence[tuple[Run, Course, LinearResponse]]) -> dict[str, list[str]]:
    """Inputs and states, and laws that only hand them on."""
    _, course, response = parts[0]
    signals = {**course.inputs, **course.states}
    same = {s: [n for n, v in response.values.items() if np.array_equal(v.begin, x.begin)] for s, x in signals.items()}
    return {signal: names for signal, names in same.items() if names}


class LawMap:
    """Scores of all laws over all signals at a fitted model."""

    def __init__(self, search: Search, fitted: FittedCandidate):
        self._search, self._fitted, problem = search, fitted, fitted.problem
        values = problem.start | problem.values(fitted.fit.q)
        ran = problem.model.run(problem.time, problem.inputs, values, problem.effort, problem.runs)
        self.laws = PerturbedLaws(fitted.candidate.cls)
        self._outputs, self._present = list(problem.measured), problem.present
        self._n = len(problem.time)
        parts = responses_of_runs(
            self.laws, problem.time, problem.inputs, ran.signals, values, search.data.linear or (), problem.runs,
            self._outputs,
        )  # fmt: skip
        self.candidates = self._different_laws(parts)
        self._other_names = _other_names(parts)
        laws = list(self.candidates)
        self.courses = dict(
            zip(laws, side_by_side(lambda law: follow(search, fitted, self.laws, law), laws), strict=True)
        )

    def _different_laws(self, parts: Sequence[tuple[Run, Course, LinearResponse]]) -> dict[str, list[str]]:
        """Laws that do different things to the outputs, each with others that do the same."""
        found: dict[str, list[str]] = {}
        shapes: dict[str, Array] = {}
        for law in self.laws.names:
            if self.laws.is_definition(law):
                continue
            whole = np.concatenate([p.ravel() for _, _, r in parts for p in r.effect_of(law)])
            size = np.linalg.norm(whole)
            if not size or not np.isfinite(size):
                continue
            whole /= size
            same = next((n for n, other in shapes.items() if abs(float(other @ whole)) > 1.0 - 1e-12), None)
            if same is None:
                shapes[law], found[law] = whole, [law]
            else:
                found[same].append(law)
        outputs = {o.name for o in self.laws.graph.layout.outputs}
        return {
            names[0]: names
            for several in found.values()
            if (names := [n for n in several if n not in outputs] or several)
        }

    def signals_of(self, course: FreeCourse) -> dict[Signal, list[Sides]]:
        """What tells different things in the longest run, by runs."""
        outputs = {o.name for o in self.laws.graph.layout.outputs}
        _, longest, response = max(course.parts, key=lambda part: len(part[1].time))
        first = plain(longest, response.values, outputs)
        told: list[Array] = []
        every = {**first, **dict(remembered(longest, first))}
        kept = [signal for signal, sides in every.items() if is_new(sides, told)]
        return {signal: [of(signal, c, r.values) for _, c, r in course.parts] for signal in kept}

    def entries(self, noise: Mapping[str, Noise] | None = None) -> list[Entry]:
        """Score everything, in one noise."""
        nearest = min(self.courses.values(), key=lambda c: sum(np.log(np.sum(e**2)) for e in c.left.values()))
        problem = self._fitted.problem
        if noise is None:
            noise = {o: estimate(e, problem.present[o], 0, problem.calm[o]) for o, e in nearest.left.items()}
        self.floor = noise
        self._chance: list[Array] = []
        several = side_by_side(lambda law: list(self._of_law(law, noise)), list(self.candidates))
        found = [entry for entries in several for entry in entries]
        self.chance = float(np.quantile(np.max(self._chance, axis=0), _SURE)) if self._chance else 0.0
        return sorted(found, key=lambda e: -e.curve.gain)

    def _of_law(self, law: str, noise: Mapping[str, Noise]) -> Iterator[Entry]:
        course = self.courses[law]
        record = LinearisedRecord(course, self._fitted.fit.prior_precision, self._present, noise)
        signals = self.signals_of(course)
        names = {s: self._name(law, s) for s in signals}
        known = [s for s in signals if not self._is_loop(s, names[s])]
        for name in dict.fromkeys(names[s] for s in known):
            mine = [s for s in known if names[s] == name]
            for at in range(0, len(mine), _AT_ONCE):
                for kind in ("add", "multiply"):
                    some = {s: signals[s] for s in mine[at : at + _AT_ONCE] if s.memory in _MEMORIES[kind]}
                    if not some:
                        continue
                    yield from self._of_signals(course, name, some, kind, record)

    def is_natural(self, entry: Entry) -> bool:
        """Whether the law hangs on the signal already: its shape is the likeliest to be wrong."""
        return entry.kind == "add" and self._reads(entry.law, entry.signal.name)

    def far_fetched(self, entry: Entry) -> tuple[bool, bool, bool, bool]:
        """How far a correction is from what the model says, for an order: what is near it is the likelier one.

        A signal is near where it stands in what the law acts on; to couple what the model keeps apart is a claim.
        """
        near = self.laws.computed_from(entry.signal.name) <= self.laws.acts_beside(entry.law)
        return not near, bool(entry.signal.memory), not self.is_natural(entry), entry.kind != "add"

    def _reads(self, law: str, signal: str) -> bool:
        """Whether a signal, under any of its names, stands in a law itself."""
        names = {signal, *self._other_names.get(signal, ())}
        return law in names or any(self.laws.reads_itself(law, name) for name in names)

    def worth_a_fit(self, entries: Sequence[Entry]) -> list[Entry]:
        """Entries that are fitted: natural ones that tell anything, and the best of the others that do other things."""
        natural: dict[tuple[str, str, bool], Entry] = {}
        for e in entries:
            if self.is_natural(e):
                natural.setdefault((e.law, e.signal.name, bool(e.signal.memory)), e)
        plain = [e for e in natural.values() if not e.signal.memory][:_NATURAL]
        memory = [e for e in natural.values() if e.signal.memory][:_REMEMBERING]
        chosen = [*plain, *memory]
        for leader in entries:
            if len(chosen) >= len(plain) + len(memory) + _OTHERS:
                break
            if not any(alike(leader, c) for c in chosen):
                like = [e for e in entries if alike(leader, e) and e.curve.gain > _NEARLY * leader.curve.gain]
                chosen.append(min(like, key=self.far_fetched))
        return chosen

    def begins(self, entry: Entry) -> float:
        """What a lag remembers at first: the signal, as it is then."""
        if entry.signal.memory not in ("lagged", "leading"):
            return 0.0
        _, course, response = self.courses[entry.driven].parts[0]
        return float(of(Signal(entry.signal.name), course, response.values).begin[0])

    def beside(self, entry: Entry) -> dict[str, float]:
        """Values of the model's own parameters that go with a correction, if all is linear."""
        problem = self._fitted.problem
        q = problem.position(problem.start | self.courses[entry.driven].values)
        return problem.values(np.clip(q + np.clip(entry.step, -1.0, 1.0), *problem.bounds()))

    def _is_loop(self, signal: Signal, law: str) -> bool:
        """Whether a signal is computed from the law at the same time, other than being that law without more."""
        return signal.name != law and signal.memory in ("", "leading") and self.laws.calls(signal.name, law)

    def _name(self, law: str, signal: Signal) -> str:
        """Of laws that do the same, the one in which the signal stands itself."""
        if signal.name in self.candidates[law]:
            return signal.name
        return next((n for n in self.candidates[law] if self._reads(n, signal.name)), law)

    def _of_signals(
        self,
        course: FreeCourse,
        law: str,
        signals: Mapping[Signal, Sequence[Sides]],
        kind: str,
        record: LinearisedRecord,
    ) -> Iterator[Entry]:
        parts = course.parts
        value = [response.values[law] for _, _, response in parts]
        if kind == "multiply" and max(np.ptp(v.begin) for v in value) <= 1e-9 * max(
            np.abs(v.begin).max() for v in value
        ):
            return
        bases = {s: Basis.over(np.concatenate([one.begin for one in several])) for s, several in signals.items()}
        whole = {o: np.zeros((self._n, sum(len(b.knots) for b in bases.values()))) for o in self._outputs}
        for r, (run, _, response) in enumerate(parts):
            begin = np.hstack([b(signals[s][r].begin) for s, b in bases.items()])
            end = np.hstack([b(signals[s][r].end) for s, b in bases.items()])
            if kind == "multiply":
                begin, end = begin * value[r].begin[:, None], end * value[r].end[:, None]
            for o, rows in response(law, Sides(begin, end)).items():
                whole[o][run.samples] = rows
        alone = record({o: columns[self._present[o]] for o, columns in whole.items()})
        free, own = record.free(alone), record.own(alone)
        first = 0
        for signal, basis in bases.items():
            block, raw, held = (part[:, first : first + len(basis.knots)] for part in (free, alone, own))
            first += len(basis.knots)
            if len(basis.knots) < 2:
                continue
            products = Columns(basis, block.T @ block, block.T @ block + held.T @ held, record.samples)
            self._chance.append(products.by_chance(block.T @ record.noise))
            found = products.best(block.T @ record.residual)
            if found.gain <= 0.0:
                continue
            shown = raw @ found.values
            step = record.beside(shown)
            gain = min(found.gain, record.fall(shown, step) - found.complexity)
            if gain > 0.0:
                effect = block @ found.values
                direction = effect / max(float(np.linalg.norm(effect)), 1e-300)
                visited = np.quantile(np.concatenate([one.begin for one in signals[signal]]), _QUANTILES)
                found = replace(found, gain=gain)
                yield Entry(course.law, law, signal, kind, basis, found, direction, step, visited)
