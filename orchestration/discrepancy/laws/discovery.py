"""Discovery of corrections: the law map, its best entries fitted as curves, and their shapes."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fmus.kit.arrays import Array
from orchestration.discrepancy.budget import Budget
from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.discrepancy.conclude import Diagnosis
from orchestration.discrepancy.data import ValidationData, is_at_rest
from orchestration.discrepancy.laws.base import effects_of, search_of
from orchestration.discrepancy.laws.entry import Entry, indistinguishable
from orchestration.discrepancy.laws.evidence import Band
from orchestration.discrepancy.laws.fitting import RELAXATIONS, FittedEntry, Fitting
from orchestration.discrepancy.laws.map import LawMap
from orchestration.discrepancy.parallel import parallel_map
from orchestration.discrepancy.selection import FAILURES
from orchestration.discrepancy.validation import Confirmation, Outcome, compare, predict

_JUDGED = 3  # corrections that unseen data judge, the best first, until they confirm one
_BEST = 6  # more entries with the effect of the best that are fitted
_PLAIN = 40  # more signals as they are that are fitted, unlikely ones too
_AT_ONCE = 6  # entries that are fitted before it is asked whether others can come as near
# times the squares that the best fit leaves, which an entry may leave to first order
_WITHIN_REACH = 1.2
_ENDED = 2  # of those that are fitted to the end, by their first fits
_FAR = 1.5  # widths of noise in the residual, above which they are
_NEAR = 0.5  # of the fall of the best, which a correction must have
_AS_GOOD = 6.0  # of the criterion, below which one correction is as good as another
# of the gain of the best, likewise: no curve, and no lag, is quite the plant's; to first order, and
# fitted
_ABOUT = 0.02
_FITTED = 0.03
# of the gain of a curve, by which a shape may be behind it: that much, it bends after the rest
_SIMPLE = 0.01
# the same of a law of one signal, to which something is added or which is multiplied
_OTHERWISE = 0.1


@dataclass(frozen=True)
class Correction:
    """A law that depends on a signal in another way than in the model.

    Attributes
    ----------
    fitted : FittedEntry
        An entry of the map, with all parameters of the model.
    gain : float
        Fall of the criterion of Bayes against the model without it, less what looking at so many
        costs.
    shape : str
        Name of the shape; empty where no simple one is as good as the curve.
    shapes : tuple of tuple of str and float
        Shapes that were fitted in the model, the nearest first, and by how much their criterion is
        above the curve's.
    alike : tuple of Entry
        Other entries that the record cannot tell it from, those nearest to the model first.
    model : FittedCandidate
        With the shape, or with the curve as a table.
    confirmation : Confirmation or None
        By data that no fit has seen.
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
        """Entry of the map."""
        return self.fitted.entry

    @property
    def relaxation(self) -> bool:
        """True if the law depends on a lagged signal in proportion."""
        return self.shape == "linear" and self.entry.signal.memory in RELAXATIONS

    @property
    def confirmed(self) -> bool:
        """True if unseen data confirm it, and are simulated no worse on the whole.

        A simulation may be worse and likelier at once, where noise is taken to wander and the
        correction does too.
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
        """Return the curve, and the ends of its 95 % band, at values (v,) of the signal."""
        return self._band(x)

    @cached_property
    def _band(self) -> Band:
        return Band(self.entry.basis, self.fitted.curve)


@dataclass(frozen=True)
class LawMapResult:
    """The law map of a model, and corrections that were fitted.

    Attributes
    ----------
    base : FittedCandidate
        The model whose laws were scored.
    entries : list of Entry
        Every law over every signal that would explain anything, to first order, the most telling
        first.
    chance : float
        Gain that the best of all stays below in 19 of 20 records without anything hidden.
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
    only: Entry | None = None,
    budget: Budget | None = None,
) -> LawMapResult:
    """Find corrections of every law of a diagnosed model, with the causes that were named.

    Parameters
    ----------
    diagnosis : Diagnosis
    progress : callable
        Told what is being done.
    only : Entry, optional
        A law over a signal and its memory; nothing else is tried then.
    budget : Budget, optional
        Time that it may take; without limit unless given. The map is drawn in any case.
    """
    base = diagnosis.selection.best
    search = search_of(diagnosis, progress, budget)
    progress("asking every law what it lacks")
    families = {effect.term.family for effect in effects_of(diagnosis)} - {""}
    law_map = LawMap(search, base, families)
    entries = [e for e in law_map.entries() if only is None or e.key == only.key]
    fitting = Fitting(search, base, law_map)
    fits = _fit_map(fitting, law_map, entries, base, only is not None, progress)
    return LawMapResult(base, entries, law_map.chance, _corrections(fitting, fits, diagnosis))


