"""The conclusion: causes with probabilities, from the comparisons of all fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from orchestration.diagnosis.cause import Cause
from orchestration.diagnosis.comparison import (
    WEIGHTS,
    Common,
    Judged,
    are_same,
    common_of,
    difference,
    rises,
)
from orchestration.diagnosis.features import confidence, features_of
from orchestration.diagnosis.readings import Reading
from orchestration.diagnosis.search import Found, Ranked
from orchestration.diagnosis.terms import NamedTerm, Term

_LEAST = 1e-12
_SETS = 8  # that share the probability


@dataclass(frozen=True, eq=False)
class Conclusion:
    """The verdict of a diagnosis.

    Attributes
    ----------
    verdict : str
        ``cause``, ``ambiguous``, ``unexplained`` or ``consistent``.
    causes : tuple of Cause
        The smallest group that reaches the probability; of ``unexplained`` the best guesses.
    nothing : float
        Probability that nothing is missing that this record can show.
    base : Judged
    """

    verdict: str
    causes: tuple[Cause, ...]
    nothing: float
    base: Judged


def conclude(found: Found) -> Conclusion:
    """Draw the conclusion from all fits of a search."""
    ranked = [entry for entry in found.compared() if not entry.comparison.is_worse]
    best: dict[object, Ranked] = {}
    for entry in _near_the_lowest(ranked, found.base):
        best.setdefault(frozenset(part.source[:3] for part in entry.judged.parts), entry)
    top = sorted(best.values(), key=lambda entry: -entry.score)[:_SETS]
    *shares, nothing = _shares(top)
    group = _group(_calibrated(_causes(top, shares, found), found))
    return Conclusion(_verdict(group, found), group, nothing, found.base)


def _shares(top: Sequence[Ranked]) -> list[float]:
    """Return the share of each set, and that of no term at all, by their scores."""
    largest = max((entry.comparison.gain for entry in top), default=0.0)
    temper = WEIGHTS.temper + WEIGHTS.temper_of_gain * max(largest, 0.0)
    scores = np.array([entry.score for entry in top] + [0.0]) / temper
    shares = np.exp(scores - scores.max())
    return [float(share) for share in shares / shares.sum()]


def _causes(top: Sequence[Ranked], shares: Sequence[float], found: Found) -> list[Cause]:
    """Join the sets with the same first part to causes, the most probable first.

    Terms that leave what a file leaves that is read in another way, without any value being fitted,
    say the same in more words.
    """
    entries = [(entry, _in_order(entry.judged, found)) for entry in top]
    misread = [(entry, parts) for entry, parts in entries if _is_plain_reading(entry.judged)]
    meant = {
        parts[0].cause: reading
        for entry, parts in entries
        for reading in misread
        if len(parts) == 1 and are_same(entry.judged, reading[0].judged)
    }
    causes: dict[tuple[str, str], Cause] = {}
    for (entry, own), share in zip(entries, shares, strict=True):
        ranked, parts = meant.get(own[0].cause, (entry, own))
        law, signal = parts[0].cause
        members = frozenset({(law, signal), own[0].cause})
        new = Cause(
            law, signal, 0.0, ranked.judged, parts, ranked.comparison, ranked.score, members
        )
        known = causes.setdefault((law, signal), new)
        causes[law, signal] = replace(
            known, probability=known.probability + share, members=known.members | members
        )
    ordered = sorted(causes.values(), key=lambda cause: -cause.probability)
    return _joined(ordered, common_of(found.fits)) if ordered else []


def _joined(causes: Sequence[Cause], common: Common) -> list[Cause]:
    """Join laws to the effects of a catalogue that are one cause with them, which has their name.

    These are laws over the same signal, and those that act alike: where the evidence of one against
    the other, if it were true, is less than what scores of causes may differ by.
    """
    named = [cause for cause in causes if isinstance(cause.parts[0], NamedTerm)]
    others = [cause for cause in causes if cause.reading is not None]
    for cause in causes:
        if cause in named or cause in others:
            continue
        apart = {
            k: nats
            for k, one in enumerate(named)
            if (nats := _apart(cause, one, common)) < WEIGHTS.temper
            or (cause.law, cause.signal) == (one.terms[0].law, one.terms[0].signal)
        }
        if not apart:
            others.append(cause)
            continue
        nearest = min(apart, key=lambda k: apart[k])
        one = named[nearest]
        named[nearest] = replace(
            one,
            probability=one.probability + cause.probability,
            members=one.members | cause.members,
            aliases=(*one.aliases, cause.name),
        )
    return sorted([*named, *others], key=lambda cause: -cause.probability)


def _apart(cause: Cause, named: Cause, common: Common) -> float:
    """Return the evidence that one cause would have against another if it were true, nats."""
    ours, theirs = cause.judged.choosing, named.judged.choosing
    noise = np.minimum(np.nanmean(ours**2, axis=0), np.nanmean(theirs**2, axis=0))
    share = np.nanmean((ours - theirs) ** 2, axis=0) / np.maximum(noise, _LEAST)
    return float(0.5 * np.nansum(common.left_out * share))


def _is_plain_reading(one: Judged) -> bool:
    """Return whether a fit is without terms, of a file in a reading that has no value to fit."""
    return one.reading is not None and not one.reading.is_fitted and not one.terms


def _calibrated(causes: Sequence[Cause], found: Found) -> list[Cause]:
    """Return as many causes as may be in a group, with probabilities by their features.

    That of each is by how much it raises the probability that the true one is among them.
    """
    result = []
    before = 0.0
    for count, cause in enumerate(causes[: WEIGHTS.most], start=1):
        reached = max(before, confidence(features_of(found, causes[:count])))
        result.append(replace(cause, probability=reached - before))
        before = reached
    return sorted(result, key=lambda cause: -cause.probability)


def _group(causes: Sequence[Cause]) -> tuple[Cause, ...]:
    """Return the smallest group that reaches the probability, or all."""
    reached = np.cumsum([cause.probability for cause in causes])
    return tuple(causes[: int(np.searchsorted(reached, WEIGHTS.group)) + 1])


def _verdict(group: Sequence[Cause], found: Found) -> str:
    """Return the verdict; never a cause whose error rises where nothing is chosen by it.

    Without a cause that holds on what is left out, the model is consistent only if none gains on
    what is fitted either.
    """
    if not group or group[0].score <= 0.0 or group[0].comparison.evidence <= WEIGHTS.least:
        return "unexplained" if found.gain_where_fitted() > WEIGHTS.least else "consistent"
    reached = sum(cause.probability for cause in group)
    if reached < WEIGHTS.group or rises(group[0].judged, found.base):
        return "unexplained"
    return "cause" if group[0].probability >= WEIGHTS.sure else "ambiguous"


def _near_the_lowest(ranked: Sequence[Ranked], base: Judged) -> list[Ranked]:
    """Return the fits that are not behind the lowest error on what is left out."""
    if not ranked:
        return []
    # one that does not gain in all is no measure of what can be reached
    best = ranked[0]
    gaining = [entry for entry in ranked if entry.score > WEIGHTS.gaining * best.score] or [best]
    lowest = min((e.judged for e in gaining), key=lambda one: float(np.nanmean(one.choosing**2)))
    removed, _ = difference(base, lowest)
    near = []
    for entry in ranked:
        behind, error = difference(entry.judged, lowest)
        if behind <= max(WEIGHTS.behind * error, WEIGHTS.share_behind * removed):
            near.append(entry)
    return near


def _in_order(one: Judged, found: Found) -> tuple[Reading | Term, ...]:
    """Return the parts in the order in which they explain.

    First that which gains most alone, if this is half of what the set gains; else that whose loss
    costs most.
    """
    gains: dict[frozenset[object], float] = {frozenset(): 0.0}
    for ranked in found.compared():
        key = frozenset(t.source for t in ranked.judged.parts)
        gains[key] = max(gains.get(key, -np.inf), ranked.comparison.gain)

    def gain(parts: Sequence[Reading | Term]) -> float:
        return gains.get(frozenset(t.source for t in parts), -np.inf)

    order: list[Reading | Term] = []
    rest = list(one.parts)
    while rest:
        alone = {t: gain([*order, t]) for t in rest}
        lost = {t: gain([x for x in one.parts if x is not t]) for t in rest}
        first = max(rest, key=lambda t: alone[t])
        if alone[first] < WEIGHTS.alone * gain(one.parts):
            first = min(rest, key=lambda t: lost[t] if np.isfinite(lost[t]) else np.inf)
        order.append(first)
        rest = [t for t in rest if t is not first]
    return tuple(order)
