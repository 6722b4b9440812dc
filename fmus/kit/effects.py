"""Effects: known forms of model error, and components with effects stacked on them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial, wraps
from inspect import signature
from types import ModuleType
from typing import Any, ClassVar, ParamSpec, TypeVar, cast
from zlib import crc32

from .component import Component, ComponentType, call_of, enable_pickling
from .declare import Declaration, OutputDeclaration, ParameterDeclaration, name_declaration
from .errors import UserError, find
from .layout import APART

_Call = ParamSpec("_Call")
_Made = TypeVar("_Made", bound=type[Component])
_ATTRIBUTES = frozenset(
    {"id", "title", "output", "term", "neutral", "assumption", "sizes", "is_random"}
)
_LONGEST_NAME = 120  # file systems allow 255 bytes, and the cache adds a prefix and a suffix


@dataclass(frozen=True)
class Term:
    """The change of a law that an effect makes.

    Attributes
    ----------
    law, signal, shape : str
        Law that changes, signal that the change is a function of, and that function.
    family : str
        Name shared by effects that are one cause in several shapes: a law over a signal, a law with
        a memory of a signal, a loop over a signal, or an input as it arrives. Empty if the effect
        is the only one.
    qualifier : str
        Distinguishes it from other effects of the same id: the law or the input that changes, or
        the shape.
    """

    law: str = ""
    signal: str = ""
    shape: str = ""
    family: str = ""
    qualifier: str = ""


def _identity(value: Any) -> Any:
    return value


@dataclass(frozen=True)
class Size:
    """Size of an effect, as a quantity that can be compared with a rig.

    Attributes
    ----------
    phrase : str
        Phrase after the title of the effect, with a place for the quantity: ``"beyond {}"``.
    parameters : tuple of str
        Parameters of the effect from which the quantity is computed.
    unit : str
        SI unit of the quantity, or ``%``; if empty, that of the parameter.
    quantity : callable
        Function of the values of these parameters, SI; monotonic in the first one.
    """

    phrase: str
    parameters: tuple[str, ...]
    unit: str = ""
    quantity: Callable[..., Any] = _identity


_ATTRIBUTE_TYPES = (str, int, Term, tuple)  # a law or variable of the same name has another type


class EffectType(ComponentType):
    """The metaclass of effects, which separates their attributes, such as ``id``, from their laws.

    A component may have a law named ``id``; an effect stacked on it must not hide that law.
    """

    described = (*ComponentType.described, "assumption", "title")
    _about: dict[str, Any]

    def __new__(
        mcs, name: str, bases: tuple[type, ...], body: dict[str, Any], /, **about: Any
    ) -> EffectType:
        """Make a class; attributes are distinguished from laws and variables by their types.

        A declaration with the name of an attribute is set apart, because ``getattr`` on the class
        would find the attribute (`_effect_attribute`) in its place. Of an output, the method stays.
        The parameter that switches the effect is tunable unless it is declared not to be.
        """
        members: dict[str, Any] = {}
        attributes: dict[str, Any] = {}
        declarations: dict[str, Declaration] = {}
        for key, value in body.items():
            if key in _ATTRIBUTES and isinstance(value, _ATTRIBUTE_TYPES):
                attributes[key] = value
            elif key in _ATTRIBUTES and isinstance(value, Declaration):
                declarations[key] = name_declaration(value, key)
                if isinstance(value, OutputDeclaration):
                    members[key] = value.law
            else:
                members[key] = value
        attributes |= about
        switch = body.get(attributes.get("neutral", ""))
        if isinstance(switch, ParameterDeclaration) and switch.tunable is None:
            switch.tunable = True
        members |= {"_about": attributes, APART: declarations}
        return super().__new__(mcs, name, bases, members)

    def __init__(
        cls, name: str, bases: tuple[type, ...], body: dict[str, Any], /, **about: Any
    ) -> None:
        super().__init__(name, bases, body)  # without the attributes, which `type` would reject


enable_pickling(EffectType)


def _effect_attribute(name: str) -> property:
    """Make a property of effect classes: an attribute of the class, or of its nearest base."""

    def value(cls: type) -> Any:
        abouts = (vars(part).get("_about", {}) for part in cls.__mro__)
        return next(about[name] for about in abouts if name in about)

    def set_value(cls: EffectType, value: Any) -> None:
        cls._about[name] = value

    return property(value, set_value)


for _name in _ATTRIBUTES:
    setattr(EffectType, _name, _effect_attribute(_name))


class Effect(Component, metaclass=EffectType):
    """An unmodelled effect of known form: a mixin that overrides a law through ``super()``.

    An effect of the physics overrides laws. An effect of a measurement has an ``output``, whose
    error no law depends on (:mod:`fmus.kit.sensors`).

    Attributes
    ----------
    id : str
        Name in the effect catalogue.
    title : str
        Name for people, a noun phrase such as ``"A second RC pair"``; if empty, the id in words.
    output : str
        Output whose measurement it changes; empty for effects of the physics.
    term : Term
        Change of a law, if it has a formula.
    neutral : str
        Parameter that switches it: at the default value the component is exactly the base model.
    assumption : int or str
        Assumption that it relaxes: its number in the component's README, or words.
    sizes : tuple of Size
        Size in quantities that have a meaning at a rig; if empty, the parameters are reported.
    is_random : bool
        Whether it adds random numbers. They cannot match those of a record, so that a diagnosis
        includes the effect only by name.
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
        Name of the class.
    body : Mapping of str to object
        Laws and declared variables, ``__doc__`` and ``__module__``.
    **about
        Attributes of `Effect`.
    """
    return cast("type[Effect]", EffectType(name, (Effect,), dict(body), **about))


def effect_maker(make: Callable[_Call, _Made]) -> Callable[_Call, _Made]:
    """Decorate a function that makes effects or components, so that each keeps its call.

    With the call it can be pickled, and an effect can be a part of a Python FMU.

    Parameters
    ----------
    make : callable
        Of an effect, its first parameter is the component, its second the law, output or input.
        The `repr` of an argument after the first must be an expression for it.
    """
    parameters = signature(make)

    @wraps(make)
    def maker(*positional: _Call.args, **named: _Call.kwargs) -> _Made:
        made = make(*positional, **named)
        call = parameters.bind(*positional, **named)
        call.apply_defaults()
        (_, first), *others = call.arguments.items()
        made._made = partial(maker, first, **dict(others))
        return made

    return maker


def made_by(cls: type[Component]) -> Callable[..., type[Component]] | None:
    """Return the function that made a class; None for a class that is defined in a module."""
    call = call_of(cls)
    return call and call.func


def made_with(cls: type[Component]) -> Mapping[str, Any]:
    """Return the arguments, after the component, of the function that made a class."""
    call = call_of(cls)
    return call.keywords if call else {}


def effect_name(effect: type[Effect]) -> str:
    """Return the id of an effect with its output or qualifier, if any: ``sensor_lag(voltage)``."""
    subject = effect.output or effect.term.qualifier
    return f"{effect.id}({subject})" if subject else effect.id


def effects_by_name(*effects: type[Effect]) -> dict[str, type[Effect]]:
    """Return effects by name, for a catalogue."""
    return {effect_name(effect): effect for effect in effects}


def effects_in(*modules: ModuleType) -> dict[str, type[Effect]]:
    """Return the effects that modules define, by name, in the order of their definition."""
    effects = []
    for module in modules:
        for value in vars(module).values():
            if isinstance(value, EffectType) and value.__module__ == module.__name__:
                effects.append(cast("type[Effect]", value))
    return effects_by_name(*(effect for effect in effects if effect.id))


def _identifier(effect: type[Effect]) -> str:
    """Return the name of an effect as a part of a file name."""
    subject = (effect.output or effect.term.qualifier).replace(", ", "_of_")
    return f"{effect.id}_of_{subject}" if subject else effect.id


def _join_to_file_name(parts: list[str]) -> str:
    """Join names into the name of a file; one that is too long is cut and ends in a checksum."""
    name = "_with_".join(parts)
    if len(name) <= _LONGEST_NAME:
        return name
    return f"{name[: _LONGEST_NAME - 9]}_{crc32(name.encode()):08x}"


def _declaring_classes(cls: type[Component]) -> dict[str, type]:
    """Return the class that declares each variable of a class, by name of the variable.

    If several declare it, it is the one nearest to the class.
    """
    return {name: part for part in reversed(cls.__mro__) for name in vars(part).get("declared", {})}


def _with_new_defaults(
    prefix: str, parts: tuple[type[Component], ...], defaults: Mapping[str, float | str]
) -> dict[str, Any]:
    """Return declarations that replace those of parameters with new defaults, by name.

    The default of a state's start parameter is in the declaration of the state.
    """
    holders: dict[str, Any] = {}  # declaration that has the default, by name of the parameter
    for part in parts:
        for variable in (*part.layout.parameters, *part.layout.texts):
            holders[variable.name] = variable
    for part in parts:
        for state in (*part.layout.states, *part.layout.discretes):
            holders[part.layout.start_of[state.name]] = state
    replaced = {}
    for name, value in defaults.items():
        holder = find(name, holders, f"{prefix}: no parameter")
        replaced[holder.name] = replace(holder, start=value)
    return replaced


def _check_effects(prefix: str, base: type[Component], effects: tuple[type[Effect], ...]) -> None:
    """Raise an error unless effects can be stacked on a component together."""
    ids = [_identifier(effect) for effect in effects]
    for identifier in ids:
        if ids.count(identifier) > 1:
            raise UserError(f"{prefix}: effect {identifier!r} is laid over it twice")
    owners = _declaring_classes(base)
    for effect in effects:
        for variable, owner in _declaring_classes(effect).items():
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
    """Make the class of a component with effects.

    Later effects call the laws of earlier ones through ``super()``.

    Parameters
    ----------
    base : type[Component]
        Component, with or without effects.
    *effects : type[Effect]
        Effects, innermost first.
    name : str, optional
        FMU name of the result; by default the ids of the effects, with their outputs or qualifiers,
        shortened to the length of a file name.
    defaults : Mapping of str to float or str, optional
        New defaults of parameters (SI), start values and texts, by name; the others are those of
        the base.

    Returns
    -------
    type[Component]

    Raises
    ------
    UserError
        If the base has no laws, two effects have the same id and output, two classes declare a
        variable of the same name, there is no such output, there is no parameter for a default, or
        a default is out of range.
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
    presets = dict(base.presets)
    for effect in effects:
        presets |= effect.presets
    body = {
        "name": name or _join_to_file_name([prefix, *map(_identifier, effects)]),
        "remark": base.remark,
        "presets": presets,
        "__doc__": component.__doc__,
        "__module__": component.__module__,
        "_made": partial(stack, component, *layers, name=name, defaults=values),
    }
    title = "".join(effect.__name__ for effect in reversed(layers)) + component.__name__
    return type(
        title,
        (*reversed(layers), component),  # a later effect overrides an earlier one
        body | _with_new_defaults(prefix, (component, *layers), values),
    )


def unstack(cls: type[Component]) -> tuple[type[Component], tuple[type[Effect], ...]]:
    """Return a component without effects, and the effects stacked on it, innermost first."""
    if made_by(cls) is not stack:
        return cls, ()
    component, *effects = cast("partial[Any]", call_of(cls)).args
    return component, tuple(effects)


def stacked_with(cls: type[Component]) -> Mapping[str, float | str]:
    """Return the new defaults that a component and its effects were stacked with, by name."""
    values: Mapping[str, float | str] = made_with(cls).get("defaults", {})
    return values
