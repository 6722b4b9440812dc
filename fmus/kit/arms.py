"""Arms: effects that add a memory of one signal, a state of first order, to a law.

A law lags a signal because of one more Kelvin element in a chain, or follows the mean of its square
because of a heat capacity.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Any

from .component import Component
from .curves import EffectNames, additive_effect, coefficient, per, size_at, variable
from .declare import Parameter, State
from .effects import Effect, Size, Term, effect_maker
from .errors import find
from .titles import generic_title, law_title


@dataclass(frozen=True)
class Arm:
    """A memory of a signal x in a state s of first order, with a time constant T.

    Attributes
    ----------
    followed : callable
        What s follows, from x.
    power : int
        Power of the signal in s.
    text : str
        The formula, for people.
    """

    followed: Callable[[Any], Any]
    power: int
    text: str


ARMS: dict[str, Arm] = {
    "lagging": Arm(lambda x: x, 1, "a s with T ds/dt = x - s"),
    "warming": Arm(lambda x: x * x, 2, "a s with T ds/dt = x^2 - s"),
}


@effect_maker
def lag_effect(
    component: type[Component],
    law: str,
    signal: str,
    kind: str,
    constant: float,
    unit: str = "1",
    *,
    nominal: float = 1.0,
    scale: float | None = None,
    names: EffectNames | None = None,
) -> type[Effect]:
    """Make an effect that adds a memory of one signal, a state of first order, to a law.

    Parameters
    ----------
    component : type[Component]
        Has the law and the signal.
    law : str
        Method that the memory is added to.
    signal : str
        Input or state that is remembered (x).
    kind : {"lagging", "warming"}
        ``lagging``: a state that follows the signal; a state starts in equilibrium with it.
        ``warming``: a state that follows the square of the signal, such as the temperature of a
        conductor that its current heats.
    constant : float
        Time constant from which a fit starts, s.
    unit : str
        SI unit of the law.
    nominal : float
        Typical magnitude of the law.
    scale : float, optional
        Typical magnitude of the signal; by default its nominal value.
    names : EffectNames, optional
        Names of the effect, of the parameter that switches it, of its constant and of its state.
        By default the effect has the name of the kind, and its variables are ``<law>_<id>``,
        ``<law>_<id>_constant`` and ``<law>_<id>_state``.

    Returns
    -------
    type[Effect]
        With two parameters and a state.

    Raises
    ------
    UserError
        If the component has no such law or signal, or there is no such kind.
    """
    arm = find(kind, ARMS, "no arm")
    argument = variable(component, signal)
    size = scale or argument.nominal
    given = names or EffectNames()
    stem = f"{law}_{given.id or kind}"
    full = given.with_defaults(kind, (stem, f"{stem}_constant", f"{stem}_state"))
    amount, time, state = full.variables
    is_lag = kind == "lagging"
    start = component.layout.start_of.get(signal, "") if is_lag else ""

    def rate(self: Any) -> Any:
        x = getattr(self, signal)
        since_start = x - getattr(self, start) if start else x
        return (arm.followed(since_start) - getattr(self, state)) / getattr(self, time)

    def value(self: Any) -> Any:
        memory = getattr(self, state)
        return getattr(self, amount) * (memory + getattr(self, start) if start else memory)

    members = {
        "__doc__": f"Adds to {law}: {arm.text}, x = {signal}; a = 0 is the base model.",
        amount: coefficient(
            per(unit, argument.unit, arm.power),
            nominal / size**arm.power,
            f"part of {law} that remembers {signal} (a)",
            least=0.0,
        ),
        time: Parameter(
            constant,
            "s",
            min=1e-3 * min(constant, 1.0),
            max=1e9,
            nominal=constant,
            doc=f"time constant (T) of {amount}",
        ),
        state: State(
            argument.unit if is_lag else f"({argument.unit})^2",
            rate=f"{state}_rate",
            min=-inf if is_lag else 0.0,
            nominal=size**arm.power,
            doc=f"what {amount} remembers of {signal}",
        ),
        f"{state}_rate": rate,
    }
    return additive_effect(
        component,
        law,
        value,
        members,
        id=full.id,
        term=Term(law, signal, arm.text, f"{law} remembering {signal}", full.qualifier),
        title=generic_title(full.id, law_title(component, law)),
        assumption=f"{law} has no memory of {signal} but that of its states",
        sizes=(
            Size("{}", (amount,))  # the coefficient is a quantity of the rig
            if is_lag
            else size_at(amount, unit, size, argument.unit, lambda x: x**arm.power),
            Size("a time constant of {}", (time,)),
        ),
    )
