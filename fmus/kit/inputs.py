"""Errors of what feeds a component: its laws see an input as it arrives, not as it was commanded.

Each function here makes an effect for one real input of a component, to be laid over it by :func:`.stack`::

    stack(Motor, dead_zone(Motor, "voltage"))

Whoever sets the input sets what was commanded; at the neutral value the laws see just that. Effects of one input are
laid one over the other: the first one is next to the command, the last one next to the laws.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .arms import GIVES
from .component import Component, Effect, Term
from .curves import per
from .declare import Declaration, InputDeclaration, Parameter, State
from .errors import UserError, suggestion
from .functions import clip, sqrt

_ANY = 1e6  # bound of parameters, in typical magnitudes of the input


class _AsItArrives:
    """An input as laws see it: what was set, or what the effect below makes of it, passed on by a law."""

    def __init__(self, name: str, law: Callable[[Any, Any], Any]):
        self.name, self.law, self.effect = name, law, Effect

    def __get__(self, one: Any, owner: Any = None) -> Any:
        if one is None:
            raise AttributeError(self.name)  # of the class there is a declaration only
        return self.law(one, self.below(one))

    def below(self, one: Any) -> Any:
        """What comes from the effect below, or was set."""
        try:
            return getattr(super(self.effect, one), self.name)
        except AttributeError:
            return one.__dict__[self.name]

    def __set__(self, one: Any, value: Any) -> None:
        one.__dict__[self.name] = value


def _feeding(
    make: Callable[..., type[Effect]],
    component: type[Component],
    name: str,
    arguments: tuple[Any, ...],
    text: str,
    arrives: Callable[[Any, Any], Any],
    members: dict[str, Any],
    follows: tuple[str, Callable[[Any, Any], Any]] | None = None,
    family: str = "{} as it arrives",
) -> type[Effect]:
    """Make the effect on an input; the first parameter among the members switches it, a state may follow the input."""
    passed = _AsItArrives(name, arrives)
    if follows:
        members[follows[0]] = lambda self: follows[1](self, passed.below(self))
    effect: type[Effect] = type(
        f"{make.__name__}_of_{name}".title().replace("_", ""),
        (Effect,),
        {
            "id": make.__name__,
            "term": Term("", name, text, family.format(name), name),
            "assumption": f"{name} arrives as it is commanded",
            "neutral": next(n for n, value in members.items() if isinstance(value, Declaration)),
            "made_by": make,
            "made_with": (name, *arguments),
            "__doc__": str(make.__doc__).partition("\n\n    Parameters\n")[0],
            "__module__": __name__,
            name: passed,
            **members,
        },
    )
    passed.effect = effect
    return effect


def _input(
    component: type[Component], name: str, scale: float | None
) -> tuple[InputDeclaration, float]:
    known = {v.name: v for v in component.layout.inputs if v.type == "real"}
    if name not in known:
        label = component.name or component.__name__
        raise UserError(f"{label}: no real input named {name!r}{suggestion(name, known)}")
    return known[name], scale or known[name].nominal


def dead_zone(component: type[Component], input: str, scale: float | None = None) -> type[Effect]:
    """Dead zone of an input: within ``d`` of zero nothing arrives, beyond it what is more.

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
    of, size = _input(component, input, scale)
    width = f"{input}_dead_zone"
    return _feeding(
        dead_zone,
        component,
        input,
        (scale,),
        "x - clip(x, -d, d)",
        lambda self, x: x - clip(x, -getattr(self, width), getattr(self, width)),
        {
            width: Parameter(
                0.0,
                of.unit,
                min=0.0,
                max=_ANY * size,
                nominal=0.1 * size,
                display=of.display,
                doc=f"{input} below which nothing arrives (d); 0 is without",
            ),
        },
    )


def asymmetric_dead_zone(
    component: type[Component], input: str, scale: float | None = None
) -> type[Effect]:
    """Dead zone of an input whose ends differ: from ``-r d`` to ``d`` nothing arrives.

    Parameters
    ----------
    component, input, scale
        See :func:`dead_zone`.

    Returns
    -------
    type[Effect]
        With parameters ``<input>_dead_zone_end`` (d), of which 0 is the base model, and ``<input>_dead_zone_ratio``.

    Raises
    ------
    UserError
        If there is no such input.
    """
    of, size = _input(component, input, scale)
    end, ratio = f"{input}_dead_zone_end", f"{input}_dead_zone_ratio"

    def arrives(self: Any, x: Any) -> Any:
        return x - clip(x, -(getattr(self, ratio) * getattr(self, end)), getattr(self, end))

    return _feeding(
        asymmetric_dead_zone,
        component,
        input,
        (scale,),
        "x - clip(x, -r d, d)",
        arrives,
        {
            end: Parameter(
                0.0,
                of.unit,
                min=0.0,
                max=_ANY * size,
                nominal=0.1 * size,
                display=of.display,
                doc=f"positive {input} below which nothing arrives (d); 0 is without",
            ),
            ratio: Parameter(
                1.0,
                "1",
                min=0.0,
                max=1e3,
                nominal=1.0,
                doc=f"lower end of it relative to {end} (r)",
            ),
        },
    )


