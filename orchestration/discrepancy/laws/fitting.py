"""Fits of corrections in their model: behind a lag in proportion, others as curves or shapes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from fmus.kit import Component, Effect, UserError
from fmus.kit.arrays import Array
from fmus.kit.corrections import SignalTerm, SmoothTable, correction
from fmus.kit.symbolic import list_laws
from orchestration.discrepancy.candidates import FittedCandidate, own_parameters
from orchestration.discrepancy.laws.entry import Entry
from orchestration.discrepancy.laws.evidence import Curve
from orchestration.discrepancy.laws.fit import CurveFit, FittedCurve
from orchestration.discrepancy.laws.map import LawMap
from orchestration.discrepancy.laws.shapes import Likeness, likenesses, shape_name, zero_of
from orchestration.discrepancy.parallel import parallel_map
from orchestration.discrepancy.selection import FAILURES, Search

T = TypeVar("T")
_MOST = 50.0  # fall of the criterion per sample
_PATIENCE = 6.0  # internal steps, over those of other effects
_SHAPES = 5  # that are fitted in the model
# of the time between samples: a lag that a fit takes so far is none, and a simulation would take
# hundreds of internal steps for each sample
_NO_LAG = 0.1
# memories that stay in proportion: what seems to bend there is another relaxation
RELAXATIONS = ("lagged", "leading")


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
    law_map : LawMap
    """

    def __init__(self, search: Search, base: FittedCandidate, law_map: LawMap):
        time = search.data.time
        self._shortest = float(np.median(np.diff(time)))
        # where a curve may step, each of its values is felt for a moment only
        self._search = replace(search, patience=_PATIENCE, shortest_lag=_NO_LAG * self._shortest)
        self._base = base
        self._law_map = law_map
        self._longest = float(time[-1] - time[0])
        self._starts_unknown = any(
            name in search.base.layout.start_parameters for name in search.parameters
        )

    def out_of_time(self) -> bool:
        """Return whether there is no time for the next fit."""
        return self._search.budget.spent()

    def first(self, entry: Entry) -> FittedEntry | None:
        """Fit an entry roughly: in proportion behind a lag, which is a relaxation, or as a curve.

        None if the model cannot be simulated with it.
        """
        fitted = _or_none(
            lambda: self._in_proportion(entry) if entry.signal.constant else self._as_curve(entry)
        )
        if fitted is None:
            return None
        # a simulation that ran away leaves figures that are none
        is_sane = self._base.fit.bic - fitted.criterion < _MOST * self._base.fit.samples
        return fitted if is_sane else None

    def settled(self, one: FittedEntry) -> FittedEntry:
        """Continue the fit of a curve to its end; what is in proportion is fitted already."""
        fit = one.fit
        table = one.table
        if fit is None or table is None:
            return one
        return _or_none(lambda: _of_table(one.entry, fit, fit.settled(table))) or one

    def bent(self, one: FittedEntry) -> FittedEntry:
        """Return the likelier of an entry in proportion and as a curve, where it may bend."""
        if one.straight is None or one.entry.signal.memory in RELAXATIONS:
            return one
        other = _or_none(lambda: self.settled(self._as_curve(one.entry)))
        return other if other and other.criterion < one.criterion else one

    def shapes(self, one: FittedEntry) -> list[tuple[str, FittedCandidate]]:
        """Return shapes that come near an entry, fitted in the model, the best first."""
        known = {"linear": one.straight} if one.straight else {}
        if one.straight is not None and one.entry.signal.memory in RELAXATIONS:
            return [("linear", one.straight)]
        signal = self.signal(one.entry, zero_of(one.entry.basis))
        near = [
            like
            for like in likenesses(one.entry.basis, one.curve, signal.scale, zero=signal.zero)
            if like.shape not in known
        ][:_SHAPES]
        tried = parallel_map(lambda like: _or_none(lambda: self._shaped(one, like)), near)
        fitted = [
            *known.items(),
            *((like.shape, model) for like, model in zip(near, tried, strict=True) if model),
        ]
        several: dict[str, FittedCandidate] = {}
        for shape, model in sorted(fitted, key=lambda pair: pair[1].fit.bic):
            width = model.fit.values.get(f"{model.effect.neutral}_width", 0.0)
            several.setdefault(shape_name(shape, width, signal.scale), model)
        return list(several.items())

    def curve_amount(self, one: FittedEntry) -> FittedCandidate | None:
        """Fit how much there is of a fitted curve, whose values stay as they are.

        Returns
        -------
        FittedCandidate or None
            The model with the curve as an effect like any other, its amount being the switch; an
            entry in proportion is one already. None if it cannot be simulated.
        """
        if one.straight is not None:
            return one.straight
        values = [float(y) for y in one.curve.values]
        effect = self.effect(one.entry, SmoothTable(_knots(one.entry), values, fixed=True))
        return _or_none(lambda: self._fitted(effect, _own(one, effect) | {effect.neutral: 1.0}))

    def effect(
        self, entry: Entry, shape: str | SmoothTable | None = None, beside: bool = False
    ) -> type[Effect]:
        """Make the effect of an entry: a table over its knots unless a shape is given."""
        cls = self._base.candidate.cls
        size = float(np.abs(entry.curve.values).max()) or 1.0
        unit = unit_of(cls, entry.law)
        is_bent = isinstance(shape, str) and shape != "linear"
        return correction(
            cls,
            entry.law,
            self.signal(entry, zero_of(entry.basis) if is_bent else 0.0),
            SmoothTable(_knots(entry)) if shape is None else shape,
            unit,
            size,
            kind=entry.kind,
            number=self._number(entry),
            beside=beside,
        )

    def signal(self, entry: Entry, zero: float = 0.0) -> SignalTerm:
        """Return the signal of an entry, as a correction takes it."""
        signal = entry.signal
        unit = unit_of(self._base.candidate.cls, signal.name)
        scale = float(np.abs(entry.basis.knots - zero).max()) or 1.0
        return SignalTerm(
            signal.name,
            signal.memory,
            signal.constant,
            unit,
            scale,
            self._law_map.begins(entry),
            zero,
        )

    def _number(self, entry: Entry) -> int:
        """Return the number of a correction, from 1; every lag of a signal in a law has its own."""
        beside = (
            [e.term.family for e in self._base.candidate.effects] if entry.signal.memory else []
        )
        return 1 + beside.count(entry.family)

    def _shaped(self, one: FittedEntry, like: Likeness) -> FittedCandidate:
        """Return a shape in the place of a curve, with a constant where that is likelier."""
        tried = []
        for beside in {bool(like.beside), False}:
            effect = self.effect(one.entry, like.shape, beside=beside)
            own = effect.neutral
            start = {own: like.amount, f"{own}_width": like.width, f"{own}_beside": like.beside}
            known = {n: v for n, v in start.items() if n in effect.declared}
            tried.append(self._fitted(effect, _own(one, effect) | known))
        return min(tried, key=lambda model: model.fit.bic)

    def _as_curve(self, entry: Entry) -> FittedEntry:
        base = self._base
        law_map = self._law_map
        fit = CurveFit(self._search, base, self.effect(entry), entry.basis)
        starts = [base.fit.values, law_map.courses[entry.driven].values, law_map.beside(entry)]
        return _of_table(entry, fit, fit.first(starts, entry.curve, law_map.floor))

    def _in_proportion(self, entry: Entry) -> FittedEntry:
        effect = self.effect(entry, "linear")
        knots = entry.basis.knots
        slope = float(np.polyfit(knots, entry.curve.values, 1)[0])
        model = self._fitted(effect, {effect.neutral: slope})
        k = model.problem.names.index(effect.neutral)
        amount = model.fit.values[effect.neutral]
        slope_of_scale = model.problem.scales[k].slope(model.fit.q[k])
        variance = float(model.fit.covariance.matrix[k, k]) * slope_of_scale**2
        shape = np.outer(knots, knots)
        gain = self._base.fit.bic - model.fit.bic
        curve = Curve(gain, amount * knots, variance * shape, amount**2 * shape, 0.0)
        fitted = _with_constant(entry, model)
        constant = fitted.signal.constant
        if constant and not self._shortest < constant < self._longest:
            raise UserError(f"{fitted.label}: no lag, but the signal itself, or a constant")
        return FittedEntry(fitted, curve, model.fit.bic, model.fit.values, straight=model)

    def _fitted(self, effect: type[Effect], start: dict[str, float]) -> FittedCandidate:
        """Fit the base with one more effect, from the base's values and those given."""
        base = self._base
        candidate = base.candidate.with_effect(effect)
        if self._starts_unknown and any(
            name.endswith("_memory_constant") for name in effect.declared
        ):
            # where start values are unknown, so is what is remembered at the start
            starts = (*candidate.starts, *effect.layout.start_of.values())
            candidate = replace(candidate, starts=starts)
        values = {**self._search.fixed, **base.fit.values, **start}
        fitted = self._search.fit_from(candidate, base, values)
        fitted.problem.forget_simulation()
        return fitted


