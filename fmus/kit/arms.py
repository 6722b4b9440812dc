"""What a law may remember: an arm of first order besides, in a chain or beside one, and a sliding element.

A Kelvin element more in a chain, an RC pair in series, heat that is stored on the way: the law lags behind a signal.
A Maxwell element beside, a branch in parallel: it answers to a change of the signal and forgets it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .component import Component, Effect, Term
from .curves import added, coefficient, per, variable
from .declare import Parameter, State
from .errors import UserError, suggestion
from .functions import absolute

# What an arm does to a law with the signal x and its own state s; whether it may take away; and the state's rate
# with a constant T (a time; of a slide the way until it gives).
_Rate = Callable[[Any, Any, Any], Any]
ARMS: dict[str, tuple[Callable[[Any, Any], Any], str, float, _Rate]] = {
    "lagging": (lambda x, s: s, "a s with T ds/dt = x - s", 0.0, lambda x, s, T: (x - s) / T),
    "leading": (lambda x, s: x - s, "a (x - s) with T ds/dt = x - s", 0.0, lambda x, s, T: (x - s) / T),
    "sliding": (lambda x, s: s, "a s with w ds/dt = x - |x| s", 0.0, lambda x, s, T: (x - absolute(x) * s) / T),
}


def arm(
    component: type[Component], law: str, signal: str, kind: str, constant: float, unit: str = "1",
    nominal: float = 1.0, scale: float | None = None, id: str = "", names: tuple[str, str, str] | None = None,
    qualifier: str = "",
) -> type[Effect]:  # fmt: skip
    """Let a law remember: a state of first order is added to it.

    Parameters
    ----------
    component : type[Component]
        Has the law and the signal.
    law : str
        Method that is added to.
    signal : str
        Input or state that is remembered (x).
    kind : {"lagging", "leading", "sliding"}
        A state that follows the signal; what the signal is ahead of such a state; or a slide after Dahl, the signal
        being its velocity: a spring that gives, so that force over travel is a loop.
    constant : float
        Time constant from which a fit starts, in s; of a slide the way until it gives, in the signal's unit times s.
    unit : str
        SI unit of the law.
    nominal : float
        Typical magnitude of the law.
    scale : float, optional
        Typical magnitude of the signal; its nominal value unless given.
    id : str, optional
        Of the effect; the kind unless given.
    names : tuple of str, optional
        Of the parameter that switches it, of its constant, and of the state.
    qualifier : str, optional
        What tells it from the same of another law.

    Returns
    -------
    type[Effect]
        With two parameters and a state.

    Raises
    ------
    UserError
        If the component has no such law or signal, or there is no such kind.

    Notes
    -----
    Dahl: A solid friction model, Aerospace Corporation TOR-158, 1968.
    """
    if kind not in ARMS:
        raise UserError(f"no arm named {kind!r}{suggestion(kind, ARMS)}")
    form, text, least, law_of_rate = ARMS[kind]
    of, slides = variable(component, signal), kind == "sliding"
    size = scale or of.nominal
    amount, time, state = names or (f"{law}_{id or kind}", f"{law}_{id or kind}_constant", f"{law}_{id or kind}_state")
    rate = f"{state}_rate"

    def moves(self: Any) -> Any:
        return law_of_rate(getattr(self, signal), getattr(self, state), getattr(self, time))

    def more(self: Any) -> Any:
        return getattr(self, amount) * form(getattr(self, signal), getattr(self, state))

    switch_unit, switch_size = (unit, nominal) if slides else (per(unit, of.unit), nominal / size)
    constant_unit = f"({of.unit})*s" if slides else "s"
    return added(arm, component, (law, signal, kind, constant, unit, nominal, scale, id, names, qualifier), more, {
        "id": id or kind,
        "term": Term(law, signal, text, f"{law} remembering {signal}", qualifier),
        "assumption": f"{law} remembers nothing of {signal}",
        "__doc__": f"More in {law}: {text}, x = {signal}; a = 0 is the base model.",
        amount: coefficient(switch_unit, switch_size, f"part of {law} that remembers {signal} (a)", least=least),
        time: Parameter(
            constant, constant_unit, min=1e-3 * min(constant, 1.0), max=1e9, nominal=constant,
            doc=f"{'way until it gives (w)' if slides else 'time constant (T)'} of {amount}",
        ),
        state: State(
            "1" if slides else of.unit, rate=rate, nominal=1.0 if slides else size,
            doc=f"what {amount} remembers of {signal}",
        ),
        rate: moves,
    })  # fmt: skip
