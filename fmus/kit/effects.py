"""Effects: known forms of what a component lacks, and the components that they are laid over."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import wraps
from inspect import signature
from types import ModuleType
from typing import Any, ClassVar, ParamSpec, cast
from zlib import crc32

from .component import Component
from .declare import Declaration, OutputDeclaration, name_declaration
from .errors import UserError, suggestion
from .layout import APART

_Call = ParamSpec("_Call")
_SAID = frozenset({"id", "title", "output", "term", "neutral", "assumption", "sizes", "is_random"})
_LONGEST_NAME = 120  # file systems allow 255 bytes, with a prefix and a suffix of the cache


@dataclass(frozen=True)
class Term:
    """The change of a law that an effect makes.

    Attributes
    ----------
    law, signal, shape : str
        The law it changes, the signal that the change is a function of, and that function.
    family : str
        Name shared by effects that are one cause in several shapes: a law over a signal, a law with
        a memory of one, the loop that it runs through over one, or an input as it arrives. Empty
        where there are no others.
    qualifier : str
        Distinguishes it from an effect of the same id: the law, or the input, that it concerns, or
        its shape.
    """

    law: str = ""
    signal: str = ""
    shape: str = ""
    family: str = ""
    qualifier: str = ""


def _as_it_is(value: Any) -> Any:
    return value


@dataclass(frozen=True)
class Size:
    """Size of an effect, as a quantity that can be held against a rig.

    Attributes
    ----------
    phrase : str
        What follows the title of the effect, with a place for the quantity: ``"beyond {}"``.
    parameters : tuple of str
        The parameters of the effect that it is made of.
    unit : str
        SI unit of the quantity, or ``%``; that of the parameter where empty.
    quantity : callable
        Of the values of these parameters, SI; monotonic in the first one.
    """

    phrase: str
    parameters: tuple[str, ...]
    unit: str = ""
    quantity: Callable[..., Any] = _as_it_is


_KINDS_SAID = (str, int, Term, tuple)  # a law of such a name is none of these


class EffectType(type):
    """The type of effects, which keeps what is said of one apart from its laws.

    A law of a component may have any name; laid over it, an effect that has an ``id`` must not take
    the law of that name away.
    """

    _about: dict[str, Any]

    def __new__(
        mcs, name: str, bases: tuple[type, ...], body: dict[str, Any], /, **about: Any
    ) -> EffectType:
        """Make a class; in its body, what is said of it are numbers, texts, a term and sizes."""
        alike = {key: body[key] for key in _SAID & body.keys()}
        own = {key: value for key, value in alike.items() if isinstance(value, _KINDS_SAID)}
        apart = {
            key: name_declaration(value, key)
            for key, value in alike.items()
            if isinstance(value, Declaration)
        }
        laws = {key: value for key, value in body.items() if key not in own | apart}
        laws |= {key: v.law for key, v in apart.items() if isinstance(v, OutputDeclaration)}
        return super().__new__(mcs, name, bases, laws | {"_about": own | about, APART: apart})

    def __init__(
        cls, name: str, bases: tuple[type, ...], body: dict[str, Any], /, **about: Any
    ) -> None:
        super().__init__(name, bases, body)


def _said_of_effect(name: str) -> property:
    """Return the attribute of an effect's class that is said of it, or of the nearest base."""

    def value(cls: type) -> Any:
        abouts = (vars(part).get("_about", {}) for part in cls.__mro__)
        return next(about[name] for about in abouts if name in about)

    def say(cls: EffectType, value: Any) -> None:
        cls._about[name] = value

    return property(value, say)


for _name in _SAID:
    setattr(EffectType, _name, _said_of_effect(_name))


