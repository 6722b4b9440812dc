"""Corrections of laws fitted in their model: what is remembered in proportion, what is not as a curve; and shapes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit import Component, Effect
from fmus.kit.corrections import Of, correction
from fmus.kit.errors import UserError
from fmus.kit.symbolic.families import laws_of
from orchestration.discrepancy.candidates.candidate import own_parameters
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.laws.evidence import Curve
from orchestration.discrepancy.laws.fit import CurveFit, FittedCurve
from orchestration.discrepancy.laws.map import Entry, LawMap
from orchestration.discrepancy.laws.shapes import called, likenesses
from orchestration.discrepancy.selection.search import FAILURES, Search

Array = NDArray[np.float64]
_MOST = 50.0  # fall of the criterion per sample
_PATIENCE = 6.0  # internal steps, over those of other effects
_SHAPES = 5  # that are fitted in the model


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
        self._is_moving = any(name in search.base.layout.start_parameters for name in search.parameters)

    def first(self, entry: Entry) -> FittedEntry | None:
        """Fit roughly: what is remembered in proportion, which is a relaxation or a growth; what is not as a curve.

        None if the model cannot be simulated with it.
        """
        try:
            with np.errstate(all="ignore"):  # a simulation may run away
                found = self._in_proportion(entry) if entry.signal.memory else self._as_curve(entry)
        except FAILURES:
            return None
        # a simulation that ran away leaves figures that are none
        return found if self._base.fit.bic - found.criterion < _MOST * self._base.fit.samples else None

    def settled(self, one: FittedEntry) -> FittedEntry:
        """Fit a curve on, in its own noise and as rough as it asks for; what is in proportion is settled."""
        if one.fit is None or one.table is None:
            return one
        try:
            with np.errstate(all="ignore"):
                return _of_table(one.entry, one.fit, one.fit.settled(one.table))
        except FAILURES:
            return one

    def bent(self, one: FittedEntry) -> FittedEntry:
        """The same as a curve, if it was in proportion and a curve is likelier."""
        if one.straight is None:
            return one
        try:
            with np.errstate(all="ignore"):
                other = self.settled(self._as_curve(one.entry))
        except FAILURES:
            return one
        return other if other.criterion < one.criterion else one

    def shape(self, one: FittedEntry, name: str, amount: float, width: float) -> FittedCandidate | None:
        """A shape in its place, from an amount and a width; None if the model cannot be simulated with it."""
        effect = self.effect(one.entry, name)
        start = _own(one, effect) | {effect.neutral: amount}
        try:
            with np.errstate(all="ignore"):
                return self._fitted(effect, start | ({f"{effect.neutral}_width": width} if width else {}))
        except FAILURES:
            return None

    def shapes(self, one: FittedEntry) -> list[tuple[str, FittedCandidate]]:
        """Shapes that come near it, fitted in the model, the best first."""
        near = likenesses(one.entry.basis, one.curve, self.signal(one.entry).scale)[:_SHAPES]
        tried = [self.shape(one, like.shape, like.amount, like.width) for like in near]
        fitted = [(like.shape, model) for like, model in zip(near, tried, strict=True) if model is not None]
        fitted += [("linear", one.straight)] if one.straight is not None else []
        several: dict[str, FittedCandidate] = {}
        for shape, model in sorted(fitted, key=lambda pair: pair[1].fit.bic):
            width = model.fit.values.get(f"{model.effect.neutral}_width", 0.0)
            several.setdefault(called(shape, width, one.entry.basis), model)
        return list(several.items())

    def tabulated(self, one: FittedEntry) -> FittedCandidate | None:
        """The curve as a table of which there may be more or less, so that it can be judged like any effect.

        None if the model cannot be simulated with it.
        """
        if one.straight is not None:
            return one.straight
        effect = self.effect(one.entry, values=[float(y) for y in one.curve.values], fixed=True)
        try:
            return self._fitted(effect, _own(one, effect) | {effect.neutral: 1.0})
        except FAILURES:
            return None

    def effect(self, entry: Entry, shape: Any = None, **more: Any) -> type[Effect]:
        """Make the effect of an entry: a table over its knots unless it has a shape."""
        cls = self._base.candidate.cls
        size = float(np.abs(entry.curve.values).max()) or 1.0
        knots = [float(x) for x in entry.basis.knots]
        unit = unit_of(cls, entry.law)
        return correction(cls, entry.law, self.signal(entry), shape or knots, unit, size, entry.kind, **more)

    def signal(self, entry: Entry) -> Of:
        """The signal of an entry, as a correction takes it."""
        signal, unit = entry.signal, unit_of(self._base.candidate.cls, entry.signal.name)
        scale = float(np.abs(entry.basis.knots).max()) or 1.0
        return Of(signal.name, signal.memory, signal.constant, unit, scale, self._found.begins(entry))

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
        amount, spread = model.fit.values[effect.neutral], model.problem.scales[k].slope(model.fit.q[k])
        variance = float(model.fit.covariance.matrix[k, k]) * spread**2
        shape = np.outer(knots, knots)
        curve = Curve(self._base.fit.bic - model.fit.bic, amount * knots, variance * shape, amount**2 * shape, 0.0)
        entry = _with_constant(entry, model)
        if entry.signal.constant and not self._shortest < entry.signal.constant < self._longest:
            raise UserError(f"{entry.label}: no lag, but the signal itself, or a constant")
        return FittedEntry(entry, curve, model.fit.bic, model.fit.values, straight=model)

    def _fitted(self, effect: type[Effect], start: dict[str, float]) -> FittedCandidate:
        base = self._base
        candidate = base.candidate.with_effect(effect)
        if self._is_moving and any(name.endswith("_memory_constant") for name in effect.declared):
            # where it is not known where everything starts, it is not known what is remembered then
            candidate = replace(candidate, starts=(*candidate.starts, *effect.layout.start_of.values()))
        fitted = self._search.fit_from(candidate, base, {**self._search.fixed, **base.fit.values, **start})
        fitted.problem.forget()
        return fitted


def _of_table(entry: Entry, fit: CurveFit, table: FittedCurve) -> FittedEntry:
    return FittedEntry(entry, table.curve, table.criterion, table.values, fit, table)


def _own(one: FittedEntry, effect: type[Effect]) -> dict[str, float]:
    """Values of a fit that another form of it has as well."""
    known = {p.name for p in effect.layout.parameters}
    return {n: v for n, v in one.values.items() if "_at_" not in n or n in known}


def _with_constant(entry: Entry, model: FittedCandidate) -> Entry:
    """The entry with the lag that was fitted."""
    fitted = [model.fit.values[n] for n in own_parameters(model.effect) if n.endswith("_memory_constant")]
    return replace(entry, signal=replace(entry.signal, constant=fitted[0])) if fitted else entry


def unit_of(cls: type[Component], name: str) -> str:
    """SI unit of an input, a state, a law, or the time."""
    layout = cls.layout
    declared = {v.name: v.unit for v in (*layout.inputs, *layout.states, *layout.discretes)} | {"time": "s"}
    return declared.get(name) or {law.name: law.unit for law in laws_of(cls)}.get(name) or "1"
