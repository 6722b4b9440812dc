"""The law map: every law of a model over every signal, with the evidence for a curve there."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.corrections import MEMORIES, correction, effect_family
from fmus.kit.effects import made_by
from fmus.kit.symbolic import PerturbedLaws
from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.discrepancy.laws.entry import Entry
from orchestration.discrepancy.laws.evidence import FEW, Basis, Curve, RegressorStack
from orchestration.discrepancy.laws.linear import (
    LinearisedRecord,
    LinearResponse,
    Sides,
    SimulatedCourse,
    UnknownInput,
    affine_powers,
    continuous,
    disturbed,
    estimate_unknown_input,
    moved,
    reach,
    responses_of_runs,
)
from orchestration.discrepancy.laws.plausible import Plausibility
from orchestration.discrepancy.laws.signals import (
    LawSignal,
    current_signals,
    is_new,
    remembered_signals,
    signal_along,
)
from orchestration.discrepancy.parallel import parallel_map
from orchestration.discrepancy.selection import Search
from orchestration.identify.noise import Noise, estimate_noise
from orchestration.records.runs import MeasuredRun

# of signals, by kind of correction: a factor that leads is one that lags, and the signal as it is
_MEMORIES = {"add": MEMORIES, "multiply": tuple(m for m in MEMORIES if m != "leading")}
_QUANTILES = np.linspace(0.0, 1.0, 101)
_AT_ONCE = 48  # signals whose columns are in memory together
_STILL = 1e-9  # of its size, within which a law is a constant
_NOTHING = float(np.finfo(float).tiny)  # sum of squares of what is not there
_SURE = 0.95  # share of records without anything hidden in which no entry gains more


def _is_constant(values: Array) -> bool:
    return float(np.ptp(values)) <= _STILL * float(np.abs(values).max())


def _basis(signal: LawSignal, values: Array) -> Basis:
    """Return a basis over a signal; few knots for the many that are remembered."""
    return Basis.over(values, FEW, stepped=False) if signal.memory else Basis.over(values)


def _other_names(
    parts: Sequence[tuple[MeasuredRun, SimulatedCourse, LinearResponse]],
) -> dict[str, list[str]]:
    """Return inputs and states, each with the laws that only hand it on."""
    _, course, response = parts[0]
    signals = {**course.inputs, **course.states}
    same = {
        s: [n for n, v in response.values.items() if np.array_equal(v.begin, x.begin)]
        for s, x in signals.items()
    }
    return {signal: names for signal, names in same.items() if names}


class LawMap:
    """Scores of all laws over all signals at a fitted model.

    Parameters
    ----------
    search : Search
    fitted : FittedCandidate
    families : collection of str
        Of effects that are known for the model, which of several equals are the likelier ones.
    """

    def __init__(self, search: Search, fitted: FittedCandidate, families: Collection[str] = ()):
        problem = fitted.problem
        self._fitted = fitted
        self._families = set(families)
        # of corrections that the model has already: what they remember, and what they are curves of
        corrections = [e for e in fitted.candidate.effects if made_by(e) is correction]
        self._memories = {
            name
            for e in corrections
            for state in e.layout.states
            for name in (state.name, state.rate)
        }
        self._corrected = {(e.term.law, e.term.qualifier) for e in corrections}
        values = problem.start | problem.values(fitted.fit.q)
        ran = problem.model.run(problem.time, problem.inputs, values, problem.effort, problem.runs)
        self.laws = PerturbedLaws(fitted.candidate.cls)
        self._outputs = list(problem.measured)
        self._present = problem.present
        self._n = len(problem.time)
        parts = responses_of_runs(
            self.laws,
            problem.time,
            problem.inputs,
            ran.signals,
            values,
            linear=search.data.linear or (),
            runs=problem.runs,
            outputs=self._outputs,
        )
        self.candidates = self._different_laws(parts)
        first_run, first_course, _ = parts[0]
        self._powers = affine_powers(
            self.laws, first_course, first_run.values(values), problem.names
        )
        others = _other_names(parts)
        self._constants = {
            law
            for law in self.laws.names
            if all(_is_constant(r.values[law].begin) for _, _, r in parts)
        }
        self.plausible = Plausibility(self.laws, self._constants, others, self._families)
        rates = {state.rate for state in self.laws.graph.layout.states}
        self._rates = rates | {s for s, names in others.items() if rates & {*names}}
        self.courses = self._unknown_inputs(search)

    def _unknown_inputs(self, search: Search) -> dict[str, UnknownInput]:
        """Estimate the unknown input to every law."""
        fitted = self._fitted
        laws = list(self.candidates)
        driven = fitted.candidate.with_effect(disturbed(fitted.candidate.cls, laws))

        def estimate(law: str) -> UnknownInput:
            return estimate_unknown_input(search, fitted, self.laws, law, driven)

        # the first one has the model compiled, for which the others would not wait
        first = [estimate(law) for law in laws[:1]]
        return dict(zip(laws, [*first, *parallel_map(estimate, laws[1:])], strict=True))

    def _different_laws(
        self, parts: Sequence[tuple[MeasuredRun, SimulatedCourse, LinearResponse]]
    ) -> dict[str, list[str]]:
        """Group laws with identical effect on the outputs, by the first of each group."""
        groups: dict[str, list[str]] = {}
        shapes: dict[str, Array] = {}
        for law in self.laws.names:
            if self.laws.is_definition(law) or law in self._memories:
                continue
            whole = np.concatenate([p.ravel() for _, _, r in parts for p in r.effect_of(law)])
            size = np.linalg.norm(whole)
            if not size or not np.isfinite(size):
                continue
            whole /= size
            same = next(
                (n for n, other in shapes.items() if abs(float(other @ whole)) > 1.0 - 1e-12), None
            )
            if same is None:
                shapes[law] = whole
                groups[law] = [law]
            else:
                groups[same].append(law)
        outputs = {o.name for o in self.laws.graph.layout.outputs}
        different = {}
        for several in groups.values():
            names = [name for name in several if name not in outputs] or several
            different[names[0]] = names
        return different

    def signals_of(self, course: UnknownInput) -> dict[LawSignal, list[Sides]]:
        """Return signals that move in the longest run, and remembered ones that differ, by runs.

        Signals that run in proportion in this record are all kept: a law is likelier to depend on
        one than on another.
        """
        _, longest, response = max(course.parts, key=lambda part: len(part[1].time))
        outputs = {o.name for o in self.laws.graph.layout.outputs}
        # a law that is computed from one signal alone is a function of that
        passed_over = (
            outputs
            | self._memories
            | {law for law in response.values if len(self.laws.computed_from(law)) == 1}
        )
        kept = current_signals(longest, response.values, passed_over)
        shapes: list[Array] = []
        different = {signal: sides for signal, sides in kept.items() if is_new(sides, shapes)}
        memories = remembered_signals(longest, different, self._rates)
        kept |= {signal: sides for signal, sides in memories if is_new(sides, shapes)}
        return {
            signal: [signal_along(signal, c, r.values) for _, c, r in course.parts]
            for signal in kept
        }

    def entries(self, noise: Mapping[str, Noise] | None = None) -> list[Entry]:
        """Score every law over every signal in one noise; return entries that gain, best first."""
        floor = self._noise_floor() if noise is None else noise
        self.floor = floor
        self._chance: list[Array] = []
        several = parallel_map(lambda law: self._of_law(law, floor), list(self.candidates))
        scored = [entry for entries in several for entry in entries]
        self.chance = 0.0
        if self._chance:
            self.chance = float(np.quantile(np.max(self._chance, axis=0), _SURE))
        return sorted(scored, key=lambda e: -e.curve.gain)

    def _noise_floor(self) -> Mapping[str, Noise]:
        """Estimate the noise from the least residual that any unknown input leaves."""
        if not self.courses:  # no law changes what was measured
            return self._fitted.fit.noise

        def size(course: UnknownInput) -> float:
            # of a record without noise nothing may be left
            squares = [float(np.sum(e**2)) for e in course.unexplained.values()]
            return sum(math.log(max(square, _NOTHING)) for square in squares)

        nearest = min(self.courses.values(), key=size)
        problem = self._fitted.problem
        return {
            o: estimate_noise(e, problem.present[o], 0, problem.noise_samples[o])
            for o, e in nearest.unexplained.items()
        }

    def _of_law(self, law: str, noise: Mapping[str, Noise]) -> list[Entry]:
        """Score a law, and others with the same effect, over every signal."""
        course = self.courses[law]
        record = LinearisedRecord(
            course, self._fitted.fit.prior_precision, self._present, noise, reach(self._powers)
        )
        signals = self.signals_of(course)
        corrections = list(self._corrections_to_score(course, list(signals)))
        entries: list[list[Entry]] = [[] for _ in corrections]
        names = list(signals)
        for at in range(0, len(names), _AT_ONCE):
            # what a signal is in the coordinates of its curve is the same for all laws
            some = {
                name: _SignalBasis.over(name, signals[name]) for name in names[at : at + _AT_ONCE]
            }
            for (name, kind, known), found in zip(corrections, entries, strict=True):
                mine = [some[signal] for signal in known if signal in some]
                found += self._of_signals(course, name, mine, kind, record)
        return [entry for found in entries for entry in found]

    def _corrections_to_score(
        self, course: UnknownInput, signals: Sequence[LawSignal]
    ) -> Iterator[tuple[str, str, list[LawSignal]]]:
        """Yield laws, kinds of corrections, and their signals.

        Of laws with identical effect on the outputs a correction is added to only one, but
        multiplies each of them.
        """
        laws = self.candidates[course.law]
        shapes: list[Array] = []
        _, _, response = max(course.parts, key=lambda part: len(part[1].time))
        factors = [
            law
            for law in laws
            if law not in self._constants and is_new(response.values[law], shapes)
        ]
        law_of = {s: self._law_for(course.law, s) for s in signals}
        added = [(law, "add", [s for s in signals if law_of[s] == law]) for law in laws]
        multiplied = [(law, "multiply", [*signals]) for law in factors]
        for law, kind, mine in (*added, *multiplied):
            known = [
                s
                for s in mine
                if s.memory in _MEMORIES[kind]
                and not self._is_loop(s, law)
                and (law, s.name) not in self._corrected
            ]
            if known:
                yield law, kind, known

    def widths(self, residual: Mapping[str, Array]) -> float:
        """Return the largest residual of any output, in widths of the least noise."""
        return max(
            float(np.sqrt(np.mean(e**2))) / self.floor[o].deviation for o, e in residual.items()
        )

    def squares(self, residual: Mapping[str, Array]) -> float:
        """Return the sum of squares of residuals, in units of the least noise."""
        return sum(float(np.sum((e / self.floor[o].deviation) ** 2)) for o, e in residual.items())

    def begins(self, entry: Entry) -> float:
        """Return the start value of a lag: the signal at the start."""
        if entry.signal.memory not in ("lagged", "leading"):
            return 0.0
        _, course, response = self.courses[entry.driven].parts[0]
        return float(signal_along(LawSignal(entry.signal.name), course, response.values).begin[0])

    def beside(self, entry: Entry) -> dict[str, float]:
        """Return values of the model's own parameters beside a correction, to first order."""
        problem = self._fitted.problem
        q = problem.position(problem.start | self.courses[entry.driven].values)
        logarithmic = np.array([scale.logarithmic for scale in problem.scales], dtype=bool)
        shifted = q + moved(entry.step, self._powers, logarithmic)
        return problem.values(np.clip(shifted, *problem.bounds()))

    def _is_loop(self, signal: LawSignal, law: str) -> bool:
        """Return whether a signal is computed from the law at the same time, and is another."""
        return (
            signal.name != law
            and signal.memory in ("", "leading")
            and self.laws.calls(signal.name, law)
        )

    def _law_for(self, law: str, signal: LawSignal) -> str:
        """Return the law, of those with the same effect, that is nearest to a signal."""
        if signal.name in self.candidates[law]:
            return signal.name
        same = self.candidates[law]
        known = (n for n in same if effect_family(n, signal.name, signal.memory) in self._families)
        reading = (n for n in same if self.plausible.reads(n, signal.name))
        return next(known, next(reading, law))

    def _of_signals(
        self,
        course: UnknownInput,
        law: str,
        signals: Sequence[_SignalBasis],
        kind: str,
        record: LinearisedRecord,
    ) -> list[Entry]:
        """Score corrections of one law over several signals.

        Parameters
        ----------
        course : UnknownInput
        law : str
        signals : sequence of _SignalBasis
        kind : {"add", "multiply"}
        record : LinearisedRecord
        """
        curved = [signal for signal in signals if len(signal.basis.knots) > 1]
        if not curved:
            return []
        responses = self._responses(course, law, curved, kind)
        whitened = record({o: columns[self._present[o]] for o, columns in responses.items()})
        entries = {
            signal.signal: Entry(
                driven=course.law,
                law=law,
                signal=signal.signal,
                kind=kind,
                basis=signal.basis,
                curve=curve,
                direction=direction,
                step=step,
                left=record.left(curve),
                visited=signal.visited,
            )
            for stack in _stacks(curved, whitened)
            for signal, curve, direction, step in self._scored(record, stack)
        }
        return [entries[one.signal] for one in curved if one.signal in entries]

    def _responses(
        self, course: UnknownInput, law: str, signals: Sequence[_SignalBasis], kind: str
    ) -> dict[str, Array]:
        """Return the responses (n, k) of every output to the curves of all bases."""
        count = sum(len(signal.basis.knots) for signal in signals)
        whole = {output: np.zeros((self._n, count)) for output in self._outputs}
        for r, (run, _, response) in enumerate(course.parts):
            begin = np.hstack([signal.columns[r].begin for signal in signals])
            end = np.hstack([signal.columns[r].end for signal in signals])
            if kind == "multiply":
                value = response.values[law]
                begin *= value.begin[:, None]
                end *= value.end[:, None]
            for output, rows in response(law, Sides(begin, end)).items():
                whole[output][run.samples] = rows
        return whole

    def _scored(
        self, record: LinearisedRecord, stack: _Stack
    ) -> Iterator[tuple[_SignalBasis, Curve, Array, Array]]:
        """Yield the signals over which a correction gains, with its curve, direction and step."""
        signals = [signal for signal, _ in stack]
        rows = np.concatenate([responses for _, responses in stack])
        shape = (len(stack), signals[0].size[0], -1)
        free = np.ascontiguousarray(record.free(rows.T).T)
        effects = free.reshape(shape)
        own = record.own(rows.T).T.reshape(shape)
        products = effects @ effects.swapaxes(1, 2)
        regressors = RegressorStack(
            [signal.basis for signal in signals],
            products,
            products + own @ own.swapaxes(1, 2),
            record.samples,
        )
        self._chance += [*regressors.by_chance((free @ record.noise).reshape(shape))]
        likeliest = regressors.best((free @ record.residual).reshape(shape[:2]))
        telling = [i for i, curve in enumerate(likeliest) if curve.gain > 0.0]
        bounded = record.within_reach([likeliest[i] for i in telling], rows.reshape(shape)[telling])
        for i, (curve, step) in zip(telling, bounded, strict=True):
            if curve.gain > 0.0:
                effect = curve.values @ effects[i]
                yield signals[i], curve, effect / max(float(np.linalg.norm(effect)), 1e-300), step


