"""The conclusion: causes with probabilities, from the comparisons of all fits."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from orchestration.diagnosis.cause import Cause
from orchestration.diagnosis.comparison import WEIGHTS, Common, Judged, are_same, rises, shortfall
from orchestration.diagnosis.courses import Courses, are_interchangeable
from orchestration.diagnosis.features import confidence, features_of
from orchestration.diagnosis.readings import Reading
from orchestration.diagnosis.remainder import drifts, recurs, remainders, structures, undersampled
from orchestration.diagnosis.search import Found, Ranked
from orchestration.diagnosis.signals import are_alike, remembered_by
from orchestration.diagnosis.subject import Subject, words_of
from orchestration.diagnosis.terms import SensorTerm, Term

_LEAST = 1e-12
_SETS = 8  # that share the probability

Pairs = Collection[frozenset[tuple[str, str]]]  # of causes, by their keys


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
    leading : tuple of Cause
        The first causes by their scores, as many as a group has at most; their probabilities are
        shares by scores alone.
    """

    verdict: str
    causes: tuple[Cause, ...]
    nothing: float
    base: Judged
    leading: tuple[Cause, ...] = ()

    @property
    def is_named(self) -> bool:
        """True if the verdict names a cause, or a group of them."""
        return self.verdict in ("cause", "ambiguous")


def conclude(found: Found, inseparable: Pairs = ()) -> Conclusion:
    """Draw the conclusion from all fits of a search.

    Parameters
    ----------
    found : Found
    inseparable : collection of frozenset
        Pairs of causes, by their keys, that no experiment tells apart; see `equivalence`.
    """
    ranked = [entry for entry in found.compared() if not entry.comparison.is_worse]
    near = _near_the_likeliest(ranked, found)
    top = _best_sets(near)
    *shares, none = _shares(top, found)
    causes = _causes(top, shares, found, inseparable)
    group = _group(_calibrated(causes, found))
    if not _is_enough(group):
        behind = _best_sets([entry for entry in ranked if entry not in near])
        causes += _others(_causes(behind, [0.0] * len(behind), found, inseparable), causes, found)
        group = _group(_calibrated(causes, found))
    leading = tuple(causes[: WEIGHTS.most])
    nothing = 0.0 if drifts(found.base) else none
    return Conclusion(_verdict(group, found), group, nothing, found.base, leading)


def _best_sets(ranked: Sequence[Ranked]) -> list[Ranked]:
    """Return the best fit of each set of sources, the best first, but of no set with a better one.

    Parameters
    ----------
    ranked : sequence of Ranked
        The best first.
    """
    best: dict[frozenset[object], Ranked] = {}
    for entry in ranked:
        best.setdefault(frozenset(part.source[:3] for part in entry.judged.parts), entry)
    return _minimal(sorted(best.items(), key=lambda item: -item[1].score))[:_SETS]


def _others(behind: Sequence[Cause], causes: Sequence[Cause], found: Found) -> list[Cause]:
    """Return the causes that are not among others in other words.

    They are behind on what is left out, or gain less than half of the best. How sure the best is
    follows from how far it is ahead of them; so they are what else the cause may be.
    """
    return [
        one
        for one in behind
        if not any(one.key in known.members or _is_one_with(one, known, found) for known in causes)
    ]


def _minimal(sets: Sequence[tuple[frozenset[object], Ranked]]) -> list[Ranked]:
    """Return the sets that contain no better one; they come by their sources, the best first."""
    kept: dict[frozenset[object], Ranked] = {}
    for sources, entry in sets:
        if not any(better < sources for better in kept):
            kept[sources] = entry
    return list(kept.values())


def _shares(top: Sequence[Ranked], found: Found) -> list[float]:
    """Return the share of each set, and that of none of them, by their scores.

    Where the best leaves white noise scores are nats of a likelihood; where it leaves more than
    that, no set is exact, and they are worth less. Where no term leaves a large slow error,
    something is missing; and if the best leaves one, too, it may be something that was not tried.
    """
    is_known = bool(top) and drifts(found.base) and not drifts(top[0].judged)
    no_term = -np.inf if is_known else 0.0
    scores = np.array([*(entry.score for entry in top), no_term]) / found.temper
    shares = np.exp(scores - scores.max())
    return [float(share) for share in shares / shares.sum()]


def _causes(
    top: Sequence[Ranked], shares: Sequence[float], found: Found, inseparable: Pairs
) -> list[Cause]:
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
        is_plainer = ranked.judged.freedom < known.judged.freedom
        if is_plainer and ranked.score > known.score - found.temper:
            known = replace(known, judged=ranked.judged, parts=parts, comparison=ranked.comparison)
        causes[law, signal] = replace(
            known, probability=known.probability + share, members=known.members | members
        )
    ordered = sorted(causes.values(), key=lambda cause: -cause.probability)
    return _joined(ordered, found, inseparable) if ordered else []