@dataclass(frozen=True)
class _MapFits:
    """Entries of a law map that were fitted in the model.

    Attributes
    ----------
    law_map : LawMap
    entries : sequence of Entry
        All of the map.
    tried : sequence of Entry
        All that were fitted, or leave too much to first order to be.
    fitted : sequence of FittedEntry
        Those that come near the best, the best first.
    below : float
        Criterion of the model without them, less the price of looking at so many.
    """

    law_map: LawMap
    entries: Sequence[Entry]
    tried: Sequence[Entry]
    fitted: Sequence[FittedEntry]
    below: float


def _fit_map(
    fitting: Fitting,
    law_map: LawMap,
    entries: Sequence[Entry],
    base: FittedCandidate,
    all_telling: bool,
    progress: Callable[[str], None],
) -> _MapFits:
    """Fit the plausible entries of a map, or all that tell anything, and more like the best."""
    telling = [e for e in entries if e.curve.gain > law_map.chance]
    chosen = telling if all_telling else law_map.plausible.worth_a_fit(telling)
    progress(f"fitting {len(chosen)} corrections of laws")
    below = base.fit.bic - 2.0 * float(np.log(max(len(entries), 1)))
    several = _fitted(fitting, law_map, chosen, [])
    fitted = _telling(several, below)
    more = _second_look(law_map, base, fitted, chosen, telling)
    if more:
        progress(f"fitting {len(more)} more")
        fitted = _telling(_fitted(fitting, law_map, more, several), below)
    return _MapFits(law_map, entries, [*chosen, *more], fitted, below)


def _corrections(fitting: Fitting, fits: _MapFits, diagnosis: Diagnosis) -> list[Correction]:
    """Return the best correction, judged on unseen data, and the others as curves."""
    as_good = _as_good(fits.law_map, fits.fitted, fits.below)
    in_turn = _one_of_each([*as_good, *fits.fitted[len(as_good) :]])

    def in_full(one: FittedEntry) -> Correction | None:
        correction = _shaped(fitting, one, fits.below)
        if correction is None:
            return None
        others = _indistinguishable(fits, one.entry, as_good)
        alike = replace(correction, alike=others)
        return _judged(alike, diagnosis.selection.best, diagnosis.validation)

    first = _first_confirmed(in_full, in_turn[:_JUDGED])
    if first is None:
        return []
    others = [one for one in in_turn if one.entry.key != first.entry.key]
    return [first, *(c for one in others for c in _as_curve(fitting, one, fits.below))]


def _one_of_each(fitted: Sequence[FittedEntry]) -> list[FittedEntry]:
    """Return the first fit of every law over a signal and its memory."""
    first: dict[tuple[str, str, str, str], FittedEntry] = {}
    for one in fitted:
        first.setdefault(one.entry.key, one)
    return list(first.values())


def _first_confirmed(
    in_full: Callable[[FittedEntry], Correction | None], fitted: Sequence[FittedEntry]
) -> Correction | None:
    """Return the first of some corrections that unseen data confirm, or else the first of all."""
    first = None
    for one in fitted:
        correction = in_full(one)
        if correction and correction.confirmed:
            return correction
        first = first or correction
    return first


