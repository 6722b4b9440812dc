"""Members of a system as one component, whose laws are those of all of them.

Variables and laws of a member stand behind its name: ``bench_velocity``. A connected input is a law
that returns what the connection carries. Laws of a member call each other through the whole, so
that additions to any of them act as they do in the member itself, and its effects can be laid over
the whole.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from fmus.kit import Component, Effect, Term, UserError
from fmus.kit.declare import (
    Declaration,
    DiscreteDeclaration,
    InputDeclaration,
    OutputDeclaration,
    StateDeclaration,
)
from fmus.kit.effects import effect_maker, make_effect
from fmus.kit.layout import law_of
from orchestration.system import Connection

Law = Callable[..., Any]


def full_name(member: str, name: str) -> str:
    """Return the name that a variable or law of a member has in the whole."""
    return f"{member}_{name}"


@dataclass(frozen=True)
class Fused:
    """A component that several members of a system are, closed over their connections.

    Attributes
    ----------
    cls : type[Component]
    members : Mapping of str to type[Component]
        By name in the system.
    """

    cls: type[Component]
    members: Mapping[str, type[Component]]

    def lifted(self, effects: Mapping[str, Mapping[str, type[Effect]]]) -> dict[str, type[Effect]]:
        """Return effects of members, by member and name, as effects of the whole.

        Without those of inputs as they arrive, which a connection computes.
        """
        return {
            full_name(member, name): _lifted(member, self.members[member], effect)
            for member, of_member in effects.items()
            for name, effect in of_member.items()
            if _is_of_laws(effect)
        }

    def origin(self, name: str) -> tuple[str, str]:
        """Return the member of a variable or law of the whole, and its name there.

        Both empty where no member has it, such as ``time``.
        """
        for member in sorted(self.members, key=len, reverse=True):
            if name.startswith(full_name(member, "")):
                return member, name.removeprefix(full_name(member, ""))
        return "", ""


def fused(
    name: str,
    members: Mapping[str, type[Component]],
    values: Mapping[str, Mapping[str, Any]],
    connections: Sequence[Connection],
) -> Fused:
    """Return members of a system as one component.

    Parameters
    ----------
    name : str
        Of the component.
    members : Mapping of str to type[Component]
        By name in the system, in its order: samples of clocks at one instant are taken in it.
    values : Mapping of str to Mapping of str to value
        Of parameters and unconnected inputs, by member.
    connections : sequence of Connection
        Among these members.

    Raises
    ------
    UserError
        If two variables have one name, or outputs wait for each other in a circle.
    """
    return Fused(_whole(name, members, values, connections), members)


@effect_maker
def _whole(
    name: str,
    members: Mapping[str, type[Component]],
    values: Mapping[str, Mapping[str, Any]],
    connections: Sequence[Connection],
) -> type[Component]:
    """Make the class of the component of `fused`."""
    received = {str(c.target): c for c in connections}
    body: dict[str, Any] = {"name": name, "__module__": __name__, "__doc__": f"Members of {name}."}
    for member, cls in members.items():
        own = {full_name(member, law): _law(member, cls, law) for law in _laws_of(cls)}
        own |= _declarations(member, cls, received, values.get(member, {}))
        twice = next((one for one in own if one in body), None)
        if twice is not None:
            raise UserError(f"{name}: two members have something named {twice!r}")
        body |= own
    made: type[Component] = type(
        "".join(part.title() for part in name.split("_")), (Component,), body
    )
    try:
        made().outputs()
    except RecursionError:
        raise UserError(f"{name}: outputs of its members wait for each other") from None
    return made


def _laws_of(cls: type[Component]) -> list[str]:
    names = [name for part in reversed(cls.__mro__) for name in vars(part)]
    known = {*vars(Component), *Component.__annotations__}
    laws = dict.fromkeys(n for n in names if n not in known and not n.startswith("_"))
    return [name for name in laws if law_of(cls, name) is not None]


def _law(member: str, cls: type[Component], name: str) -> Law:
    """Return a law of a member as one of the whole."""
    return _through(_Views(member, cls), law_of(cls, name))


def _through(views: _Views, own: Law | None) -> Law:
    """Return a law as one of the whole, which computes it with a view of the member."""
    assert own is not None

    def law(whole: Component, *given: Any, **named: Any) -> Any:
        return own(views.of(whole), *given, **named)

    law.__doc__ = own.__doc__
    law.__dict__.update(vars(own))  # the title, and what else is declared of it
    return law


class _Views:
    """Members of the whole as instances of their own class, whose variables are read there.

    Its laws call those of the whole.

    Parameters
    ----------
    member : str
    cls : type[Component]
        Of the member.
    layers : type
        Over it, the outermost first.
    """

    def __init__(self, member: str, cls: type[Component], *layers: type[Component]):
        self._arriving = [v.name for v in cls.layout.inputs if _is_computed(cls, v.name)]

        def through(name: str) -> Law:
            of_whole = full_name(member, name)
            return lambda view, *given, **named: getattr(view.whole, of_whole)(*given, **named)

        def variable(view: Any, name: str) -> Any:
            if name.startswith("_") or name == "whole":
                raise AttributeError(name)
            value = getattr(view.whole, name if name == "time" else full_name(member, name))
            return value() if callable(value) else value  # what a connection carries is a law

        laws = [law for part in (cls, *layers) for law in _laws_of(part)]
        body: dict[str, Any] = {law: through(law) for law in laws}
        body |= {"__getattr__": variable, "ports": (), "name": "", "__module__": __name__}
        self._cls: Any = type(f"{cls.__name__}OfWhole", (*layers, cls), body)

    def of(self, whole: Component) -> Component:
        """Return the member of the whole."""
        view: Any = object.__new__(self._cls)
        view.__dict__["whole"] = whole
        for name in self._arriving:  # the command, of which the class computes what arrives
            view.__dict__[name] = self._cls.__getattr__(view, name)
        return view


def _is_computed(cls: type[Component], name: str) -> bool:
    """Return whether a class computes what arrives of an input."""
    return any(hasattr(vars(part).get(name), "__set__") for part in cls.__mro__)


def _declarations(
    member: str, cls: type[Component], received: Mapping[str, Connection], values: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the variables of a member under their names in the whole."""
    layout = cls.layout
    body: dict[str, Any] = {}
    for variable in layout.variables:
        name = full_name(member, variable.name)
        connection = received.get(f"{member}.{variable.name}")
        if isinstance(variable, InputDeclaration) and connection is not None:
            body[name] = _carried(connection, variable)
        elif isinstance(variable, OutputDeclaration):
            body[name] = replace(variable, law=_law(member, cls, variable.name))
        elif getattr(variable, "starts", None) is None:
            start = layout.start_of.get(variable.name, variable.name)
            body[name] = _renamed(member, variable, values.get(start, _start(cls, variable)))
    return body


