"""Arms: effects that add a memory of one signal, a state of first order, to a law.

One more Kelvin element in a chain, an RC pair in series, heat that is stored on the way: the law
lags a signal. A Maxwell element, a branch in parallel: it answers to a change of the signal and
forgets it. Sliding elements and plays make a loop of force over travel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from .component import Component
from .curves import EffectNames, added, coefficient, per, size_at, variable
from .declare import Declaration, Discrete, Parameter, State
from .effects import Effect, Size, Term, effect_maker
from .errors import UserError, suggestion
from .functions import absolute, clip, where
from .sampling import Sampling
from .titles import generic_title, in_words, law_title

# a sample period, in s, that leaves one sample in any simulation: the one at the start
_ONCE = 1e9


@dataclass(frozen=True)
class Arm:
    """A memory of a signal x in a state s of first order.

    Attributes
    ----------
    form : callable
        Its value, to be multiplied with ``a``: of x, s and its constant.
    text : str
        The formula, for people.
    rate : callable
        Time derivative of s: of x, s and the constant. The constant is a time T; of a loop it is
        the way w until it gives. Of a play, which follows at once, the change that is due.
    """

    form: Callable[[Any, Any, Any], Any]
    text: str
    rate: Callable[[Any, Any, Any], Any]


ARMS: dict[str, Arm] = {
    "lagging": Arm(
        lambda x, s, T: s,
        "a s with T ds/dt = x - s",
        lambda x, s, T: (x - s) / T,
    ),
    "leading": Arm(
        lambda x, s, T: x - s,
        "a (x - s) with T ds/dt = x - s",
        lambda x, s, T: (x - s) / T,
    ),
    "heating": Arm(
        lambda x, s, T: s * x,
        "a s x with T ds/dt = x^2 - s",
        lambda x, s, T: (x * x - s) / T,
    ),
    "warming": Arm(
        lambda x, s, T: s,
        "a s with T ds/dt = x^2 - s",
        lambda x, s, T: (x * x - s) / T,
    ),
    "sliding": Arm(
        lambda x, s, w: s,
        "a s with w ds/dt = x - |x| s",
        lambda x, s, w: (x - absolute(x) * s) / w,
    ),
    "hysteresis": Arm(  # whose rate is of the velocity v
        lambda x, s, w: s,
        "a s with w ds/dt = dx/dt (1 - s^2 (1 + sign(s dx/dt)) / 2)",
        lambda v, s, w: (v - 0.5 * (v * s + absolute(v) * absolute(s)) * s) / w,
    ),
    "play": Arm(
        lambda x, s, w: clip(x - s, -w, w),
        "a clip(x - s, -w, w), s being dragged",
        lambda x, s, w: x - clip(x - s, -w, w) - s,
    ),
}
_NORMALISED = ("sliding", "hysteresis")  # the state is a share of its limit
_MEAN_SQUARE = ("heating", "warming")  # the state is the mean square of the signal
# the state starts in equilibrium with a signal that stayed where it starts
_SETTLED = ("lagging", "leading", "play")
_LOOPS = ("sliding", "hysteresis", "play")  # the constant is a way
_WAY, _TIME = "gives within {}", "a time constant of {}"  # what is said of it
_POWERS = {"sliding": 0, "hysteresis": 0, "heating": 3, "warming": 2}  # of the signal; others 1


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
    sampling: Sampling | None = None,
) -> type[Effect]:
    """Make an effect that adds a memory of one signal, a state of first order, to a law.

    Parameters
    ----------
    component : type[Component]
        Has the law and the signal.
    law : str
        Method that is added to.
    signal : str
        Input or state that is remembered (x).
    kind : {"lagging", "leading", "heating", "warming", "sliding", "hysteresis", "play"}
        A state that follows the signal; the signal less such a state; heat of its square that
        follows, times the signal (a voltage over a current) or alone (a resistance); or a slide
        after Dahl, the signal being its velocity: a spring that gives, so that force over travel is
        a loop. Of a signal that is a state, such a loop after Bouc and Wen, or a Prandtl element: a
        spring that gives at ``a w`` and then is dragged along.
    constant : float
        Time constant from which a fit starts, in s; of a loop the way until it gives, in the
        signal's unit (of a slide times s).
    unit : str
        SI unit of the law.
    nominal : float
        Typical magnitude of the law.
    scale : float, optional
        Typical magnitude of the signal; its nominal value unless given.
    names : EffectNames, optional
        Names of the effect, of the parameter that switches it, of its constant and of the state;
        unless given the effect is called like the kind, and its variables ``<law>_<id>``,
        ``<law>_<id>_constant`` and ``<law>_<id>_state``.
    sampling : Sampling, optional
        Of the record that it is made for.

    Returns
    -------
    type[Effect]
        With two parameters and a state.

    Raises
    ------
    UserError
        If the component has no such law or signal, or there is no such kind, or it takes a state
        and there is none.

    Notes
    -----
    Dahl: A solid friction model, Aerospace Corporation TOR-158, 1968. Wen: Method for random
    vibration of hysteretic systems, J. Eng. Mech. Div. ASCE 102(2), 1976, here with n = 2 and equal
    beta and gamma. Visintin: Differential Models of Hysteresis, 1994, of Prandtl's and Ishlinskii's
    elements.
    """
    if kind not in ARMS:
        raise UserError(f"no arm named {kind!r}{suggestion(kind, ARMS)}")
    argument = variable(component, signal)
    if kind == "hysteresis" and not _rate_of(component, signal):
        raise UserError(f"{kind} is over a state, which {signal!r} is not")
    size = scale or argument.nominal
    given = names or EffectNames()
    own = f"{law}_{given.id or kind}"
    called = given.completed(kind, (own, f"{own}_constant", f"{own}_state"))
    amount, constant_name, state = called.variables
    power = _POWERS.get(kind, 1)
    loop = f"{law} {'loop of' if kind in ('hysteresis', 'play') else 'remembering'} {signal}"
    members = {
        "__doc__": f"Adds to {law}: {ARMS[kind].text}, x = {signal}; a = 0 is the base model.",
        amount: coefficient(
            per(unit, argument.unit, power),
            nominal / size**power,
            f"part of {law} that remembers {signal} (a)",
            least=0.0,
        ),
    }
    members |= _constant_and_state(kind, argument, called.variables, constant, size)
    at_once = (sampling or Sampling()).at_once
    more, rate = _behaviour(component, kind, signal, called.variables, at_once)
    members[f"{state}_rate"] = rate
    return added(
        component,
        law,
        more,
        members,
        id=called.id,
        term=Term(law, signal, ARMS[kind].text, loop, called.qualifier),
        title=generic_title(called.id, law_title(component, law)),
        assumption=f"{law} has no memory of {signal} but that of its states",
        sizes=(
            size_at(amount, unit, size, argument.unit, lambda x: x**power)
            if kind in _MEAN_SQUARE
            else Size("{}", (amount,)),
            Size(_WAY if kind in _LOOPS else _TIME, (constant_name,)),
        ),
    )


@effect_maker
def storing_wall(
    component: type[Component],
    law: str,
    sides: tuple[str, str],
    constant: float,
    unit: str = "W",
    *,
    nominal: float = 1.0,
    scale: float = 1.0,
) -> type[Effect]:
    """Make the effect of a store between two sides, such as the capacity of a wall.

    A conductance ``G`` from one side to the store and ``H`` from there to the other pass the flow
    of both in series when nothing changes, which the law gives. The flow from the first side is
    that and ``G (w x + (1 - w) y - s)`` more, where x and y are the sides,
    ``T ds/dt = w x + (1 - w) y - s`` and ``w = G / (G + H)``. At ``G = 0`` it is the base model.

    Parameters
    ----------
    component : type[Component]
        Has the law and both signals.
    law : str
        Method that gives the flow from the first side to the second.
    sides : tuple of str
        Inputs or states x and y, of one unit.
    constant : float
        Time constant T, s, from which a fit starts.
    unit : str
        SI unit of the law.
    nominal : float
        Typical magnitude of the law.
    scale : float
        Typical difference of the sides.

    Returns
    -------
    type[Effect]
        With the parameters ``<law>_wall_conductance`` (G), ``<law>_wall_share`` (w) and
        ``<law>_wall_constant`` (T), and the state ``<law>_wall_change``: what the store has gained
        since the start, when it was in equilibrium with the sides.

    Raises
    ------
    UserError
        If the component has no such law or signal.

    Notes
    -----
    The wall of two resistances and a capacity of Madsen and Holst, Energy and Buildings 22, 1995.
    """
    one, other = (variable(component, side) for side in sides)
    conductance, share, time = (
        f"{law}_wall_{name}" for name in ("conductance", "share", "constant")
    )
    change, start = f"{law}_wall_change", f"{law}_wall_start"
    known = f"{law}_wall_started"

    def between(self: Any) -> Any:
        w = getattr(self, share)
        return w * getattr(self, one.name) + (1.0 - w) * getattr(self, other.name)

    def beyond(self: Any) -> Any:
        at_start = where(getattr(self, known), getattr(self, start), between(self))
        return between(self) - at_start - getattr(self, change)

    members = {
        "__doc__": (
            f"Store between {one.name} and {other.name}, such as the capacity of a wall; G = 0 is"
            " the base model."
        ),
        conductance: coefficient(
            per(unit, one.unit), nominal / scale, f"from {one.name} to the store (G)", least=0.0
        ),
        share: Parameter(0.5, "1", min=0.0, max=1.0, doc=f"share of {one.name} in the store (w)"),
        time: Parameter(
            constant, "s", min=1e-3 * constant, max=1e12, nominal=constant, doc="of the store (T)"
        ),
        change: State(one.unit, rate=f"{change}_rate", nominal=scale, doc="gain since the start"),
        f"{change}_rate": lambda self: beyond(self) / getattr(self, time),
        start: Discrete(
            one.unit, update=f"{start}_update", period=_ONCE, nominal=scale, doc="of the store"
        ),
        f"{start}_update": between,
        known: Discrete(
            "1", update=f"{known}_update", period=_ONCE, type="boolean", doc="whether it is known"
        ),
        f"{known}_update": lambda self: 1.0,
    }
    return added(
        component,
        law,
        lambda self: getattr(self, conductance) * beyond(self),
        members,
        id="storing_wall",
        term=Term(law, "", "G (w x + (1 - w) y - s)", f"store within {law}", law),
        title=f"A store between {in_words(one.name)} and {in_words(other.name)}",
        assumption=f"nothing is stored between {one.name} and {other.name}",
        sizes=(
            Size("{} to the store", (conductance,)),
            Size(f"which is at {{}} of {one.name}", (share,), "%", lambda w: 100.0 * w),
            Size(_TIME, (time,)),
        ),
    )


def _rate_of(component: type[Component], signal: str) -> str:
    """Return the law that is the time derivative of a signal; empty for one that is no state."""
    return next((s.rate for s in component.layout.states if s.name == signal), "")


def _constant_and_state(
    kind: str, argument: Declaration, variables: tuple[str, ...], constant: float, size: float
) -> dict[str, Any]:
    """Declare the constant of an arm, and its state, by name."""
    amount, constant_name, state = variables
    unit = argument.unit
    if kind in _LOOPS:
        meaning = "way until it gives (w)"
        constant_unit = f"({unit})*s" if kind == "sliding" else unit
    else:
        meaning = "time constant (T)"
        constant_unit = "s"
    state_range: dict[str, Any] = {}
    if kind in _NORMALISED:
        state_unit = "1"
        typical = 1.0
        state_range = {"min": -1.0, "max": 1.0}
    elif kind in _MEAN_SQUARE:
        state_unit = f"({unit})^2"
        typical = size**2
        state_range = {"min": 0.0}
    else:
        state_unit = unit
        typical = size
    return {
        constant_name: Parameter(
            constant,
            constant_unit,
            min=1e-3 * min(constant, 1.0),
            max=1e9,
            nominal=constant,
            doc=f"{meaning} of {amount}",
        ),
        state: State(
            state_unit,
            rate=f"{state}_rate",
            nominal=typical,
            doc=f"what {amount} remembers of {argument.name}",
            **state_range,
        ),
    }


def _behaviour(
    component: type[Component],
    kind: str,
    signal: str,
    variables: tuple[str, ...],
    at_once: float,
) -> tuple[Callable[[Any], Any], Callable[[Any], Any]]:
    """Return the laws that give the value of an arm and the rate of its state."""
    chosen = ARMS[kind]
    amount, constant, state = variables
    velocity = _rate_of(component, signal)
    start = component.layout.start_of.get(signal, "") if kind in _SETTLED else ""

    def since_start(self: Any) -> Any:
        """Return the signal; of a state its change since the start, when both were at rest."""
        x = getattr(self, signal)
        return x - getattr(self, start) if start else x

    def rate(self: Any) -> Any:
        x = getattr(self, velocity)() if kind == "hysteresis" else since_start(self)
        change = chosen.rate(x, getattr(self, state), getattr(self, constant))
        return change / at_once if kind == "play" else change

    def more(self: Any) -> Any:
        value = chosen.form(since_start(self), getattr(self, state), getattr(self, constant))
        if start and kind == "lagging":
            value = value + getattr(self, start)
        return getattr(self, amount) * value

    return more, rate