@dataclass(frozen=True)
class _SignalBasis:
    """A signal with the knots of a curve over it.

    Attributes
    ----------
    signal : LawSignal
    basis : Basis
        Of k knots.
    columns : list of Sides, of shape (n, k)
        Hat functions of the knots along each run.
    visited : ndarray, shape (v,)
        Quantiles of the signal.
    """

    signal: LawSignal
    basis: Basis
    columns: list[Sides]
    visited: Array

    @classmethod
    def over(cls, signal: LawSignal, runs: Sequence[Sides]) -> _SignalBasis:
        """Place knots over a signal that is given by runs."""
        values = np.concatenate([sides.begin for sides in runs])
        basis = _basis(signal, values)
        columns = [_columns(basis, sides) for sides in runs]
        return cls(signal, basis, columns, np.quantile(values, _QUANTILES))

    @property
    def size(self) -> tuple[int, int]:
        """Numbers of knots and of straight curves; curves of one size are scored in a stack."""
        return len(self.basis.knots), len(self.basis.plain)


# signals over which curves have one size, with the whitened responses (k, m) to their knots
_Stack = list[tuple[_SignalBasis, Array]]


def _stacks(signals: Sequence[_SignalBasis], responses: Array) -> Iterable[_Stack]:
    """Return signals by the size of their curves, with the responses (m, knots) to all of them."""
    ends = np.cumsum([signal.size[0] for signal in signals])
    stacks: dict[tuple[int, int], _Stack] = {}
    of_signals = np.split(np.ascontiguousarray(responses.T), ends[:-1])
    for signal, rows in zip(signals, of_signals, strict=True):
        stacks.setdefault(signal.size, []).append((signal, rows))
    return stacks.values()


def _columns(basis: Basis, sides: Sides) -> Sides:
    """Return the hat functions of knots along a signal."""
    begin = basis(sides.begin)
    if np.array_equal(sides.end[:-1], sides.begin[1:]):  # the last end is not used
        return continuous(begin)
    return Sides(begin, begin if np.array_equal(sides.end, sides.begin) else basis(sides.end))
