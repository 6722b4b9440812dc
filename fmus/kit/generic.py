"""Effects for mechanical models: friction, an offset, a hardening spring, more creep.

Each function here makes an effect for one law of a component::

    EFFECTS = {e.id: e for e in (coulomb_friction(Stage, "friction", "velocity"),
    force_offset(Stage, "friction"))}

The parameters of the effect are named after that law, and at the neutral value the law gives the
bits of the base model. The component declares the variables that an effect depends on (a velocity,
a position, a load) with their units. A law has no declared unit, which therefore is an argument.
"""

from __future__ import annotations

from .arms import lag_effect
from .component import Component
from .curves import EffectNames, additive_effect, coefficient, curve
from .effects import Effect, Size, Term, effect_maker


def coulomb_friction(
    component: type[Component], law: str, velocity: str, unit: str = "N", nominal: float = 1.0
) -> type[Effect]:
    """Make the effect of dry friction: a smooth sign of the velocity.

    It adds ``F_c tanh(v / v_c)`` to the friction. Below ``v_c`` the friction is viscous, so that
    the part creeps instead of sticking. ``F_c = 0`` is the base model.

    Parameters
    ----------
    component : type[Component]
        Has the law and the variable.
    law : str
        Method that returns the friction, positive against a positive velocity.
    velocity : str
        Input or state that is the velocity.
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
    variables = (f"{law}_coulomb", f"{law}_coulomb_velocity")
    names = EffectNames("coulomb_friction", variables)
    effect = curve(component, law, velocity, "sign", unit, nominal, names=names)
    return describe_effect(
        effect,
        "friction is viscous",
        "Dry friction, ``F_c tanh(v / v_c)`` more; a sign of the velocity that is smooth within "
        "``v_c``.",
        "Dry friction",
    )


def asymmetric_friction(
    component: type[Component], law: str, velocity: str, unit: str = "N", nominal: float = 1.0
) -> type[Effect]:
    """Make the effect of viscous friction that differs in the two directions.

    It adds ``d |v|`` to the friction: the damping is larger by ``d`` forwards and smaller by ``d``
    backwards. ``d = 0`` is the base model. For *dry* friction that differs in the two directions,
    combine :func:`coulomb_friction` with :func:`force_offset`; in motion both are the same.

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
    Janot, Gautier, Brunot: Data set and reference models of EMPS, Nonlinear System Identification
    Benchmarks, 2019.
    """
    names = EffectNames("asymmetric_friction", (f"{law}_asymmetry",))
    effect = curve(component, law, velocity, "asymmetric", unit, nominal, names=names)
    return describe_effect(
        effect,
        "friction is the same in both directions",
        "Viscous friction that differs in the two directions: ``d |v|`` more.",
        "Friction that differs in the two directions",
    )


@effect_maker
def force_offset(
    component: type[Component], law: str, unit: str = "N", nominal: float = 1.0
) -> type[Effect]:
    """Make the effect of a constant force, such as a weight or the offset of a drive.

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
    return additive_effect(
        component,
        law,
        lambda self: getattr(self, offset),
        {
            "__doc__": (
                "Constant force more, as of a weight or a drive with an offset; 0 is the base"
                " model."
            ),
            offset: coefficient(unit, nominal, f"constant part of {law}"),
        },
        id="force_offset",
        term=Term(law, "", "a"),
        title="A constant force",
        assumption="nothing pushes at rest",
        sizes=(Size("{}", (offset,)),),
    )


def cubic_stiffness(
    component: type[Component], law: str, position: str, unit: str = "N", nominal: float = 1.0
) -> type[Effect]:
    """Make the effect of Duffing's spring, which hardens or softens with the stroke.

    It adds ``k_3 x^3`` to the force of the spring; ``k_3 = 0`` is the base model.

    Parameters
    ----------
    component, unit, nominal
        See :func:`coulomb_friction`.
    law : str
        Method that returns the force of the spring.
    position : str
        Input or state that is its elongation.

    Returns
    -------
    type[Effect]
        With the parameter ``<law>_cubic`` (k_3); the spring hardens if it is positive.

    Raises
    ------
    UserError
        If the component has no such law or variable.
    """
    names = EffectNames("cubic_stiffness", (f"{law}_cubic",))
    effect = curve(component, law, position, "cubic", unit, nominal, names=names)
    return describe_effect(
        effect,
        "the spring is linear",
        "Spring that hardens, or softens, with the stroke: ``k_3 x^3`` more, after Duffing; "
        "``k_3 = 0`` is the base model.",
        "A spring that hardens or softens with the stroke",
    )


def extra_kelvin(
    component: type[Component],
    law: str,
    load: str,
    ordinal: str,
    time: float,
    unit: str = "m",
    *,
    nominal: float = 1.0,
) -> type[Effect]:
    """Make the effect of one more Kelvin element in a chain that creeps.

    It adds ``J f`` to the elongation, where ``T df/dt = F - f`` and ``f`` is the force of its
    spring; the transfer function from the load is ``J / (T s + 1)``. ``J = 0`` is the base model.
    Several may be stacked.

    Parameters
    ----------
    component : type[Component]
        Has the law and the variable.
    law : str
        Method that returns the elongation, or strain, that lags behind the load.
    load : str
        Input or state that is the load, or stress (F).
    ordinal : str
        ``"second"``, ``"third"``, ... of the element; the effect's id is ``<ordinal>_kelvin``.
    time : float
        Time constant from which a fit starts, in s.
    unit : str
        SI unit of the law.
    nominal : float
        Typical magnitude of the law.

    Returns
    -------
    type[Effect]
        With parameters ``<ordinal>_<law>_compliance`` (J) and ``<ordinal>_<law>_time`` (T), and a
        state.

    Raises
    ------
    UserError
        If the component has no such law or variable.
    """
    stem = f"{ordinal}_{law}"
    variables = (f"{stem}_compliance", f"{stem}_time", f"{stem}_force")
    names = EffectNames(f"{ordinal}_kelvin", variables)
    effect = lag_effect(component, law, load, "lagging", time, unit, nominal=nominal, names=names)
    return describe_effect(
        effect,
        "creep has no further time constant",
        "One more Kelvin element in a chain that creeps: ``J f`` more, where ``T df/dt = F - f`` is"
        " its spring's force.",
        f"A {ordinal} creep time constant",
    )


def describe_effect(
    effect: type[Effect], assumption: int | str, text: str, title: str = ""
) -> type[Effect]:
    """Set the description, assumption and title of an effect in a component's catalogue.

    Parameters
    ----------
    effect : type[Effect]
        Changed in place.
    assumption : int or str
        Assumption that it relaxes: its number in the component's README, or words.
    text : str
        Docstring of the effect; its first line describes it in reports and in FMUs.
    title : str
        Name for people, a noun phrase; if empty, the title stays.

    Returns
    -------
    type[Effect]
        The argument.
    """
    effect.__doc__ = text
    effect.assumption = assumption
    effect.title = title or effect.title
    return effect