class Effect(Component, metaclass=EffectType):
    """An unmodelled effect of known form: a mixin that overrides a law through ``super()``.

    An effect of the physics overrides laws; an output is for effects of its measurement, which no
    law sees (:mod:`fmus.kit.sensors`).

    Attributes
    ----------
    id : str
        Name in the effect catalogue.
    title : str
        Name for people, a noun phrase such as ``"A second RC pair"``; its id in words where empty.
    output : str
        The output whose measurement it concerns; empty for effects of the physics.
    term : Term
        Its change of a law, where that has a formula.
    neutral : str
        The parameter that switches it: at the default value the component is exactly the one below.
    assumption : int or str
        The assumption it relaxes: its number in the component's README, or words.
    sizes : tuple of Size
        How large it is, in quantities that mean something at a rig; where there are none, its
        parameters are told as they are.
    is_random : bool
        Whether it adds random numbers. Those of a record are others, so that no diagnosis looks for
        it unless it is named.
    """

    id: ClassVar[str] = ""
    title: ClassVar[str] = ""
    output: ClassVar[str] = ""
    term: ClassVar[Term] = Term()
    neutral: ClassVar[str] = ""
    assumption: ClassVar[int | str] = ""
    sizes: ClassVar[tuple[Size, ...]] = ()
    is_random: ClassVar[bool] = False


def make_effect(name: str, body: Mapping[str, Any], /, **about: Any) -> type[Effect]:
    """Make the class of an effect.

    Parameters
    ----------
    name : str
        Of the class.
    body : Mapping of str to object
        Laws and declared variables, ``__doc__`` and ``__module__``.
    **about
        What is said of it: the attributes of `Effect`; ``made_by`` and ``made_with``, a function
        and its arguments after the component by which it can be made anew, where this is not said
        by `effect_maker`.
    """
    effect = cast("type[Effect]", EffectType(name, (Effect,), dict(body), **about))
    return effect


def effect_maker(make: Callable[_Call, type[Effect]]) -> Callable[_Call, type[Effect]]:
    """Note on every effect that a function makes the call by which it can be made anew.

    Parameters
    ----------
    make : callable
        Its first parameter is the component, its second the law, output or input of the effect; an
        argument after the first is one that `repr` writes as it is made.
    """
    form = signature(make)

    @wraps(make)
    def noted(*positional: _Call.args, **named: _Call.kwargs) -> type[Effect]:
        effect = make(*positional, **named)
        call = form.bind(*positional, **named)
        call.apply_defaults()
        _, *arguments = call.arguments.items()
        effect._about |= {"made_by": noted, "made_with": dict(arguments)}
        return effect

    return noted


def made_by(cls: type[Component]) -> Callable[..., type[Effect]] | None:
    """Return the function by which an effect can be made anew; None for a class that is written."""
    function: Callable[..., type[Effect]] | None = vars(cls).get("_about", {}).get("made_by")
    return function


def made_with(cls: type[Component]) -> Mapping[str, Any]:
    """Return the arguments of that function after the component."""
    arguments: Mapping[str, Any] = vars(cls).get("_about", {}).get("made_with", {})
    return arguments


def effect_name(effect: type[Effect]) -> str:
    """Return the id of an effect with its output or qualifier, if any: ``sensor_lag(voltage)``."""
    subject = effect.output or effect.term.qualifier
    return f"{effect.id}({subject})" if subject else effect.id


def effects_by_name(*effects: type[Effect]) -> dict[str, type[Effect]]:
    """Return effects by their names, for a catalogue."""
    return {effect_name(effect): effect for effect in effects}


def effects_in(*modules: ModuleType) -> dict[str, type[Effect]]:
    """Return the effects that modules define by their names, in the order of their definition."""
    defined = [
        cast("type[Effect]", thing)
        for module in modules
        for thing in vars(module).values()
        if isinstance(thing, EffectType) and thing.__module__ == module.__name__
    ]
    return effects_by_name(*(effect for effect in defined if effect.id))


def _identifier(effect: type[Effect]) -> str:
    """Return the name of an effect as a part of a file name."""
    subject = (effect.output or effect.term.qualifier).replace(", ", "_of_")
    return f"{effect.id}_of_{subject}" if subject else effect.id


def _joined(parts: list[str]) -> str:
    """Join names into one that is short enough for a file; a longer one ends in a checksum."""
    name = "_with_".join(parts)
    if len(name) <= _LONGEST_NAME:
        return name
    return f"{name[: _LONGEST_NAME - 9]}_{crc32(name.encode()):08x}"


