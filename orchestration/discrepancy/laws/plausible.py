"""Prior ranking of corrections by the model alone, and the choice of those worth a fit."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cache
from itertools import chain, zip_longest

import numpy as np

from fmus.kit.symbolic import PerturbedLaws
from orchestration.discrepancy.laws.entry import IDENTICAL, INDISTINGUISHABLE, Entry, identical

_MEMORY = ("", "leading", "lagged", "integrated", "throughput", "heat")  # the plainest first
# entries that are fitted: of signals that the law depends on, as they are and remembered, and
# others
_EXPECTED = 8
_REMEMBERING = 8
_OTHERS = 24
# of the gain of the best of its like, which a correction that is nearer to the model must have
_NEARLY = 0.95


class Plausibility:
    """Prior plausibility of corrections: how near they are to a model.

    Parameters
    ----------
    laws : PerturbedLaws
    constants : collection of str
        Laws that are constants in the model.
    other_names : Mapping of str to sequence of str
        Of inputs and states: laws that only hand them on.
    families : collection of str
        Of effects that are known for the model, which of several equals are the likelier ones.
    """

    def __init__(
        self,
        laws: PerturbedLaws,
        constants: Collection[str],
        other_names: Mapping[str, Sequence[str]],
        families: Collection[str],
    ):
        self._laws = laws
        self._constants = constants
        self._other_names = other_names
        self._families = families
        self._beside = cache(laws.acts_beside)
        self._computed_from = cache(laws.computed_from)

    def is_expected(self, entry: Entry) -> bool:
        """Return whether the law depends on the signal already, or is known to.

        The shape of such a law is the likeliest to be wrong. A constant of the model depends on
        nothing, and may depend on all that it acts beside.
        """
        if entry.kind == "add" and entry.family in self._families:
            return True
        if entry.law in self._constants:
            return self._is_near(entry)
        # a law of one signal that is multiplied is one that is added to
        several = entry.kind == "add" or not self.depends_on_one_signal(entry.law)
        return several and self.reads(entry.law, entry.signal.name)

    def depends_on_one_signal(self, law: str) -> bool:
        """Return whether a law is computed from one input or state, or from none."""
        return len(self._computed_from(law)) <= 1

    def prior_rank(self, entry: Entry) -> tuple[bool, bool, bool, bool, int, int]:
        """Return a key that sorts corrections by their distance from the model, nearest first.

        A signal is near where it stands in what the law acts on; to couple parts of the model that
        are separate is a claim.
        """
        # what is added over time is what nothing else is known of; a coefficient is likelier to
        # drift than to remember
        drifts = entry.signal.name == "time" and entry.kind == "add"
        remembers = len(_MEMORY) if drifts else _MEMORY.index(entry.signal.memory)
        natural = self.is_expected(entry)
        known = entry.family in self._families
        odd = (entry.kind != "add") + (entry.signal.name == entry.law)
        return not self._is_near(entry), remembers > 0, not known, not natural, odd, remembers

    def _is_near(self, entry: Entry) -> bool:
        return self._computed_from(entry.signal.name) <= {*self._beside(entry.law), "time"}

    def reads(self, law: str, signal: str) -> bool:
        """Return whether a signal, under any of its names, stands in a law itself."""
        names = {signal, *self._other_names.get(signal, ())}
        return law in names or any(self._laws.reads_itself(law, name) for name in names)

    def worth_a_fit(self, entries: Sequence[Entry]) -> list[Entry]:
        """Return the entries that are fitted: expected ones, and the best others that differ.

        Parameters
        ----------
        entries : sequence of Entry
            The most telling first. Of what is remembered in one way with several constants one is
            taken.
        """
        natural: dict[tuple[str, str, str, str], Entry] = {}
        for e in sorted(entries, key=lambda e: e.family not in self._families):
            if self.is_expected(e):
                natural.setdefault(e.key, e)
        plain = [e for e in natural.values() if not e.signal.memory][:_EXPECTED]
        memory = [e for e in natural.values() if e.signal.memory][:_REMEMBERING]
        chosen = {e.key: e for e in (*plain, *memory)}
        most = len(chosen) + _OTHERS
        # gains along different courses do not compare, so that they take turns
        courses = dict.fromkeys(e.driven for e in entries)
        turns = [self._leaders([e for e in entries if e.driven == course]) for course in courses]
        for several in zip_longest(*turns, fillvalue=()):
            if len(chosen) >= most:  # to look further takes long where there are thousands
                break
            for e in chain(*several):
                if len(chosen) < most and not any(identical(e, c) for c in chosen.values()):
                    chosen.setdefault(e.key, e)
        return list(chosen.values())

    def _leaders(self, mine: Sequence[Entry]) -> Iterator[tuple[Entry, ...]]:
        """Yield of each group of like entries along an unknown input those nearest to the model."""
        directions = np.array([entry.direction for entry in mine])
        led = np.zeros(len(mine), dtype=bool)
        for k, entry in enumerate(mine):
            if led[k]:
                continue
            overlap = np.abs(directions @ entry.direction)
            led |= overlap >= INDISTINGUISHABLE
            one = [mine[i] for i in np.flatnonzero(overlap >= IDENTICAL).tolist()]
            like = [mine[i] for i in np.flatnonzero(overlap >= INDISTINGUISHABLE).tolist()]
            best = [e for e in like if e.curve.gain > _NEARLY * entry.curve.gain]
            yield min(one, key=self.prior_rank), min(best, key=self.prior_rank)