def input_offset(
    component: type[Component], input: str, scale: float | None = None
) -> type[Effect]:
    """Offset of an input: something arrives where nothing is commanded.

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
    of, size = _input(component, input, scale)
    offset = f"{input}_input_offset"
    return _feeding(
        input_offset,
        component,
        input,
        (scale,),
        "x + a",
        lambda self, x: x + getattr(self, offset),
        {
            offset: Parameter(
                0.0,
                of.unit,
                min=-_ANY * size,
                max=_ANY * size,
                nominal=0.1 * size,
                display=of.display,
                doc=f"{input} that arrives where none is commanded; 0 is without",
            ),
        },
    )


def input_saturation(
    component: type[Component], input: str, scale: float | None = None
) -> type[Effect]:
    """Input that levels off: ``x / sqrt(1 + c x^2)`` arrives, which never passes ``1 / sqrt(c)``.

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
    of, size = _input(component, input, scale)
    level = f"{input}_saturation"
    return _feeding(
        input_saturation,
        component,
        input,
        (scale,),
        "x / sqrt(1 + c x^2)",
        lambda self, x: x / sqrt(1.0 + getattr(self, level) * (x * x)),
        {
            level: Parameter(
                0.0,
                per("1", of.unit, 2),
                min=0.0,
                max=_ANY / size**2,
                nominal=0.1 / size**2,
                doc=f"inverse square of the {input} that is never passed (c); 0 is without",
            ),
        },
    )


def backlash(component: type[Component], input: str, scale: float | None = None) -> type[Effect]:
    """Play in what passes an input on: it is taken along only after ``d``, and stays where it is on the way back.

    What arrives is ``x - clip(x - z, -d, d)``, where ``z`` follows it at once, within a hundredth of a second.

    Parameters
    ----------
    component, input, scale
        See :func:`dead_zone`.

    Returns
    -------
    type[Effect]
        With the parameter ``<input>_play`` (d), half of the gap, and a state; 0 is the base model.

    Raises
    ------
    UserError
        If there is no such input.
    """
    of, size = _input(component, input, scale)
    gap, place = f"{input}_play", f"{input}_passed_on"

    def arrives(self: Any, x: Any) -> Any:
        return x - clip(x - getattr(self, place), -getattr(self, gap), getattr(self, gap))

    def rate(self: Any, x: Any) -> Any:
        return (arrives(self, x) - getattr(self, place)) / GIVES

    return _feeding(
        backlash,
        component,
        input,
        (scale,),
        "x - clip(x - z, -d, d)",
        arrives,
        {
            gap: Parameter(
                0.0,
                of.unit,
                min=0.0,
                max=_ANY * size,
                nominal=0.1 * size,
                display=of.display,
                doc=f"half of the play of {input} (d); 0 is without",
            ),
            place: State(
                of.unit,
                rate=f"{place}_rate",
                nominal=size,
                display=of.display,
                doc=f"{input} as passed on",
            ),
        },
        (f"{place}_rate", rate),
        "loop of {} on its way",
    )


def input_lag(component: type[Component], input: str, scale: float | None = None) -> type[Effect]:
    """Input that arrives late: the share ``p`` of it lags by ``T`` behind the command.

    Parameters
    ----------
    component, input, scale
        See :func:`dead_zone`.

    Returns
    -------
    type[Effect]
        With parameters ``<input>_lagging_share`` (p), of which 0 is the base model and 1 a plain lag, and
        ``<input>_lag`` (T), and a state.

    Raises
    ------
    UserError
        If there is no such input.
    """
    of, size = _input(component, input, scale)
    share, time, behind = f"{input}_lagging_share", f"{input}_lag", f"{input}_behind"

    def arrives(self: Any, x: Any) -> Any:
        return x + getattr(self, share) * (getattr(self, behind) - x)

    def rate(self: Any, x: Any) -> Any:
        return (x - getattr(self, behind)) / getattr(self, time)

    return _feeding(
        input_lag,
        component,
        input,
        (scale,),
        "x + p (s - x) with T ds/dt = x - s",
        arrives,
        {
            share: Parameter(
                0.0,
                "1",
                min=0.0,
                max=1.0,
                nominal=0.3,
                doc=f"share of {input} that lags (p); 0 is without",
            ),
            time: Parameter(
                0.1, "s", min=1e-4, max=1e6, nominal=0.1, doc="time by which it lags (T)"
            ),
            behind: State(
                of.unit,
                rate=f"{behind}_rate",
                nominal=size,
                display=of.display,
                doc=f"{input} that lags",
            ),
        },
        (f"{behind}_rate", rate),
        "{} arriving late",
    )


INPUT_EFFECTS = (
    dead_zone,
    asymmetric_dead_zone,
    input_offset,
    input_saturation,
    backlash,
    input_lag,
)