def _shaped(fitting: Fitting, one: FittedEntry, below: float) -> Correction | None:
    """Return an entry as a correction with the shape that it may have.

    Parameters
    ----------
    fitting : Fitting
    one : FittedEntry
    below : float
        Criterion of the model without it, less the price of looking at so many.

    Returns
    -------
    Correction or None
        With its curve where no simple shape does as well; None where that cannot be fitted.
    """
    curved = fitting.bent(one)
    shapes = fitting.shapes(curved)
    above = tuple((name, shaped.fit.bic - curved.criterion) for name, shaped in shapes)
    nearest = _nearest(shapes, curved, below)
    if nearest:
        shape, model = nearest
        return Correction(curved, below - model.fit.bic, shape, model, above)
    return next((replace(c, shapes=above) for c in _as_curve(fitting, curved, below)), None)


def _as_curve(fitting: Fitting, one: FittedEntry, below: float) -> list[Correction]:
    """Return an entry as a correction with its curve; none where that cannot be fitted."""
    model = fitting.curve_amount(one)
    return [Correction(one, below - one.criterion, "", model)] if model else []


def _fitted(
    fitting: Fitting, law_map: LawMap, chosen: Sequence[Entry], known: Sequence[FittedEntry]
) -> list[FittedEntry]:
    """Return fits that are known, and more of those that may come as near, fitted to the end.

    What is left to first order along the course that an unknown input has is less than a fit leaves
    where that does not run as near, so that the entries that leave least are fitted first, and
    those that leave far more than the best fit does not at all.

    Parameters
    ----------
    fitting : Fitting
    law_map : LawMap
    chosen : sequence of Entry
        That may be fitted.
    known : sequence of FittedEntry
        Fitted before.
    """
    remaining = sorted(chosen, key=lambda entry: entry.left)
    ended = list(known)
    while remaining and not fitting.out_of_time():
        least = min((law_map.squares(one.residual) for one in ended), default=np.inf)
        wave = [e for e in remaining[:_AT_ONCE] if e.left <= _WITHIN_REACH * least]
        remaining = remaining[_AT_ONCE:] if wave else []
        first = sorted(
            filter(None, parallel_map(fitting.first, wave)), key=lambda one: one.criterion
        )
        # a fit from afar may need more than its first steps, and the map knows
        mapped = sorted(first[_ENDED:], key=lambda one: one.entry.left)
        ended += parallel_map(fitting.settled, [*first[:_ENDED], *mapped[:1]])
        ended += mapped[1:]
    return ended


def _telling(fitted: Sequence[FittedEntry], below: float) -> list[FittedEntry]:
    """Return those that come near the best, the best first."""
    ordered = sorted(fitted, key=lambda one: one.criterion)
    return [
        one
        for one in ordered
        if below - one.criterion > max(_NEAR * (below - ordered[0].criterion), 0.0)
    ]


def _second_look(
    law_map: LawMap,
    base: FittedCandidate,
    fitted: Sequence[FittedEntry],
    done: Sequence[Entry],
    telling: Sequence[Entry],
) -> list[Entry]:
    """Return more entries to fit: with the same effect as the best to first order, or likely ones.

    The first order tells little of what a fit gains: far from a record, all signals as they are are
    near enough.

    Parameters
    ----------
    law_map : LawMap
    base : FittedCandidate
    fitted : sequence of FittedEntry
        The best first.
    done : sequence of Entry
        All that were fitted.
    telling : sequence of Entry
        All that gain more than by chance.
    """
    best = next(iter(fitted), None)
    is_far = law_map.widths(best.residual if best else base.fit.residual) > _FAR
    near = [e for e in telling if is_far or (best and not law_map.plausible.prior_rank(e)[0])]
    tried = {e.key for e in done}
    same_effect = [
        e for e in _first_of_each(telling, tried) if best and indistinguishable(e, best.entry)
    ]
    current = [e for e in _first_of_each(near, tried) if not e.signal.memory]
    return list({e.key: e for e in (*same_effect[:_BEST], *current[:_PLAIN])}.values())