def _knots(entry: Entry) -> list[float]:
    """Return the knots of an entry's curve, in the unit of its signal."""
    return [float(x) for x in entry.basis.knots]


def _or_none(work: Callable[[], T]) -> T | None:
    """Return the result of a fit, or None if the model cannot be simulated or runs away."""
    try:
        with np.errstate(all="ignore"):
            return work()
    except FAILURES:
        return None


def _of_table(entry: Entry, fit: CurveFit, table: FittedCurve) -> FittedEntry:
    return FittedEntry(entry, table.curve, table.criterion, table.values, fit, table)


def _own(one: FittedEntry, effect: type[Effect]) -> dict[str, float]:
    """Return values of a fit that another form of the entry has as well."""
    known = {p.name for p in effect.layout.parameters}
    return {n: v for n, v in one.values.items() if "_at_" not in n or n in known}


def _with_constant(entry: Entry, model: FittedCandidate) -> Entry:
    """Return the entry with the lag that was fitted."""
    fitted = [
        model.fit.values[n] for n in own_parameters(model.effect) if n.endswith("_memory_constant")
    ]
    return replace(entry, signal=replace(entry.signal, constant=fitted[0])) if fitted else entry


def unit_of(cls: type[Component], name: str) -> str:
    """Return the SI unit of an input, a state, a law, or the time."""
    layout = cls.layout
    declared = {v.name: v.unit for v in (*layout.inputs, *layout.states, *layout.discretes)} | {
        "time": "s"
    }
    return declared.get(name) or {law.name: law.unit for law in list_laws(cls)}.get(name) or "1"
