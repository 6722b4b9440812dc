"""A member of a system with its loop closed by the equations of its partners, as one component.

A slide that is pushed by a measured force integrates the noise of that force twice, so the loop
cannot be cut there. Closed over the laws of what it pulls on, nothing between samples is unknown,
and the noise of no measurement comes in.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from fmus.kit import Component, UserError
from fmus.kit.declare import (
    Declaration,
    DiscreteDeclaration,
    InputDeclaration,
    OutputDeclaration,
    ParameterDeclaration,
    StateDeclaration,
)
from orchestration.system import Connection

NAME = "{}_in_its_loop"


def close_loop(
    member: str,
    cls: type[Component],
    partners: Mapping[str, type[Component]],
    connections: Sequence[Connection],
) -> type[Component]:
    """Return a component whose inputs are computed by the laws of its partners.

    Variables of the member keep their names, so that its effects can be laid over it; those of a
    partner are called ``partner_variable``.

    Parameters
    ----------
    member : str
        Its name in the system.
    cls : type[Component]
    partners : Mapping of str to type[Component]
        By name in the system.
    connections : sequence of Connection
        Among member and partners, with their factors and offsets.

    Returns
    -------
    type[Component]

    Raises
    ------
    UserError
        If names of variables coincide.
    """
    received = {str(c.target): c for c in connections}
    # no ports: the inputs that the member's own would name are computed in the loop
    body: dict[str, Any] = {"name": NAME.format(cls.name), "__module__": __name__, "ports": ()}

    def value(owner: Component, connection: Connection) -> Any:
        """Return what a connection carries."""
        source = connection.source
        holder = owner if source.member == member else embedded(owner, source.member)
        signal = getattr(holder, source.variable)
        amount = signal() if callable(signal) else signal
        return connection.factor * amount + connection.offset

    def embedded(owner: Component, name: str) -> Component:
        """Return a partner with the values that its variables have in the loop."""
        partner = partners[name]()
        for variable in partner.layout.variables:
            if not isinstance(variable, OutputDeclaration):
                connection = received.get(f"{name}.{variable.name}")
                amount = (
                    getattr(owner, f"{name}_{variable.name}")
                    if connection is None
                    else value(owner, connection)
                )
                setattr(partner, variable.name, amount)
        partner.time = owner.time
        return partner

    def law_of(name: str, law: str) -> Any:
        def evaluate(owner: Component) -> Any:
            return getattr(embedded(owner, name), law)()

        return evaluate

    computed = {
        own.name: received[f"{member}.{own.name}"]
        for own in cls.layout.inputs
        if f"{member}.{own.name}" in received
    }
    for own, connection in computed.items():
        body[own] = property(partial(value, connection=connection))
    for name, partner in partners.items():
        body |= _declarations(name, partner, received, law_of)
    taken = [name for name in body if name in cls.layout.names and name not in computed]
    if taken:
        raise UserError(f"{member}: in its loop {taken[0]!r} would mean two variables")
    return type(f"{cls.__name__}InItsLoop", (cls,), body)


def _declarations(
    name: str, partner: type[Component], received: Mapping[str, Connection], law_of: Any
) -> dict[str, Any]:
    """Return the variables of a partner and their laws, under their names in the loop."""
    body: dict[str, Any] = {}
    layout = partner.layout
    for variable in layout.variables:
        new = f"{name}_{variable.name}"
        match variable:
            case ParameterDeclaration() if variable.starts is None:
                body[new] = replace(variable)
            case InputDeclaration() if f"{name}.{variable.name}" not in received:
                body[new] = replace(variable)
            case StateDeclaration():
                rate = f"{name}_{variable.rate}"
                body[new] = replace(variable, rate=rate, start=_start(layout, variable))
                body[rate] = law_of(name, variable.rate)
            case DiscreteDeclaration():
                update = f"{name}_{variable.update}"
                period = variable.period
                body[new] = replace(
                    variable,
                    update=update,
                    period=f"{name}_{period}" if isinstance(period, str) else period,
                    shift=tuple(f"{name}_{shift}" for shift in variable.shift),
                    start=_start(layout, variable),
                )
                body[update] = law_of(name, variable.update)
            case OutputDeclaration():
                body[new] = replace(variable, law=law_of(name, variable.name))
    return body


def _start(layout: Any, state: Declaration) -> Any:
    parameters = {p.name: p for p in layout.parameters}
    return parameters[layout.start_of[state.name]].start


def without_limits(cls: type[Component]) -> type[Component]:
    """Return a component without the limits of its laws, for records in which none is reached.

    Its laws may be linear then, and are integrated exactly.

    Parameters
    ----------
    cls : type[Component]
    """

    def law_of(unlimited: str) -> Any:
        return lambda self: getattr(self, unlimited)()

    laws = {limited: law_of(unlimited) for limited, unlimited in cls.limits.items()}
    return type(f"{cls.__name__}WithoutLimits", (cls,), {"__module__": __name__, **laws})
