"""Arms: effects that add a memory of one signal, a state of first order, to a law.

A law lags a signal because of one more Kelvin element in a chain, an RC pair in series, or a heat
capacity. It answers to a change of the signal and forgets it because of a Maxwell element or a
branch in parallel. Sliding elements and plays make a loop of force over travel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from .component import Component
from .curves import EffectNames, additive_effect, coefficient, per, size_at, variable
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
        Value that is multiplied with ``a``, from x, s and the constant of the arm.
    text : str
        The formula, for people.
    rate : callable
        Time derivative of s, from x, s and the constant: a time T, or in a loop the displacement w
        at which it yields. A play has no rate; for it this is the change of s at once.
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
    # The rate is from the velocity v, not from x; |v| |s| s is v s^2 sign(s v) without a sign.
    "hysteresis": Arm(
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
_FROM_EQUILIBRIUM = ("lagging", "leading", "play")
_LOOPS = ("sliding", "hysteresis", "play")  # the constant is a displacement
_DISPLACEMENT_PHRASE = "gives within {}"
_TIME_PHRASE = "a time constant of {}"
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
        Method that the memory is added to.
    signal : str
        Input or state that is remembered (x).
    kind : {"lagging", "leading", "heating", "warming", "sliding", "hysteresis", "play"}
        ``lagging``: a state that follows the signal. ``leading``: the signal less such a state.
        ``heating``, ``warming``: a state that follows the square of the signal, multiplied with the
        signal (a voltage over a current) or alone (a resistance). ``sliding``: Dahl's friction, the
        signal being a velocity. ``hysteresis``: a loop after Bouc and Wen, of a signal that is a
        state. ``play``: a Prandtl element, a spring that yields at ``a w`` and then is dragged.
    constant : float
        Value from which a fit starts: a time constant in s, or in a loop the displacement at which
        it yields, in the signal's unit (for ``sliding`` times s).
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
    sampling : Sampling, optional
        Sampling of the record that the effect is made for.

    Returns
    -------
    type[Effect]
        With two parameters and a state.

    Raises
    ------
    UserError
        If the component has no such law or signal, there is no such kind, or the kind is
        ``hysteresis`` and the signal is no state.

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
    if kind == "hysteresis" and not _rate_law_of(component, signal):
        raise UserError(f"{kind} is over a state, which {signal!r} is not")
    size = scale or argument.nominal
    given = names or EffectNames()
    stem = f"{law}_{given.id or kind}"
    full = given.with_defaults(kind, (stem, f"{stem}_constant", f"{stem}_state"))
    amount, constant_name, state = full.variables
    power = _POWERS.get(kind, 1)
    relation = "loop of" if kind in ("hysteresis", "play") else "remembering"
    at_once = (sampling or Sampling()).at_once
    value, rate = _value_and_rate_laws(component, kind, signal, full.variables, at_once)
    members = {
        "__doc__": f"Adds to {law}: {ARMS[kind].text}, x = {signal}; a = 0 is the base model.",
        amount: coefficient(
            per(unit, argument.unit, power),
            nominal / size**power,
            f"part of {law} that remembers {signal} (a)",
            least=0.0,
        ),
        **_declare_constant_and_state(kind, argument, full.variables, constant, size),
        f"{state}_rate": rate,
    }
    is_visible = kind not in _MEAN_SQUARE  # the coefficient is a quantity of the rig
    return additive_effect(
        component,
        law,
        value,
        members,
        id=full.id,
        term=Term(law, signal, ARMS[kind].text, f"{law} {relation} {signal}", full.qualifier),
        title=generic_title(full.id, law_title(component, law)),
        assumption=f"{law} has no memory of {signal} but that of its states",
        sizes=(
            Size("{}", (amount,))
            if is_visible
            else size_at(amount, unit, size, argument.unit, lambda x: x**power),
            Size(_DISPLACEMENT_PHRASE if kind in _LOOPS else _TIME_PHRASE, (constant_name,)),
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
    """Make an effect that stores heat or mass between two sides, such as the capacity of a wall.

    The store is connected by a conductance ``G`` to the first side x and by ``H`` to the second
    side y. The law gives the stationary flow through both. The effect adds
    ``G (w x + (1 - w) y - s)`` to the flow from the first side, with
    ``T ds/dt = w x + (1 - w) y - s`` and ``w = G / (G + H)``. ``G = 0`` is the base model.

    Parameters
    ----------
    component : type[Component]
        Has the law and both signals.
    law : str
        Method that returns the flow from the first side to the second.
    sides : tuple of str
        Inputs or states x and y, of the same unit.
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
        ``<law>_wall_constant`` (T), and the state ``<law>_wall_change``: the change of the store
        since the start, when it was in equilibrium with the sides.

    Raises
    ------
    UserError
        If the component has no such law or signal.

    Notes
    -----
    The wall of two resistances and a capacity of Madsen and Holst, Energy and Buildings 22, 1995.
    """
    first, second = (variable(component, side) for side in sides)
    conductance = f"{law}_wall_conductance"
    share = f"{law}_wall_share"
    time = f"{law}_wall_constant"
    change = f"{law}_wall_change"
    start = f"{law}_wall_start"
    known = f"{law}_wall_started"

    def equilibrium(self: Any) -> Any:
        w = getattr(self, share)
        return w * getattr(self, first.name) + (1.0 - w) * getattr(self, second.name)

    def imbalance(self: Any) -> Any:
        # before the first sample, which is taken at the first step, the start is now
        at_start = where(getattr(self, known), getattr(self, start), equilibrium(self))
        return equilibrium(self) - at_start - getattr(self, change)

    members = {
        "__doc__": (
            f"Store between {first.name} and {second.name}, such as the capacity of a wall; G = 0"
            " is the base model."
        ),
        conductance: coefficient(
            per(unit, first.unit), nominal / scale, f"from {first.name} to the store (G)", least=0.0
        ),
        share: Parameter(0.5, "1", min=0.0, max=1.0, doc=f"share of {first.name} in the store (w)"),
        time: Parameter(
            constant, "s", min=1e-3 * constant, max=1e12, nominal=constant, doc="of the store (T)"
        ),
        change: State(first.unit, rate=f"{change}_rate", nominal=scale, doc="gain since the start"),
        f"{change}_rate": lambda self: imbalance(self) / getattr(self, time),
        start: Discrete(
            first.unit, update=f"{start}_update", period=_ONCE, nominal=scale, doc="of the store"
        ),
        f"{start}_update": equilibrium,
        known: Discrete(
            "1", update=f"{known}_update", period=_ONCE, type="boolean", doc="whether it is known"
        ),
        f"{known}_update": lambda self: 1.0,
    }
    return additive_effect(
        component,
        law,
        lambda self: getattr(self, conductance) * imbalance(self),
        members,
        id="storing_wall",
        term=Term(law, "", "G (w x + (1 - w) y - s)", f"store within {law}", law),
        title=f"A store between {in_words(first.name)} and {in_words(second.name)}",
        assumption=f"nothing is stored between {first.name} and {second.name}",
        sizes=(
            Size("{} to the store", (conductance,)),
            Size(f"which is at {{}} of {first.name}", (share,), "%", lambda w: 100.0 * w),
            Size(_TIME_PHRASE, (time,)),
        ),
    )


def _rate_law_of(component: type[Component], signal: str) -> str:
    """Return the law that is the time derivative of a signal; empty for one that is no state."""
    return next((s.rate for s in component.layout.states if s.name == signal), "")


def _declare_constant_and_state(
    kind: str, argument: Declaration, variables: tuple[str, ...], constant: float, size: float
) -> dict[str, Any]:
    """Declare the constant of an arm, and its state, by name."""
    amount, constant_name, state = variables
    unit = argument.unit
    meaning = "way until it gives (w)" if kind in _LOOPS else "time constant (T)"
    constant_units = {"sliding": f"({unit})*s", "hysteresis": unit, "play": unit}
    about_state: dict[str, Any] = {"unit": unit, "nominal": size}
    if kind in _NORMALISED:
        about_state = {"unit": "1", "nominal": 1.0, "min": -1.0, "max": 1.0}
    elif kind in _MEAN_SQUARE:
        about_state = {"unit": f"({unit})^2", "nominal": size**2, "min": 0.0}
    return {
        constant_name: Parameter(
            constant,
            constant_units.get(kind, "s"),
            min=1e-3 * min(constant, 1.0),
            max=1e9,
            nominal=constant,
            doc=f"{meaning} of {amount}",
        ),
        state: State(
            rate=f"{state}_rate",
            doc=f"what {amount} remembers of {argument.name}",
            **about_state,
        ),
    }


def _value_and_rate_laws(
    component: type[Component],
    kind: str,
    signal: str,
    variables: tuple[str, ...],
    at_once: float,
) -> tuple[Callable[[Any], Any], Callable[[Any], Any]]:
    """Return the law for the value of an arm and the law for the rate of its state.

    The state of a play follows within `at_once`, s.
    """
    arm = ARMS[kind]
    amount, constant, state = variables
    velocity = _rate_law_of(component, signal)
    start = component.layout.start_of.get(signal, "") if kind in _FROM_EQUILIBRIUM else ""

    def since_start(self: Any) -> Any:
        """Return the signal, or the change of a state since the start, when both were at rest."""
        x = getattr(self, signal)
        return x - getattr(self, start) if start else x

    def rate(self: Any) -> Any:
        x = getattr(self, velocity)() if kind == "hysteresis" else since_start(self)
        change = arm.rate(x, getattr(self, state), getattr(self, constant))
        return change / at_once if kind == "play" else change

    def value(self: Any) -> Any:
        memory = arm.form(since_start(self), getattr(self, state), getattr(self, constant))
        whole = memory + getattr(self, start) if start and kind == "lagging" else memory
        return getattr(self, amount) * whole

    return value, rate
