"""The picture of an effect: its law over its signal, with the effect and without it.

An effect with a memory is no function of its signal and has no picture: over the signal it would
be a tangle of lines.
"""

from __future__ import annotations

from inspect import isfunction
from typing import Any, NamedTuple

import numpy as np

from fmus.kit import Component, Effect, UserError
from fmus.kit.arrays import Array
from fmus.kit.effects import made_with, unstack
from fmus.kit.symbolic import list_laws
from fmus.kit.titles import effect_title, in_words, law_title, within_sentence
from fmus.kit.units import with_prefix
from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.report.figures import COLOURS, Chart
from orchestration.discrepancy.report.wording import EXTENDED
from orchestration.reporting import pictures
from orchestration.reporting.html import MOST, Markup, Panel, Trace, stacked

_HEIGHT = 260  # pixels
WITHOUT = "#52616e"  # of no model: the parameters are those with the effect
_BINS = 60  # of a signal, within which a function of it hardly changes
_SCATTER = 0.1  # of the spread of what an effect does, that it may have within a bin
_MOST_POINTS = 300  # that are drawn of a record
_NUDGE = 1e-4  # of what a law spans, by which it is changed to see which output shows it
_SHOWS = 0.1  # of the most that an output answers, below which it tells nothing of the law
_LOST = 5.0  # times what the law spans, from which on its scatter would hide it
_FAILURES = (ArithmeticError, AttributeError, KeyError, TypeError, UserError, ValueError)


class AxisLabel(NamedTuple):
    """The name for people of a law or a signal, and its SI unit."""

    title: str
    unit: str

    def scaled(self, *values: Array) -> tuple[str, list[Array]]:
        """Return the title of an axis, and values in the unit with a prefix that it has.

        Tenths of a unit stay in it: a size of the effect, beside the picture, may be above 1.
        """
        largest = max(float(np.abs(each).max()) for each in values) or 1.0
        number, unit = with_prefix(largest, self.unit, 1.0 if 0.1 <= largest < 1.0 else largest)
        title = self.title if unit == "1" else f"{self.title} [{unit}]"
        return title, [each * (number / largest) for each in values]


class LawValues(NamedTuple):
    """A law along a record, in the order of time.

    Attributes
    ----------
    law, signal : AxisLabel
        What is drawn upwards, and what the effect is over; that has no title where it has none.
    x : ndarray, shape (n,)
        The signal, SI.
    with_effect, without : ndarray, shape (n,)
        The law, SI, for the same states.
    measured : ndarray, shape (n,)
        The law that a measured output shows, given all others, SI; NaN where none does.
    shown_by : str
        That output, in words; empty where there is none.
    """

    law: AxisLabel
    signal: AxisLabel
    x: Array
    with_effect: Array
    without: Array
    measured: Array
    shown_by: str = ""

    @property
    def is_function(self) -> bool:
        """True if what the effect does is a function of its signal, as of no memory."""
        if not self.signal.title or not np.ptp(self.x) > 0.0:
            return False
        more = self.with_effect - self.without
        order = np.argsort(self.x)
        bins = [part for part in np.array_split(more[order], _BINS) if len(part) > 1]
        within = float(np.median([np.std(np.diff(part)) for part in bins])) if bins else np.inf
        return within < _SCATTER * float(np.std(more))


def effect_chart(diagnosis: Diagnosis, chosen: FittedCandidate) -> Chart | None:
    """Draw the law of an effect with and without it, over its signal or over time.

    Parameters
    ----------
    diagnosis : Diagnosis
    chosen : FittedCandidate
        Whose last effect is drawn.

    Returns
    -------
    Chart or None
        None where the law cannot be evaluated along the record, or is no function of its signal.
    """
    try:
        values = law_values(diagnosis, chosen.effect)
    except _FAILURES:
        return None
    if not np.isfinite(values.with_effect + values.without).all():
        return None
    if not values.is_function:
        return None
    title = within_sentence(effect_title(chosen.effect))
    words = (
        f"Points: the {values.shown_by} as measured, less what all other laws of the model make"
        " of it."
        if values.shown_by
        else "No measured output shows this law at the same instant, so there are no points."
        " Ticks below: where the record has been."
    )
    return Chart(_draw(values), f"The law with and without {title}, all else the same. {words}")