def _joined(causes: Sequence[Cause], found: Found, inseparable: Pairs) -> list[Cause]:
    """Join laws that are one cause, of which the plainest has the name; an effect is plainest.

    A law is one with an effect over the same signal, or if the evidence of one against the other,
    if it were true, is less than what scores of causes may differ by; and with another law if a
    function of the signal in the one is a function of it in the other, or no experiment tells them
    apart.
    """
    common = found.common
    joined: list[Cause] = []
    for cause in sorted(causes, key=_plainness):
        same = {
            k: apart
            for k, one in enumerate(joined)
            if ((apart := _apart(cause, one, common)) < WEIGHTS.temper and one.is_effect)
            or _is_one_with(cause, one, found)
            or any(frozenset((cause.key, member)) in inseparable for member in one.members)
        }
        if not same or cause.reading is not None or cause.is_effect:
            joined.append(cause)
            continue
        nearest = min(same, key=lambda k: same[k])
        one = joined[nearest]
        joined[nearest] = replace(
            one,
            probability=one.probability + cause.probability,
            score=max(one.score, cause.score),
            members=one.members | cause.members,
            aliases=(*one.aliases, cause.name),
        )
    return sorted(joined, key=lambda cause: -cause.probability)


def _plainness(cause: Cause) -> tuple[bool, float]:
    return not cause.is_effect, cause.judged.words


def _is_one_with(cause: Cause, other: Cause, found: Found) -> bool:
    """Return whether two causes are of one signal, in laws in which its functions are the same."""
    ours, theirs = cause.parts[0], other.parts[0]
    if not isinstance(ours, Term) or not isinstance(theirs, Term):
        return False
    is_one_name = ours.signal == theirs.signal
    if is_one_name and ours.law == theirs.law:  # a gain and a lag of one sensor are two faults
        return not (isinstance(ours, SensorTerm) and isinstance(theirs, SensorTerm))
    if not is_one_name and (ours.is_instant or not theirs.is_instant):
        return False
    along = found.along
    if along is None or not (is_one_name or _remembers(cause, theirs.signal, along)):
        return False
    is_of_instants = theirs.is_instant and (ours.is_instant or not is_one_name)
    signal = theirs.signal if is_of_instants else ""
    laws = {law for law, _ in other.members}
    return ours.law in laws or any(
        are_interchangeable(along, ours.law, law, signal) for law in laws
    )


def _remembers(cause: Cause, signal: str, along: Courses) -> bool:
    """Return whether what a cause remembers of its signal is another signal."""
    term = cause.parts[0]
    values = along.values
    if not isinstance(term, Term) or not {term.signal, signal} <= set(values):
        return False
    fitted = cause.judged.fit.values_of(term)[term.coefficients :]
    remembered = remembered_by(term.memory, values[term.signal], along.times, np.exp(fitted))
    return remembered is not None and are_alike(remembered, values[signal])


def _apart(cause: Cause, named: Cause, common: Common) -> float:
    """Return the evidence that one cause would have against another if it were true, nats."""
    ours, theirs = cause.judged.choosing, named.judged.choosing
    noise = np.minimum(np.nanmean(ours**2, axis=0), np.nanmean(theirs**2, axis=0))
    share = np.nanmean((ours - theirs) ** 2, axis=0) / np.maximum(noise, _LEAST)
    return float(0.5 * np.nansum(common.left_out * share))


def _is_plain_reading(one: Judged) -> bool:
    """Return whether a fit is without terms, of a file in a reading that has no value to fit."""
    return one.reading is not None and not one.reading.is_sized and not one.terms


def _calibrated(causes: Sequence[Cause], found: Found) -> list[Cause]:
    """Return as many causes as may be in a group, with probabilities by their features.

    That of each is by how much it raises the probability that the true one is among them.
    """
    result = []
    before = 0.0
    for count, cause in enumerate(causes[: WEIGHTS.most], start=1):
        reached = confidence(features_of(found, causes[:count]))
        result.append(replace(cause, probability=reached - before))
        before = reached
    return sorted(result, key=lambda cause: -cause.probability)


def _group(causes: Sequence[Cause]) -> tuple[Cause, ...]:
    """Return the smallest group that reaches the probability, or all."""
    reached = np.cumsum([cause.probability for cause in causes])
    return tuple(causes[: int(np.searchsorted(reached, WEIGHTS.group)) + 1])


def _is_enough(group: Sequence[Cause]) -> bool:
    """Return whether a group reaches the probability of an answer."""
    return sum(cause.probability for cause in group) >= WEIGHTS.group