def _owners(cls: type[Component]) -> dict[str, type]:
    """Return the variables of a class by name, each with the base class that declares it."""
    return {name: part for part in reversed(cls.__mro__) for name in vars(part).get("declared", {})}


def _redeclared(
    prefix: str, parts: tuple[type[Component], ...], defaults: Mapping[str, float | str]
) -> dict[str, Any]:
    """Return declarations that give parameters other defaults.

    A parameter that is the start value of a state has its default in the declaration of the state.
    """
    holders: dict[str, Any] = {}  # by parameter: the declaration that has its default
    for part in parts:
        for variable in (*part.layout.parameters, *part.layout.texts):
            holders[variable.name] = variable
    for part in parts:
        for state in (*part.layout.states, *part.layout.discretes):
            holders[part.layout.start_of[state.name]] = state
    for name in defaults:
        if name not in holders:
            raise UserError(f"{prefix}: no parameter named {name!r}{suggestion(name, holders)}")
    return {
        holders[name].name: replace(holders[name], start=value) for name, value in defaults.items()
    }


def _check_effects(prefix: str, base: type[Component], effects: tuple[type[Effect], ...]) -> None:
    """Check that effects can be laid over a component together; UserError if not."""
    ids = [_identifier(effect) for effect in effects]
    for identifier in ids:
        if ids.count(identifier) > 1:
            raise UserError(f"{prefix}: effect {identifier!r} is laid over it twice")
    owners = _owners(base)
    for effect in effects:
        for variable, owner in _owners(effect).items():
            other = owners.setdefault(variable, owner)
            if other is not owner:
                raise UserError(
                    f"{prefix}: {other.__name__} and {owner.__name__} both declare variable"
                    f" {variable!r}"
                )
    outputs = {output.name for part in (base, *effects) for output in part.layout.outputs}
    for effect in effects:
        if effect.output and effect.output not in outputs:
            raise UserError(
                f"{prefix}: {effect.id} is of {effect.output!r}, which is none of its outputs"
            )


def stack(
    base: type[Component],
    *effects: type[Effect],
    name: str | None = None,
    defaults: Mapping[str, float | str] | None = None,
) -> type[Component]:
    """Lay effects over a component.

    Later effects see the laws of earlier ones through ``super()``.

    Parameters
    ----------
    base : type[Component]
        The component class, also one that has effects already.
    *effects : type[Effect]
        Effects, innermost first.
    name : str, optional
        FMU name of the result; default joins the ids of the effects, with their outputs or
        qualifiers, shortened to the length of a file name.
    defaults : Mapping of str to float or str, optional
        Values that replace defaults of parameters, start values included, SI, and of texts. Those
        of the base stay otherwise.

    Returns
    -------
    type[Component]

    Raises
    ------
    UserError
        If the base has no laws, two effects have the same id and output, two classes declare a
        variable of the same name, or there is no such output, or a default is of no parameter or
        out of its range.
    """
    prefix = base.name
    if effects and base.engine is not None:
        raise UserError(
            f"{prefix} has no laws that an effect could change: it stands for something outside"
        )
    values = {**stacked_with(base), **(defaults or {})}
    component, earlier = unstack(base)
    layers = (*earlier, *effects)
    _check_effects(prefix, component, layers)
    body = {
        "name": name or _joined([prefix, *map(_identifier, effects)]),
        "remark": base.remark,
        "__doc__": component.__doc__,
        "__module__": component.__module__,
        "_stacked": (component, layers),
        "_stacked_with": values,
    }
    title = "".join(effect.__name__ for effect in reversed(layers)) + component.__name__
    return type(
        title,
        (*reversed(layers), component),
        body | _redeclared(prefix, (component, *layers), values),
    )


def unstack(cls: type[Component]) -> tuple[type[Component], tuple[type[Effect], ...]]:
    """Return a component without effects, and the effects stacked on it, innermost first."""
    parts: tuple[type[Component], tuple[type[Effect], ...]] = vars(cls).get("_stacked", (cls, ()))
    return parts


def stacked_with(cls: type[Component]) -> Mapping[str, float | str]:
    """Return the defaults that replace those of a component and of the effects stacked on it."""
    values: Mapping[str, float | str] = vars(cls).get("_stacked_with", {})
    return values