def _draw(values: LawValues) -> Markup:
    """Draw the law without and with its effect over the signal, and what the record shows of it."""
    order = np.argsort(values.x)
    across, (x,) = values.signal.scaled(values.x)
    along = np.linspace(x.min(), x.max(), MOST)
    curves = [
        np.interp(along, x[order], law[order]) for law in (values.without, values.with_effect)
    ]
    known = np.flatnonzero(np.isfinite(values.measured) | (not values.shown_by))
    thinned = known[np.unique(np.linspace(0, len(known) - 1, _MOST_POINTS).astype(int))]
    title, (without, with_effect, measured) = values.law.scaled(*curves, values.measured[thinned])
    traces = [
        Trace("without the effect", along, without, WITHOUT, 2.0),
        Trace("with the effect", along, with_effect, COLOURS[EXTENDED], 2.0),
    ]
    if values.shown_by:
        points = Trace("measured", x[thinned], measured, pictures.MEASURED, 3.0, dots=True)
        traces.insert(0, points)
    else:
        foot = np.full(len(thinned), min(without.min(), with_effect.min()))
        traces.append(Trace("the record", x[thinned], foot, pictures.MEASURED, 1.0, dots=True))
    return stacked([Panel(title, _HEIGHT, traces)], across)


def law_values(diagnosis: Diagnosis, effect: type[Effect]) -> LawValues:
    """Evaluate the law of an effect along the first run of the estimation data.

    Parameters
    ----------
    diagnosis : Diagnosis
    effect : type[Effect]
        One of those that were named.

    Returns
    -------
    LawValues
    """
    best = diagnosis.selection.best
    cls = best.candidate.cls
    one = _along_record(diagnosis, best)
    law = _law_of(effect, cls)
    signal = _signal_of(one, effect)
    with_effect = _full(one, _called(one, law))
    x = _full(one, _called(one, signal) if signal else one.time)
    unit = _unit(one, cls, law, with_effect)
    measured, shown_by = _shown_law(diagnosis, one, law, with_effect)
    setattr(one, effect.neutral, _neutral_value(effect))
    without = _full(one, _called(one, law))
    if signal == law:  # an input, which is drawn over what was commanded
        x = without
    return LawValues(
        AxisLabel(law_title(cls, law), unit),
        _signal_label(cls, effect, signal),
        x,
        with_effect,
        without,
        measured,
        shown_by,
    )


def _shown_law(diagnosis: Diagnosis, one: Any, law: str, with_effect: Array) -> tuple[Array, str]:
    """Return a law as the measured outputs show it, and the output that shows it best.

    An output that answers to the law at the same instant, by so much per change of it, differs from
    its measurement by that times what the law differs from its own: the partial residuals of Larsen
    and McCleary, Technometrics 14(3), 1972.

    Returns
    -------
    measured : ndarray, shape (n,)
        SI; NaN where nothing was measured, or the output does not answer.
    shown_by : str
        The output in words; empty where none answers, or where noise would hide the law.
    """
    best, shown_by = np.full(len(one.time), np.nan), ""
    span = float(np.ptp(with_effect)) or float(np.abs(with_effect).max())
    best_scatter = _LOST * span
    nudged = _nudged(one, law, _NUDGE * span)
    for output, y in diagnosis.estimation.measured.items():
        simulated = _full(one, _called(one, output))
        answer = (_full(nudged, _called(nudged, output)) - simulated) / (_NUDGE * span)
        answers = np.abs(answer) > _SHOWS * np.abs(answer).max()
        run = diagnosis.estimation.runs[0].samples
        away = np.where(answers, y[run] - simulated, np.nan) / np.where(answers, answer, 1.0)
        scatter = float(np.nanstd(away)) if np.isfinite(away).any() else np.inf
        if scatter < best_scatter:
            title = law_title(type(one), output)
            best, best_scatter, shown_by = with_effect + away, scatter, title
    return best, shown_by


