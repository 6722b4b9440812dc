"""Which law of a model lacks what: the map, its best entries as curves, and what they look like."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit import Component, Effect
from fmus.kit.corrections import Of, correction
from fmus.kit.symbolic.families import laws_of
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.holdout import ValidationData, is_at_rest
from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.laws.fit import CurveFit, FittedCurve
from orchestration.discrepancy.laws.map import Entry, LawMap
from orchestration.discrepancy.laws.shapes import Likeness, likenesses
from orchestration.discrepancy.parallel import side_by_side
from orchestration.discrepancy.selection.search import FAILURES, Search
from orchestration.discrepancy.validation.confirmation import Confirmation, Outcome, score
from orchestration.discrepancy.validation.prediction import predict
from orchestration.records.joined import base_name

Array = NDArray[np.float64]
_NAMED = 3  # shapes that are fitted in the model
_TOLD = 6  # corrections that are told
_AS_GOOD = 6.0  # of the criterion, below which one correction is as good as another
_ABOUT = 0.02  # of what the best gains, likewise: a curve that is straight between knots is not the plant's
_SURE = 1.96  # standard deviations of a band


@dataclass(frozen=True)
class Correction:
    """A law that hangs on a signal in another way than the model says.

    Attributes
    ----------
    entry : Entry
        Of the map.
    fitted : FittedCurve
        As a curve, with all parameters of the model.
    gain : float
        Fall of the criterion of Bayes against the model without it, less what looking at so many costs.
    shape : str
        What it looks like; empty where no simple shape is as good as the curve.
    model : FittedCandidate
        With the shape, or with the curve as a table.
    confirmation : Confirmation or None
        What data that no fit has seen say of it.
    errors : tuple of dict of str to float
        Normalised RMS errors on those, without and with it.
    """

    entry: Entry
    fitted: FittedCurve
    gain: float
    shape: str
    model: FittedCandidate
    confirmation: Confirmation | None = None
    errors: tuple[dict[str, float], dict[str, float]] = ({}, {})

    @property
    def confirmed(self) -> bool:
        """Whether unseen data are surely likelier with it."""
        return self.confirmation is not None and self.confirmation.outcome is Outcome.CONFIRMED

    @property
    def band(self) -> tuple[Array, Array, Array]:
        """Curve at its knots, and the ends of its 95 % band, in the unit of the law."""
        spread = _SURE * np.sqrt(np.clip(np.diag(self.fitted.curve.covariance), 0.0, None))
        values = self.fitted.curve.values
        return values, values - spread, values + spread


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


def discover(diagnosis: Diagnosis, progress: Callable[[str], None] = lambda text: None) -> LawMapResult:
    """Ask every law of a diagnosed model, with the causes that were named, what it lacks.

    Parameters
    ----------
    diagnosis : Diagnosis
    progress : callable
        Told what is being done.
    """
    base = diagnosis.selection.best
    search = search_of(diagnosis, progress)
    progress("asking every law what it lacks")
    found = LawMap(search, base)
    entries = found.entries()
    telling = [e for e in entries if e.curve.gain > found.chance]
    price = 2.0 * float(np.log(max(len(entries), 1)))
    chosen = found.worth_a_fit(telling)
    progress(f"fitting {len(chosen)} corrections of laws")

    def fitted(entry: Entry) -> FittedCurve | None:
        try:
            effect = effect_of(found, base, entry)
            starts = [base.fit.values, found.courses[entry.driven].values, found.beside(entry)]
            return CurveFit(search, base, effect, entry.basis).fit(starts, entry.curve, found.floor)
        except FAILURES:
            return None

    curves = [(e, c) for e, c in zip(chosen, side_by_side(fitted, chosen), strict=True) if c is not None]
    better = [(e, c) for e, c in curves if base.fit.bic - c.criterion - price > 0.0]
    better.sort(key=lambda pair: pair[1].criterion)
    better = _plainest_first(found, better, base.fit.bic)[:_TOLD]
    corrections = []
    for k, (entry, curve) in enumerate(better):
        named = _named(search, found, base, entry, curve) if k == 0 else None
        shape, model = named or ("", _tabulated(search, found, base, entry, curve))
        criterion = model.fit.bic if shape else curve.criterion
        one = Correction(entry, curve, base.fit.bic - criterion - price, shape, model)
        corrections.append(_judged(one, base, diagnosis.validation) if k == 0 else one)
    return LawMapResult(base, entries, found.chance, corrections)


def _plainest_first(found: LawMap, curves: Sequence[tuple[Entry, FittedCurve]], below: float) -> list[Any]:
    """Among corrections about as good as the best, what is nearest to the model comes first.

    Parameters
    ----------
    found : LawMap
    curves : sequence of tuple of Entry and FittedCurve
        The best first.
    below : float
        Criterion of the model without a correction.
    """
    if not curves:
        return []
    best = curves[0][1].criterion
    limit = best + max(_AS_GOOD, _ABOUT * (below - best))
    as_good = [pair for pair in curves if pair[1].criterion <= limit]
    return [*sorted(as_good, key=lambda pair: found.far_fetched(pair[0])), *curves[len(as_good) :]]


def search_of(diagnosis: Diagnosis, progress: Callable[[str], None] = lambda text: None) -> Search:
    """Fits of models over the estimation data of a diagnosis, that search what its base was searched for."""
    base = diagnosis.selection.base
    names = list(dict.fromkeys(map(base_name, base.problem.names)))
    known = {p.name for p in base.candidate.cls.layout.parameters}
    fixed = {n: v for n, v in base.problem.start.items() if n in known and n not in names}
    start = {n: v for n, v in base.problem.start.items() if n in names}
    return Search(diagnosis.estimation, base.candidate.cls, names, fixed | start, progress)


def _of(found: LawMap, base: FittedCandidate, entry: Entry) -> Of:
    """The signal of an entry, as a correction takes it."""
    signal, cls = entry.signal, base.candidate.cls
    scale = float(np.abs(entry.basis.knots).max()) or 1.0
    return Of(signal.name, signal.memory, signal.constant, unit_of(cls, signal.name), scale, found.begins(entry))


def unit_of(cls: type[Component], name: str) -> str:
    """SI unit of an input, a state, a law, or the time."""
    layout = cls.layout
    declared = {v.name: v.unit for v in (*layout.inputs, *layout.states, *layout.discretes)} | {"time": "s"}
    return declared.get(name) or {law.name: law.unit for law in laws_of(cls)}.get(name) or "1"


def effect_of(found: LawMap, base: FittedCandidate, entry: Entry, shape: Any = None, **more: Any) -> type[Effect]:
    """Make the effect of an entry: a table over its knots unless it has a shape."""
    cls = base.candidate.cls
    size = float(np.abs(entry.curve.values).max()) or 1.0
    knots = [float(x) for x in entry.basis.knots]
    return correction(
        cls, entry.law, _of(found, base, entry), shape or knots, unit_of(cls, entry.law), size, entry.kind, **more
    )


def _fitted(search: Search, base: FittedCandidate, effect: type[Effect], start: dict[str, float]) -> FittedCandidate:
    candidate = base.candidate.with_effect(effect)
    fitted = search.fit_from(candidate, base, {**search.fixed, **base.fit.values, **start})
    fitted.problem.forget()
    return fitted


def _tabulated(
    search: Search, found: LawMap, base: FittedCandidate, entry: Entry, curve: FittedCurve
) -> FittedCandidate:
    """The curve as a table of which there may be more or less, so that it can be judged like any effect."""
    effect = effect_of(found, base, entry, values=[float(y) for y in curve.curve.values], fixed=True)
    return _fitted(search, base, effect, _own(curve, effect) | {effect.neutral: 1.0})


def _own(curve: FittedCurve, effect: type[Effect]) -> dict[str, float]:
    known = {p.name for p in effect.layout.parameters}
    return {n: v for n, v in curve.values.items() if "_at_" not in n or n in known}


def _named(
    search: Search, found: LawMap, base: FittedCandidate, entry: Entry, curve: FittedCurve
) -> tuple[str, FittedCandidate] | None:
    """The shape that is at least as good as the curve, if there is one, fitted in the model."""

    def fitted(like: Likeness) -> FittedCandidate | None:
        effect = effect_of(found, base, entry, like.shape)
        width = {f"{effect.neutral}_width": like.width} if like.width else {}
        try:
            return _fitted(search, base, effect, _own(curve, effect) | {effect.neutral: like.amount} | width)
        except FAILURES:
            return None

    near = likenesses(entry.basis, curve.curve, _of(found, base, entry).scale)[:_NAMED]
    tried = [(like.shape, f) for like, f in zip(near, side_by_side(fitted, near), strict=True) if f is not None]
    shape, best = min(tried, key=lambda pair: pair[1].fit.bic, default=("", None))
    return None if best is None or best.fit.bic > curve.criterion + _AS_GOOD else (shape, best)


def _judged(one: Correction, base: FittedCandidate, validation: ValidationData) -> Correction:
    """Hold a correction against unseen data."""
    try:
        before, after = predict(validation, base), predict(validation, one.model)
        found = Confirmation(score(validation, before, after), is_at_rest(validation.data, validation.judged))
    except FAILURES:
        return one
    return replace(one, confirmation=found, errors=(before.errors, after.errors))
