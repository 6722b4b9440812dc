"""Effects that many mechanical models share: dry and asymmetric friction, an offset, a hardening spring, more creep.

Each function here makes an effect for one law of a component, whatever its name::

    EFFECTS = {e.id: e for e in (coulomb_friction(Stage, "friction", "velocity"), force_offset(Stage, "friction"))}

Its parameters are named after that law, and at the neutral value the law gives the bits of the component below. The
variables that an effect depends on (a velocity, a position, a load) are declared by the component, which gives their
units; a law declares none, so its unit is an argument here.
"""

from __future__ import annotations

from collections.abc import Callable

from .arms import arm
from .component import Component, Effect, Term
from .curves import added, coefficient, curve


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
    effect = curve(
        component,
        law,
        velocity,
        "sign",
        unit,
        nominal,
        None,
        "coulomb_friction",
        ("coulomb", "coulomb_velocity"),
    )
    return _known(effect, coulomb_friction, "friction is viscous")


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
    effect = curve(
        component,
        law,
        velocity,
        "asymmetric",
        unit,
        nominal,
        None,
        "asymmetric_friction",
        ("asymmetry",),
    )
    return _known(effect, asymmetric_friction, "friction is the same in both directions")


def force_offset(
    component: type[Component], law: str, unit: str = "N", nominal: float = 1.0
) -> type[Effect]:
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
    return added(
        force_offset,
        component,
        (law, unit, nominal),
        lambda self: getattr(self, offset),
        {
            "assumption": "nothing pushes at rest",
            "term": Term(law, "", "a"),
            offset: coefficient(unit, nominal, f"constant part of {law}"),
        },
    )


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
    effect = curve(
        component, law, position, "cubic", unit, nominal, None, "cubic_stiffness", ("cubic",)
    )
    return _known(effect, cubic_stiffness, "the spring is linear")


def extra_kelvin(
    component: type[Component],
    law: str,
    load: str,
    ordinal: str,
    time: float,
    unit: str = "m",
    nominal: float = 1.0,
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
    own = f"{ordinal}_{law}"
    names = f"{own}_compliance", f"{own}_time", f"{own}_force"
    effect = arm(
        component, law, load, "lagging", time, unit, nominal, None, f"{ordinal}_kelvin", names
    )
    return _known(effect, extra_kelvin, "creep has no further time constant")


def described(effect: type[Effect], assumption: int | str, text: str) -> type[Effect]:
    """Say of an effect, for a component's own catalogue, what it is and which assumption it relaxes."""
    effect.__doc__, effect.assumption = text, assumption
    return effect


def _known(
    effect: type[Effect], make: Callable[..., type[Effect]], assumption: str
) -> type[Effect]:
    """Let an effect be described as engineers know it."""
    return described(effect, assumption, str(make.__doc__).partition("\n\n    Parameters\n")[0])
