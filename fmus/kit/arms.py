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
from .functions import absolute, clip

# What an arm does to a law with the signal x and its own state s; whether it may take away; and the state's rate
# with a constant T (a time; of a slide the way until it gives).
_Form = Callable[[Any, Any, Any], Any]
ARMS: dict[str, tuple[_Form, str, float, _Form]] = {
    "lagging": (lambda x, s, T: s, "a s with T ds/dt = x - s", 0.0, lambda x, s, T: (x - s) / T),
    "leading": (
        lambda x, s, T: x - s,
        "a (x - s) with T ds/dt = x - s",
        0.0,
        lambda x, s, T: (x - s) / T,
    ),
    "heating": (
        lambda x, s, T: s * x,
        "a s x with T ds/dt = x^2 - s",
        0.0,
        lambda x, s, T: (x * x - s) / T,
    ),
    "warming": (
        lambda x, s, T: s,
        "a s with T ds/dt = x^2 - s",
        0.0,
        lambda x, s, T: (x * x - s) / T,
    ),
    "sliding": (
        lambda x, s, w: s,
        "a s with w ds/dt = x - |x| s",
        0.0,
        lambda x, s, w: (x - absolute(x) * s) / w,
    ),
    "hysteresis": (
        lambda x, s, w: s,
        "a s with w ds/dt = dx/dt (1 - s^2 (1 + sign(s dx/dt)) / 2)",
        0.0,
        lambda v, s, w: (v - 0.5 * (v * s + absolute(v) * absolute(s)) * s) / w,
    ),
    "play": (
        lambda x, s, w: clip(x - s, -w, w),
        "a clip(x - s, -w, w), s being dragged",
        0.0,
        lambda x, s, w: (x - clip(x - s, -w, w) - s) / GIVES,
    ),
}
_ONE = "sliding", "hysteresis"  # whose state is a share of its limit, and whose constant is a way
_SQUARE = "heating", "warming"  # whose state is the mean square of the signal
_SETTLED = (
    "lagging",
    "leading",
    "play",
)  # which a signal that stayed where it starts has brought to equilibrium
_LOOPS = "sliding", "hysteresis", "play"
GIVES = 0.01  # s, in which a play has followed; shorter is as good as at once


def arm(
    component: type[Component],
    law: str,
    signal: str,
    kind: str,
    constant: float,
    unit: str = "1",
    nominal: float = 1.0,
    scale: float | None = None,
    id: str = "",
    names: tuple[str, str, str] | None = None,
    qualifier: str = "",
) -> type[Effect]:
    """Let a law remember: a state of first order is added to it.

    Parameters
    ----------
    component : type[Component]
        Has the law and the signal.
    law : str
        Method that is added to.
    signal : str
        Input or state that is remembered (x).
    kind : {"lagging", "leading", "heating", "warming", "sliding", "hysteresis", "play"}
        A state that follows the signal; what the signal is ahead of such a state; heat of its square that follows,
        times the signal (a voltage over a current) or alone (a resistance); or a slide after Dahl, the signal being
        its velocity: a spring that gives, so that force over travel is a loop. Of a signal that is a state, such a
        loop after Bouc and Wen, or a Prandtl element: a spring that gives at ``a w`` and then is dragged along.
    constant : float
        Time constant from which a fit starts, in s; of a loop the way until it gives, in the signal's unit (of a
        slide times s).
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
        If the component has no such law or signal, or there is no such kind, or it takes a state and there is none.

    Notes
    -----
    Dahl: A solid friction model, Aerospace Corporation TOR-158, 1968. Wen: Method for random vibration of hysteretic
    systems, J. Eng. Mech. Div. ASCE 102(2), 1976, here with n = 2 and equal beta and gamma. Visintin: Differential
    Models of Hysteresis, 1994, of Prandtl's and Ishlinskii's elements.
    """
    if kind not in ARMS:
        raise UserError(f"no arm named {kind!r}{suggestion(kind, ARMS)}")
    form, text, least, law_of_rate = ARMS[kind]
    of, slides, way = variable(component, signal), kind in _ONE, kind in _LOOPS
    speed = next((s.rate for s in component.layout.states if s.name == signal), "")
    if kind == "hysteresis" and not speed:
        raise UserError(f"{kind} is over a state, which {signal!r} is not")
    size = scale or of.nominal
    amount, time, state = names or (
        f"{law}_{id or kind}",
        f"{law}_{id or kind}_constant",
        f"{law}_{id or kind}_state",
    )
    rate = f"{state}_rate"
    began = component.layout.start_of.get(signal, "") if kind in _SETTLED else ""

    def since_start(self: Any) -> Any:
        """The signal, of a state that is remembered as such how far it has come: both were in equilibrium before."""
        x = getattr(self, signal)
        return x - getattr(self, began) if began else x

    def moves(self: Any) -> Any:
        x = getattr(self, speed)() if kind == "hysteresis" else since_start(self)
        return law_of_rate(x, getattr(self, state), getattr(self, time))

    def more(self: Any) -> Any:
        effect = form(since_start(self), getattr(self, state), getattr(self, time))
        if began and kind == "lagging":
            effect = effect + getattr(self, began)
        return getattr(self, amount) * effect

    power = 0 if slides else 3 if kind == "heating" else 2 if kind == "warming" else 1
    square = f"({of.unit})^2" if kind in _SQUARE else of.unit
    constant_unit = f"({of.unit})*s" if kind == "sliding" else of.unit if way else "s"
    remembered = (
        f"{law} loop of {signal}"
        if kind in ("hysteresis", "play")
        else f"{law} remembering {signal}"
    )
    return added(
        arm,
        component,
        (law, signal, kind, constant, unit, nominal, scale, id, names, qualifier),
        more,
        {
            "id": id or kind,
            "term": Term(law, signal, text, remembered, qualifier),
            "assumption": f"{law} remembers nothing of {signal}",
            "__doc__": f"More in {law}: {text}, x = {signal}; a = 0 is the base model.",
            amount: coefficient(
                per(unit, of.unit, power),
                nominal / size**power,
                f"part of {law} that remembers {signal} (a)",
                least=least,
            ),
            time: Parameter(
                constant,
                constant_unit,
                min=1e-3 * min(constant, 1.0),
                max=1e9,
                nominal=constant,
                doc=f"{'way until it gives (w)' if way else 'time constant (T)'} of {amount}",
            ),
            state: State(
                "1" if slides else square,
                rate=rate,
                nominal=1.0 if slides else size**2 if kind in _SQUARE else size,
                doc=f"what {amount} remembers of {signal}",
            ),
            rate: moves,
        },
    )
