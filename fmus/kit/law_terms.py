"""Effects that add a term to a law, as a diagnosis finds it.

A term is a function of a signal, or of a memory of it. A law as a signal has its value without any
terms: a term that hung on what other terms add would close an algebraic loop.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from math import isclose, isfinite
from typing import Any

from .component import Component
from .curves import coefficient, per
from .declare import ONCE, Constant, Discrete, Output, Parameter, State
from .effects import Effect, Term, effect_maker, made_by, make_effect, stack, unstack
from .errors import UserError
from .functions import absolute, exp, maximum, minimum, smooth_table, sqrt, tanh, where

ABRUPT = 0.004  # of the scale, within which a step is made, as in free_run.c
ROUNDED = 0.02  # of the scale, within which a root is straight, as in free_run.c
_FROM_REST = {
    "heat": "lag of the square of {}",
    "integral": "integral of {} since the start",
    "throughput": "integral of the modulus of {} since the start",
}
STEEPEST = 30.0  # exponent, beyond which an exponential is constant, as in free_run.c
_WITH_WIDTH = ("dry", "dead_zone", "above", "below", "exponential", "levelling", "sinh", "step")
_FOLLOWING = ("play", "dahl", "backlash")  # at sample instants
_MEMORIES = ("none", "lag", "fading", "two_lags", "rate_limit", *_FOLLOWING, *_FROM_REST)
_WIDEST = 1e6  # of a width or a constant, in its value, and the reciprocal of the smallest


@dataclass(frozen=True)
class LawTerm:
    """A term of a law, in SI units.

    Attributes
    ----------
    law, signal : str
        The signal is an input, a state, a law or ``time``; empty for a constant.
    shape, memory : str
        Names of a `Shape` and a `Memory`, in small letters.
    stem : str
        Name of the parameter that switches it; those of other variables begin with it.
    amount_unit, signal_unit : str
        Of the coefficient (of a curve, of its values), and of the signal as the shape has it: of
        heat its square, of an integral its product with a second.
    power : float
        Power of the signal in the coefficient's unit.
    size, scale, middle : float
        Typical magnitude of the law, or 1 for a change in percent; of the signal; and its origin.
    factor : str
        Law or signal that it is in proportion to; empty for none.
    places : tuple of float
        Values of the signal at the knots of a curve, in equal steps; see
        `fmus.kit.functions.smooth_table`.
    period : float
        Between the instants at which play or a Dahl element follows its signal, s.
    is_held : bool
        Whether such a memory keeps its value between these instants.
    known : int
        Number of effects that the model had when the term was found: laws are seen with these.
    range : tuple of float
        Smallest and largest value of the signal of a curve in the records from which it is.
    """

    law: str
    signal: str
    shape: str
    memory: str
    stem: str
    amount_unit: str
    signal_unit: str
    power: float = 0.0
    size: float = 1.0
    scale: float = 1.0
    middle: float = 0.0
    factor: str = ""
    places: tuple[float, ...] = ()
    period: float = 0.0
    is_held: bool = True
    known: int = 0
    range: tuple[float, ...] = ()


def check_term(term: LawTerm, laws: Collection[str], signals: Collection[str]) -> None:
    """Refuse a term that comes from a file, unless a model with these laws and signals can have it.

    Raises
    ------
    UserError
        If it names something else, or one of its values is not finite or has the wrong sign.
    """
    known: tuple[tuple[str, Collection[str]], ...] = (
        (term.law, laws),
        (term.signal, {*signals, "time", ""}),
        (term.factor, {*signals, ""}),
        (term.shape, {*_SHAPES, "curve"}),
        (term.memory, _MEMORIES),
    )
    unknown = next((name for name, names in known if name not in names), None)
    if unknown is not None:
        raise UserError(f"the term {term.stem!r} has {unknown!r}, which the model does not have")
    if not term.stem.isidentifier():
        raise UserError(f"the term {term.stem!r} has a name that no parameter can have")
    values = (term.power, term.middle, *term.places, *term.range)
    positive = (term.size, term.scale, 1.0 + term.period, 1.0 + term.known)
    if not (all(map(isfinite, (*values, *positive))) and min(positive) > 0.0):
        raise UserError(f"the term {term.stem!r} has a value that is not finite, or not positive")
    steps = [high - low for low, high in pairwise(term.places)]
    is_even = all(isclose(step, steps[0], rel_tol=1e-6) and step > 0.0 for step in steps)
    if bool(steps) is not (term.shape == "curve") or not is_even:
        raise UserError(f"the term {term.stem!r} has no knots of a curve in equal steps upwards")


@cache
def _without(
    cls: type[Component], effects: tuple[type[Effect], ...], known: int
) -> type[Component]:
    """Return the class of a component without some effects, and without terms after the known."""
    component, stacked = unstack(cls)
    terms = [effect for effect in stacked[known:] if made_by(effect) is law_term_effect]
    others = [effect for effect in stacked if effect not in (*terms, *effects)]
    return stack(component, *others) if others else component


def base_value(
    self: Any,
    name: str,
    effects: tuple[type[Effect], ...] = (),
    known: int = 0,
    arguments: tuple[Any, ...] = (),
) -> Any:
    """Return an input, a state, the time, or a law without terms and without some effects.

    Parameters
    ----------
    self : Component
        Of a stacked class.
    name : str
    effects : tuple of type[Effect]
        That are stacked on it, and change the law: those of a file by `--effect-out` leave out each
        other.
    known : int
        Number of effects whose terms the law has.
    arguments : tuple
        Of a law that takes some.
    """
    value = getattr(self, name)
    if not callable(value):
        return value
    stacked = next(part for part in type(self).__mro__ if made_by(part) is stack)
    plain: Any = object.__new__(_without(stacked, effects, known))
    vars(plain).update(vars(self))
    plain._kept = None
    return getattr(plain, name)(*arguments)


@effect_maker
def law_term_effect(component: type[Component], law: str, term: LawTerm) -> type[Effect]:
    """Make the effect that adds a term to a law.

    Parameters
    ----------
    component : type[Component]
        Has the law and the signal.
    law : str
        Method that the term is added to; its arguments are passed on.
    term : LawTerm

    Returns
    -------
    type[Effect]
        With the parameter ``<stem>``: the coefficient of a shape, or the factor of a curve, whose
        values at its knots are ``<stem>_at_<k>``. If its range is known, the output
        ``<stem>_signal`` declares it. A shape may have a width, ``<stem>_width``;
        constants of a memory end in ``_time``, ``_ratio``, ``_rate`` and ``_way``.
    """
    stem = term.stem
    memory = _memory(term)

    # `effect` is assigned below, before the first call
    def corrected(self: Any, *arguments: Any) -> Any:
        base = getattr(super(effect, self), law)(*arguments)
        addition = _shape_value(self, term, memory.value(self))
        if term.factor:
            own = arguments if term.factor == law else ()
            addition = addition * base_value(self, term.factor, known=term.known, arguments=own)
        return base + addition

    members = _shape_parameters(term) | memory.members
    if term.range:
        members[f"{stem}_signal"] = _curve_signal(term, memory.value)
    # a new coefficient of these would act from the start
    members[stem].tunable = term.memory not in ("integral", "throughput")
    text = f"{law} hangs on {term.signal or 'a constant'}: {term.shape} shape"
    if term.memory != "none":
        text += f" of its {term.memory}"
    effect = make_effect(
        f"{stem}_term".title().replace("_", ""),
        {"__doc__": f"{text}; {stem} = 0 is the base model.", "__module__": __name__}
        | members
        | {law: corrected},
        id=law,
        title="",
        term=Term(law, term.signal, term.shape, f"{law} over {term.signal}", stem),
        neutral=stem,
        assumption=f"{law} does not hang on {term.signal or 'a constant'} like this",
    )
    return effect


def _positive(value: float, unit: str, doc: str) -> Any:
    """Declare a parameter that is positive by nature."""
    return Parameter(value, unit, min=value / _WIDEST, max=value * _WIDEST, nominal=value, doc=doc)


def _shape_parameters(term: LawTerm) -> dict[str, Any]:
    """Return the parameters of a shape by name, the switch first."""
    stem = term.stem
    nominal = term.size / term.scale**term.power
    declared = {}
    if term.places:
        declared[stem] = coefficient("1", 1.0, f"how much of its curve {term.law} has")
        for k, place in enumerate(term.places):
            about_knot = f"addition to {term.law} at {term.signal} = {place:g}"
            declared[f"{stem}_at_{k}"] = coefficient(term.amount_unit, nominal, about_knot)
        return declared
    about_part = f"part of {term.law} over {term.signal or 'nothing'} (a)"
    declared[stem] = coefficient(term.amount_unit, nominal, about_part)
    if term.shape in _WITH_WIDTH:
        about_width = f"{term.signal} at which {stem} bends (w)"
        declared[f"{stem}_width"] = _positive(term.scale, term.signal_unit, about_width)
    return declared


_SHAPES: dict[str, Callable[[Any, Any, Any], Any]] = {
    "constant": lambda x, w, s: 1.0,
    "linear": lambda x, w, s: x,
    "modulus": lambda x, w, s: absolute(x),
    "square": lambda x, w, s: x * x,
    "odd_square": lambda x, w, s: x * absolute(x),
    "cube": lambda x, w, s: x * x * x,
    "root": lambda x, w, s: x / sqrt((absolute(x) + ROUNDED * s) * s),
    "dry": lambda x, w, s: tanh(x / w),
    "dead_zone": lambda x, w, s: x - maximum(minimum(x, w), -w),
    "above": lambda x, w, s: maximum(x - w, 0.0 * w),
    "exponential": lambda x, w, s: exp(minimum(x / w, STEEPEST)) - 1.0,
    "levelling": lambda x, w, s: 1.0 - exp(minimum(-x / w, STEEPEST)),
    "sinh": lambda x, w, s: 0.5 * (exp(minimum(x / w, STEEPEST)) - exp(minimum(-x / w, STEEPEST))),
    "step": lambda x, w, s: 0.5 + 0.5 * tanh((x - w) / (ABRUPT * s)),
    "below": lambda x, w, s: minimum(x + w, 0.0 * w),
}


def _shape_value(self: Any, term: LawTerm, x: Any) -> Any:
    """Return the value of a term at a value of its signal, or of the memory of it."""
    amount = getattr(self, term.stem)
    if term.places:
        return amount * _curve_value(self, term, x)
    shifted = x - Constant(term.middle, term.signal_unit) if term.middle else x
    width = getattr(self, f"{term.stem}_width", 1.0)
    scale = Constant(term.scale, term.signal_unit)
    return amount * _SHAPES[term.shape](shifted, width, scale)


def _curve_signal(term: LawTerm, value: Callable[[Any], Any]) -> Any:
    """Declare the signal of a curve as an output, of which a run tells when it leaves its range."""
    return Output(
        term.signal_unit,
        min=term.range[0],
        max=term.range[-1],
        nominal=term.scale,
        measured=False,
        doc=f"{term.signal}, over which the curve of {term.law} was identified in this range only",
    )(value)


def _curve_value(self: Any, term: LawTerm, x: Any) -> Any:
    """Return the value of a curve, constant beyond its first and last knot."""
    first = Constant(term.places[0], term.signal_unit)
    spacing = Constant(term.places[1] - term.places[0], term.signal_unit)
    last = len(term.places) - 1
    values = [getattr(self, f"{term.stem}_at_{k}") for k in range(last + 1)]
    # from one on: at a knot at zero a smooth table has a corner
    place = 1.0 + minimum(maximum((x - first) / spacing, 0.0), float(last))
    return smooth_table(place, [1.0 + k for k in range(last + 1)], values)


@dataclass(frozen=True)
class _Memory:
    """The variables of a memory by name, and its value, from the component instance."""

    members: dict[str, Any]
    value: Callable[[Any], Any]


def _memory(term: LawTerm) -> _Memory:
    """Return the memory through which a term sees its signal."""
    if not term.signal:
        return _Memory({}, lambda self: 0.0)
    if term.memory == "none":
        return _Memory({}, lambda self: base_value(self, term.signal, known=term.known))
    if term.memory in _FROM_REST:
        return _from_rest(term)
    return _sampled(term) if term.memory in _FOLLOWING else _continuous(term)


def _from_rest(term: LawTerm) -> _Memory:
    """Return a memory that begins at zero: of the square of a signal, or an integral."""
    time = f"{term.stem}_time"
    state = f"{term.stem}_{term.memory}"

    def rate(self: Any) -> Any:
        now = base_value(self, term.signal, known=term.known)
        if term.memory == "heat":
            return (now * now - getattr(self, state)) / getattr(self, time)
        return absolute(now) if term.memory == "throughput" else now

    members = {
        state: State(
            term.signal_unit,
            rate=f"{state}_rate",
            nominal=term.scale,
            doc=_FROM_REST[term.memory].format(term.signal),
        ),
        f"{state}_rate": rate,
    }
    if term.memory == "heat":
        members[time] = _positive(1.0, "s", f"time constant of {term.stem}")
    return _Memory(members, lambda self: getattr(self, state))


def _continuous(term: LawTerm) -> _Memory:
    """Return a memory with a rate, which begins in equilibrium with its signal.

    Its state is the change since the start, as a start value cannot be computed from an input.
    """
    stem = term.stem
    is_behind = term.memory in ("fading", "two_lags", "rate_limit")
    unit = term.signal_unit
    change = f"{stem}_change"
    begin = f"{stem}_begin"
    begun = f"{stem}_begun"
    time = f"{stem}_time"

    def now(self: Any) -> Any:
        return base_value(self, term.signal, known=term.known)

    def remembered(self: Any) -> Any:
        start = where(getattr(self, begun), getattr(self, begin), now(self))
        return start + getattr(self, change)

    def rate(self: Any) -> Any:
        gap = now(self) - remembered(self)
        plain = gap / getattr(self, time)
        if term.memory == "two_lags":
            ratio = getattr(self, f"{stem}_ratio")
            return where(gap < Constant(0.0, unit), plain / ratio, plain)
        if term.memory == "rate_limit":
            most = getattr(self, f"{stem}_rate")
            return most * tanh(plain / most)
        return plain

    def value(self: Any) -> Any:
        before = remembered(self)
        return now(self) - before if is_behind else before

    members = {
        time: _positive(1.0, "s", f"time constant of {stem}"),
        change: State(
            unit,
            rate=f"{change}_rate",
            nominal=term.scale,
            doc=f"gain of the memory of {stem} since the start",
        ),
        f"{change}_rate": rate,
        begin: _once(term, begin, f"{term.signal} at the start"),
        f"{begin}_update": now,
        begun: _flag(begun, ONCE),
        f"{begun}_update": lambda self: 1.0,
    }
    if term.memory == "two_lags":
        members[f"{stem}_ratio"] = _positive(1.0, "1", "time constant of falling over rising")
    if term.memory == "rate_limit":
        members[f"{stem}_rate"] = _positive(
            term.scale, per(unit, "s"), f"largest rate of the memory of {stem}"
        )
    return _Memory(members, value)


def _sampled(term: LawTerm) -> _Memory:
    """Return a memory without a rate, which follows its signal at sample instants.

    With the displacement w, play stays within w of its signal s, of which backlash is the rest, and
    a Dahl element z follows its change: dz = ds - |ds| z/w.
    """
    stem = term.stem
    memory = f"{stem}_memory"
    previous = f"{stem}_before"
    begun = f"{stem}_begun"
    way = f"{stem}_way"
    is_dahl = term.memory == "dahl"

    def now(self: Any) -> Any:
        return base_value(self, term.signal, known=term.known)

    def begin(self: Any) -> Any:
        return 0.0 * now(self) if is_dahl else now(self)

    def followed(self: Any) -> Any:
        z = getattr(self, memory)
        w = getattr(self, way)
        if not is_dahl:
            return maximum(minimum(z, now(self) + w), now(self) - w)
        change = now(self) - getattr(self, previous)
        share = exp(-absolute(change) / w)
        end = where(change < Constant(0.0, term.signal_unit), -w, w)
        return share * z + (1.0 - share) * end

    def update(self: Any) -> Any:
        return where(getattr(self, begun), followed(self), begin(self))

    def held(self: Any) -> Any:
        return where(getattr(self, begun), getattr(self, memory), begin(self))

    members = {
        way: _positive(term.scale, term.signal_unit, f"way until {stem} gives (w)"),
        memory: _at_instants(term, memory, f"memory of {stem}"),
        f"{memory}_update": update,
        begun: _flag(begun, term.period),
        f"{begun}_update": lambda self: 1.0,
    }
    if is_dahl:
        members[previous] = _at_instants(term, previous, f"{term.signal} at the instant before")
        members[f"{previous}_update"] = now
    shown = held if term.is_held else update
    if term.memory == "backlash":
        return _Memory(members, lambda self: now(self) - shown(self))
    return _Memory(members, shown)


def _once(term: LawTerm, name: str, doc: str) -> Any:
    """Declare a discrete state that is sampled once, at the start."""
    return replace(_at_instants(term, name, doc), period=ONCE)


def _at_instants(term: LawTerm, name: str, doc: str) -> Any:
    """Declare a discrete state that is sampled with the period of a term."""
    return Discrete(
        term.signal_unit,
        update=f"{name}_update",
        period=term.period,
        nominal=term.scale,
        is_memory=True,
        doc=doc,
    )


def _flag(name: str, period: float) -> Any:
    """Declare whether the first sample instant has passed."""
    return Discrete(
        "1",
        update=f"{name}_update",
        period=period,
        type="boolean",
        is_memory=True,
        doc="whether it has begun",
    )
