"""Effects of inputs: the laws use an input as it arrives, which differs from the command.

Each function here makes an effect for one real input of a component, for use with :func:`.stack`::

    stack(Motor, dead_zone(Motor, "voltage"))

A host sets the command; at the neutral value of the effect it is the value that laws use. Several
effects of one input are applied in order: the first to the command, the last before the laws.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from .component import Component
from .curves import per
from .declare import Declaration, InputDeclaration, Parameter, State, of_differences
from .delay_line import DelayLine
from .effects import Effect, Size, Term, effect_maker, make_effect
from .errors import find
from .functions import clip, outside, sqrt
from .sampling import Sampling, sampling_of
from .titles import generic_title, in_words

_ANY = 1e6  # bound of parameters, in typical magnitudes of the input


class _ArrivingInput:
    """Descriptor of an input as laws use it: a function of the command, or of an earlier effect.

    Parameters
    ----------
    name : str
        Name of the input.
    law : callable
        Returns the arriving value, from the component instance and the value before the effect.

    Attributes
    ----------
    effect : type[Effect]
        Effect that the descriptor belongs to.
    """

    def __init__(self, name: str, law: Callable[[Any, Any], Any]):
        self.name = name
        self.law = law
        self.effect = Effect

    def __get__(self, instance: Any, owner: Any = None) -> Any:
        if instance is None:
            raise AttributeError(self.name)  # a class has only the declaration
        return self.law(instance, self.before_effect(instance))

    def before_effect(self, instance: Any) -> Any:
        """Return the value before the effect: after an earlier effect, or the command."""
        try:
            return getattr(super(self.effect, instance), self.name)
        except AttributeError:
            return instance.__dict__[self.name]

    def __set__(self, instance: Any, value: Any) -> None:
        instance.__dict__[self.name] = value


def _input_effect(
    id: str,
    name: str,
    doc: str,
    text: str,
    *,
    arrives: Callable[[Any, Any], Any],
    declared: dict[str, Any],
    sizes: tuple[Size, ...],
    laws: Mapping[str, Callable[[Any, Any], Any]] | None = None,
    family: str = "{} as it arrives",
) -> type[Effect]:
    """Make the effect that makes a change to an input.

    Parameters
    ----------
    id : str
        Id of the effect.
    name : str
        Name of the input.
    doc : str
        Docstring of the effect.
    text : str
        Formula, for people.
    arrives : callable
        Returns the arriving value, from the component instance and the value before the effect.
    declared : dict of str to Declaration
        Variables of the effect; the first parameter switches it.
    sizes : tuple of Size
    laws : Mapping of str to callable, optional
        Of its states, from the component instance and the value before the effect.
    family : str
        Name shared by effects that are one cause in several shapes, with a place for the input.
    """
    arriving = _ArrivingInput(name, arrives)

    def law_of(change: Callable[[Any, Any], Any]) -> Callable[[Any], Any]:
        return lambda self: change(self, arriving.before_effect(self))

    switch = next(n for n, value in declared.items() if isinstance(value, Declaration))
    effect = make_effect(
        f"{id}_of_{name}".title().replace("_", ""),
        {
            "__doc__": doc,
            "__module__": __name__,
            name: arriving,
            **declared,
            **{law: law_of(change) for law, change in (laws or {}).items()},
        },
        id=id,
        title=generic_title(id, in_words(name)),
        term=Term("", name, text, family.format(name), name),
        assumption=f"{name} arrives as it is commanded",
        neutral=switch,
        sizes=sizes,
    )
    arriving.effect = effect  # before the first access, which is after the effect is stacked
    return effect


def _find_input(
    component: type[Component], name: str, scale: float | None
) -> tuple[InputDeclaration, float]:
    """Return a real input and its typical magnitude: `scale`, or its nominal value."""
    known = {v.name: v for v in component.layout.inputs if v.type == "real"}
    input = find(name, known, f"{component.name or component.__name__}: no real input")
    return input, scale or input.nominal


def _switch_parameter(variable: InputDeclaration, size: float, doc: str, least: float = 0.0) -> Any:
    """Declare the parameter that switches an effect: a difference of the input, 0 by default."""
    return Parameter(
        0.0,
        of_differences(variable.unit),
        min=least * size,
        max=_ANY * size,
        nominal=0.1 * size,
        display=of_differences(variable.display) if variable.display else None,
        doc=f"{doc}; 0 is without",
    )


@effect_maker
def dead_zone(component: type[Component], input: str, scale: float | None = None) -> type[Effect]:
    """Make the effect of a dead zone: within ``d`` of zero nothing arrives, beyond it the excess.

    Parameters
    ----------
    component : type[Component]
    input : str
        Name of a real input.
    scale : float, optional
        Typical magnitude of the input; by default its nominal value.

    Returns
    -------
    type[Effect]
        With the parameter ``<input>_dead_zone`` (d); 0 is the base model.

    Raises
    ------
    UserError
        If there is no such input.
    """
    variable, size = _find_input(component, input, scale)
    width = f"{input}_dead_zone"

    def arrives(self: Any, x: Any) -> Any:
        return outside(x, -getattr(self, width), getattr(self, width))

    switch = _switch_parameter(variable, size, f"{input} below which nothing arrives (d)")
    doc = "Dead zone of an input: within ``d`` of zero nothing arrives, beyond it what is more."
    return _input_effect(
        "dead_zone",
        input,
        doc,
        "x - clip(x, -d, d)",
        arrives=arrives,
        declared={width: switch},
        sizes=(Size("dead below {}", (width,)),),
    )


@effect_maker
def asymmetric_dead_zone(
    component: type[Component], input: str, scale: float | None = None
) -> type[Effect]:
    """Make the effect of an asymmetric dead zone: between ``-r d`` and ``d`` nothing arrives.

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
    variable, size = _find_input(component, input, scale)
    end = f"{input}_dead_zone_end"
    ratio = f"{input}_dead_zone_ratio"

    def arrives(self: Any, x: Any) -> Any:
        return outside(x, -(getattr(self, ratio) * getattr(self, end)), getattr(self, end))

    declared = {
        end: _switch_parameter(variable, size, f"positive {input} below which nothing arrives (d)"),
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
        Size("and down to {}", (end, ratio), variable.unit, lambda d, r: -r * d),
    )
    return _input_effect(
        "asymmetric_dead_zone",
        input,
        doc,
        "x - clip(x, -r d, d)",
        arrives=arrives,
        declared=declared,
        sizes=sizes,
    )