def _nudged(one: Any, law: str, change: float) -> Any:
    """Return the same instance with a law, or an input, that gives so much more."""

    def more(self: Any, *arguments: Any) -> Any:
        return getattr(super(nudged, self), law)(*arguments) + change

    def arriving(self: Any) -> Any:
        return getattr(super(nudged, self), law) + change

    changed: Any = more
    if not callable(getattr(one, law)):
        changed = property(arriving, lambda self, value: self.__dict__.update({law: value}))
    nudged = type(type(one).__name__, (type(one),), {law: changed, "__module__": __name__})
    other = nudged()
    other.__dict__.update(one.__dict__)
    return other


def _unit(one: Any, cls: type[Component], law: str, values: Array) -> str:
    """Return the SI unit of a law; of one with arguments that of the output that shows it."""
    known = unit_of(cls, law)
    if known != "1":
        return known
    for output in cls.layout.measured_outputs:
        if np.array_equal(_full(one, _called(one, output.name)), values):
            return output.unit
    return known


def _neutral_value(effect: type[Effect]) -> float:
    """Return the value of its switch at which an effect does nothing."""
    layout = effect.layout
    return float(layout.parameters[layout.parameter_index[effect.neutral]].start)


def _along_record(diagnosis: Diagnosis, best: FittedCandidate) -> Any:
    """Return an instance of the best model whose inputs and states are those of its run."""
    data = diagnosis.estimation
    values = best.parameters
    run = data.runs[0]
    signals = best.problem.model.run(data.time, data.inputs, values, runs=data.runs).signals
    one: Any = best.candidate.cls()
    layout = one.layout
    one.__dict__.update(
        {n: v for n, v in run.values(values).items() if n in layout.parameter_index}
    )
    for state in (*layout.states, *layout.discretes):
        setattr(one, state.name, signals[state.name][run.samples])
    for name, fed in data.inputs.items():
        setattr(one, name, np.broadcast_to(fed, data.time.shape)[run.samples])
    one.time = data.time[run.samples] - run.ahead
    return one


def unit_of(cls: type[Component], name: str) -> str:
    """Return the SI unit of an input, a state, a law, or the time."""
    layout = cls.layout
    variables = (*layout.inputs, *layout.states, *layout.discretes)
    declared = {v.name: v.unit for v in variables} | {"time": "s"}
    return declared.get(name) or {law.name: law.unit for law in list_laws(cls)}.get(name) or "1"


def _law_of(effect: type[Effect], cls: type[Component]) -> str:
    """Return the law, the output or the input that an effect changes."""
    if effect.output or effect.term.law:
        return effect.output or effect.term.law
    base = unstack(cls)[0]
    overridden = [n for n, law in vars(effect).items() if isfunction(law) and hasattr(base, n)]
    return overridden[0] if overridden else effect.term.signal


def _called(one: Any, law: str) -> Any:
    """Return the value of a law, of one with arguments where an output or a rate calls it first."""
    held = getattr(one, law)
    if not callable(held):
        return held
    try:
        return held()
    except TypeError:  # it has arguments
        return _first_call(one, law)


def _first_call(one: Any, law: str) -> Any:
    """Return what a law gives where it is first called by the outputs and the rates."""
    values: list[Any] = []

    def followed(self: Any, *arguments: Any) -> Any:
        value = getattr(super(watched, self), law)(*arguments)
        values.append(value)
        return value

    watched = type(type(one).__name__, (type(one),), {law: followed, "__module__": __name__})
    spy = watched()
    spy.__dict__.update(one.__dict__)
    for compute in (spy.outputs, spy.rates):
        if not values:
            compute()
    return values[0]


def _full(one: Any, value: Any) -> Array:
    return np.broadcast_to(np.asarray(value, dtype=float), one.time.shape)


def _signal_of(one: Any, effect: type[Effect]) -> str:
    """Return the signal that an effect is over, or what it remembers of it; empty for none."""
    source = made_with(effect).get("signal")
    if getattr(source, "memory", ""):
        return f"{effect.neutral}_memory"
    name: str = getattr(source, "name", "") or effect.term.signal
    return name if hasattr(one, name) else ""


def _signal_label(cls: type[Component], effect: type[Effect], signal: str) -> AxisLabel:
    """Return that signal with its unit; without a title where there is none."""
    if not signal:
        return AxisLabel("", "1")
    is_own = signal in effect.declared
    title = in_words(effect.term.signal) if is_own else law_title(cls, signal)
    return AxisLabel(title, unit_of(cls, signal))