def _verdict(group: Sequence[Cause], found: Found) -> str:
    """Return the verdict; never a cause whose error rises where nothing is chosen by it.

    Nor one that leaves the larger part of what is missing, if this is a large slow error still.

    That something is missing at all is seen by a large slow error of the model, or by strong
    evidence of a cause, on what is left out too. Without either the model is consistent only if no
    cause gains on what is fitted, and if what is left can be told to be noise: it does not recur.
    """
    is_missing = drifts(found.base)
    gains = bool(group) and group[0].score > 0.0
    if not is_missing and not (gains and group[0].comparison.evidence > WEIGHTS.least):
        gains_where_fitted = found.gain_where_fitted() > WEIGHTS.least
        is_open = gains_where_fitted or undersampled(found.base) or recurs(found.base)
        return "unexplained" if is_open else "consistent"
    if not gains or not _is_enough(group) or rises(group[0].judged, found.base):
        return "unexplained"
    first = group[0].judged
    if _leaves_much(first, found.base) or is_lost(first, found.subject_of(first.reading)):
        return "unexplained"
    return "cause" if group[0].probability >= WEIGHTS.sure else "ambiguous"


def _leaves_much(first: Judged, base: Judged) -> bool:
    """Return whether a cause leaves much of what is missing where it was fitted and beyond.

    A record of another day or range may have a cause of its own, which the others do not show.
    """
    left = zip(structures(first), structures(base), strict=True)
    return all(ours > (1.0 - WEIGHTS.explained) * theirs for ours, theirs in left)


def is_lost(judged: Judged, subject: Subject) -> bool:
    """Return whether no output is predicted much better than by its mean, where nothing was fitted.

    Parameters
    ----------
    judged : Judged
    subject : Subject
        By which it was judged.
    """
    left = remainders(judged, subject.sizes)
    return bool(left) and all(
        one.is_more_than_noise and one.share > WEIGHTS.no_better for one in left
    )


def _near_the_likeliest(ranked: Sequence[Ranked], found: Found) -> list[Ranked]:
    """Return the fits that are not behind the most likely one on what is left out.

    Errors are in widths of the noise of each output, or one of large errors would decide alone.
    What is plainer may be behind by what its words are worth: nats, as far as the best are exact.
    """
    if not ranked:
        return []
    # one that does not gain in all is no measure of what can be reached, and not as likely: where
    # errors are large for a short while their difference is uncertain
    best = ranked[0]
    gaining = [entry for entry in ranked if entry.score > WEIGHTS.gaining * best.score] or [best]
    likeliest = max(gaining, key=lambda entry: entry.comparison.left_out)
    lowest, most = likeliest.judged, likeliest.comparison.left_out
    noise = np.maximum(np.sqrt(np.nanmean(lowest.beyond**2, axis=0)), _LEAST)
    removed, _ = shortfall(found.base, lowest, noise)
    deviations = WEIGHTS.behind * (2.0 - found.structure)
    of_words = WEIGHTS.share_of_words * found.structure

    def is_near(entry: Ranked) -> bool:
        behind, error = shortfall(entry.judged, lowest, noise)
        plainer = max(lowest.words - entry.judged.words, 0.0)
        worth = (WEIGHTS.share_behind + of_words * plainer) * most
        worth += (1.0 - found.structure) * plainer
        is_behind = behind > max(deviations * error, WEIGHTS.share_behind * removed)
        return not is_behind or bool(plainer and most - entry.comparison.left_out <= worth)

    return [entry for entry in gaining if is_near(entry)]


def _in_order(one: Judged, found: Found) -> tuple[Reading | Term, ...]:
    """Return the parts in the order in which they explain.

    First that which gains most alone, less what its columns and words cost, if this is half of what
    the set gains; else the reading of the file, in which the terms are, or the part that adds most
    on the mean over all orders (Shapley: A value for n-person games, 1953). A set that was not
    fitted gains as much as the best of its subsets.
    """
    gains: dict[frozenset[object], float] = {frozenset(): 0.0}
    for ranked in found.compared():
        key = frozenset(t.source for t in ranked.judged.parts)
        gained = ranked.comparison.gain - ranked.comparison.columns
        gains[key] = max(gains.get(key, 0.0), gained)

    def gain(parts: Iterable[Reading | Term]) -> float:
        sources = frozenset(t.source for t in parts)
        return max(gained for key, gained in gains.items() if key <= sources)

    def added(part: Reading | Term, order: Sequence[Reading | Term]) -> float:
        before = [*explaining, *order[: order.index(part)]]
        return gain([*before, part]) - gain(before)

    share = WEIGHTS.share_of_words * found.structure * gain(one.parts)
    model = one.fit.problem.model
    words = {part: share * words_of(model, part) for part in one.parts}
    explaining: list[Reading | Term] = []
    rest = list(one.parts)
    while rest:
        alone = {t: gain([*explaining, t]) for t in rest}
        first = max(rest, key=lambda t: alone[t] - words[t])
        if alone[first] < WEIGHTS.alone * gain(one.parts):
            orders = list(permutations(rest))
            worth = {t: sum(added(t, order) for order in orders) for t in rest}
            first = max(rest, key=lambda t: (isinstance(t, Reading), worth[t]))
        explaining.append(first)
        rest = [t for t in rest if t is not first]
    return tuple(explaining)