@effect_maker
def input_offset(
    component: type[Component], input: str, scale: float | None = None
) -> type[Effect]:
    """Make the effect of an offset: a constant value is added to the command.

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
    variable, size = _find_input(component, input, scale)
    offset = f"{input}_input_offset"

    def arrives(self: Any, x: Any) -> Any:
        return x + getattr(self, offset)

    switch = _switch_parameter(
        variable, size, f"{input} that arrives where none is commanded", least=-_ANY
    )
    doc = "Offset of an input: something arrives where nothing is commanded."
    return _input_effect(
        "input_offset",
        input,
        doc,
        "x + a",
        arrives=arrives,
        declared={offset: switch},
        sizes=(Size("{}", (offset,)),),
    )


@effect_maker
def input_saturation(
    component: type[Component], input: str, scale: float | None = None
) -> type[Effect]:
    """Make the effect of a saturation: an input approaches the limit ``1 / sqrt(c)``.

    The value that arrives is ``x / sqrt(1 + c x^2)``.

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
    variable, size = _find_input(component, input, scale)
    level = f"{input}_saturation"

    def arrives(self: Any, x: Any) -> Any:
        return x / sqrt(1.0 + getattr(self, level) * (x * x))

    switch = Parameter(
        0.0,
        per("1", variable.unit, 2),
        min=0.0,
        max=_ANY / size**2,
        nominal=0.1 / size**2,
        doc=f"inverse square of the {input} that is never passed (c); 0 is without",
    )
    doc = (
        "Input that levels off: ``x / sqrt(1 + c x^2)`` arrives, which never passes"
        " ``1 / sqrt(c)``."
    )
    sizes = (Size("never passes {}", (level,), variable.unit, lambda c: c**-0.5),)
    return _input_effect(
        "input_saturation",
        input,
        doc,
        "x / sqrt(1 + c x^2)",
        arrives=arrives,
        declared={level: switch},
        sizes=sizes,
    )


