"""Corrections of laws fitted in their model: what is behind a lag in proportion, what is not as a curve; and shapes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from fmus.kit import Component, Effect
from fmus.kit.corrections import Of, correction
from fmus.kit.errors import UserError
from fmus.kit.symbolic.families import laws_of
from orchestration.discrepancy.candidates.candidate import own_parameters
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.laws.entry import Entry
from orchestration.discrepancy.laws.evidence import Curve
from orchestration.discrepancy.laws.fit import CurveFit, FittedCurve
from orchestration.discrepancy.laws.map import LawMap
from orchestration.discrepancy.laws.shapes import Likeness, called, likenesses, zero_of
from orchestration.discrepancy.parallel import side_by_side
from orchestration.discrepancy.selection.search import FAILURES, Search

Array = NDArray[np.float64]
T = TypeVar("T")
_MOST = 50.0  # fall of the criterion per sample
_PATIENCE = 6.0  # internal steps, over those of other effects
_SHAPES = 5  # that are fitted in the model
RELAXATIONS = (
    "lagged",
    "leading",
)  # memories that stay in proportion: what seems to bend there is another relaxation


@dataclass(frozen=True)
class FittedEntry:
    """An entry of the map, fitted with all parameters of the model.

    Attributes
    ----------
    entry : Entry
    curve : Curve
        Values and covariance at the knots, in the unit of the law.
    criterion : float
        Of Bayes, as far as a curve has one.
    values : dict of str to float
        Parameters by name, SI.
    fit : CurveFit or None
        Where it can be fitted on.
    table : FittedCurve or None
        Where it is a curve.
    straight : FittedCandidate or None
        Where it is in proportion.
    """

    entry: Entry
    curve: Curve
    criterion: float
    values: dict[str, float]
    fit: CurveFit | None = None
    table: FittedCurve | None = None
    straight: FittedCandidate | None = None

    @property
    def residual(self) -> dict[str, Array]:
        """Measured minus simulated, by output."""
        fitted = self.table or (self.straight.fit if self.straight else None)
        return dict(fitted.residual) if fitted else {}


class Fitting:
    """Fits of entries of one map.

    Parameters
    ----------
    search : Search
    base : FittedCandidate
        That the map is of.
    found : LawMap
    """

    def __init__(self, search: Search, base: FittedCandidate, found: LawMap):
        # where a curve may step, each of its values is felt for a moment only
        self._search, self._base, self._found = replace(search, patience=_PATIENCE), base, found
        time = search.data.time
        self._shortest, self._longest = float(np.median(np.diff(time))), float(time[-1] - time[0])
        self._is_moving = any(
            name in search.base.layout.start_parameters for name in search.parameters
        )

    def first(self, entry: Entry) -> FittedEntry | None:
        """Fit roughly: what is behind a lag in proportion, which is a relaxation; everything else as a curve.

        None if the model cannot be simulated with it.
        """
        found = _or_none(
            lambda: self._in_proportion(entry) if entry.signal.constant else self._as_curve(entry)
        )
        # a simulation that ran away leaves figures that are none
        return (
            found
            if found and self._base.fit.bic - found.criterion < _MOST * self._base.fit.samples
            else None
        )

    def settled(self, one: FittedEntry) -> FittedEntry:
        """Fit a curve on, in its own noise and as rough as it asks for; what is in proportion is settled."""
        fit, table = one.fit, one.table
        if fit is None or table is None:
            return one
        return _or_none(lambda: _of_table(one.entry, fit, fit.settled(table))) or one

    def bent(self, one: FittedEntry) -> FittedEntry:
        """The same as a curve, if it was in proportion, may bend, and a curve is likelier."""
        if one.straight is None or one.entry.signal.memory in RELAXATIONS:
            return one
        other = _or_none(lambda: self.settled(self._as_curve(one.entry)))
        return other if other and other.criterion < one.criterion else one

    def shapes(self, one: FittedEntry) -> list[tuple[str, FittedCandidate]]:
        """Shapes that come near it, fitted in the model, the best first."""
        known = {"linear": one.straight} if one.straight else {}
        if one.straight is not None and one.entry.signal.memory in RELAXATIONS:
            return [("linear", one.straight)]
        of = self.signal(one.entry, zero_of(one.entry.basis))
        near = [
            like
            for like in likenesses(one.entry.basis, one.curve, of.scale, zero=of.zero)
            if like.shape not in known
        ][:_SHAPES]
        tried = side_by_side(lambda like: _or_none(lambda: self._shaped(one, like)), near)
        fitted = [
            *known.items(),
            *((like.shape, model) for like, model in zip(near, tried, strict=True) if model),
        ]
        several: dict[str, FittedCandidate] = {}
        for shape, model in sorted(fitted, key=lambda pair: pair[1].fit.bic):
            width = model.fit.values.get(f"{model.effect.neutral}_width", 0.0)
            several.setdefault(called(shape, width, of.scale), model)
        return list(several.items())

    def tabulated(self, one: FittedEntry) -> FittedCandidate | None:
        """The curve as a table of which there may be more or less, so that it can be judged like any effect.

        None if the model cannot be simulated with it.
        """
        if one.straight is not None:
            return one.straight
        effect = self.effect(one.entry, values=[float(y) for y in one.curve.values], fixed=True)
        return _or_none(lambda: self._fitted(effect, _own(one, effect) | {effect.neutral: 1.0}))

    def effect(self, entry: Entry, shape: Any = None, **more: Any) -> type[Effect]:
        """Make the effect of an entry: a table over its knots unless it has a shape."""
        cls = self._base.candidate.cls
        size = float(np.abs(entry.curve.values).max()) or 1.0
        knots = [float(x) for x in entry.basis.knots]
        unit = unit_of(cls, entry.law)
        more["number"] = self._number(entry)
        of = self.signal(entry, zero_of(entry.basis) if shape and shape != "linear" else 0.0)
        return correction(cls, entry.law, of, shape or knots, unit, size, entry.kind, **more)

    def signal(self, entry: Entry, zero: float = 0.0) -> Of:
        """The signal of an entry, as a correction takes it."""
        signal, unit = entry.signal, unit_of(self._base.candidate.cls, entry.signal.name)
        scale = float(np.abs(entry.basis.knots - zero).max()) or 1.0
        return Of(
            signal.name,
            signal.memory,
            signal.constant,
            unit,
            scale,
            self._found.begins(entry),
            zero,
        )

    def _number(self, entry: Entry) -> int:
        """One, or where the model remembers the signal in the law already, one more: every lag has its own constant."""
        beside = (
            [e.term.family for e in self._base.candidate.effects] if entry.signal.memory else []
        )
        return 1 + beside.count(entry.family)

    def _shaped(self, one: FittedEntry, like: Likeness) -> FittedCandidate:
        """A shape in its place; the likelier one of those with and without a constant, where it may have one."""
        tried = []
        for beside in {bool(like.beside), False}:
            effect = self.effect(one.entry, like.shape, beside=beside)
            own = effect.neutral
            start = {own: like.amount, f"{own}_width": like.width, f"{own}_beside": like.beside}
            known = {n: v for n, v in start.items() if n in effect.declared}
            tried.append(self._fitted(effect, _own(one, effect) | known))
        return min(tried, key=lambda model: model.fit.bic)

    def _as_curve(self, entry: Entry) -> FittedEntry:
        found, base = self._found, self._base
        fit = CurveFit(self._search, base, self.effect(entry), entry.basis)
        starts = [base.fit.values, found.courses[entry.driven].values, found.beside(entry)]
        return _of_table(entry, fit, fit.first(starts, entry.curve, found.floor))

    def _in_proportion(self, entry: Entry) -> FittedEntry:
        effect, knots = self.effect(entry, "linear"), entry.basis.knots
        slope = float(np.polyfit(knots, entry.curve.values, 1)[0])
        model = self._fitted(effect, {effect.neutral: slope})
        k = model.problem.names.index(effect.neutral)
        amount, spread = (
            model.fit.values[effect.neutral],
            model.problem.scales[k].slope(model.fit.q[k]),
        )
        variance = float(model.fit.covariance.matrix[k, k]) * spread**2
        shape = np.outer(knots, knots)
        curve = Curve(
            self._base.fit.bic - model.fit.bic,
            amount * knots,
            variance * shape,
            amount**2 * shape,
            0.0,
        )
        entry = _with_constant(entry, model)
        if entry.signal.constant and not self._shortest < entry.signal.constant < self._longest:
            raise UserError(f"{entry.label}: no lag, but the signal itself, or a constant")
        return FittedEntry(entry, curve, model.fit.bic, model.fit.values, straight=model)

    def _fitted(self, effect: type[Effect], start: dict[str, float]) -> FittedCandidate:
        base = self._base
        candidate = base.candidate.with_effect(effect)
        if self._is_moving and any(name.endswith("_memory_constant") for name in effect.declared):
            # where it is not known where everything starts, it is not known what is remembered then
            candidate = replace(
                candidate, starts=(*candidate.starts, *effect.layout.start_of.values())
            )
        fitted = self._search.fit_from(
            candidate, base, {**self._search.fixed, **base.fit.values, **start}
        )
        fitted.problem.forget()
        return fitted


def _or_none(work: Callable[[], T]) -> T | None:
    """What a fit gives, or None if the model cannot be simulated; a simulation may run away."""
    try:
        with np.errstate(all="ignore"):
            return work()
    except FAILURES:
        return None


def _of_table(entry: Entry, fit: CurveFit, table: FittedCurve) -> FittedEntry:
    return FittedEntry(entry, table.curve, table.criterion, table.values, fit, table)


def _own(one: FittedEntry, effect: type[Effect]) -> dict[str, float]:
    """Values of a fit that another form of it has as well."""
    known = {p.name for p in effect.layout.parameters}
    return {n: v for n, v in one.values.items() if "_at_" not in n or n in known}


def _with_constant(entry: Entry, model: FittedCandidate) -> Entry:
    """The entry with the lag that was fitted."""
    fitted = [
        model.fit.values[n] for n in own_parameters(model.effect) if n.endswith("_memory_constant")
    ]
    return replace(entry, signal=replace(entry.signal, constant=fitted[0])) if fitted else entry


def unit_of(cls: type[Component], name: str) -> str:
    """SI unit of an input, a state, a law, or the time."""
    layout = cls.layout
    declared = {v.name: v.unit for v in (*layout.inputs, *layout.states, *layout.discretes)} | {
        "time": "s"
    }
    return declared.get(name) or {law.name: law.unit for law in laws_of(cls)}.get(name) or "1"
