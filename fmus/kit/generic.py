"""Effects that many mechanical models share: dry and asymmetric friction, an offset, a hardening spring, more creep.

Each function here makes an effect for one law of a component, whatever its name::

    EFFECTS = {e.id: e for e in (coulomb_friction(Stage, "friction", "velocity"), force_offset(Stage, "friction"))}

Its parameters are named after that law, and at the neutral value the law gives the bits of the component below. The
variables that an effect depends on (a velocity, a position, a load) are declared by the component, which gives their
units; a law declares none, so its unit is an argument here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .component import Component, Effect
from .declare import Declaration, Parameter, State
from .errors import UserError, suggestion
from .functions import absolute, tanh

_ANY = 1e12  # bound of parameters that may have any value, in nominal values
_SHARPNESS = 0.01  # width of the smooth sign of a velocity, relative to its nominal value


def coulomb_friction(
    component: type[Component], law: str, velocity: str, unit: str = "N", nominal: float = 1.0
) -> type[Effect]:
    """Dry friction, ``F_c tanh(v / v_c)`` more; a sign of the velocity that is smooth within ``v_c``.

    Slower than ``v_c`` it is viscous: what should stick creeps. ``F_c = 0`` is the base model.

    Parameters
    ----------
    component : type[Component]
        Has the law and the variable.
    law : str
        Method that gives the friction, positive against a positive velocity.
    velocity : str
        Variable that holds the velocity.
    unit : str
        SI unit of the law.
    nominal : float
        Typical magnitude of the law.

    Returns
    -------
    type[Effect]
        With parameters ``<law>_coulomb`` (F_c) and ``<law>_coulomb_velocity`` (v_c).

    Raises
    ------
    UserError
        If the component has no such law or variable.
    """
    speed = _variable(component, velocity)
    level, width = f"{law}_coulomb", f"{law}_coulomb_velocity"

    def more(self: Any) -> Any:
        return getattr(self, level) * tanh(getattr(self, velocity) / getattr(self, width))

    return _added(coulomb_friction, component, (law, velocity, unit, nominal), more, {
        "assumption": "friction is viscous",
        level: _coefficient(unit, nominal, f"dry part of {law} (F_c)", least=0.0),
        width: Parameter(
            _SHARPNESS * speed.nominal, speed.unit, min=1e-9 * speed.nominal, max=1e3 * speed.nominal,
            nominal=_SHARPNESS * speed.nominal, doc=f"{velocity} within which dry friction changes its sign (v_c)",
        ),
    })  # fmt: skip


def asymmetric_friction(
    component: type[Component], law: str, velocity: str, unit: str = "N", nominal: float = 1.0
) -> type[Effect]:
    """Viscous friction that differs in the two directions: ``d |v|`` more.

    That is ``d`` more damping forwards and ``d`` less backwards. *Dry* friction that differs is a mean one and a
    constant: :func:`coulomb_friction` with :func:`force_offset`, indistinguishable from it while something moves.
    ``d = 0`` is the base model.

    Parameters
    ----------
    component, law, velocity, unit, nominal
        See :func:`coulomb_friction`.

    Returns
    -------
    type[Effect]
        With the parameter ``<law>_asymmetry`` (d).

    Raises
    ------
    UserError
        If the component has no such law or variable.

    Notes
    -----
    Janot, Gautier, Brunot: Data set and reference models of EMPS, Nonlinear System Identification Benchmarks, 2019.
    """
    speed = _variable(component, velocity)
    difference = f"{law}_asymmetry"

    def more(self: Any) -> Any:
        return getattr(self, difference) * absolute(getattr(self, velocity))

    return _added(asymmetric_friction, component, (law, velocity, unit, nominal), more, {
        "assumption": "friction is the same in both directions",
        difference: _coefficient(
            _per(unit, speed.unit), nominal / speed.nominal, f"damping that {law} has more forwards, less backwards (d)"
        ),
    })  # fmt: skip


def force_offset(component: type[Component], law: str, unit: str = "N", nominal: float = 1.0) -> type[Effect]:
    """Constant force more, as of a weight or a drive with an offset; 0 is the base model.

    Parameters
    ----------
    component, law, unit, nominal
        See :func:`coulomb_friction`; the law is any force.

    Returns
    -------
    type[Effect]
        With the parameter ``<law>_offset``.

    Raises
    ------
    UserError
        If the component has no such law.
    """
    offset = f"{law}_offset"
    return _added(force_offset, component, (law, unit, nominal), lambda self: getattr(self, offset), {
        "assumption": "nothing pushes at rest",
        offset: _coefficient(unit, nominal, f"constant part of {law}"),
    })  # fmt: skip


def cubic_stiffness(
    component: type[Component], law: str, position: str, unit: str = "N", nominal: float = 1.0
) -> type[Effect]:
    """Spring that hardens, or softens, with the stroke: ``k_3 x^3`` more, after Duffing; ``k_3 = 0`` is the base model.

    Parameters
    ----------
    component, unit, nominal
        See :func:`coulomb_friction`.
    law : str
        Method that gives the force of the spring.
    position : str
        Variable that holds its elongation.

    Returns
    -------
    type[Effect]
        With the parameter ``<law>_cubic`` (k_3); it hardens where that is positive.

    Raises
    ------
    UserError
        If the component has no such law or variable.
    """
    stroke = _variable(component, position)
    cubic = f"{law}_cubic"

    def more(self: Any) -> Any:
        x = getattr(self, position)
        return getattr(self, cubic) * (x * x * x)

    return _added(cubic_stiffness, component, (law, position, unit, nominal), more, {
        "assumption": "the spring is linear",
        cubic: _coefficient(
            _per(unit, stroke.unit, 3), nominal / stroke.nominal**3, f"cubic coefficient of {law} (k_3)"
        ),
    })  # fmt: skip


def extra_kelvin(
    component: type[Component], law: str, load: str, ordinal: str, time: float, unit: str = "m", nominal: float = 1.0
) -> type[Effect]:
    """One more Kelvin element in a chain that creeps: ``J f`` more, where ``T df/dt = F - f`` is its spring's force.

    Its transfer function from the load is ``J / (T s + 1)``; ``J = 0`` is the base model. A chain may have several.

    Parameters
    ----------
    component : type[Component]
        Has the law and the variable.
    law : str
        Method that gives the elongation, or strain, that lags behind the load.
    load : str
        Variable that holds the load, or stress (F).
    ordinal : str
        ``"second"``, ``"third"``, ... distinguishes them; the effect's id is ``<ordinal>_kelvin``.
    time : float
        Time constant from which a fit starts, in s.
    unit : str
        SI unit of the law.
    nominal : float
        Typical magnitude of the law.

    Returns
    -------
    type[Effect]
        With parameters ``<ordinal>_<law>_compliance`` (J) and ``<ordinal>_<law>_time`` (T), and a state.

    Raises
    ------
    UserError
        If the component has no such law or variable.
    """
    force = _variable(component, load)
    compliance, constant, state = (f"{ordinal}_{law}_{part}" for part in ("compliance", "time", "force"))

    def rate(self: Any) -> Any:
        return (getattr(self, load) - getattr(self, state)) / getattr(self, constant)

    def more(self: Any) -> Any:
        return getattr(self, compliance) * getattr(self, state)

    return _added(extra_kelvin, component, (law, load, ordinal, time, unit, nominal), more, {
        "id": f"{ordinal}_kelvin",
        "assumption": "creep has no further time constant",
        compliance: _coefficient(
            _per(unit, force.unit), nominal / force.nominal, f"compliance of the {ordinal} Kelvin spring (J)", least=0.0
        ),
        constant: Parameter(
            time, "s", min=1e-3 * min(time, 1.0), max=1e9, nominal=time,
            doc=f"time constant of the {ordinal} Kelvin element (T)",
        ),
        state: State(
            force.unit, rate=f"{state}_rate", nominal=force.nominal, display=force.display,
            doc=f"load that the spring of the {ordinal} Kelvin element bears",
        ),
        f"{state}_rate": rate,
    })  # fmt: skip


def _variable(component: type[Component], name: str) -> Declaration:
    """Look up the declared variable that an effect depends on."""
    known = {v.name: v for v in (*component.layout.inputs, *component.layout.states, *component.layout.discretes)}
    if name not in known:
        raise UserError(f"{_label(component)}: no input or state named {name!r}{suggestion(name, known)}")
    return known[name]


def _label(component: type[Component]) -> str:
    return component.name or component.__name__


def _coefficient(unit: str, nominal: float, doc: str, least: float = -_ANY) -> Any:
    """Declare the parameter that switches an effect; without it at 0."""
    return Parameter(0.0, unit, min=least * nominal, max=_ANY * nominal, nominal=nominal, doc=f"{doc}; 0 is without")


def _per(unit: str, below: str, power: int = 1) -> str:
    """Unit of a coefficient that is multiplied by a variable, or by a power of it."""
    above, under = (f"({u})" if "/" in u or "*" in u else u for u in (unit, below))
    return f"{above}/{under}" + (f"^{power}" if power > 1 else "")


def _added(
    make: Callable[..., type[Effect]],
    component: type[Component],
    arguments: tuple[Any, ...],
    more: Callable[[Any], Any],
    members: dict[str, Any],
) -> type[Effect]:
    """Make the effect that adds to a law; the first parameter among the members switches it."""
    law = arguments[0]
    if not callable(getattr(component, law, None)):
        raise UserError(f"{_label(component)}: no law named {law!r}")

    def enlarged(self: Any) -> Any:
        return getattr(super(effect, self), law)() + more(self)

    about = {
        "id": make.__name__,
        "neutral": next(name for name, value in members.items() if isinstance(value, Declaration)),
        "made_by": make,
        "made_with": arguments,
        "__doc__": str(make.__doc__).partition("\n\n    Parameters\n")[0],
        "__module__": __name__,
        law: enlarged,
    }  # fmt: skip
    body = about | members
    title = f"{body['id']}_of_{law}".title().replace("_", "")
    effect: type[Effect] = type(title, (Effect,), body)
    return effect