@effect_maker
def backlash(
    component: type[Component],
    input: str,
    scale: float | None = None,
    sampling: Sampling | None = None,
) -> type[Effect]:
    """Make the effect of play: an input is passed on only after ``d``, in both directions.

    The value that arrives is ``x - clip(x - z, -d, d)``. The state ``z`` follows it almost at once:
    within a hundredth of a second, or `Sampling.at_once` of a record.

    Parameters
    ----------
    component, input, scale
        See :func:`dead_zone`.
    sampling : Sampling, optional
        Sampling of the record that the effect is made for.

    Returns
    -------
    type[Effect]
        With the parameter ``<input>_play`` (d), half of the gap, and a state; 0 is the base model.

    Raises
    ------
    UserError
        If there is no such input.
    """
    variable, size = _find_input(component, input, scale)
    gap = f"{input}_play"
    place = f"{input}_passed_on"
    at_once = (sampling or sampling_of(component.experiment)).at_once

    def arrives(self: Any, x: Any) -> Any:
        return x - clip(x - getattr(self, place), -getattr(self, gap), getattr(self, gap))

    def rate(self: Any, x: Any) -> Any:
        return (arrives(self, x) - getattr(self, place)) / at_once

    declared = {
        gap: _switch_parameter(variable, size, f"half of the play of {input} (d)"),
        place: State(
            variable.unit,
            rate=f"{place}_rate",
            nominal=size,
            display=variable.display,
            doc=f"{input} as passed on",
        ),
    }
    doc = (
        "Play in what passes an input on: it is taken along only after ``d``, and stays where it is"
        " on the way back."
    )
    return _input_effect(
        "backlash",
        input,
        doc,
        "x - clip(x - z, -d, d)",
        arrives=arrives,
        declared=declared,
        sizes=(Size("a gap of {}", (gap,), variable.unit, lambda d: 2.0 * d),),
        laws={f"{place}_rate": rate},
        family="loop of {} on its way",
    )


@effect_maker
def input_lag(
    component: type[Component],
    input: str,
    scale: float | None = None,
    sampling: Sampling | None = None,
) -> type[Effect]:
    """Make the effect of a lag: the share ``p`` of an input lags with the time constant ``T``.

    Parameters
    ----------
    component, input, scale
        See :func:`dead_zone`.
    sampling : Sampling, optional
        Sampling of the record that the effect is made for.

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
    variable, size = _find_input(component, input, scale)
    share = f"{input}_lagging_share"
    time = f"{input}_lag"
    lagged = f"{input}_behind"
    typical = 0.1 * (sampling or sampling_of(component.experiment)).time_constant

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
            variable.unit,
            rate=f"{lagged}_rate",
            nominal=size,
            display=variable.display,
            doc=f"{input} that lags",
        ),
    }
    doc = "Input that arrives late: the share ``p`` of it lags by ``T`` behind the command."
    sizes = (
        Size("{} of it late", (share,), "%", lambda p: 100.0 * p),
        Size("with a time constant of {}", (time,)),
    )
    return _input_effect(
        "input_lag",
        input,
        doc,
        "x + p (s - x) with T ds/dt = x - s",
        arrives=arrives,
        declared=declared,
        sizes=sizes,
        laws={f"{lagged}_rate": rate},
        family="{} arriving late",
    )


@effect_maker
def input_delay(
    component: type[Component],
    input: str,
    scale: float | None = None,
    sampling: Sampling | None = None,
) -> type[Effect]:
    """Make the effect of a dead time: an input arrives as it was commanded a while ago.

    A `DelayLine` holds the commands; its period is `Sampling.delay_period` of a record, or of the
    component's experiment.

    Parameters
    ----------
    component, input, scale, sampling
        See :func:`backlash`.

    Returns
    -------
    type[Effect]
        With the parameter ``<input>_delay``, s; 0 is the base model.

    Raises
    ------
    UserError
        If there is no such input.
    """
    variable, size = _find_input(component, input, scale)
    display = of_differences(variable.display) if variable.display else None
    about = {"unit": of_differences(variable.unit), "nominal": size, "display": display}
    period = (sampling or sampling_of(component.experiment)).delay_period
    line = DelayLine(input, period, about, is_held=True)
    return _input_effect(
        "input_delay",
        input,
        "Dead time of an input: it arrives as it was commanded that long ago.",
        "x(t - D)",
        arrives=line.delayed,
        declared=line.variables(f"dead time of {input} (D); 0 is without"),
        sizes=(Size("{} late", (line.delay,)),),
        laws=line.updates(),
        family="{} arriving late",
    )


def input_effects(
    component: type[Component], sampling: Sampling | None = None
) -> list[type[Effect]]:
    """Make all effects of this module for every real input of a component.

    Parameters
    ----------
    component : type[Component]
    sampling : Sampling, optional
        Sampling of the record that the effects are made for.
    """
    effects: list[type[Effect]] = []
    for variable in component.layout.inputs:
        if variable.type == "real":
            for make in (dead_zone, asymmetric_dead_zone, input_offset, input_saturation):
                effects.append(make(component, variable.name))
            for make in (backlash, input_lag, input_delay):
                effects.append(make(component, variable.name, sampling=sampling))
    return effects
