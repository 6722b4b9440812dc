"""Effects of inputs: the laws see an input as it arrives, not as it was commanded.

Each function here makes an effect for one real input of a component, to be laid over it by
:func:`.stack`::

    stack(Motor, dead_zone(Motor, "voltage"))

A host sets the commanded value; at the neutral value of the effect the laws see just that. Effects
of one input are laid one over the other: the first one is next to the command, the last one next to
the laws.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from .component import Component
from .curves import per
from .declare import Declaration, InputDeclaration, Parameter, State
from .effects import Effect, Size, Term, effect_maker, make_effect
from .errors import UserError, suggestion
from .functions import clip, outside, sqrt
from .sampling import Sampling
from .titles import generic_title, in_words

_ANY = 1e6  # bound of parameters, in typical magnitudes of the input


class _ArrivingInput:
    """An input as laws see it: a law of the set value, or of the value that the effect below gives.

    Parameters
    ----------
    name : str
        The input.
    law : callable
        Gives the arriving value, from the component instance and the value below.

    Attributes
    ----------
    effect : type[Effect]
        The effect that it belongs to.
    """

    def __init__(self, name: str, law: Callable[[Any, Any], Any]):
        self.name = name
        self.law = law
        self.effect = Effect

    def __get__(self, one: Any, owner: Any = None) -> Any:
        if one is None:
            raise AttributeError(self.name)  # of the class there is a declaration only
        return self.law(one, self.below(one))

    def below(self, one: Any) -> Any:
        """Return the value that the effect below gives, or the value that was set."""
        try:
            return getattr(super(self.effect, one), self.name)
        except AttributeError:
            return one.__dict__[self.name]

    def __set__(self, one: Any, value: Any) -> None:
        one.__dict__[self.name] = value


@dataclass(frozen=True)
class _Change:
    """The change that an effect makes to an input.

    Attributes
    ----------
    text : str
        Its formula, for people.
    arrives : callable
        Gives the arriving value, from the component instance and the value below.
    declared : dict of str to Declaration
        Variables of the effect; the first parameter switches it.
    sizes : tuple of Size
    rates : Mapping of str to callable
        Laws for the rates of its states, from the component instance and the value below.
    family : str
        Name shared by effects that are one cause in several shapes, with a place for the input.
    """

    text: str
    arrives: Callable[[Any, Any], Any]
    declared: dict[str, Any]
    sizes: tuple[Size, ...]
    rates: Mapping[str, Callable[[Any, Any], Any]] = field(default_factory=dict)
    family: str = "{} as it arrives"


def _changed(id: str, name: str, doc: str, change: _Change) -> type[Effect]:
    """Make the effect of an input."""
    arriving = _ArrivingInput(name, change.arrives)

    def rate_law(rate: Callable[[Any, Any], Any]) -> Callable[[Any], Any]:
        return lambda self: rate(self, arriving.below(self))

    switch = next(n for n, value in change.declared.items() if isinstance(value, Declaration))
    effect = make_effect(
        f"{id}_of_{name}".title().replace("_", ""),
        {
            "__doc__": doc,
            "__module__": __name__,
            name: arriving,
            **change.declared,
            **{law: rate_law(rate) for law, rate in change.rates.items()},
        },
        id=id,
        title=generic_title(id, in_words(name)),
        term=Term("", name, change.text, change.family.format(name), name),
        assumption=f"{name} arrives as it is commanded",
        neutral=switch,
        sizes=change.sizes,
    )
    arriving.effect = effect
    return effect


def _input(
    component: type[Component], name: str, scale: float | None
) -> tuple[InputDeclaration, float]:
    """Return a real input and its typical magnitude."""
    known = {v.name: v for v in component.layout.inputs if v.type == "real"}
    if name not in known:
        label = component.name or component.__name__
        raise UserError(f"{label}: no real input named {name!r}{suggestion(name, known)}")
    return known[name], scale or known[name].nominal


def _switch(fed: InputDeclaration, size: float, doc: str, least: float = 0.0) -> Any:
    """Declare the parameter that switches an effect, a value of the input; without it at 0."""
    return Parameter(
        0.0,
        fed.unit,
        min=least * size,
        max=_ANY * size,
        nominal=0.1 * size,
        display=fed.display,
        doc=f"{doc}; 0 is without",
    )


@effect_maker
def dead_zone(component: type[Component], input: str, scale: float | None = None) -> type[Effect]:
    """Make the effect of a dead zone: within ``d`` of zero nothing arrives, beyond it the excess.

    Parameters
    ----------
    component : type[Component]
    input : str
        One of its real inputs.
    scale : float, optional
        Its typical magnitude; its nominal value unless given.

    Returns
    -------
    type[Effect]
        With the parameter ``<input>_dead_zone`` (d); 0 is the base model.

    Raises
    ------
    UserError
        If there is no such input.
    """
    fed, size = _input(component, input, scale)
    width = f"{input}_dead_zone"

    def arrives(self: Any, x: Any) -> Any:
        return outside(x, -getattr(self, width), getattr(self, width))

    switch = _switch(fed, size, f"{input} below which nothing arrives (d)")
    doc = "Dead zone of an input: within ``d`` of zero nothing arrives, beyond it what is more."
    change = _Change(
        "x - clip(x, -d, d)", arrives, {width: switch}, (Size("dead below {}", (width,)),)
    )
    return _changed("dead_zone", input, doc, change)


@effect_maker
def asymmetric_dead_zone(
    component: type[Component], input: str, scale: float | None = None
) -> type[Effect]:
    """Make the effect of a dead zone whose ends differ: from ``-r d`` to ``d`` nothing arrives.

    Parameters
    ----------
    component, input, scale
        See :func:`dead_zone`.

    Returns
    -------
    type[Effect]
        With parameters ``<input>_dead_zone_end`` (d), of which 0 is the base model, and
        ``<input>_dead_zone_ratio``.

    Raises
    ------
    UserError
        If there is no such input.
    """
    fed, size = _input(component, input, scale)
    end = f"{input}_dead_zone_end"
    ratio = f"{input}_dead_zone_ratio"

    def arrives(self: Any, x: Any) -> Any:
        return outside(x, -(getattr(self, ratio) * getattr(self, end)), getattr(self, end))

    declared = {
        end: _switch(fed, size, f"positive {input} below which nothing arrives (d)"),
        ratio: Parameter(
            1.0,
            "1",
            min=0.0,
            max=1e3,
            nominal=1.0,
            doc=f"lower end of it relative to {end} (r)",
        ),
    }
    doc = "Dead zone of an input whose ends differ: from ``-r d`` to ``d`` nothing arrives."
    sizes = (
        Size("dead up to {}", (end,)),
        Size("and down to {}", (end, ratio), fed.unit, lambda d, r: -r * d),
    )
    change = _Change("x - clip(x, -r d, d)", arrives, declared, sizes)
    return _changed("asymmetric_dead_zone", input, doc, change)


@effect_maker
def input_offset(
    component: type[Component], input: str, scale: float | None = None
) -> type[Effect]:
    """Make the effect of an offset: something arrives where nothing is commanded.

    Parameters
    ----------
    component, input, scale
        See :func:`dead_zone`.

    Returns
    -------
    type[Effect]
        With the parameter ``<input>_input_offset``; 0 is the base model.

    Raises
    ------
    UserError
        If there is no such input.
    """
    fed, size = _input(component, input, scale)
    offset = f"{input}_input_offset"

    def arrives(self: Any, x: Any) -> Any:
        return x + getattr(self, offset)

    switch = _switch(fed, size, f"{input} that arrives where none is commanded", least=-_ANY)
    doc = "Offset of an input: something arrives where nothing is commanded."
    change = _Change("x + a", arrives, {offset: switch}, (Size("{}", (offset,)),))
    return _changed("input_offset", input, doc, change)


@effect_maker
def input_saturation(
    component: type[Component], input: str, scale: float | None = None
) -> type[Effect]:
    """Make the effect of an input that levels off and never passes ``1 / sqrt(c)``.

    ``x / sqrt(1 + c x^2)`` arrives.

    Parameters
    ----------
    component, input, scale
        See :func:`dead_zone`.

    Returns
    -------
    type[Effect]
        With the parameter ``<input>_saturation`` (c); 0 is the base model.

    Raises
    ------
    UserError
        If there is no such input.
    """
    fed, size = _input(component, input, scale)
    level = f"{input}_saturation"

    def arrives(self: Any, x: Any) -> Any:
        return x / sqrt(1.0 + getattr(self, level) * (x * x))

    switch = Parameter(
        0.0,
        per("1", fed.unit, 2),
        min=0.0,
        max=_ANY / size**2,
        nominal=0.1 / size**2,
        doc=f"inverse square of the {input} that is never passed (c); 0 is without",
    )
    doc = (
        "Input that levels off: ``x / sqrt(1 + c x^2)`` arrives, which never passes"
        " ``1 / sqrt(c)``."
    )
    sizes = (Size("never passes {}", (level,), fed.unit, lambda c: c**-0.5),)
    change = _Change("x / sqrt(1 + c x^2)", arrives, {level: switch}, sizes)
    return _changed("input_saturation", input, doc, change)


@effect_maker
def backlash(
    component: type[Component],
    input: str,
    scale: float | None = None,
    sampling: Sampling | None = None,
) -> type[Effect]:
    """Make the effect of play: an input is passed on only after ``d``, in both directions.

    ``x - clip(x - z, -d, d)`` arrives, where ``z`` follows it at once, within a hundredth of a
    second unless the record that it is made for has another scale.

    Parameters
    ----------
    component, input, scale
        See :func:`dead_zone`.
    sampling : Sampling, optional
        Of the record that it is made for.

    Returns
    -------
    type[Effect]
        With the parameter ``<input>_play`` (d), half of the gap, and a state; 0 is the base model.

    Raises
    ------
    UserError
        If there is no such input.
    """
    fed, size = _input(component, input, scale)
    gap = f"{input}_play"
    place = f"{input}_passed_on"
    at_once = (sampling or Sampling()).at_once

    def arrives(self: Any, x: Any) -> Any:
        return x - clip(x - getattr(self, place), -getattr(self, gap), getattr(self, gap))

    def rate(self: Any, x: Any) -> Any:
        return (arrives(self, x) - getattr(self, place)) / at_once

    declared = {
        gap: _switch(fed, size, f"half of the play of {input} (d)"),
        place: State(
            fed.unit,
            rate=f"{place}_rate",
            nominal=size,
            display=fed.display,
            doc=f"{input} as passed on",
        ),
    }
    doc = (
        "Play in what passes an input on: it is taken along only after ``d``, and stays where it is"
        " on the way back."
    )
    text = "x - clip(x - z, -d, d)"
    sizes = (Size("a gap of {}", (gap,), fed.unit, lambda d: 2.0 * d),)
    rates = {f"{place}_rate": rate}
    change = _Change(text, arrives, declared, sizes, rates, "loop of {} on its way")
    return _changed("backlash", input, doc, change)


@effect_maker
def input_lag(
    component: type[Component],
    input: str,
    scale: float | None = None,
    sampling: Sampling | None = None,
) -> type[Effect]:
    """Make the effect of an input that arrives late: the share ``p`` of it lags by ``T``.

    Parameters
    ----------
    component, input, scale
        See :func:`dead_zone`.
    sampling : Sampling, optional
        Of the record that it is made for.

    Returns
    -------
    type[Effect]
        With parameters ``<input>_lagging_share`` (p), of which 0 is the base model and 1 a plain
        lag, and ``<input>_lag`` (T), and a state.

    Raises
    ------
    UserError
        If there is no such input.
    """
    fed, size = _input(component, input, scale)
    share = f"{input}_lagging_share"
    time = f"{input}_lag"
    lagged = f"{input}_behind"
    typical = 0.1 * (sampling or Sampling()).time_constant

    def arrives(self: Any, x: Any) -> Any:
        return x + getattr(self, share) * (getattr(self, lagged) - x)

    def rate(self: Any, x: Any) -> Any:
        return (x - getattr(self, lagged)) / getattr(self, time)

    declared = {
        share: Parameter(
            0.0,
            "1",
            min=0.0,
            max=1.0,
            nominal=0.3,
            doc=f"share of {input} that lags (p); 0 is without",
        ),
        time: Parameter(
            typical,
            "s",
            min=1e-3 * typical,
            max=1e6,
            nominal=typical,
            doc="time by which it lags (T)",
        ),
        lagged: State(
            fed.unit,
            rate=f"{lagged}_rate",
            nominal=size,
            display=fed.display,
            doc=f"{input} that lags",
        ),
    }
    doc = "Input that arrives late: the share ``p`` of it lags by ``T`` behind the command."
    text = "x + p (s - x) with T ds/dt = x - s"
    sizes = (
        Size("{} of it late", (share,), "%", lambda p: 100.0 * p),
        Size("with a time constant of {}", (time,)),
    )
    rates = {f"{lagged}_rate": rate}
    change = _Change(text, arrives, declared, sizes, rates, "{} arriving late")
    return _changed("input_lag", input, doc, change)


INPUT_CURVES = (dead_zone, asymmetric_dead_zone, input_offset, input_saturation)
INPUT_MEMORIES = (backlash, input_lag)  # made for a record's sampling