def _start(cls: type[Component], variable: Declaration) -> Any:
    """Return where a variable starts: of a state as its start parameter says."""
    layout = cls.layout
    parameter = layout.start_of.get(variable.name, variable.name)
    declared = next((v for v in layout.variables if v.name == parameter), variable)
    return getattr(declared, "start", None)


def _renamed(member: str, variable: Declaration, start: Any) -> Declaration:
    """Return a declaration with the names that what it refers to has in the whole."""
    named: dict[str, Any] = {"start": start}
    match variable:
        case StateDeclaration():
            named["rate"] = full_name(member, variable.rate)
        case DiscreteDeclaration():
            named["update"] = full_name(member, variable.update)
            named["shift"] = tuple(full_name(member, shift) for shift in variable.shift)
            if isinstance(variable.period, str):
                named["period"] = full_name(member, variable.period)
    return replace(variable, **named)


def _carried(connection: Connection, received: Declaration) -> Law:
    """Return the law of an input that a connection feeds."""
    source = full_name(connection.source.member, connection.source.variable)

    def law(whole: Any) -> Any:
        value = getattr(whole, source)
        amount = value() if callable(value) else value
        if connection.passes_on:
            return amount
        return connection.factor * amount + connection.offset

    law.__doc__ = received.doc
    law.__dict__["title"] = received.title
    return law


def _is_of_laws(effect: type[Effect]) -> bool:
    """Return whether an effect declares variables and overrides laws, and does nothing else."""
    return not any(hasattr(value, "__set__") for value in vars(effect).values())


@effect_maker
def _lifted(member: str, cls: type[Component], effect: type[Effect]) -> type[Effect]:
    """Return an effect of a member as one of the whole."""
    laws = _laws_of(effect)
    made: list[type[Effect]] = []

    def before(name: str) -> Law:
        """Return the law below the effect."""
        of_whole = full_name(member, name)
        return lambda view, *given: getattr(super(made[0], view.whole), of_whole)(*given)

    below = type(
        f"Below{effect.__name__}",
        (Component,),
        {"__module__": __name__, **{law: before(law) for law in laws}},
    )
    views = _Views(member, cls, effect, below)
    body: dict[str, Any] = {
        full_name(member, law): _through(views, law_of(effect, law)) for law in laws
    }
    for variable in effect.layout.variables:
        if getattr(variable, "starts", None) is None:
            name = full_name(member, variable.name)
            body[name] = _renamed(member, variable, _start(effect, variable))
    term = effect.term
    sizes = [
        replace(size, parameters=tuple(full_name(member, name) for name in size.parameters))
        for size in effect.sizes
    ]
    made.append(
        make_effect(
            f"{effect.__name__}Of{member.title()}",
            {"__module__": __name__, "__doc__": effect.__doc__, **body},
            id=full_name(member, effect.id),
            title=effect.title,
            term=Term(
                full_name(member, term.law) if term.law else "",
                full_name(member, term.signal) if term.signal else "",
                term.shape,
                full_name(member, term.family) if term.family else "",
                term.qualifier,
            ),
            neutral=full_name(member, effect.neutral),
            assumption=effect.assumption,
            sizes=tuple(sizes),
            is_random=effect.is_random,
            output=full_name(member, effect.output) if effect.output else "",
        )
    )
    return made[0]
