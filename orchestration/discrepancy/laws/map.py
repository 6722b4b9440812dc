"""The map of what a model's laws lack: every law over every signal, and how much a curve there would explain."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fmus.kit.corrections import MEMORIES, correction, family
from fmus.kit.symbolic.perturbed import PerturbedLaws
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.laws.entry import Entry
from orchestration.discrepancy.laws.evidence import FEW, Basis, Columns
from orchestration.discrepancy.laws.linear.course import FreeCourse, follow
from orchestration.discrepancy.laws.linear.linearised import LinearisedRecord
from orchestration.discrepancy.laws.linear.powers import moved, powers, reach
from orchestration.discrepancy.laws.linear.response import (
    Course,
    LinearResponse,
    Sides,
    responses_of_runs,
)
from orchestration.discrepancy.laws.plausible import Plausible
from orchestration.discrepancy.laws.signals import Signal, is_new, of, plain, remembered
from orchestration.discrepancy.parallel import side_by_side
from orchestration.discrepancy.selection.search import Search
from orchestration.identify.noise.model import Noise, estimate
from orchestration.records.joined import Run

Array = NDArray[np.float64]
# of signals, by kind of correction: a factor that leads is one that lags, and the signal as it is
_MEMORIES = {"add": MEMORIES, "multiply": tuple(m for m in MEMORIES if m != "leading")}
_QUANTILES = np.linspace(0.0, 1.0, 101)
_AT_ONCE = 48  # signals whose columns are in memory together
_STILL = 1e-9  # of its size, within which a law is a constant
_SURE = 0.95  # share of records without anything hidden in which no entry gains more


def _is_constant(values: Array) -> bool:
    return float(np.ptp(values)) <= _STILL * float(np.abs(values).max())


def _basis(signal: Signal, values: Array) -> Basis:
    """Few knots for what is remembered: there are many of these, and they are mostly in proportion."""
    return Basis.over(values, FEW, stepped=False) if signal.memory else Basis.over(values)


def _other_names(parts: Sequence[tuple[Run, Course, LinearResponse]]) -> dict[str, list[str]]:
    """Inputs and states, and laws that only hand them on."""
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
        self._search, self._fitted, problem = search, fitted, fitted.problem
        self._families = set(families)
        # of corrections that the model has already: what they remember, and what they are curves of
        corrections = [
            e for e in fitted.candidate.effects if getattr(e, "made_by", None) is correction
        ]
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
        self._outputs, self._present = list(problem.measured), problem.present
        self._n = len(problem.time)
        parts = responses_of_runs(
            self.laws,
            problem.time,
            problem.inputs,
            ran.signals,
            values,
            search.data.linear or (),
            problem.runs,
            self._outputs,
        )
        self.candidates = self._different_laws(parts)
        self._powers = powers(self.laws, parts[0][1], parts[0][0].values(values), problem.names)
        others = _other_names(parts)
        self._constants = {
            law
            for law in self.laws.names
            if all(_is_constant(r.values[law].begin) for _, _, r in parts)
        }
        self.plausible = Plausible(self.laws, self._constants, others, self._families)
        rates = {state.rate for state in self.laws.graph.layout.states}
        self._rates = rates | {s for s, names in others.items() if rates & {*names}}
        laws = list(self.candidates)
        self.courses = dict(
            zip(
                laws,
                side_by_side(lambda law: follow(search, fitted, self.laws, law), laws),
                strict=True,
            )
        )

    def _different_laws(
        self, parts: Sequence[tuple[Run, Course, LinearResponse]]
    ) -> dict[str, list[str]]:
        """Laws that do different things to the outputs, each with others that do the same."""
        found: dict[str, list[str]] = {}
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
        """What moves in the longest run, and of what is remembered of it what tells something else, by runs.

        Signals that run in proportion in this record are all kept: a law is likelier to hang on one than on another.
        """
        _, longest, response = max(course.parts, key=lambda part: len(part[1].time))
        outputs = {o.name for o in self.laws.graph.layout.outputs}
        # what is computed from one signal alone tells what that one tells
        passed_over = (
            outputs
            | self._memories
            | {law for law in response.values if len(self.laws.computed_from(law)) == 1}
        )
        kept = plain(longest, response.values, passed_over)
        told: list[Array] = []
        different = {signal: sides for signal, sides in kept.items() if is_new(sides, told)}
        memories = remembered(longest, different, self._rates)
        kept |= {signal: sides for signal, sides in memories if is_new(sides, told)}
        return {signal: [of(signal, c, r.values) for _, c, r in course.parts] for signal in kept}

    def entries(self, noise: Mapping[str, Noise] | None = None) -> list[Entry]:
        """Score everything, in one noise."""
        nearest = min(
            self.courses.values(), key=lambda c: sum(np.log(np.sum(e**2)) for e in c.left.values())
        )
        problem = self._fitted.problem
        if noise is None:
            noise = {
                o: estimate(e, problem.present[o], 0, problem.calm[o])
                for o, e in nearest.left.items()
            }
        self.floor = noise
        self._chance: list[Array] = []
        several = side_by_side(lambda law: list(self._of_law(law, noise)), list(self.candidates))
        found = [entry for entries in several for entry in entries]
        self.chance = (
            float(np.quantile(np.max(self._chance, axis=0), _SURE)) if self._chance else 0.0
        )
        return sorted(found, key=lambda e: -e.curve.gain)

    def _of_law(self, law: str, noise: Mapping[str, Noise]) -> Iterator[Entry]:
        course = self.courses[law]
        record = LinearisedRecord(
            course, self._fitted.fit.prior_precision, self._present, noise, reach(self._powers)
        )
        signals = self.signals_of(course)
        for name, kind, mine in self._asked(course, list(signals)):
            for at in range(0, len(mine), _AT_ONCE):
                yield from self._of_signals(
                    course, name, {s: signals[s] for s in mine[at : at + _AT_ONCE]}, kind, record
                )

    def _asked(
        self, course: FreeCourse, signals: Sequence[Signal]
    ) -> Iterator[tuple[str, str, list[Signal]]]:
        """Laws, kinds of corrections, and their signals.

        Of laws that do the same one is enough to be added to; but what is multiplied is each of them.
        """
        laws, told = self.candidates[course.law], list[Array]()
        _, _, response = max(course.parts, key=lambda part: len(part[1].time))
        factors = [
            law for law in laws if law not in self._constants and is_new(response.values[law], told)
        ]
        add = {s: self._name(course.law, s) for s in signals}
        names = [(law, "add", [s for s in signals if add[s] == law]) for law in laws]
        for law, kind, mine in (*names, *((law, "multiply", [*signals]) for law in factors)):
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
        """What is left of an output, in widths of the noise that is left at best, at most."""
        return max(
            float(np.sqrt(np.mean(e**2))) / self.floor[o].deviation for o, e in residual.items()
        )

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
        logarithmic = np.array([scale.logarithmic for scale in problem.scales], dtype=bool)
        return problem.values(
            np.clip(q + moved(entry.step, self._powers, logarithmic), *problem.bounds())
        )

    def _is_loop(self, signal: Signal, law: str) -> bool:
        """Whether a signal is computed from the law at the same time, other than being that law without more."""
        return (
            signal.name != law
            and signal.memory in ("", "leading")
            and self.laws.calls(signal.name, law)
        )

    def _name(self, law: str, signal: Signal) -> str:
        """Of laws that do the same, the one that is known to hang on the signal, or in which it stands itself."""
        if signal.name in self.candidates[law]:
            return signal.name
        same = self.candidates[law]
        known = (n for n in same if family(n, signal.name, signal.memory) in self._families)
        reading = (n for n in same if self.plausible.reads(n, signal.name))
        return next(known, next(reading, law))

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
        bases = {
            s: _basis(s, np.concatenate([one.begin for one in several]))
            for s, several in signals.items()
        }
        whole = {
            o: np.zeros((self._n, sum(len(b.knots) for b in bases.values()))) for o in self._outputs
        }
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
            block, raw, held = (
                part[:, first : first + len(basis.knots)] for part in (free, alone, own)
            )
            first += len(basis.knots)
            if len(basis.knots) < 2:
                continue
            products = Columns(
                basis, block.T @ block, block.T @ block + held.T @ held, record.samples
            )
            self._chance.append(products.by_chance(block.T @ record.noise))
            found = products.best(block.T @ record.residual)
            if found.gain <= 0.0:
                continue
            found, step = record.within_reach(found, raw)
            if found.gain > 0.0:
                effect = block @ found.values
                direction = effect / max(float(np.linalg.norm(effect)), 1e-300)
                visited = np.quantile(
                    np.concatenate([one.begin for one in signals[signal]]), _QUANTILES
                )
                yield Entry(course.law, law, signal, kind, basis, found, direction, step, visited)