def _first_of_each(
    entries: Sequence[Entry], tried: Collection[tuple[str, str, str, str]]
) -> list[Entry]:
    """Return the first entry of every key that was not tried, signals as they are first."""
    remaining: dict[tuple[str, str, str, str], Entry] = {}
    for entry in entries:
        if entry.key not in tried:
            remaining.setdefault(entry.key, entry)
    return sorted(remaining.values(), key=lambda e: e.signal.memory != "")


def _as_good(law_map: LawMap, fitted: Sequence[FittedEntry], below: float) -> list[FittedEntry]:
    """Return those about as good as the best of several, the nearest to the model first."""
    if not fitted:
        return []
    best = fitted[0]
    most = below - best.criterion
    plausible = law_map.plausible

    def tolerance(one: FittedEntry) -> float:
        # what is added to a law of one signal and what multiplies it are one function, on other
        # knots
        is_same = one.entry.key[:3] == best.entry.key[:3]
        is_same = is_same and plausible.depends_on_one_signal(one.entry.law)
        return max(_AS_GOOD, (_OTHERWISE if is_same else _FITTED) * most)

    as_good = [one for one in fitted if one.criterion <= best.criterion + tolerance(one)]
    return sorted(as_good, key=lambda one: plausible.prior_rank(one.entry))


def _indistinguishable(
    fits: _MapFits, entry: Entry, as_good: Sequence[FittedEntry]
) -> tuple[Entry, ...]:
    """Return entries with the same effect to first order, or fitted as well, one for each signal.

    What couples things that the model keeps apart is not among them, unless the entry does too, nor
    what does rather the same as another that was fitted and is worse.

    Parameters
    ----------
    fits : _MapFits
    entry : Entry
    as_good : sequence of FittedEntry
        Fitted about as well.
    """
    plausible = fits.law_map.plausible
    good = [one.entry for one in as_good]
    good_keys = {one.key for one in good}
    worse = [other for other in fits.tried if other.key not in good_keys]
    least = entry.curve.gain - max(_AS_GOOD, _ABOUT * entry.curve.gain)
    is_far = plausible.prior_rank(entry)[0]
    same = [
        e
        for e in fits.entries
        if indistinguishable(e, entry)
        and e.curve.gain >= least
        and plausible.prior_rank(e)[0] <= is_far
        and not any(_is_nearer(e, other, entry) for other in worse)
    ]
    several = {e.key[:3]: e for e in (*same[::-1], *good[::-1])}
    several.pop(entry.key[:3], None)
    return tuple(list(several.values())[::-1])


def _is_nearer(entry: Entry, one: Entry, other: Entry) -> bool:
    """Return whether the effect of an entry is nearer to that of one than to that of another."""
    to_one = abs(float(entry.direction @ one.direction))
    return to_one > abs(float(entry.direction @ other.direction))


def _nearest(
    shapes: Sequence[tuple[str, FittedCandidate]], one: FittedEntry, below: float
) -> tuple[str, FittedCandidate] | None:
    """Return the best shape, if it is about as good as the curve."""
    tolerance = max(_AS_GOOD, _SIMPLE * (below - one.criterion))
    return shapes[0] if shapes and shapes[0][1].fit.bic <= one.criterion + tolerance else None


def _judged(one: Correction, base: FittedCandidate, validation: ValidationData) -> Correction:
    """Return a correction with its confirmation and its errors on unseen data."""
    try:
        before = predict(validation, base)
        after = predict(validation, one.model)
        at_rest = is_at_rest(validation.data, validation.judged)
        confirmation = compare(validation, before, after, at_rest)
    except FAILURES:
        return one
    return replace(one, confirmation=confirmation, errors=(before.errors, after.errors))
