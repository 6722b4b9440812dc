"""Which law of a model lacks what: the map, its best entries as curves, and what they look like."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fmus.kit import Component
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.holdout import ValidationData, is_at_rest
from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.laws.band import Band
from orchestration.discrepancy.laws.base import search_of
from orchestration.discrepancy.laws.entry import Entry, alike
from orchestration.discrepancy.laws.fitting import RELAXATIONS, FittedEntry, Fitting
from orchestration.discrepancy.laws.map import LawMap
from orchestration.discrepancy.parallel import side_by_side
from orchestration.discrepancy.selection.search import FAILURES
from orchestration.discrepancy.validation.confirmation import Confirmation, Outcome, score
from orchestration.discrepancy.validation.prediction import predict
from orchestration.fmu.effects import catalogue, families

Array = NDArray[np.float64]
_TOLD, _MAPPED = 6, 3  # curves that are fitted to the end: by their first fits, and by the map
_PLAIN, _MUCH = (
    40,
    1.5,
)  # more signals as they are, likely or not where so many widths of noise are left
_NEAR = 0.5  # of the fall of the best, which a correction that is told must have
_AS_GOOD = 6.0  # of the criterion, below which one correction is as good as another
# of what the best gains, likewise: no curve, and no lag, is quite the plant's; to first order, and fitted
_ABOUT, _FITTED = 0.02, 0.03
_SIMPLE = 0.01  # of what a curve gains, by which a shape may be behind it: that much, it bends after the rest
_OTHERWISE = (
    0.1  # the same of a law of one signal, to which something is added or which is multiplied
)


@dataclass(frozen=True)
class Correction:
    """A law that hangs on a signal in another way than the model says.

    Attributes
    ----------
    fitted : FittedEntry
        An entry of the map, with all parameters of the model.
    gain : float
        Fall of the criterion of Bayes against the model without it, less what looking at so many costs.
    shape : str
        What it looks like; empty where no simple shape is as good as the curve.
    shapes : tuple of tuple of str and float
        Shapes that were fitted in the model, the nearest first, and by how much their criterion is above the curve's.
    alike : tuple of Entry
        Other entries that the record cannot tell it from, those nearest to the model first.
    model : FittedCandidate
        With the shape, or with the curve as a table.
    confirmation : Confirmation or None
        What data that no fit has seen say of it.
    errors : tuple of dict of str to float
        Normalised RMS errors on those, without and with it.
    """

    fitted: FittedEntry
    gain: float
    shape: str
    model: FittedCandidate
    shapes: tuple[tuple[str, float], ...] = ()
    alike: tuple[Entry, ...] = ()
    confirmation: Confirmation | None = None
    errors: tuple[dict[str, float], dict[str, float]] = ({}, {})

    @property
    def entry(self) -> Entry:
        """Of the map."""
        return self.fitted.entry

    @property
    def relaxation(self) -> bool:
        """Whether a law follows a signal behind a lag, in proportion."""
        return self.shape == "linear" and self.entry.signal.memory in RELAXATIONS

    @property
    def confirmed(self) -> bool:
        """Whether unseen data are surely likelier with it, and simulated no worse on the whole.

        A simulation may be worse and likelier at once, where noise is taken to wander and the correction does too.
        """
        sure = self.confirmation is not None and self.confirmation.outcome is Outcome.CONFIRMED
        before, after = (
            float(np.mean(np.square(list(e.values())))) if e else 0.0 for e in self.errors
        )
        return sure and after <= before

    @property
    def band(self) -> tuple[Array, Array, Array]:
        """Curve at its knots, and the ends of its 95 % band, in the unit of the law."""
        return self.band_at(self.entry.basis.knots)

    def band_at(self, x: Array) -> tuple[Array, Array, Array]:
        """Curve, and the ends of its 95 % band, at values (v,) of the signal, in the unit of the law."""
        return self._band(x)

    @cached_property
    def _band(self) -> Band:
        return Band(self.entry.basis, self.fitted.curve)


@dataclass(frozen=True)
class LawMapResult:
    """What was found of a model's laws.

    Attributes
    ----------
    base : FittedCandidate
        The model that it was looked for in.
    entries : list of Entry
        Every law over every signal that would explain anything, to first order, the most telling first.
    chance : float
        What the best of all gains where nothing is hidden, in 19 records of 20.
    corrections : list of Correction
        The best, as curves fitted in the model, the best first.
    """

    base: FittedCandidate
    entries: list[Entry]
    chance: float
    corrections: list[Correction]


def discover(
    diagnosis: Diagnosis,
    progress: Callable[[str], None] = lambda text: None,
    again: Entry | None = None,
) -> LawMapResult:
    """Ask every law of a diagnosed model, with the causes that were named, what it lacks.

    Parameters
    ----------
    diagnosis : Diagnosis
    progress : callable
        Told what is being done.
    again : Entry, optional
        A law over a signal and its memory; nothing else is asked then.
    """
    base = diagnosis.selection.best
    search = search_of(diagnosis, progress)
    progress("asking every law what it lacks")
    found = LawMap(search, base, _families(base.candidate.cls))
    entries = [e for e in found.entries() if again is None or e.what == again.what]
    telling = [e for e in entries if e.curve.gain > found.chance]
    chosen = found.plausible.worth_a_fit(telling) if again is None else telling
    progress(f"fitting {len(chosen)} corrections of laws")
    fitting, below = (
        Fitting(search, base, found),
        base.fit.bic - 2.0 * float(np.log(max(len(entries), 1))),
    )
    fitted = _fitted(fitting, chosen, below)
    best = next(iter(fitted), None)
    far = found.widths(best.residual if best else base.fit.residual) > _MUCH
    near = [e for e in telling if far or (best and not found.plausible.far_fetched(e)[0])]
    more = _second_look(best, near, chosen, telling)
    if more:
        progress(f"fitting {len(more)} more")
        chosen = [*chosen, *more]
        fitted = _telling([*fitted, *_fitted(fitting, more, below)], below)
    as_good = _as_good(found, fitted, below)
    good = [one.entry for one in as_good]
    worse = [entry for entry in chosen if entry.what not in {other.what for other in good}]
    corrections: list[Correction] = []
    for one in [*as_good, *fitted[len(as_good) :]]:
        curved = one if corrections else fitting.bent(one)
        shapes = [] if corrections else fitting.shapes(curved)
        shape, model = _nearest(shapes, curved, below) or ("", fitting.tabulated(curved))
        if model is None or any(one.entry.what == other.entry.what for other in corrections):
            continue
        gain = below - (model.fit.bic if shape else curved.criterion)
        above = tuple((name, shaped.fit.bic - curved.criterion) for name, shaped in shapes)
        of = () if corrections else _not_told_apart(found, one.entry, good, worse, entries)
        correction = Correction(curved, gain, shape, model, above, of)
        if not corrections:
            correction = _judged(correction, base, diagnosis.validation)
        corrections.append(correction)
    return LawMapResult(base, entries, found.chance, corrections)


def _families(cls: type[Component]) -> set[str]:
    known = (*catalogue(cls).values(), *families(cls).values())
    return {effect.term.family for effect in known if effect.term.family}


def _fitted(fitting: Fitting, chosen: Sequence[Entry], below: float) -> list[FittedEntry]:
    """Entries that make a record likelier than it is below, the best first; only curves that come near are settled."""
    first = sorted(filter(None, side_by_side(fitting.first, chosen)), key=lambda one: one.criterion)
    curves = [one for one in first if one.table is not None]
    # a fit from afar may need more than its first steps, and the map knows
    mapped = sorted(curves[_TOLD:], key=lambda one: -one.entry.curve.gain)[:_MAPPED]
    ended = [
        *(one for one in first if one.table is None),
        *side_by_side(fitting.settled, [*curves[:_TOLD], *mapped]),
    ]
    return _telling(ended, below)


def _telling(fitted: Sequence[FittedEntry], below: float) -> list[FittedEntry]:
    """Those that come near the best, the best first."""
    ordered = sorted(fitted, key=lambda one: one.criterion)
    return [
        one
        for one in ordered
        if below - one.criterion > max(_NEAR * (below - ordered[0].criterion), 0.0)
    ]


def _second_look(
    best: FittedEntry | None, near: Sequence[Entry], done: Sequence[Entry], entries: Sequence[Entry]
) -> list[Entry]:
    """What does the same as the best to first order, signals as they are before what remembers; and those near the law.

    The first order tells little of what a fit gains: far from a record, all signals as they are are near enough.
    """
    tried = {e.what for e in done}

    def first(several: Sequence[Entry]) -> list[Entry]:
        rest: dict[tuple[str, ...], Entry] = {}
        for entry in several:
            if entry.what not in tried:
                rest.setdefault(entry.what, entry)
        return sorted(rest.values(), key=lambda e: e.signal.memory != "")

    like = [e for e in first(entries) if best and alike(e, best.entry)][:_TOLD]
    plain = [e for e in first(near) if not e.signal.memory][:_PLAIN]
    return list({e.what: e for e in (*like, *plain)}.values())


def _as_good(found: LawMap, fitted: Sequence[FittedEntry], below: float) -> list[FittedEntry]:
    """Those about as good as the best of several, what is nearest to the model first."""
    if not fitted:
        return []
    best, most = fitted[0], below - fitted[0].criterion

    def behind(one: FittedEntry) -> float:
        # what is added to a law of one signal and what multiplies it are one function, on other knots
        same = one.entry.what[:3] == best.entry.what[:3] and found.plausible.hangs_on_one_signal(
            one.entry.law
        )
        return max(_AS_GOOD, (_OTHERWISE if same else _FITTED) * most)

    return sorted(
        (one for one in fitted if one.criterion <= best.criterion + behind(one)),
        key=lambda one: found.plausible.far_fetched(one.entry),
    )


def _within(gain: float) -> float:
    """By how much a gain may be less than the best, and as good."""
    return max(_AS_GOOD, _ABOUT * gain)


def _not_told_apart(
    found: LawMap,
    entry: Entry,
    as_good: Sequence[Entry],
    others: Sequence[Entry],
    entries: Sequence[Entry],
) -> tuple[Entry, ...]:
    """Entries fitted about as well, and those that do the same to the outputs to first order, one for each signal.

    What couples things that the model keeps apart is not among them, unless the entry does too, nor what does rather
    the same as another that was fitted and is worse.
    """
    least, far = entry.curve.gain - _within(entry.curve.gain), found.plausible.far_fetched(entry)[0]
    same = [
        e
        for e in entries
        if alike(e, entry)
        and e.curve.gain >= least
        and found.plausible.far_fetched(e)[0] <= far
        and not any(_nearer(e, other, entry) for other in others)
    ]
    several = {e.what[:3]: e for e in (*same[::-1], *as_good[::-1])}
    several.pop(entry.what[:3], None)
    return tuple(list(several.values())[::-1])


def _nearer(entry: Entry, one: Entry, other: Entry) -> bool:
    """Whether an entry does rather what one does than what another does."""
    return abs(float(entry.direction @ one.direction)) > abs(
        float(entry.direction @ other.direction)
    )


def _nearest(
    shapes: Sequence[tuple[str, FittedCandidate]], one: FittedEntry, below: float
) -> tuple[str, FittedCandidate] | None:
    """The best shape, if it is about as good as the curve."""
    behind = max(_AS_GOOD, _SIMPLE * (below - one.criterion))
    return shapes[0] if shapes and shapes[0][1].fit.bic <= one.criterion + behind else None


def _judged(one: Correction, base: FittedCandidate, validation: ValidationData) -> Correction:
    """Hold a correction against unseen data."""
    try:
        before, after = predict(validation, base), predict(validation, one.model)
        found = Confirmation(
            score(validation, before, after), is_at_rest(validation.data, validation.judged)
        )
    except FAILURES:
        return one
    return replace(one, confirmation=found, errors=(before.errors, after.errors))
